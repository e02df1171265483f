"""Arms that tests import: a function for any URDF, and the Panda's with its options."""

from __future__ import annotations

import re
from pathlib import Path

import throwplan as tp
from throwplan.cli import main

PANDA_URDF = Path(__file__).parent.parent / "data" / "panda.urdf"
PANDA_JOINTS = [f"panda_joint{i}" for i in range(1, 8)]
PANDA_OPTIONS = [
    *["--tool", "panda_hand", "--tcp", "0.1034", "--palm", "0.1034", "0.045", "0.033"],
    *["--acceleration", "15", "7.5", "10", "12.5", "15", "20", "20"],
    *["--jerk", "7500", "3750", "5000", "6250", "7500", "10000", "10000", "--name", "my-panda"],
]


def imported(folder: Path, urdf: Path, joints: list[str], *options: str):
    """The arm of a scene that uses the file which `import-robot` writes."""
    out = folder / "arm.toml"
    out.unlink(missing_ok=True)
    words = ["import-robot", str(urdf), "--joints", *joints, *options, "--out", str(out)]
    assert main(words) == 0
    text = re.sub(r"start_deg = .*", "", tp.scene_text("pose"))
    # The grip of the scene's gripper, without its file: the arm may have a hand.
    text = text.replace('file = "franka-hand"', "dwell = 0.05\nopening = 0.05")
    (folder / "scene.toml").write_text(text.replace('arm = "panda"', 'arm = "arm.toml"'))
    return tp.load_scene(folder / "scene.toml").arm
