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
# How robust is a throw to timing, and a throw that is

Grippers do not open when they are told to: the delay from the command to the fall of the force
scatters by milliseconds. At a hand speed of 2 m/s a millisecond is 2 mm of path, and the hand turns
meanwhile. Here we measure what ±10 ms do to a throw of the least effort, and to one that does not
mind, and look at what it costs.
"""

# %%
import json
import math
import tempfile
from importlib.resources import files
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import throwplan as tp
from matplotlib.patches import Rectangle

plt.rc("figure", dpi=85)
plt.rc("figure.constrained_layout", use=True)
plt.rc("axes", grid=True, titlelocation="left", titlesize=11)
plt.rc("axes.spines", top=False, right=False)
plt.rc("grid", alpha=0.25)
plt.rc("legend", fontsize=9)
RED, GREEN = "#d1495b", "#2a9d6f"

# %% [markdown]
"""
## The throw of least effort, and its sweep

The scene `delay` asks a Panda to land the bar flat at x = 0.8 m. Its section `[uncertainty]` says
that the delay is uniform within ±10 ms:

```toml
[uncertainty]
delay = { uniform = 0.010 } # s, half width about no delay
opening = 0 # its duration does not scatter
```

With `[cost] quiet = 0` the load on the pads costs nothing. `sweep` throws the motion that is sent
again and again, each time with another delay, and counts how many land inside the tolerance of 2 mm
and 0.5°.
"""

# %%
scene = tp.load_scene("delay")
loud = tp.plan(scene.replace(cost=tp.Cost(quiet=0.0)))
swept = tp.sweep(loud, samples=1000)


def say(name, sweep):
    """Prints the rate of success and what the delay does."""
    told = sweep.to_dict()
    rate, worst = told["success"], told["quantiles"]
    print(
        f"{name}: {100 * rate['rate']:.1f} % succeed "
        f"(95 % interval {100 * rate['low']:.1f} to {100 * rate['high']:.1f}), 95 % land within "
        f"{1e3 * worst['position']['95']:.2f} mm and {math.degrees(worst['angle']['95']):.2f} deg"
    )


print(loud.status, "-", loud.message)
say("loud plan", swept)

# %% [markdown]
"""
The plan is exact to micrometres, and one throw in seven succeeds. The delays that it can bear:
"""


# %%
def draw_delay(axes, sweep, colour, name):
    """Landing errors over the delay, the only thing that this sweep draws."""
    order = np.argsort(sweep.values[:, 0])
    ms, pose = 1e3 * sweep.values[order, 0], sweep.landings.pose[order]
    target = sweep.plan.target
    axes[0].plot(ms, 1e3 * (pose[:, 0] - target.x), color=colour, lw=2, label=name)
    axes[1].plot(ms, np.degrees(pose[:, 1] - target.theta), color=colour, lw=2, label=name)


def frame_delay(axes):
    """Names of the axes, the tolerance, and the delays that are expected."""
    widths = (1e3 * scene.tolerance.position, math.degrees(scene.tolerance.angle))
    names = ("landing off in x [mm]", "landing off in θ [deg]")
    for axis, width, words in zip(axes, widths, names, strict=True):
        axis.axhspan(-width, width, color="#4c78a8", alpha=0.35, lw=0, label="tolerance")
        axis.axvspan(-10, 10, color="#8a8f98", alpha=0.13, lw=0, label="delays expected")
        axis.set(xlabel="opening late by [ms]", ylabel=words, xlim=(-12, 12))


figure, axes = plt.subplots(1, 2, figsize=(10, 3.8))
draw_delay(axes, swept, RED, "loud plan")
frame_delay(axes)
axes[0].legend()
axes[0].set_title("Error over delay, loud plan")
plt.show()
early, late = swept.delays.early, swept.delays.late
print(f"lands inside the tolerance from {1e3 * early:.2f} to {1e3 * late:+.2f} ms")

# %% [markdown]
"""
## A throw that forgives

By default the load on the pads is part of the cost, and a plan is a throw in which the hand, while
the pads open, follows the way that the bar would fly on its own: it falls with the bar and
turns with it. Then the pads transmit next to nothing, and it does not matter *when* they let go.
`peak_load` says how well that worked: the largest wrench, once a quarter of the grip may be left,
as a share of what the full grip can hold.

