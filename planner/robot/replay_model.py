"""The MuJoCo models of a replay, as MJCF text: the release, and the flight into the cup."""

from __future__ import annotations

import math

import numpy as np

from ...problems import Cup, Scene
from ..check import reach_of_bar

#: Penetration [m] that the pads have at most: a pad is a sphere of 1 m on a plate 2 m thick.
PRESSED = 0.1
#: Least mass [kg] of all points of a pad together.
PAD_MASS = 1e-5
#: Inertia of the driven hand over that of the bar: the bar cannot push the hand.
HAND_OVER_BAR = 1e4
#: How much stiffer friction is than the pressing. Up to 1e6 points under load creep.
IMPRATIO = 1e9

#: Of the bar against cup, floor, hand and column: friction, and 1/s over the angular
#: frequency of a contact's spring, which is pressed in by 1 mm at 2 m/s.
FRICTION, CONTACT_TIME = 0.4, 0.001
#: Boxes of the cup's wall, and its thickness [m].
WALL_BOXES, WALL = 48, 0.005
#: Thickness of a bar whose width is not given, and half depth of the hand's body [m].
THIN, HAND_DEPTH = 0.001, 0.1

RELEASE = """
<mujoco>
  <option timestep="{step}" gravity="0 0 -{gravity}" cone="elliptic" impratio="{impratio}"
          tolerance="1e-14" jacobian="dense"><flag autoreset="disable"/></option>
  <worldbody>
    <body name="hand">
      <joint type="slide" axis="1 0 0" armature="{rotor}"/>
      <joint type="slide" axis="0 0 1" armature="{rotor}"/>
      <joint type="hinge" axis="0 -1 0" armature="{rotor}"/>
      <inertial pos="0 0 0" mass="1e-3" diaginertia="1e-6 1e-6 1e-6"/>
      {pads}
    </body>
    <body name="bar">
      <joint type="slide" axis="1 0 0"/>
      <joint type="slide" axis="0 0 1"/>
      <joint type="hinge" axis="0 -1 0"/>
      <inertial pos="0 0 0" mass="{mass}" diaginertia="{inertia} {inertia} {inertia}"/>
      <geom name="bar" type="box" size="{reach} 1 {reach}" contype="0" conaffinity="0"/>
    </body>
  </worldbody>
  <contact>{pairs}</contact>
  <actuator>{motors}</actuator>
</mujoco>
"""
PAD = """
<body pos="{x} {y} {z}">
  <joint name="{name}" type="slide" axis="0 {inwards} 0"/>
  <inertial pos="0 0 0" mass="{mass}" diaginertia="1e-9 1e-9 1e-9"/>
  <geom name="{name}" type="sphere" size="1" contype="0" conaffinity="0"/>
</body>
"""
# Sliding friction twice, then torsion: a length times the friction.
PAIR = """
<pair geom1="{name}" geom2="bar" condim="{condim}" solref="{time_constant} 1"
      friction="{friction} {friction} {torsion} 1e-5 1e-5"/>
"""

LANDING = """
<mujoco>
  <option timestep="{step}" gravity="0 0 -{gravity}" cone="elliptic" impratio="10"
          integrator="RK4"><flag autoreset="disable"/></option>
  <default><geom friction="{friction} 0.001 0.0001" solref="{time_constant} {damping}"/></default>
  <worldbody>
    {surroundings}
    <body name="bar">
      <freejoint/>
      <inertial pos="0 0 0" mass="{mass}" diaginertia="{along} {inertia} {inertia}"/>
      <geom name="bar" type="box" size="{half_length} {half_width} {half_width}"
            pos="{middle} 0 0"/>
    </body>
  </worldbody>
</mujoco>
"""


def pads_of(scene: Scene) -> int:
    """Pads in the model: more than two faces are pressed on as two."""
    return min(int(scene.contact.faces), 2)


def release_model(scene: Scene, step: float, points: int) -> str:
    """The hand, its pads and the bar, which moves in the throw's plane only.

    points: contact points of a pad, on a ring of radius c r_p, so that they hold the
    patch's torque; each is pressed on by a motor of its own, one after another of each pad.
    One point: with torsional friction instead, the ellipsoid of the limit surface. Pads
    have no size otherwise: the bar cannot slip out of them.
    """
    contact, bar = scene.patch, scene.object
    radius = contact.torsion_arm if points > 1 else 0.0
    full = scene.gripper.profile().full
    mass = max(PAD_MASS, full * (2 * step) ** 2 / PRESSED) / points
    pads, names = [], []
    for side in (1, -1)[: pads_of(scene)]:
        for k in range(points):
            angle = 2 * math.pi * k / points
            name = f"pad{side}_{k}"
            x, z = radius * math.cos(angle), radius * math.sin(angle)
            pads.append(PAD.format(name=name, x=x, y=2 * side, z=z, inwards=-side, mass=mass))
            names.append(name)
    pair = {
        "condim": 3 if points > 1 else 4,
        "time_constant": 2 * step,
        "friction": contact.friction,
        "torsion": contact.torsion_arm * contact.friction,
    }
    return RELEASE.format(
        step=step,
        gravity=scene.gravity,
        impratio=IMPRATIO,
        rotor=hand_inertia(scene),
        mass=bar.mass,
        inertia=bar.inertia,
        reach=10 * bar.length + 1,
        pads="".join(pads),
        pairs="".join(PAIR.format(name=name, **pair) for name in names),
        motors="".join(f'<motor joint="{name}"/>' for name in names),
    )


