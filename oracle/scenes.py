"""Random scenes with high grip use: weak grips, hard braking, early and late openings."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import throwplan as tp
from throwplan.problems import Distribution, Obstacle, Scene, Uncertainty

#: Grip use of the plan of each built-in scene that is varied.
BASES = {
    "pose": 0.41,
    "near-cup": 0.40,
    "box": 0.54,
    "flip": 0.55,
    "cup": 0.56,
    "fr3": 0.33,
    "hand-flip": 0.95,
    "hand-box": 0.05,
}
#: Range of the grip force over the one at which such a plan uses all of the grip.
FORCE = (0.75, 1.1)
#: Largest distance [m] by which targets are moved.
MOVED = 0.06
#: Ranges of the tolerance of position [m] and angle [rad].
TOLERANCES = (0.002, 0.05), (np.radians(0.5), np.radians(20.0))
#: Share of arm scenes without a cup to which a wall in front of the target is added.
WALLS = 0.3


def random_scene(name: str, random: np.random.Generator) -> Scene:
    """A variant of a built-in scene."""
    scene = tp.load_scene(name)
    target = scene.target
    x, z = target.x + random.uniform(-MOVED, MOVED), target.z + random.uniform(0.0, MOVED)
    scene = scene.aimed_at(target.changed(x=x, z=z))
    weaker = BASES[name] * random.uniform(*FORCE)
    grip, friction = weaker, 1.0
    if random.random() < 0.5:
        grip, friction = weaker**0.5, weaker**0.5
    position, angle = (float(np.exp(random.uniform(*np.log(span)))) for span in TOLERANCES)
    changes = {
        "tolerance": scene.tolerance.changed(position=position, angle=angle),
        "gripper": scene.gripper.changed(
            force=scene.gripper.force * grip, sticking_margin=random.uniform(0.0, 0.12)
        ),
        "contact": scene.contact.changed(friction=scene.contact.friction * friction),
        "uncertainty": spread(random),
    }
    if scene.robot is not None:
        changes["robot"] = scene.robot.changed(acceleration_margin=0.0, jerk_margin=0.0)
        if scene.cup is None and random.random() < WALLS:
            tall = random.uniform(0.15, 0.4)
            at = (random.uniform(0.65, 0.8) * x, 0.0, tall / 2)
            changes["obstacle"] = (Obstacle("wall", "box", (0.06, 0.5, tall), at),)
    return scene.replace(**changes)


def spread(random: np.random.Generator) -> Uncertainty:
    """Delays up to 20 ms early or late, and some of friction, mass, inertia and grasp."""
    rest = {
        "friction": Distribution(uniform=random.uniform(0.02, 0.15), relative=True),
        "mass": Distribution(uniform=random.uniform(0.02, 0.10), relative=True),
        "inertia": Distribution(uniform=random.uniform(0.02, 0.10), relative=True),
        "patch_radius": Distribution(uniform=random.uniform(0.02, 0.15), relative=True),
        "opening": Distribution(uniform=random.uniform(0.05, 0.2), relative=True),
        "grasp_offset": Distribution(uniform=random.uniform(0.001, 0.008)),
        "grasp_angle": Distribution(normal=np.radians(random.uniform(0.2, 1.5))),
        "hand_theta": Distribution(normal=np.radians(random.uniform(0.05, 0.3))),
        "hand_omega": Distribution(normal=random.uniform(0.005, 0.05)),
        "hand_vx": Distribution(normal=random.uniform(0.001, 0.005)),
        "hand_x": Distribution(uniform=random.uniform(0.0005, 0.002)),
    }
    kept = {name: each for name, each in rest.items() if random.random() < 0.4}
    late = Distribution(uniform=random.uniform(0.002, 0.02), mean=random.choice([0.0, 0.005]))
    return Uncertainty(delay=late, **kept)


def random_scenes(seed: int = 0) -> Iterator[tuple[str, Scene]]:
    """Endless names and random scenes, each with its own generator."""
    names, number = list(BASES), 0
    while True:
        name = names[number % len(names)]
        try:
            scene = random_scene(name, np.random.default_rng((seed, number)))
            yield f"{number:03d}-{name}", scene
        except tp.InputError:
            pass  # A cup that its target left, a wall on the target.
        number += 1
