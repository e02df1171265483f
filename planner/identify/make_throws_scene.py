"""What is thrown in a synthetic batch: bars, surfaces, gripper, arm and its surroundings."""

from __future__ import annotations

from functools import cache

from ...problems import Gripper, PadContact, Scene, ThrownObject, Workspace, load_scene

#: The paper's bar, Table II, and those of its factor analysis; where the paper gives no CoM
#: it is taken in the middle of the bar, and the inertia of a changed mass as unchanged.
BARS = {
    "com1": ThrownObject(mass=0.24, inertia=535e-6, length=0.26, com=0.10, width=0.02),
    "com2": ThrownObject(mass=0.24, inertia=802e-6, length=0.26, com=0.16, width=0.02),
    "metal": ThrownObject(mass=0.246, inertia=535e-6, length=0.26, com=0.13, width=0.02),
    "plastic": ThrownObject(mass=0.122, inertia=535e-6, length=0.26, com=0.13, width=0.02),
    "moi-small": ThrownObject(mass=0.40, inertia=714e-6, length=0.26, com=0.13, width=0.02),
    "moi-large": ThrownObject(mass=0.40, inertia=1961e-6, length=0.26, com=0.13, width=0.02),
}
#: Grip force of one pad [N], the Robotiq 2F-85's largest being 235; dwell and fall [s].
GRIPPER = Gripper(force=220.0, dwell=0.05, opening=0.06)
#: The arm stands high: floor for arm and held bar, its base, the bar from the palm in flight [m].
WORKSPACE = Workspace(floor=-0.3, column_radius=0.12, column_height=0.45, palm_clearance=0.002)
#: Landing height [m] that makes the batch's mean flight time the paper's 0.6 s.
HEIGHT = -0.65
#: Contact that the motions must hold the bars with: friction, patch radius [m].
HELD = (0.8, 0.0031)
#: Factors on friction and patch radius of the surfaces: what the paper identified for
#: papertape, 0.4 and 5 mm, over its 1.0 and 2.5 mm for the plastic.
SURFACES = {"base": (1.0, 1.0), "plastic": (1.0, 1.0), "papertape": (0.4, 2.0)}


def scene_with(bar: str, friction: float, patch_radius: float) -> Scene:
    """The Panda with one of the BARS and a contact; its target has no part in this."""
    contact = PadContact(friction=friction, patch_radius=patch_radius)
    return _panda().replace(object=BARS[bar], contact=contact, gripper=GRIPPER)


@cache
def _panda() -> Scene:
    return load_scene("pose").replace(workspace=WORKSPACE)


def surfaced(bar: str, surface: str, friction: float, patch_radius: float) -> Scene:
    """The scene of a bar with a surface, for contact parameters of the base surface."""
    less, wider = SURFACES[surface]
    return scene_with(bar, less * friction, wider * patch_radius)
