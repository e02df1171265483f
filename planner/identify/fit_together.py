"""Throws that share their grip force, predicted side by side: for a few parameter sets."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ...models import Body, Contact, GripProfile, Path, ReleaseBatch, land
from .predict import BATCHES, Parameters, Predictor

Array = npt.NDArray[np.float64]

#: Most throws times parameter sets of one batch: every one has a spline of its own there.
MOST = 4096
#: Shares of the opening at which two grip forces are compared.
SHARES = np.linspace(0.0, 1.0, 21)


def landings_together(predictor: Predictor, model: str, parameters: Parameters) -> Array:
    """x [m], theta [rad] (T, M, 2) of every throw with every parameter set.

    The same as `Predictor.predict`, only faster without compiled code where the throws
    have one grip force.
    """
    throws, sets = predictor.data.throws, parameters.count
    few = len(throws) > 1 and len(throws) * sets <= MOST
    alike = all(_same(throw.grip, throws[0].grip) for throw in throws) if few else False
    if not alike or model not in BATCHES:
        return predictor.predict(model, parameters).landing[..., :2]
    batches = [
        predictor.batch(throw, hand, parameters)
        for throw, hand in zip(throws, predictor.hands, strict=True)
    ]
    detach = BATCHES[model](_joined(batches)).detach
    shared = predictor.data.shared
    landing = land(detach, shared.landing_height, shared.gravity)
    return landing.reshape(len(throws), sets, 3)[..., :2]


def _joined(batches: list[ReleaseBatch]) -> ReleaseBatch:
    """Batches that differ in body, contact, hand and grasp as one."""
    first = batches[0]

    def column(values: list[object]) -> Array:
        spread = [
            np.broadcast_to(np.asarray(v, float), one.count)
            for v, one in zip(values, batches, strict=True)
        ]
        return np.concatenate(spread)

    bodies, contacts = [one.body for one in batches], [one.contact for one in batches]
    poses = np.concatenate([np.repeat(one.hands.given, one.count, axis=0) for one in batches])
    delays = column([one.hands.delays for one in batches])
    return ReleaseBatch(
        sum(one.count for one in batches),
        Body(
            column([body.mass for body in bodies]),
            column([body.inertia for body in bodies]),
            column([body.com_offset for body in bodies]),
        ),
        Contact(
            column([contact.friction for contact in contacts]),
            column([contact.patch_radius for contact in contacts]),
            first.contact.torsion,
            first.contact.faces,
        ),
        first.grip,
        Path.through(first.hands.breaks, poses, delays),
        column([one.opening for one in batches]),
        column([one.force for one in batches]),
        first.gravity,
        column([one.grasp_angle for one in batches]),
    )


def _same(one: GripProfile, other: GripProfile) -> bool:
    """Whether two grip forces fall alike."""
    return (
        abs(one.opening - other.opening) < 1e-9
        and abs(one.full - other.full) < 1e-9 * one.full
        and np.allclose(one.force(SHARES * one.opening), other.force(SHARES * one.opening))
    )
