"""Job files of cycles."""

from __future__ import annotations

from pathlib import Path

#: The scene of the first of them.
POSE = Path(__file__).parents[1] / "problems/scenes/pose.toml"
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
