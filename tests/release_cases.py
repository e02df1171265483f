"""The seven reference cases as releases, and extreme ones."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from hypothesis import strategies as st
from throwplan.models import Body, PinchContact, Trajectory, release_dynamics
from throwplan.models.release import LinearGrip, Release, ReleaseCase
from throwplan.models.release.patch import Patch

VALUES: dict[str, Any] = {
    name: case
    for name, case in json.loads(
        (Path(__file__).parent / "data" / "release.json").read_text()
    ).items()
    if isinstance(case, dict) and "detach" in case
}
#: Arguments of `simulate_batch`.
Values = dict[str, Any]
BAR = Body(mass=0.24, inertia=5.35e-4, com_offset=0.1)
STILL = {"theta0": 0.0, "v0": [0.0, 0.0], "omega0": 0.0, "a": [0.0, 0.0], "alpha": 0.0}


def reference_case(name: str) -> ReleaseCase:
    values = VALUES[name]
    body, contact = values["object"], values["contact"]
    hand = STILL if values["hand"] == "drop" else values["hand"]
    return ReleaseCase(
        Body(body["m"], body["I"], body["h"]),
        PinchContact(contact["mu"], contact["r"], contact["c"], contact["faces"]),
        LinearGrip(values["fN0"], 0.0, values["T"]),
        Trajectory.accelerating(
            (0.0, 0.0, hand["theta0"]), (*hand["v0"], hand["omega0"]), (*hand["a"], hand["alpha"])
        ),
    )


def expected(name: str, model: str) -> np.ndarray:
    """x, z, theta, v_x, v_z, omega at detach."""
    values = VALUES[name]["detach"][model]
    return np.array([*values["x"], values["theta"], *values["v"], values["omega"]])


def reference_values() -> Values:
    """The seven reference cases as arrays."""
    cases = [reference_case(name) for name in VALUES]
    hands = [case.hand.at(np.zeros(1)) for case in cases]

    def column(part: str, *keys: str) -> dict[str, np.ndarray]:
        return {key: np.array([getattr(getattr(c, part), key) for c in cases]) for key in keys}

    grip = column("grip", "full", "opening")
    return {
        **column("body", "mass", "inertia", "com_offset"),
        **column("contact", "friction", "patch_radius", "torsion", "faces"),
        "force": grip["full"],
        "opening": grip["opening"],
        "hand": {
            key: np.array([getattr(hand, key)[:, 0] for hand in hands])
            for key in ("pose", "twist", "acceleration")
        },
    }


def function_inputs(case: ReleaseCase, function: ca.Function) -> dict[str, Any]:
    """The inputs of a function that describe object, contact and gravity of a release."""
    known = vars(case.body) | vars(case.contact) | {"gravity": case.gravity}
    return {name: value for name, value in known.items() if name in function.name_in()}


def smoothed(case: ReleaseCase, width: float, steps: int = 400) -> np.ndarray:
    """The object at detach, by Runge-Kutta steps of `release_dynamics`."""
    dynamics, dt = release_dynamics(), case.grip.opening / steps

    def at(t, state):
        hand = case.hand.at(np.array([t]))
        given = dict(zip(("pose", "twist", "acceleration"), hand, strict=True))
        force = max(float(case.grip.force(t)), 0.0)
        given |= function_inputs(case, dynamics)
        return dynamics(state=state, normal_force=force, width=width, **given)

    state = ca.DM([0.0, 0.0, case.grasp_angle, 0.0, 0.0, 0.0])
    for i in range(steps):
        first = at(i * dt, state)["rates"]
        second = at((i + 0.5) * dt, state + dt / 2 * first)["rates"]
        third = at((i + 0.5) * dt, state + dt / 2 * second)["rates"]
        fourth = at((i + 1) * dt, state + dt * third)["rates"]
        state += dt / 6 * (first + 2 * second + 2 * third + fourth)
    return np.array(at(steps * dt, state)["object"]).ravel()


def log_floats(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(math.log(low), math.log(high)).map(math.exp)


def order_of(steps: Any, errors: Any) -> Any:
    """The exponent p of errors (N, ...) that fall as steps (N,) ** -p."""
    return -np.polyfit(np.log(steps), np.log(errors), 1)[0]


def energy_of(case: ReleaseCase, release: Release) -> np.ndarray:
    """Kinetic and potential energy [J] of the body at the release's instants."""
    (v_x, v_z, omega), body = release.com_twist, case.body
    kinetic = body.mass * (v_x**2 + v_z**2) / 2 + body.inertia * omega**2 / 2
    return np.asarray(kinetic + body.mass * case.gravity * release.com[1])


def landed(release: Release, below: float = 1.0) -> tuple[float, float]:
    """x [m] and theta [rad] `below` metres under the hand's first position."""
    end = release.detach
    time = (end.v_z + np.sqrt(end.v_z**2 + 2 * 9.81 * (end.z + below))) / 9.81
    return float(end.x + end.v_x * time), float(end.theta + end.omega * time)


def sliding_wrench(patch: Patch, twist: np.ndarray) -> np.ndarray:
    """Coulomb friction (3,) of a patch whose points slip with a twist (3,), over mu f_N."""
    u_x, u_z = twist[0] - twist[2] * patch.z, twist[1] + twist[2] * patch.x
    share = patch.weights / np.hypot(u_x, u_z)
    force_x, force_z = -share * u_x, -share * u_z
    torque = patch.x * force_z - patch.z * force_x
    return np.array([force_x.sum(), force_z.sum(), torque.sum()])


def extremes(count: int, seed: int) -> Values:
    """mu 0.02-3, r_p 0.05-50 mm, h 0-1 m, m 1 g-50 kg, opening 0.5 ms-2 s, f_N 0.1-2000 N,
    hand accelerations to 500 m/s^2; a fifth with h = 0."""
    rng = np.random.default_rng(seed)

    def wide(low: float, high: float) -> np.ndarray:
        return np.exp(rng.uniform(np.log(low), np.log(high), count))

    mass, a, direction = wide(1e-3, 50), wide(1, 500), rng.uniform(-np.pi, np.pi, count)
    turn = rng.uniform(-500, 500, count)
    return {
        "mass": mass,
        "inertia": mass * wide(5e-3, 0.3) ** 2,
        "com_offset": np.where(rng.random(count) < 0.2, 0.0, wide(1e-3, 1)),
        "friction": wide(0.02, 3),
        "patch_radius": wide(5e-5, 0.05),
        "force": wide(0.1, 2000),
        "opening": wide(5e-4, 2),
        "hand": {
            "pose": np.column_stack([np.zeros((count, 2)), rng.uniform(-3, 3, count)]),
            "twist": rng.uniform(-1, 1, (count, 3)) * [3, 3, 10],
            "acceleration": np.column_stack([a * np.cos(direction), a * np.sin(direction), turn]),
        },
    }


def single(values: Values, i: int) -> ReleaseCase:
    number = {name: float(value[i]) for name, value in values.items() if name != "hand"}
    return ReleaseCase(
        Body(*(number[k] for k in ("mass", "inertia", "com_offset"))),
        PinchContact(number["friction"], number["patch_radius"], 0.6, 2),
        LinearGrip(number["force"], 0.0, number["opening"]),
        Trajectory.accelerating(*(values["hand"][k][i] for k in ("pose", "twist", "acceleration"))),
    )
