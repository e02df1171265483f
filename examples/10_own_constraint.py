# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
#   kernelspec:
#     display_name: Python 3 (ipykernel)
#     language: python
#     name: python3
# ---

# %% [markdown]
"""
# A constraint of your own

A camera measures where the object flies, and needs time for it. throwplan has no key for the
shortest time of a flight, so we write the constraint ourselves: one expression for the
optimisation, and one function that reads the same value from the throw that is sent. A plan whose
throw breaks the constraint is not `solved`.
"""

# %%
import json

import matplotlib.pyplot as plt
import numpy as np
import throwplan as tp

# %% [markdown]
"""
`in_flight` gets the flight from the detach to the landing as CasADi expressions: `start` and `end`
(x, z, theta, v_x, v_z, omega of the centre of mass) and `time`. `check` gets the sent throw as
numbers. Both return the time of the flight [s]. The optimisation keeps a millisecond more than we
ask for: it throws by the smoothed model, and the check by the exact one.
"""


# %%
def sent_time(throw):
    """The time [s] that a sent throw flies."""
    return throw.landing_time - throw.detach_time


def longer_than(least):
    """At least so much time [s]."""
    return tp.Constraint(
        "time for the camera",
        in_flight=lambda flight: flight.time,
        low=least,
        margin=1e-3,
        check=sent_time,
    )


# %% [markdown]
"""
We plan without the constraint, then ask for longer and longer flights. Where no throw keeps it,
the plan is `not_found`, and its message names the constraint.
"""

# %%
SCENE = "hand-flip"
plans = {0.0: tp.Planner(SCENE).plan()}
for least in (0.7, 0.8, 0.9, 1.0):
    plans[least] = tp.Planner(SCENE, constraints=[longer_than(least)]).plan()
for least, plan in plans.items():
    print(f"at least {least:.1f} s: {plan.status}, {plan.message}")

# %% [markdown]
"""
The longer the flight, the higher the bar is thrown.
"""

# %%
figure, axes = plt.subplots(figsize=(7, 4.5), layout="constrained")
times = {}
for least, plan in plans.items():
    if plan.solved:
        throw = plan.sent_throw()
        times[least] = sent_time(throw)
        flight = throw.scene.flight.after(throw.landing.start, np.linspace(0.0, times[least], 50))
        axes.plot(flight.x, flight.z, label=f"{times[least]:.2f} s")
axes.set(xlabel="x [m]", ylabel="z [m]", aspect="equal", title="flight of the centre of mass")
axes.legend()
plt.show()
print(json.dumps({"status": [plan.status for plan in plans.values()], "times": times}))
