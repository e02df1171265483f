"""Random job lists, planned, timed, judged by the oracle, and simulated in MuJoCo.

`PYTHONPATH=. .venv/bin/python tests/job_lists.py 20` plans and judges that many; a second word
takes another of `KINDS`, a third one the number of objects. Needs the extra `mujoco`.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np


#: The scene of all lists.
POSE = Path(__file__).parents[1] / "problems/scenes/pose.toml"
#: Bars that the 70 N of the hand carry in space, whichever way they are turned.
LIGHT = POSE.read_text().replace("mass = 0.24 ", "mass = 0.15 ").replace("535e-6", "335e-6")
#: Bars into bins beyond the arm's reach; half of them hammers; among posts; into bins within reach.
KINDS = ("bars", "hammers", "posts", "near")
#: Least distance [m] of picks: half the length of a Franka Hand (118 mm), a bar's radius (14 mm),
#: and the clearance (10 mm). Nearer, the hand at a pick may touch a neighbour that stands higher.
APART = 0.15

#: A part and a bin.
ONE = """
scene = "pose"
[[bin]]
name = "bin"
target = { x = 1.0, y = 0.3, z = 0.2, theta_deg = -90.0 }
[[pick]]
name = "part"
x = 0.45
y = 0.1
z = 0.35
"""
#: Two parts and a bin of an FR3, whose hand has the time to close.
TWO = f"""{ONE.replace("pose", "fr3")}
grasp_time = 0.5
[[pick]]
name = "other part"
x = 0.45
y = -0.1
z = 0.35
grasp_time = 0.5
"""
#: A handle, and a head across it around the CoM.
HAMMER = """[pick.object]
length = 0.162
outline = [
  { begin = [0.012, 0.0], end = [0.15, 0.0], radius = 0.012 },
  { begin = [0.10, -0.04], end = [0.10, 0.05], radius = 0.018 },
]
"""
#: What stands between picks and bins.
POST = """
[[obstacle]]
name = "post {n}"
kind = "{kind}"
size = {size}
position = [{x:.3f}, {y:.3f}, {z:.3f}]
"""


def write_random_jobs(folder: Path, seed: int, kind: str = "bars", picks: int = 8) -> Path:
    """The file of random jobs, picks in front of a Panda and 3 bins, beside its scene."""
    random = np.random.default_rng(seed)
    posts = _posts(np.random.default_rng(seed)) if kind == "posts" else ""
    (folder / "scene.toml").write_text(LIGHT + posts)
    lines = ['scene = "scene.toml"']
    lines += _bins(random, near=kind == "near")
    lines += _picks(random, picks, HAMMER if kind == "hammers" else "")
    file = folder / "jobs.toml"
    file.write_text("\n".join(lines) + "\n")
    return file


def _bins(random: np.random.Generator, near: bool) -> list[str]:
    """Three bins, beyond the arm's reach or aside of the picks."""
    lines = list[str]()
    for number in range(3):
        away, azimuth = random.uniform(0.95, 1.2), math.radians(random.uniform(-65, 65))
        z, theta = random.uniform(0.1, 0.25), random.uniform(-100.0, -60.0)
        if near:
            side = 1.0 if number % 2 else -1.0
            away, azimuth = away - 0.55, azimuth / 3 + side * math.radians(65)
            z, theta = z + 0.1, theta - 10.0
        x, y = away * math.cos(azimuth), away * math.sin(azimuth)
        turn = f"[{theta - 8:.1f}, {theta + 8:.1f}]" if number % 2 else f"{theta:.1f}"
        lines += ["[[bin]]", f'name = "bin {number + 1}"']
        lines += [f"target = {{ x = {x:.3f}, y = {y:.3f}, z = {z:.3f}, theta_deg = {turn} }}"]
    return lines


def _picks(random: np.random.Generator, count: int, object_: str) -> list[str]:
    """Picks; object_: section of every second one."""
    lines = list[str]()
    for number, (x, y) in enumerate(_places(random, count)):
        lines += ["[[pick]]", f'name = "part {number + 1}"', f"x = {x:.3f}", f"y = {y:.3f}"]
        lines += [
            f"z = {random.uniform(0.33, 0.42):.3f}",
            f"grasp_time = {random.uniform(0.2, 0.4):.2f}",
        ]
        if random.random() < 0.3:
            lines += [f'bins = ["bin {random.integers(3) + 1}"]']
        lines += [object_] if number % 2 else []
    return lines


def _places(random: np.random.Generator, count: int) -> list[tuple[float, float]]:
    """Places in front of the arm, `APART` from each other; drawn anew where the last ones find no
    room."""
    while True:
        found = list[tuple[float, float]]()
        for _ in range(500):
            away, azimuth = random.uniform(0.38, 0.6), math.radians(random.uniform(-50, 50))
            place = away * math.cos(azimuth), away * math.sin(azimuth)
            if all(math.dist(place, other) >= APART for other in found):
                found.append(place)
            if len(found) == count:
                return found


def _posts(random: np.random.Generator) -> str:
    """Obstacles around the picks."""
    found = ""
    for n, azimuth in enumerate(np.radians(random.uniform([-55.0, 5.0], [-5.0, 55.0]))):
        away, height = random.uniform(0.72, 0.8), random.uniform(0.4, 0.6)
        place = {"x": away * math.cos(azimuth), "y": away * math.sin(azimuth), "z": height / 2}
        kind, size = ("box", [0.05, 0.1, height]) if n else ("capsule", [0.03, height - 0.06])
        found += POST.format(n=n + 1, kind=kind, size=[round(s, 3) for s in size], **place)
    return found


if __name__ == "__main__":
    study(int(sys.argv[1]), *sys.argv[2:3], *map(int, sys.argv[3:4]))
