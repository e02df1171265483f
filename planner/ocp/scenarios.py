"""Other openings that share one hand motion: early, late, slow ones, thrown in the NLP too."""

from __future__ import annotations

import casadi as ca
import numpy as np

from ...models import FlightState
from .assembly import Stage
from .context import Context
from .integration import full_state, gauss_interval, relative_state


def scenario_interval(
    context: Context, number: int, stage: Stage, following: Stage, dt: ca.SX
) -> None:
    """Scenario `number` across one interval of the window, with its own grip force.

    Under full grip it sticks, without any it flies: the same law serves all along.
    """
    name = f"rel_{number}"
    end = gauss_interval(context, stage, dt, f"_{number}")
    # In the order of the next stage's states, as FATROP's gaps want it.
    ahead = stage.following | {name: end}
    stage.following = {key: ahead[key] for key in following.states if key in ahead}


def scattered(context: Context, stage: Stage) -> None:
    """At the window's end: each scenario's landing, and the price of missing the target."""
    p = context.parameters
    pose, twist, motion = context.hand(stage, *context.node(stage))
    for number in range(context.structure.scenarios):
        state = full_state(context, relative_state(context, stage, f"_{number}"))
        flight = FlightState(*stage.lift(*context.release.com_state(state, pose, twist, motion)))
        land = flight.after(stage.control(f"t_f_{number}"), context.gravity)
        stage.row("landing z", land.z - p("target_z"), 0.0, 0.0)
        stage.row("coming down", land.v_z, -np.inf, 0.0)
        miss = (land.x - p("target_x")) ** 2
        if context.structure.angle:
            miss += (p("quiet_arm") * (land.theta - p("target_theta"))) ** 2
        stage.cost += p("scenario_weight") * miss / context.structure.scenarios
