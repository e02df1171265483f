"""Ballistic flight without drag, angle unwrapped."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .backend import Value

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class FlightState:
    """CoM position [m], angle [rad, unwrapped], velocity [m/s] and rate [rad/s]."""

    x: Value
    z: Value
    theta: Value
    v_x: Value
    v_z: Value
    omega: Value

    def after(self, time: Value, gravity: Value) -> FlightState:
        """State `time` seconds later under `gravity` [m/s^2] along -z."""
        return FlightState(
            self.x + self.v_x * time,
            self.z + self.v_z * time - 0.5 * gravity * time * time,
            self.theta + self.omega * time,
            self.v_x,
            self.v_z - gravity * time,
            self.omega,
        )


def time_to_height(state: FlightState, height: float, gravity: float) -> float:
    """Time [s] until the CoM comes down through `height`; NaN if it never does.

    Numbers only: inside the NLP the flight time is an unknown with a polynomial
    constraint, which cannot give a NaN.
    """
    drop = state.z - height
    if gravity <= 0.0:
        return drop / -state.v_z if drop >= 0.0 and state.v_z < 0.0 else math.nan
    discriminant = state.v_z**2 + 2.0 * gravity * drop
    if discriminant < 0.0:
        return math.nan
    root = math.sqrt(discriminant)
    # The stable form of the later root of z + v t - g t^2 / 2 = height.
    time = (state.v_z + root) / gravity if state.v_z > 0 else 2.0 * drop / (root - state.v_z or 1.0)
    return time if time >= 0.0 else math.nan


def land(detach: Array, height: float, gravity: float) -> Array:
    """x [m], theta [rad] and flight time [s] (N, 3) of coming down through `height`.

    detach (N, 6): x, z, theta, v_x, v_z, omega of the CoM. NaN where it never does.
    """
    x, z, theta, v_x, v_z, omega = detach.T
    with np.errstate(invalid="ignore", divide="ignore"):
        if gravity > 0:
            time = (v_z + np.sqrt(v_z**2 + 2 * gravity * (z - height))) / gravity
        else:
            time = np.where(v_z < 0, (height - z) / v_z, np.nan)
        time = np.where(time >= 0, time, np.nan)
    return np.column_stack([x + v_x * time, theta + omega * time, time])