def hand_inertia(scene: Scene) -> float:
    """Mass and moment of inertia [kg, kg m^2] of the driven hand."""
    bar = scene.object
    return HAND_OVER_BAR * max(bar.mass, bar.inertia + bar.mass * scene.com_offset**2)


def landing_model(scene: Scene, step: float, restitution: float) -> str:
    """The bar, free in space, and what the scene has for it to meet.

    The cup is fixed and stands on a floor; the hand's body is a mocap body "hand".
    """
    bar, damping = scene.object, damping_ratio(restitution)
    width = max(bar.width, THIN)
    along = float(np.clip(bar.mass * width**2 / 6, 1e-2 * bar.inertia, 2 * bar.inertia))
    return LANDING.format(
        step=step,
        gravity=scene.gravity,
        friction=FRICTION,
        time_constant=CONTACT_TIME / damping,
        damping=damping,
        surroundings=_surroundings(scene),
        mass=bar.mass,
        inertia=bar.inertia,
        along=along,
        half_length=bar.length / 2,
        half_width=width / 2,
        middle=bar.length / 2 - bar.com,
    )


def damping_ratio(restitution: float) -> float:
    """Of a spring and damper that a mass leaves with `restitution` times its speed.

    It leaves when the force is zero: exp(-2 d acos(d) / sqrt(1 - d^2)) for a ratio d, 0.135
    at critical damping; no ratio above 4, so that steps stay short enough.
    """

    def left(d: float) -> float:
        if abs(d - 1) < 1e-6:
            return math.exp(-2.0)
        angle = math.acos(d) if d < 1 else math.acosh(d)
        return math.exp(-2 * d * angle / math.sqrt(abs(1 - d * d)))

    low, high = 1e-4, 4.0
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if left(middle) > restitution else (low, middle)
    return high


def has_hand(scene: Scene) -> bool:
    """Whether the scene counts the hand's body as something to be hit."""
    workspace = scene.workspace
    return scene.arm is not None and workspace is not None and workspace.palm_clearance is not None


def _surroundings(scene: Scene) -> str:
    """Cup and floor, base column, hand's body: those that the scene has."""
    parts = []
    if scene.cup is not None:
        parts.append(_cup(scene.cup, 2 * reach_of_bar(scene.object)))
    workspace = scene.workspace
    if workspace is not None and workspace.column_radius and workspace.column_height:
        half = workspace.column_height / 2
        size = f'size="{workspace.column_radius} {half}"'
        parts.append(f'<geom name="base column" type="cylinder" {size} pos="0 0 {half}"/>')
    if has_hand(scene):
        assert scene.arm is not None
        tool = scene.arm.tool
        half = (tool.palm_back - tool.palm_front) / 2
        middle = (tool.palm_back + tool.palm_front) / 2
        size = f'size="{half} {HAND_DEPTH} {tool.palm_half_width}"'
        geom = f'<geom name="hand" type="box" {size} pos="{-middle} 0 0"/>'
        parts.append(f'<body name="hand" mocap="true">{geom}</body>')
    return "".join(parts)


def _cup(cup: Cup, beyond: float) -> str:
    """A round wall of boxes on a plate, and the floor under it; `beyond` [m] is drawn only."""
    bottom, half = cup.rim - cup.depth, cup.depth / 2
    outer = cup.radius + WALL
    wide = outer * math.tan(math.pi / WALL_BOXES)
    parts = [
        f'<geom name="floor" type="plane" size="{beyond} {beyond} 1" '
        f'pos="{cup.x} 0 {bottom - WALL}"/>',
        f'<geom name="cup bottom" type="box" size="{outer} {outer} {WALL / 2}" '
        f'pos="{cup.x} 0 {bottom - WALL / 2}"/>',
    ]
    for k in range(WALL_BOXES):
        turn = 2 * math.pi * k / WALL_BOXES
        away = cup.radius + WALL / 2
        x, y = cup.x + away * math.cos(turn), away * math.sin(turn)
        parts.append(
            f'<geom name="wall {k}" type="box" size="{WALL / 2} {wide} {half}" '
            f'pos="{x} {y} {bottom + half}" euler="0 0 {math.degrees(turn)}"/>'
        )
    return "".join(parts)
