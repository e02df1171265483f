"""The models as CasADi functions with named inputs: for optimal control problems of one's own.

All quantities are in SI units. Frame: x forward, z up, angles counter-clockwise. Inputs and outputs
that several functions have:

    object        CoM in the world: x, z [m], theta [rad], v_x, v_z [m/s], omega [rad/s]
    pose, twist   hand, at the middle of the pads: x, z, theta; v_x, v_z, omega
    normal_force  of one pad [N]
    object's      mass [kg], inertia [kg m^2] about the CoM, com_offset [m] from pads to CoM
    contact's     friction [-], patch_radius [m], torsion c [-] (0.6 if left out), faces [-] (2)
    gravity       [m/s^2] along -z (9.81)

Inputs are numbers or CasADi symbols; of `function.map(N)`, N columns, or one for all. An input that
a call leaves out, and that has no value above, is NaN. Functions that CasADi derives by `factory`,
`jacobian` or `mapaccum` take all inputs: CasADi sets those left out to 0.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import fields
from typing import TypeVar

import casadi as ca

from .backend import Value
from .body import Body, HandMotion, HandSamples, PinchContact
from .flight import FlightLaw, FlightState
from .release.limit_surface import ITERATIONS, LimitSurfaceStepping
from .release.sliding_pivot import SlidingPivot, Widths

#: Values of inputs that a call may leave out.
DEFAULTS = {
    "torsion": PinchContact.torsion,
    "faces": PinchContact.faces,
    "gravity": FlightLaw.gravity,
    "width": 0.01,
}
#: Inputs that describe object and contact.
BODY, CONTACT = ([field.name for field in fields(each)] for each in (Body, PinchContact))

Kind = TypeVar("Kind", Body, PinchContact)


def release_dynamics() -> ca.Function:
    """Rates of an object between the pads by the smoothed sliding pivot, (28)-(38).

    Inputs: state (6,), against the hand: slip_x, slip_z [m] of the pivot in world axes, theta_r
    [rad], angle of the object minus angle of the hand, and their rates; pose, twist, acceleration
    (3,) of the hand, the last in m/s^2 and rad/s^2; normal_force; mass, inertia, com_offset;
    friction, patch_radius, torsion, faces; gravity; width [-] of the smoothing, as a share of the
    object's weight, above 0 (0.01 if left out).
    Outputs: rates (6,) of the state; object (6,) in the world; excess (2,), by which the pivot's
    torque [N m] and force [N] exceed the friction limits: an object without slip and with a
    constant theta_r sticks while both are below 0.

    The law is for a grip that falls. Its friction keeps an object from accelerating against the
    hand, and does not brake one that turns already.
    """
    s = _symbols("state", size=6) | _symbols("pose", "twist", "acceleration", size=3)
    s |= _symbols("normal_force", *BODY, *CONTACT, "gravity", "width")
    body, contact = _of(Body, s), _of(PinchContact, s)
    widths = Widths.relative(s["width"], body, contact, s["gravity"])
    law = SlidingPivot(body, contact, s["gravity"], widths=widths)
    hand = HandMotion(s["pose"][2], s["twist"][2], *ca.vertsplit(s["acceleration"]))
    outputs = {
        "rates": law.rates(s["state"], hand, s["normal_force"]),
        "object": law.com_state(s["state"], s["pose"], s["twist"], hand),
        "excess": law.excess(s["state"], hand, s["normal_force"]),
    }
    return _function("release_dynamics", s, outputs)


def limit_surface_step() -> ca.Function:
    """One Moreau-Jean step of an object on the ellipsoidal limit surface (19), without smoothing.

    Inputs: object (6,) and pose (3,) of the hand where the step begins (of a held object: `object`
    of `release_dynamics` with a zero state); next_pose, next_twist (3,) of the hand where it ends;
    normal_force in its middle, above 0; dt [s]; mass, inertia; friction, patch_radius, torsion,
    faces; gravity.
    Output: next_object (6,). The steps are of first order. The derivative jumps where the object
    begins to slip.
    """
    s = _symbols("object", size=6) | _symbols("pose", "next_pose", "next_twist", size=3)
    s |= _symbols("normal_force", "dt", "mass", "inertia", *CONTACT, "gravity")
    state, dt = s["object"], s["dt"]
    # The law does not use the CoM's offset, the hand's twist at the start and its acceleration.
    unused: Value = ca.SX.nan(3)
    body = Body(s["mass"], s["inertia"], math.nan)
    law = LimitSurfaceStepping(body, _of(PinchContact, s), s["gravity"])
    start = HandSamples(0.0, s["pose"], unused, unused)
    hands = start, HandSamples(dt, s["next_pose"], s["next_twist"], unused)
    lever = law.lever(state, hands, dt)
    problem = law.problem(state, hands, lever, s["normal_force"], dt)
    iterate = problem.sticking()
    sticks = iterate.norm <= problem.radius
    for _ in range(ITERATIONS):
        iterate = problem.refined(iterate, problem.moving(iterate, sticks))
    # An iteration from the solution has the solution's derivative; those before have not.
    iterate = problem.refined(iterate, ca.logic_not(sticks))
    after = law.after(state, hands, lever, problem.trimmed(iterate, sticks), dt)
    # Comparisons with NaN are false: without this an absent force would count as a large one.
    known = s["normal_force"] >= 0.0
    rows = [ca.if_else(known, value, math.nan) for value in after]
    return _function("limit_surface_step", s, {"next_object": rows})


def flight() -> ca.Function:
    """Landing of an object in free flight: where its CoM falls through a height.

    Inputs: object (6,) at detach; height [m]; gravity.
    Outputs: landing (3,): x, z [m], theta [rad], unwrapped; time [s] of the flight. NaN for an
    object that never falls through the height.
    """
    s = _symbols("object", size=6) | _symbols("height", "gravity")
    law, state = FlightLaw(s["gravity"]), FlightState(*ca.vertsplit(s["object"]))
    time = law.fall_time(state, s["height"])
    end = law.after(state, time)
    return _function("flight", s, {"landing": [end.x, end.z, end.theta], "time": [time]})


def _symbols(*names: str, size: int = 1) -> dict[str, Value]:
    return {name: ca.SX.sym(name, size) for name in names}


def _of(kind: type[Kind], s: dict[str, Value]) -> Kind:
    """Object or contact of the symbols that have its fields' names."""
    return kind(**{field.name: s[field.name] for field in fields(kind)})


def _function(
    name: str, inputs: dict[str, Value], outputs: dict[str, Sequence[Value]]
) -> ca.Function:
    """A function of named symbols; outputs: the rows of each."""
    rows = [ca.cse(ca.densify(ca.vertcat(*values))) for values in outputs.values()]
    defaults = {"default_in": [DEFAULTS.get(each, math.nan) for each in inputs]}
    return ca.Function(name, [*inputs.values()], rows, [*inputs], [*outputs], defaults)
