"""The next motion for a throw, from what the arm did of the last one.

Iterative learning on the reference: how the joints follow is fitted to the recording, and what
that does not explain is taken to come again. The motion to send is then a quadratic program over
the coefficients of splines: the throw that will be measured lands at its target, its joints move
nearly as planned while the pads open, and what is sent keeps the limits. It may begin earlier and
elsewhere than the plan's: an arm that lags needs a longer run-up.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import numpy.typing as npt

from ...models import PlanarArm
from ...problems import InputError
from ..check import Samples, Throw, broken_limits
from ..ocp import broken as broken_terms
from ..result import joint_samples
from .controllers import JointMotion
from .lesson import LANDING, Lesson
from .recording import Recording

Array = npt.NDArray[np.float64]

#: Steps of the program's rounds; its landing is near enough where its share of what weighs alike
#: there is below.
STEPS, ENOUGH = (*[0.3] * 8, *[0.15] * 10), 1.0


def corrected(plan: JointMotion, recording: Recording) -> tuple[JointMotion, Throw]:
    """The motion to send next, by the recording of one that was sent for the same plan.

    Also the throw that it is expected to be. InputError where no motion within the limits is
    found, and where that throw breaks what the scene asks.
    """
    lesson = Lesson.of(plan.throw, recording)
    starts = [lesson.better(), lesson.last]
    coefficients = min(starts, key=lambda each: _off(lesson.throw(each)))
    found: list[tuple[bool, float, list[str], Throw, Throw]] = []
    for step in STEPS:
        coefficients = lesson.better(coefficients, step)
        expected = lesson.throw(coefficients)
        samples = Samples(*(basis @ coefficients for basis in lesson.basis))
        sent = dataclasses.replace(expected, path=samples.path, samples=samples)
        off, wrong = _off(expected), _wrong(sent, expected)
        found.append((bool(wrong), off, wrong, sent, expected))
        if not wrong and off < ENOUGH:
            break
    _, _, wrong, sent, expected = min(found, key=lambda each: each[:2])
    if wrong:
        raise InputError(f"the corrected motion is not sent: {wrong[0]}")
    assert isinstance(sent.mover.kinematics, PlanarArm)
    values = joint_samples(sent.mover.kinematics, sent.target.plane.azimuth, sent.samples)
    return JointMotion(plan.arm, sent, *values), expected


def _off(throw: Throw) -> float:
    """The landing off the target, 1 for what weighs alike; infinite where it does not land."""
    off = float(np.abs(np.array(throw.miss()) / LANDING).max())
    return off if math.isfinite(off) else math.inf


def _wrong(sent: Throw, expected: Throw) -> list[str]:
    """Why a motion must not be sent, in words."""
    found = [f"limit of {name} broken" for name in broken_limits(sent.mover, sent.samples)]
    most, speed = sent.scene.tool_speed, sent.measured.speed
    if most is not None and speed > most:
        found.append(f"tool speed: {speed:.3f} m/s, at most {most:g}")
    return found + [violation.words for violation in broken_terms(expected)]
