"""Residuals of measured throws: measured less predicted landing, and their speeds at detach."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..models import Array, ReadOnly
from ..planner import TICK, Throw, read_plan
from ..problems import InputError, Scene, csv_lines, table_number
from ..workers import Progress
from .belief import Belief
from .identification import identify
from .measured import delayed
from .predict import Predictor, parameter_sets
from .throws import ThrowData

#: Columns of a CSV file of plans and the landings of their throws.
COLUMNS = ("plan", "x", "theta")
#: Allowed difference from the scene of the measured throws' object and grip force, shares.
SAME_OBJECT, SAME_FORCE = 0.01, 0.1


@dataclass(frozen=True)
class Residuals(ReadOnly):
    """N measured throws against their prediction.

    names: of the throws; landing (N, 2): measured less predicted, dx [m] and dtheta [rad]; twist
    (N, 2): predicted speed [m/s] of the CoM and turning rate [rad/s] at detach. fit: the contact
    fitted to all throws, None where the scene's is used; each landing is then predicted by the fit
    to the others.
    """

    names: tuple[str, ...]
    landing: Array
    twist: Array
    fit: Belief | None = None

    def __post_init__(self) -> None:
        """Refuses throws without a predicted landing, and angles that count other full turns."""
        super().__post_init__()
        for name, (dx, turn) in zip(self.names, self.landing.tolist(), strict=True):
            if not math.isfinite(dx + turn):
                raise InputError(f"throw {name}: no landing: the model lets it fall nowhere")
            if abs(turn) > math.pi:
                raise InputError(
                    f"throw {name}: theta is {math.degrees(turn):+.0f} deg off the predicted "
                    "landing, must be within 180 deg: theta is in radians (is it in degrees?), and "
                    "full turns count"
                )


def recorded_residuals(
    data: ThrowData, scene: Scene, fit: bool, about: Callable[[str], Progress]
) -> Residuals:
    """Of a data set with recordings, by the scene's model, contact and mean delay, and by each
    throw's own recorded grip force.

    fit: by a contact fitted to the other throws. InputError for another object, median of the grip
    forces or shape of the contact than the scene's, and where recorded forces may hold its mean
    delay already.
    """
    for key in ("torsion", "faces"):
        there, here = getattr(data.shared, key), getattr(scene.contact, key)
        if there != here:
            have, want = (
                "left out" if value in (None, ()) else f"{value}" for value in (there, here)
            )
            raise InputError(
                f"{data.name}: {key} is {have}, must be as [contact] {key} of {scene.place}: {want}"
            )
    for throw in data.throws:
        _check_object(throw.name, throw.object.mass, throw.object.com, scene)
    force = float(np.median([throw.grip.full for throw in data.throws]))
    _check_force(f"{data.name}: median grip force", force, scene)
    if scene.mean_delay:
        _check_dwell(data, scene)
        data = delayed(data, scene.mean_delay)
    model, whole = scene.tolerance.model, None
    if fit:
        identified = identify(data, model, about=about)
        whole, predictor = identified.posterior, identified.predictor
        progress = about("left out of the fit")
        detach = identified.predict_left_out(np.arange(len(data.throws)), progress)
    else:
        predictor = Predictor.of(data)
        contact = parameter_sets(scene.contact.friction, scene.contact.patch_radius)
        detach = predictor.detached(model, contact)[:, 0]
    off = predictor.truth - predictor.landed(detach)
    speed = np.hypot(detach[:, 3], detach[:, 4])
    names = tuple(throw.name for throw in data.throws)
    return Residuals(names, off, np.column_stack([speed, detach[:, 5]]), whole)


def planned_residuals(path: Path, scene: Scene) -> Residuals:
    """Of a CSV file with the columns plan, x [m] and theta [rad]: a plan.json or its folder, beside
    the file, and where its throw landed in the throw's plane.

    The scene's deciding model throws the motions that were sent, with the scene's contact.
    """
    header, lines = csv_lines(path)
    missing = [name for name in COLUMNS if name not in header]
    if missing:
        raise InputError(
            f"{path}: the first line must name the columns plan, x and theta "
            f"({missing[0]} is missing)"
        )
    plans: dict[str, Throw] = {}
    names, off, twist = list[str](), [], []
    for number, line in lines:
        cells = dict(zip(header, line + [""] * len(header), strict=False))
        name = cells["plan"].strip()
        try:
            x, theta = (table_number(key, cells[key].strip()) for key in COLUMNS[1:])
            throw = plans[name] = plans.get(name) or _thrown(path.parent / name, scene)
        except InputError as error:
            raise error.within(f"{path}: line {number}") from None
        start, landing = throw.release.detach, throw.landing
        names.append(f"{name} (line {number})")
        off.append((x - landing.x, theta - landing.theta))
        twist.append((math.hypot(start.v_x, start.v_z), start.omega))
    found = np.array(off).reshape(-1, 2), np.array(twist).reshape(-1, 2)
    return Residuals(tuple(names), *found)


def _thrown(plan: Path, scene: Scene) -> Throw:
    """The motion of a saved plan, thrown by the scene's model and contact without a bias."""
    saved = read_plan(plan)
    bar = saved.scene.object
    _check_object(str(plan), bar.mass, bar.com, scene)
    _check_force(f"{plan}: grip force", saved.scene.gripper.profile().full, scene)
    if saved.scene.arm != scene.arm:
        raise InputError(f"{plan}: its arm is not the scene's")
    return saved.in_scene(scene.changed(calibration=None).aimed_at(saved.target)).deciding


def _check_object(name: str, mass: float, com: float, scene: Scene) -> None:
    """InputError for an object other than the scene's."""
    for key, value in (("mass", mass), ("com", com)):
        own = getattr(scene.object, key)
        if abs(value - own) > SAME_OBJECT * own:
            raise InputError(
                f"throw {name}: its object has {key} {value:g}, must be [object] {key} = {own:g} "
                f"of {scene.place}"
            )


def _check_force(what: str, force: float, scene: Scene) -> None:
    """InputError for a grip force other than the scene's."""
    own = scene.gripper.profile().full
    if abs(force - own) > SAME_FORCE * own:
        raise InputError(
            f"{what} is {force:.4g} N, must be within {100 * SAME_FORCE:g} % of [gripper] force = "
            f"{own:.4g} of {scene.place}"
        )


def _check_dwell(data: ThrowData, scene: Scene) -> None:
    """InputError for forces that fall after another dwell than the scene's, from which its mean
    delay counts."""
    mean, dwell = scene.mean_delay, scene.gripper.profile().dwell
    fall = float(np.mean([throw.grip.dwell for throw in data.throws]))
    if abs(fall - dwell) > max(abs(mean) / 2, TICK):
        raise InputError(
            f"{data.name}: the grip force falls {1e3 * fall:.1f} ms after the command, must be "
            f"after [gripper] dwell = {1e3 * dwell:.1f} ms of the scene: the mean {1e3 * mean:.1f} "
            "ms of its [uncertainty] delay counts from there"
        )
