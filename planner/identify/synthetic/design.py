"""The design of a synthetic batch: bars, postures, joint motions.

As in Liu and Billard, section VI-A: per pitch angle one state of the joints as the grip force
starts to fall, and from there six constant joint accelerations along the joints' rates, from
speeding up to slowing down. Each motion starts at rest, keeps the Panda's limits on position,
velocity, acceleration and jerk, and brakes to rest.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np

from ....problems import Gripper, PadContact, Scene, ThrownObject, Workspace, load_scene
from ...search.samples import carry
from ...throw import TICK, Manipulator, Samples, Throw, make_manipulator, send

#: The paper's bar, Table II, and those of its factor analysis. Where the paper gives no CoM it
#: is the middle of the bar; the inertia of a changed mass is taken as unchanged.
BARS = {
    "com1": ThrownObject(mass=0.24, inertia=535e-6, length=0.26, com=0.10, width=0.02),
    "com2": ThrownObject(mass=0.24, inertia=802e-6, length=0.26, com=0.16, width=0.02),
    "metal": ThrownObject(mass=0.246, inertia=535e-6, length=0.26, com=0.13, width=0.02),
    "plastic": ThrownObject(mass=0.122, inertia=535e-6, length=0.26, com=0.13, width=0.02),
    "moi-small": ThrownObject(mass=0.40, inertia=714e-6, length=0.26, com=0.13, width=0.02),
    "moi-large": ThrownObject(mass=0.40, inertia=1961e-6, length=0.26, com=0.13, width=0.02),
}
#: Grip force [N] of one pad; the Robotiq 2F-85 reaches 235.
FORCE = 220.0
#: Time [s] from the opening command until the force falls.
DWELL = 0.05
#: Time [s] in which the force falls.
OPENING = 0.06
#: Workspace of an arm on a high base [m].
WORKSPACE = Workspace(floor=-0.3, column_radius=0.12, column_height=0.45, palm_clearance=0.002)
#: Landing height [m] at which the batch's mean flight time is the paper's 0.6 s.
HEIGHT = -0.65
#: Friction and patch radius [m] with which the grip must hold the bars on all motions.
HELD = (0.8, 0.0031)
#: Factors on friction and patch radius of the surfaces: what the paper identified for
#: papertape, 0.4 and 5 mm, over its 1.0 and 2.5 mm for the plastic.
SURFACES = {"base": (1.0, 1.0), "plastic": (1.0, 1.0), "papertape": (0.4, 2.0)}
#: Joint positions [rad] and rates [rad/s] of joints 2, 4 and 6 as the force starts to fall: an
#: upward throw, one in between and a forward one, and how long each release's launch takes [s].
#: Drawn at random once, and kept because every motion from them passes the checks of a plan.
PITCHES = {
    "p1": (
        (-0.120472, -2.706771, 3.368954),
        (-1.333137, 0.958174, 1.824863),
        (0.5, 0.5, 0.5, 0.4, 0.4, 0.4),
    ),
    "p2": (
        (-0.060491, -2.421472, 2.874295),
        (-1.329277, 0.583433, 1.272851),
        (0.5, 0.5, 0.5, 0.5, 0.5, 0.4),
    ),
    "p3": (
        (0.462194, -2.157387, 2.954733),
        (-0.109184, 1.228937, 1.434976),
        (0.5, 0.5, 0.5, 0.5, 0.4, 0.4),
    ),
}
#: Joint accelerations from speeding up to slowing down, over the limit of the joint that reaches
#: its own first.
RELEASES = (0.36, 0.18, 0.0, -0.3, -0.6, -0.9)
#: Numbers of the releases with which single factors vary, from 1.
FACTOR_RELEASES = (2, 4, 6)
#: Time [s] beyond the opening for which the acceleration stays constant: late openings and the
#: low-pass filter see no step.
LONGER = 0.025
#: Time [s] of constant acceleration from the nominal start of the opening on.
LATEST = OPENING + LONGER
#: Largest friction use of the carry: a fifth of the grip is reserve for weak throws.
GRIP = 0.8


@dataclass(frozen=True)
class Condition:
    """A condition: a bar of BARS, pitch, number of the release from 1, a surface of SURFACES;
    labels of its row in throws.csv."""

    bar: str
    pitch: str
    release: int
    surface: str
    labels: dict[str, str]


@dataclass(frozen=True)
class Throwing:
    """A motion of the design: samples at 1 kHz; opening_time [s]: nominal start of the fall."""

    samples: Samples
    opening_time: float


def conditions(factors: bool) -> Iterator[Condition]:
    """The batch's 36 conditions, then those that vary surface, payload or inertia alone."""
    base = {"surface": "base", "payload": "base", "moi": "base"}
    releases = range(1, len(RELEASES) + 1)
    for com, pitch, release in itertools.product(("com1", "com2"), PITCHES, releases):
        labels = {"set": "batch", "com": com, "pitch": pitch, "release": f"a{release}"}
        yield Condition(com, pitch, release, "base", labels | base)
    if not factors:
        return
    varied = [("surface", label, "com1", label) for label in ("plastic", "papertape")]
    varied += [("payload", label, label, "base") for label in ("metal", "plastic")]
    varied += [("moi", label, f"moi-{label}", "base") for label in ("small", "large")]
    for (factor, label, bar, surface), release in itertools.product(varied, FACTOR_RELEASES):
        com = bar if bar == "com1" else "middle"
        labels = {"set": "factors", "com": com, "pitch": "p2", "release": f"a{release}"}
        yield Condition(bar, "p2", release, surface, labels | base | {factor: label})


def contact_of(surface: str, friction: float, patch_radius: float) -> tuple[float, float]:
    """Friction and patch radius [m] of a surface, for those of the base surface."""
    less, wider = SURFACES[surface]
    return less * friction, wider * patch_radius


@cache
def scene_with(
    bar: str, surface: str = "base", friction: float = HELD[0], patch_radius: float = HELD[1]
) -> Scene:
    """The Panda with a bar and a surface; its target is not used."""
    mu, radius = contact_of(surface, friction, patch_radius)
    return load_scene("pose").replace(
        workspace=WORKSPACE,
        object=BARS[bar],
        contact=PadContact(friction=mu, patch_radius=radius),
        gripper=Gripper(force=FORCE, dwell=DWELL, opening=OPENING),
    )


@cache
def design() -> dict[str, list[Throwing]]:
    """For each pitch the motions of the six release accelerations."""
    manipulator = make_manipulator(scene_with("com1"))
    found = {}
    for pitch, (place, rate, launches) in PITCHES.items():
        q, dq = np.array(place), np.array(rate)
        direction = dq / (np.abs(dq) / manipulator.planning.ddq).max()
        found[pitch] = [
            Throwing(
                send(
                    manipulator, carry(manipulator, (q, dq, share * direction), time, LATEST, ticks)
                ),
                time,
            )
            for share, time in zip(RELEASES, launches, strict=True)
            for ticks in [round(time / TICK)]
        ]
    return found


def grip_use(manipulator: Manipulator, motion: Throwing, scene: Scene) -> float:
    """Largest friction use while the bar is carried, 1 is the limit."""
    late = motion.opening_time + LONGER / 2
    return Throw(scene, manipulator, motion.samples.path, late).grip_use
