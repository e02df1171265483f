"""Prints how far the release models are apart: 200 random throws against the rigid patch.

Every throw holds its body at full grip and lands 0.9 m below where the hand was when the
grip began to fall. The patch of points with Coulomb friction is the reference. A run
takes about half a minute:

    .venv/bin/python examples/model_table.py
"""

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from throwplan.models.batch import ConstantAccelerations, ReleaseBatch
from throwplan.models.contact import Body, Contact, HandMotion, pivot_wrench
from throwplan.models.flight import FlightState, time_to_height
from throwplan.models.grip_force import LinearRelease
from throwplan.models.hand_track import ConstantAcceleration
from throwplan.models.lugre_release import LuGreRelease
from throwplan.models.patch_release import PatchRelease
from throwplan.models.release import Release, ReleaseCase, ReleaseModel
from throwplan.models.sliding_pivot_release import SlidingPivotRelease
from throwplan.models.time_stepping_release import SteppedRelease

GRAVITY = 9.81
DROP = 0.9
#: Steps of the reference, and of the bristles, so that their step errors cancel.
STEPS = 5000
#: Share of the ellipsoid that the load may use at full grip: the patch's own limit
#: surface lies up to 6.6 % inside it.
HELD = 0.9


@dataclass(frozen=True)
class Sample:
    """N throws: columns (N,) of body and contact, hand (3, N), full force and opening (N,)."""

    body: Body
    contact: Contact
    hand: tuple[np.ndarray, np.ndarray, np.ndarray]
    grip: tuple[np.ndarray, np.ndarray]

    def case(self, i: int) -> ReleaseCase:
        """One throw."""
        body, contact = self.body, self.contact
        return ReleaseCase(
            Body(*(float(v[i]) for v in (body.mass, body.inertia, body.com_offset))),
            Contact(float(contact.friction[i]), float(contact.patch_radius[i])),
            LinearRelease(float(self.grip[0][i]), 0.0, float(self.grip[1][i])),
            ConstantAcceleration(*(tuple(float(v) for v in part[:, i]) for part in self.hand)),
        )

    def batch(self) -> ReleaseBatch:
        """All throws as one batch."""
        full, opening = self.grip
        hands = ConstantAccelerations(*(part.T for part in self.hand))
        grip = LinearRelease(1.0, 0.0, 1.0)
        return ReleaseBatch(full.size, self.body, self.contact, grip, hands, opening, full)


def draw(count: int, seed: int) -> Sample:
    """`count` random throws that full grip holds; the grip is a 2F-85's, 20 to 235 N."""
    rng, many = np.random.default_rng(seed), 20 * count

    def uniform(low: float, high: float) -> np.ndarray:
        return rng.uniform(low, high, many)

    mass = uniform(0.1, 0.4)
    body = Body(mass, mass * uniform(0.03, 0.08) ** 2, uniform(0.02, 0.2))
    contact = Contact(uniform(0.3, 1.0), uniform(0.0025, 0.01))
    speed, up, zero = uniform(1.0, 3.0), uniform(np.radians(10), np.radians(70)), np.zeros(many)
    pose = np.array([zero, zero, uniform(-np.pi / 3, np.pi / 2)])
    twist = np.array([speed * np.cos(up), speed * np.sin(up), uniform(0.0, 6.0)])
    acceleration = np.array([uniform(-8, 8), uniform(-8, 8), uniform(-20, 20)])
    full, opening = uniform(20, 235), uniform(0.03, 0.1)
    motion = HandMotion(pose[2], twist[2], *acceleration)
    x_r, z_r = body.com_offset * np.cos(pose[2]), body.com_offset * np.sin(pose[2])
    load = pivot_wrench(body, GRAVITY, motion, twist[2], x_r, z_r)
    held = np.flatnonzero(contact.utilisation_squared(*load, full) < HELD**2)[:count]
    if held.size < count:
        raise SystemExit(f"only {held.size} of {many} random throws hold at full grip")
    return Sample(
        Body(body.mass[held], body.inertia[held], body.com_offset[held]),
        Contact(contact.friction[held], contact.patch_radius[held]),
        (pose[:, held], twist[:, held], acceleration[:, held]),
        (full[held], opening[held]),
    )


def landings(detach: np.ndarray) -> np.ndarray:
    """x [m] and theta [rad] (2, N) where each CoM of detach (N, 6) comes down through -DROP."""
    states = [FlightState(*map(float, row)) for row in detach]
    ends = [state.after(time_to_height(state, -DROP, GRAVITY), GRAVITY) for state in states]
    return np.array([[end.x, end.theta] for end in ends]).T


def models(sample: Sample) -> dict[str, Callable[[], np.ndarray]]:
    """Name of each row and how to get its detach states (N, 6); the reference comes first."""
    cases, batch = [sample.case(i) for i in range(sample.grip[0].size)], sample.batch()

    def one_by_one(model: ReleaseModel) -> Callable[[], np.ndarray]:
        return lambda: np.array([detached(model.release(case)) for case in cases])

    def together(model: PatchRelease | LuGreRelease) -> Callable[[], np.ndarray]:
        return lambda: model.batch(batch)

    rows = {
        "rigid patch": together(PatchRelease(steps=STEPS)),
        "the same, 500 steps": together(PatchRelease(steps=500)),
        "the same, Hertz pressure": together(PatchRelease(pressure="hertz", steps=STEPS)),
        "sp, continuous form": one_by_one(SlidingPivotRelease()),
        "sp, paper form": one_by_one(SlidingPivotRelease("paper")),
    }
    for steps in (5000, 500, 50):
        rows[f"ls-step, {steps} steps"] = one_by_one(SteppedRelease(steps))
    for power in (7, 6, 5):
        model = LuGreRelease(stiffness=10.0**power, steps=STEPS)
        rows[f"LuGre, 1e{power} 1/m"] = together(model)
    return rows


def detached(release: Release) -> np.ndarray:
    """x, z, theta, v_x, v_z, omega at the end of the opening."""
    return np.concatenate([release.com[:, -1], release.com_twist[:, -1]])


def quantiles(values: np.ndarray, digits: int) -> str:
    """Median, 90 % and maximum."""
    return " / ".join(f"{value:.{digits}f}" for value in np.quantile(values, [0.5, 0.9, 1.0]))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--throws", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    start = time.perf_counter()
    rows = models(draw(options.throws, options.seed))
    reference = landings(next(iter(rows.values()))())
    print(
        f"{options.throws} random throws, seed {options.seed}, landing {DROP} m below the hand; "
        f"difference to the rigid patch ({STEPS} steps, 64 points, uniform pressure), "
        "median / 90 % / max\n"
    )
    print("| model | Δx [mm] | Δθ [deg] |\n|---|---|---|")
    for name, detach in list(rows.items())[1:]:
        x, theta = np.abs(landings(detach()) - reference)
        cells = quantiles(1e3 * x, 2), quantiles(np.degrees(theta), 2)
        print(f"| {name} | {cells[0]} | {cells[1]} |", flush=True)
    print(f"\n{time.perf_counter() - start:.0f} s")


if __name__ == "__main__":
    main()