`robust=True` tries harder (other throws, several openings in one optimisation) where some of 1,000
sampled throws fail, and takes the best. The message has what the samples say.
"""

# %%
planner = tp.Planner(scene)
quiet = planner.plan()
forgiving = planner.plan(robust=True)
for name, plan in (("quiet", quiet), ("robust", forgiving)):
    print(f"{name}: {plan.status}, {plan.message}, peak load {plan.peak_load:.2%}")
again = tp.sweep(forgiving, samples=1000)
say("loud plan  ", swept)
say("robust plan", again)

# %%
figure, axes = plt.subplots(1, 2, figsize=(10, 4.4))
width = [1e3 * scene.tolerance.position, math.degrees(scene.tolerance.angle)]
for axis, sweep, name in zip(axes, (swept, again), ("loud", "robust"), strict=True):
    dx = 1e3 * (sweep.landings.pose[:, 0] - scene.target.x)
    dtheta = np.degrees(sweep.landings.pose[:, 1] - scene.target.theta)
    dots = axis.scatter(
        dx, dtheta, c=1e3 * sweep.values[:, 0], cmap="coolwarm", s=9, vmin=-10, vmax=10
    )
    box = Rectangle((-width[0], -width[1]), 2 * width[0], 2 * width[1], fill=False, lw=1.5)
    axis.add_patch(box)
    rate = sweep.to_dict()["success"]["rate"]
    axis.set(title=f"{name} plan: {100 * rate:.1f} % inside", xlabel="landing off in x [mm]")
axes[0].set_ylabel("landing off in θ [deg]")
axes[1].set(xlim=(-2.5, 2.5), ylim=(-0.65, 0.65))
axes[1].annotate("tolerance", (-1.95, 0.52), fontsize=9)
figure.colorbar(dots, ax=axes, label="opening late by [ms]")
plt.show()

# %% [markdown]
"""
Mind the scales: the right picture shows little more than the small box in the left one.
"""

# %%
figure, axes = plt.subplots(1, 2, figsize=(10, 3.8))
draw_delay(axes, swept, RED, "loud plan")
draw_delay(axes, again, GREEN, "robust plan")
frame_delay(axes)
axes[0].set(title="Error over delay")
axes[1].legend(loc="lower left")
plt.show()

# %% [markdown]
"""
## Why it works

We send both motions through the sliding pivot once more and look at the wrench between pads and
bar. A scene with a recorded joint motion does that: `motion.csv`, as `save` writes it, is one.
(Joint recordings are low-passed; `cutoff` is set high here, because these samples have no noise.)
The rest of the scene is the text of the built-in file (`throwplan scenes --write delay` copies it).
"""

# %%
TEXT = (files("throwplan.problems") / "scenes" / "delay.toml").read_text(encoding="utf-8")
HELD, _ = TEXT.split("[robot]")  # object, contact, gripper
MOTION = """[motion]
arm = "panda"
joints = "motion.csv"
cutoff = 300.0
"""


def released(plan):
    """The release of the motion that is sent, with its friction wrench over time."""
    with tempfile.TemporaryDirectory() as folder:
        plan.save(folder)
        file = Path(folder, "sent.toml")
        file.write_text(
            f"{HELD}{MOTION}opening_time = {plan.throw.opening_time}\n", encoding="utf-8"
        )
        return tp.simulate(file, "sp")["sp"].release


figure, axes = plt.subplots(1, 3, figsize=(11, 3.8))
for plan, colour, name in ((loud, RED, "loud plan"), (forgiving, GREEN, "robust plan")):
    release = released(plan)
    ms = 1e3 * release.times
    axes[0].plot(ms, np.hypot(*release.wrench[:2]), color=colour, label=name)
    axes[1].plot(ms, 1e3 * np.abs(release.wrench[2]), color=colour)
    axes[2].plot(ms, release.com_twist[2], color=colour)
axes[0].set(ylabel="friction force on the bar [N]", title="Force")
axes[1].set(ylabel="friction torque on the bar [N mm]", title="Torque")
axes[2].set(ylabel="turning rate of the bar [rad/s]", title="Turning rate")
for axis in axes:
    axis.set(xlabel="from the start of the opening [ms]", xlim=(0, 50))
axes[0].legend()
plt.show()

# %% [markdown]
"""
In the loud throw the hand still pushes and turns the bar while the pads open; every millisecond
more of that changes the landing. In the robust throw the bar is nearly in free flight already when
the pads let go.

## The price

