"""The flight of a body after its release: a parabola without drag, turning evenly."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .backend import Value, backend
from .body import Array

#: Longest flight [s]: without gravity an object may hardly fall.
LONGEST = 1000.0


@dataclass(frozen=True)
class FlightState:
    """CoM position [m], angle [rad], velocity [m/s] and rate [rad/s] of a body in flight."""

    x: Value
    z: Value
    theta: Value
    v_x: Value
    v_z: Value
    omega: Value

    @property
    def pose(self) -> Array:
        """x, z, theta (3, ...)."""
        return np.array(np.broadcast_arrays(self.x, self.z, self.theta))


@dataclass(frozen=True)
class FlightLaw:
    """A rigid body under gravity [m/s^2] along -z, without drag.

    bias: by how far measured throws land off the release model's prediction, dx [m] and dtheta
    [rad]; None without a calibration.
    """

    gravity: Value = 9.81
    bias: tuple[Value, Value] | None = None

    def after(self, state: FlightState, time: Value) -> FlightState:
        """The state `time` [s] later: numbers, arrays, or CasADi expressions."""
        return FlightState(
            state.x + state.v_x * time,
            state.z + state.v_z * time - 0.5 * self.gravity * time * time,
            state.theta + state.omega * time,
            state.v_x,
            state.v_z - self.gravity * time,
            state.omega,
        )

    def fall_time(self, state: FlightState, height: Value) -> Value:
        """Time [s] until the CoM falls through `height` [m]; NaN if it takes over `LONGEST`.

        In the NLP the flight time is an unknown with a polynomial constraint, which has no NaN.
        """
        # The later root of drop + v_z t - g t^2 / 2 = 0, in the form that does not cancel; 1e-300
        # in place of 0 for a fall from rest at its own height.
        v_z, g = state.v_z, self.gravity
        drop, xp = state.z - height, backend(state.z, height)
        with np.errstate(invalid="ignore", divide="ignore"):
            root = xp.sqrt(v_z * v_z + 2 * g * drop)
            falling = 2 * drop / xp.maximum(root - v_z, 1e-300)
            straight = xp.where(v_z < 0, drop / xp.maximum(-v_z, 1e-300), np.nan)
            time = xp.where(g > 0, xp.where(v_z > 0, (v_z + root) / g, falling), straight)
            return xp.where(time >= 0, xp.where(time <= LONGEST, time, np.nan), np.nan)

    def calibrated(self, detach: FlightState, time: Value) -> FlightState:
        """The state at detach of a flight of `time` [s] that ends `bias` farther.

        Measurements show the bias at the landing only. It is spread evenly over the flight, as
        errors of v_x and omega: none at the pads, all of it at the landing.
        """
        if self.bias is None:
            return detach
        dx, dtheta = self.bias
        return replace(detach, v_x=detach.v_x + dx / time, omega=detach.omega + dtheta / time)

    def land(self, detach: Array, height: float) -> Array:
        """x [m], theta [rad] and flight time [s] (N, 3) at which the CoM falls through `height`.

        detach (N, 6): x, z, theta, v_x, v_z, omega of the CoM, by a release model; the landing has
        the bias. NaN where it never does.
        """
        start, (dx, dtheta) = FlightState(*detach.T), self.bias or (0.0, 0.0)
        time = self.fall_time(start, height)
        end = self.after(start, time)
        return np.column_stack([end.x + dx, end.theta + dtheta, time])

    def apex(self, start: FlightState) -> FlightState:
        """The highest state from `start` on; `start` itself if it falls, or without gravity."""
        xp = backend(start.v_z, self.gravity)
        rise = xp.maximum(start.v_z, 0.0) / xp.maximum(self.gravity, 1e-300)
        return self.after(start, xp.where(self.gravity > 0, rise, 0.0 * start.v_z))
