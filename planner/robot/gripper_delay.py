"""The time from a gripper's opening command to its motion, measured with an empty hand."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ...models import Array
from ...problems import Distribution, InputError
from ...problems.arms import GripperData, load_arm
from .franka import ARM, check_port
from .gripper import MOVED, OPEN_WIDTH, PORT, SPEED, GripperLink

#: Grip force [N] of one pad that a Franka Hand keeps up: Franka Hand data sheet, continuous force.
FORCE = 70.0
#: Assumed duration [s] of the force's fall; an empty hand does not show it.
OPENING = 0.05
#: Time [s] in which a gripper begins to move, and in which it ends.
BEGINS, ENDS = 5.0, 10.0
#: Time [s] at rest before an opening, at least that of five reports.
REST = 0.3
#: Way [m] that the fit takes at least, and share of the way that it takes at most: later the
#: gripper may be slower.
BEGIN, FITTED = 0.003, 0.7
#: Golden ratio: its multiples spread evenly modulo 1.
GOLDEN = (5**0.5 - 1) / 2
#: Starts [s] of the fit for the time to full speed.
RAMPS = (1e-3, 0.02, 0.1)
#: Reports of the width in motion in each opening: to fit, and at least.
ENOUGH, FEWEST = 4, 2
#: Openings with fewer reports that end the measurement: a busy machine or network loses some.
LOST = 5


@dataclass(frozen=True)
class Opening:
    """Reported widths (N,) [m] of one opening, at times (N,) [s] after its command."""

    times: Array
    widths: Array

    @property
    def way(self) -> float:
        """How far [m] it opened."""
        return float(self.widths[-1] - self.widths[0])

    @property
    def speed(self) -> float:
        """Mean speed [m/s] in the middle of the way."""
        share = (self.widths - self.widths[0]) / self.way
        first, last = np.argmax(share > 1 - FITTED), np.argmax(share > FITTED)
        middle = slice(int(first) - 1, int(last) + 1)
        times, widths = self.times[middle], self.widths[middle]
        return float((widths[-1] - widths[0]) / (times[-1] - times[0]))

    def begin(self, way: float) -> tuple[Array, Array]:
        """Times [s] and ways [m] (M,) of the reports before it has gone `way` [m]."""
        gone = self.widths - self.widths[0]
        count = int(np.argmax(gone > min(way, FITTED * self.way)))
        return self.times[:count], gone[:count]

    @property
    def tells(self) -> bool:
        """Whether enough reports came in motion to tell when it began."""
        _, gone = self.begin(OPEN_WIDTH)
        return int(np.sum(gone > MOVED / 4)) >= FEWEST


@dataclass(frozen=True)
class GripperDelay:
    """Delays of a gripper.

    delays (N,) [s]: from each opening's command to its motion; speed [m/s]: of the width, in the
    middle of its way; interval [s]: between reports of the width; error [m]: standard deviation of
    these about the fit.
    """

    host: str
    delays: Array
    speed: float
    interval: float
    error: float

    @cached_property
    def gripper(self) -> GripperData:
        """The gripper file's data: the delay measured, the rest of the robot's hand assumed."""
        dwell = round(float(self.delays.mean()), 5)
        samples = tuple(round(float(value) - dwell, 5) for value in self.delays)
        return GripperData.of_hand(
            load_arm(ARM),
            "Franka Hand",
            force=FORCE,
            dwell=dwell,
            opening=OPENING,
            delay=Distribution(samples=samples),
        )

    def text(self) -> str:
        """The gripper file."""
        return self.gripper.text(
            [
                f"Franka Hand at {self.host}, empty, opened {len(self.delays)} times by throwplan "
                "measure-gripper.",
                self.words,
                "dwell: mean of these delays; delay: each of them less the mean.",
                f"Not measured: force ({FORCE:g} N, continuous force in the Franka Hand's data "
                f"sheet) and opening ({OPENING:g} s, an assumption): how the force falls cannot be "
                "seen with an empty hand. Record it by a force sensor between the pads, or fit it "
                "to throws by throwplan identify --delay.",
                f"The rest is the hand of the arm file {ARM}.toml.",
            ]
        )

    @property
    def words(self) -> str:
        """The measurement in a sentence."""
        delays = 1e3 * self.delays
        return (
            f"From command to motion {delays.mean():.1f} ms in the mean, standard deviation "
            f"{delays.std():.1f} ms, {delays.min():.1f} to {delays.max():.1f} ms; it opens at "
            f"{self.speed:.3f} m/s; it reports its width every {1e3 * self.interval:.0f} ms."
        )

    def to_dict(self) -> dict[str, Any]:
        """As JSON, SI units."""
        delays = self.delays
        return {
            "robot": self.host,
            "times": len(delays),
            "delay": {
                "mean": float(delays.mean()),
                "deviation": float(delays.std()),
                "least": float(delays.min()),
                "worst": float(delays.max()),
                "samples": delays.tolist(),
            },
            "speed": self.speed,
            "interval": self.interval,
            "error": self.error,
        }


def measure_gripper(
    host: str,
    times: int,
    ask: Callable[[str], None],
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> GripperDelay:
    """Open the empty gripper `times` times and find its delays.

    ask: called with what comes next before anything moves; its exceptions stop it. An opening in
    which too few reports arrived is repeated. InputError for a gripper that does not answer, is not
    homed, holds something, does not move or reports its width too rarely.
    """
    check_port(host, PORT)
    link = GripperLink(host)
    try:
        now = link.homed_state()
        if now.holds:
            raise InputError(f"{host}: its gripper holds something: take it out")
        ask(f"the gripper at {host} closes and opens {times} times")
        # It neither meets its stops nor presses its pads.
        closed, opened = 0.1 * now.max_width, 0.95 * now.max_width
        openings: list[Opening] = []
        tried = 0
        while len(openings) < times:
            _move(link, closed)
            # At another time between two reports each time, or all would show the same instants.
            wait = GOLDEN * tried % 1.0 * _at_rest(link)
            opening = _move(link, opened, wait)
            tried += 1
            if opening.tells:
                openings.append(opening)
                progress(len(openings), times)
            elif tried - len(openings) == LOST:
                raise InputError(
                    f"{host}: in {LOST} of {tried} openings the gripper reported its width less "
                    f"than {FEWEST} times while it moved, too rarely to tell its delay"
                )
    finally:
        link.close()
    return fitted(host, openings)


def _move(link: GripperLink, width: float, after: float = 0.0) -> Opening:
    """Move to a width in `after` [s] and return the reports; InputError if the gripper stays."""
    before = link.states[-1].width
    link.order("move", width, SPEED, after=after)
    begin = time.monotonic()
    while True:
        link.update(0.1)
        waited, now = time.monotonic() - begin, link.states[-1]
        moved = abs(now.width - before) > MOVED
        if abs(now.width - width) < MOVED:
            break
        if waited > (ENDS if moved else BEGINS):
            raise InputError(
                f"{link.host}: its gripper stays at {1e3 * now.width:.0f} mm, must move to "
                f"{1e3 * width:.0f} mm: clear its way, or see Desk for its state"
            )
    link.result(ENDS)
    seen, sent = link.states, link.ordered or begin
    return Opening(
        np.array([state.time - sent for state in seen]), np.array([state.width for state in seen])
    )


def _at_rest(link: GripperLink) -> float:
    """Wait until the width has rested for `REST`, and was reported five times; returns the mean
    time [s] between these reports."""
    states = [link.state()]
    while states[-1].time - states[0].time < REST or len(states) < 5:
        states.append(link.state())
        if abs(states[-1].width - states[0].width) > MOVED / 4:
            states = states[-1:]
    return (states[-1].time - states[0].time) / (len(states) - 1)


def fitted(host: str, openings: Sequence[Opening]) -> GripperDelay:
    """The delays by least squares on the reports of the width in motion.

    All openings share one law: at rest until the delay, then at constant acceleration for `ramp` to
    `speed`. Reports that are far apart thus tell the delay to a part of their interval.
    """
    from scipy.optimize import least_squares

    interval = float(np.median(np.concatenate([np.diff(one.times) for one in openings])))
    parts: list[tuple[Array, Array]] = []
    moving, way = parts, BEGIN
    while not moving or (min(len(t) for t, _ in moving) < ENOUGH and way < OPEN_WIDTH):
        parts = [one.begin(way) for one in openings]
        moving = [(times[gone > MOVED / 4], gone[gone > MOVED / 4]) for times, gone in parts]
        way *= 1.2
    speed = float(np.median(np.concatenate([np.diff(w) / np.diff(t) for t, w in moving])))

    def errors(point: Array) -> Array:
        ways = [
            point[0] * _travel(times - delay, point[1]) - gone
            for (times, gone), delay in zip(parts, point[2:], strict=True)
        ]
        return np.concatenate(ways)

    def fit(ramp: float) -> Any:
        # Each report in motion tells when the motion began.
        begins = [max(float(np.mean(t - _duration(w / speed, ramp))), 1e-6) for t, w in moving]
        low = [0.1 * speed, 0.0, *[0.0] * len(parts)]
        high = [10 * speed, 1.0, *[np.inf] * len(parts)]
        scale = [speed, 0.02, *[0.01] * len(parts)]
        start = [speed, ramp, *begins]
        return least_squares(errors, start, bounds=(low, high), x_scale=scale)

    best = min(map(fit, RAMPS), key=lambda found: float(found.cost))
    error = float(np.sqrt(np.mean(best.fun**2)))
    mean_speed = float(np.median([one.speed for one in openings]))
    return GripperDelay(host, best.x[2:], mean_speed, interval, error)


def _travel(since: Array, ramp: float) -> Array:
    """Way per unit of speed (N,) [s] after `since` (N,) [s] in motion."""
    short = np.clip(since, 0.0, ramp)
    return np.asarray(short**2 / (2 * ramp + 1e-12) + np.maximum(since - ramp, 0.0))


def _duration(way: Array, ramp: float) -> Array:
    """Inverse of `_travel`: time (N,) [s] in motion for a way per unit of speed (N,) [s]."""
    return np.where(way < ramp / 2, np.sqrt(2 * ramp * way), way + ramp / 2)