The hand has to fly like the bar for a while, so the bar must have its whole motion before the pads
let go: joints move at other speeds, and accelerate by a fifth more.
"""

# %%
limits = scene.arm.limits
joints = [joint - 1 for joint in scene.arm.throwing_joints]


def price(plan):
    """RMS of the joints' accelerations [rad/s^2], the bar's speed [m/s], shares of limits."""
    samples, start = plan.throw.samples, plan.throw.deciding.release.detach
    speed = np.abs(samples.dq).max(axis=0) / np.array(limits.velocity)[joints]
    return np.sqrt((samples.ddq**2).sum(axis=1).mean()), math.hypot(start.v_x, start.v_z), speed


costs = {"loud": price(loud), "robust": price(forgiving)}
figure, axes = plt.subplots(1, 3, figsize=(10, 3.6), width_ratios=(1, 1, 2))
titles = ("joint acceleration, RMS [rad/s²]", "bar's speed at detach [m/s]")
for column, words in enumerate(titles):
    values = [cost[column] for cost in costs.values()]
    bars = axes[column].bar(list(costs), values, color=[RED, GREEN], width=0.55)
    axes[column].bar_label(bars, fmt="%.2f")
    axes[column].set_title(words, fontsize=9)
for offset, (name, cost), colour in zip((-0.18, 0.18), costs.items(), (RED, GREEN), strict=True):
    axes[2].bar(np.arange(3) + offset, 100 * cost[2], width=0.34, color=colour, label=name)
axes[2].set_xticks(range(3), [f"joint {joint + 1}" for joint in joints])
axes[2].set_title("largest speed, share of the joint's limit [%]", fontsize=9)
axes[2].legend()
plt.show()

# %% [markdown]
"""
## Not only timing

A throw that transmits nothing depends on friction and on the opening's duration as little as on its
delay. So we take more to be uncertain: 20 % of friction and of the pads' radius, the opening's
duration within a fifth.
"""

# %%
MORE = """
friction = { uniform = 0.2, relative = true }
patch_radius = { uniform = 0.2, relative = true }
"""
SPREAD = "opening = { uniform = 0.2, relative = true }"
with tempfile.TemporaryDirectory() as folder:
    file = Path(folder, "more.toml")
    text = TEXT.replace("opening = 0", SPREAD) + MORE  # [uncertainty] is its last section
    file.write_text(text, encoding="utf-8")
    more = tp.load_scene(file)
plans = {
    "loud": tp.plan(more.replace(cost=tp.Cost(quiet=0.0))),
    "robust": tp.plan(more, robust=True),
}
sweeps = {name: tp.sweep(plan, samples=1000) for name, plan in plans.items()}
for name, sweep in sweeps.items():
    say(f"{name} plan, four uncertain", sweep)

# %%
edges = {
    "delay ±10 ms": ("delay", 0.010),
    "friction ±20 %": ("friction", 0.2 * scene.contact.friction),
    "pads' radius ±20 %": ("patch_radius", 0.2 * scene.contact.patch_radius),
    "opening ±20 %": ("opening", 0.2 * scene.gripper.opening),
}
figure, axes = plt.subplots(1, 2, figsize=(10, 3.4), sharey=True)
for offset, (name, sweep), colour in zip((-0.18, 0.18), sweeps.items(), (RED, GREEN), strict=True):
    slopes = sweep.to_dict()["sensitivity"]
    for axis, value, unit in zip(axes, ("x", "theta"), (1e3, math.degrees(1)), strict=True):
        moves = [unit * abs(slopes[key][value]) * edge for key, edge in edges.values()]
        axis.barh(np.arange(4) + offset, moves, height=0.34, color=colour, label=name)
for axis, words in zip(axes, ("x moves by [mm]", "θ moves by [deg]"), strict=True):
    axis.set(xscale="log", xlabel=words)
axes[0].set_yticks(range(4), edges)
axes[0].invert_yaxis()
axes[0].set_title("What each does alone, by its slope, at the edge of its range")
axes[1].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2)
plt.show()

# %% [markdown]
"""
Friction and the pads' radius hardly matter to the robust plan (mind the logarithmic scale). What is
left is time: delay and duration add up, and still nine throws of ten land inside the tolerance.

A robust throw still needs the hand to be where it was planned to be: errors of the hand's own
motion (`hand_x`, `hand_vx`, ... in `[uncertainty]`) move the landing of any throw. And all this is
by the model; measure your gripper's delay first.

The key figures of this notebook, as the tests read them:
"""

# %%
rates = [sweep.to_dict()["success"]["rate"] for sweep in (swept, again)]
figures = {
    "status": [loud.status, quiet.status, forgiving.status],
    "success": {"loud": rates[0], "robust": rates[1]},
    "peak_load": round(forgiving.peak_load, 4),
    "rms_acceleration": {name: round(float(cost[0]), 2) for name, cost in costs.items()},
    "four_uncertain": {name: one.to_dict()["success"]["rate"] for name, one in sweeps.items()},
}
print(json.dumps(figures))
