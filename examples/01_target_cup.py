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
# Throw into the target cup, then move the cup

A Panda swings a bar, opens its gripper, and the bar turns while it slips out of the pads. We ask
for a *pose*: the bar's centre of mass (CoM) at x = 0.90 m, z = 0.22 m, the bar upright with its
CoM end down, so that it drops into a cup. Then we move the cup and plan again, from the last plan.

All angles are in radians inside Python. θ is the direction from the grasped end to the CoM,
counter-clockwise from +x: −90° hangs below the hand.
"""

# %%
import json
import math
import tempfile

import matplotlib.pyplot as plt
import numpy as np
import throwplan as tp
from IPython.display import Image, display
from throwplan import pictures

plt.rc("figure", dpi=85)
plt.rc("figure.constrained_layout", use=True)
plt.rc("axes", grid=True, titlelocation="left", titlesize=11)
plt.rc("axes.spines", top=False, right=False)
plt.rc("grid", alpha=0.25)
plt.rc("legend", fontsize=9)

# %% [markdown]
"""
## One throw

A `Planner` builds the optimisation problem of a scene once. `plan` solves it for a target; without
one it takes the target of the scene file.
"""

# %%
scene = tp.load_scene("near-cup")
planner = tp.Planner(scene)
plan = planner.plan()
print(plan.status, "-", plan.message)

# %% [markdown]
"""
`plan.save` writes the plan (`plan.json`) and the joint motion at 1 kHz (`motion.csv`),
`pictures.save` two pictures: one that stands still and one that moves.
"""

# %%
with tempfile.TemporaryDirectory() as folder:
    pictures.save(plan, folder)
    display(Image(f"{folder}/throw.png", width=900))

# %% [markdown]
"""
Left: the arm at rest, at the opening and at detach, and the bar from 0 s to landing. Right: the
bar between the pads while they open; and, from shortly before the command, the grip force of one
pad, the turning rates, and how much of the friction limit the bar would need to stick. The torque
limit is passed first (the bar *pivots* between the pads), the force limit only at the very end (it
*slides*). The bar leaves with another turning rate than the hand's: that is what has to be
planned.

## Four landings

Every plan says where the object lands by four calculations. They answer different questions:

- **planned**: the smoothed model inside the optimisation. It is aimed beside the target on purpose;
- **exact**: the non-smooth sliding pivot along the planned motion;
- **sent**: the same along the 1 kHz samples that go to the robot;
- **limit surface**: another release model along the same samples. `solved` needs this one inside
  the tolerance, unless the scene says `model = "sp"` in `[tolerance]`. How far it is from the row
  above is how much of the landing is the model's opinion.
"""


# %%
def show_landings(plan):
    """Prints the four landings and how far they are from the target."""
    print(f"{'':14} {'x [m]':>9} {'theta [deg]':>12} {'off by [mm]':>12} {'[deg]':>8}")
    for name, pose in plan.to_dict()["landing"].items():
        dx = 1e3 * abs(pose["x"] - plan.target.x)
        turned = math.degrees(abs(pose["theta"] - plan.target.theta))
        angle = math.degrees(pose["theta"])
        print(f"{name:14} {pose['x']:9.5f} {angle:12.3f} {dx:12.3f} {turned:8.3f}")


show_landings(plan)
tolerance = scene.tolerance
print(f"tolerance {1e3 * tolerance.position:g} mm, {math.degrees(tolerance.angle):g} deg")

# %% [markdown]
"""
## Move the cup

The cup goes along with the target. `warm=` starts from a plan for a target nearby; it is solved,
smoothed, thrown by the exact model, corrected and checked like any other. We go out from the
scene's own cup in steps of 2 cm, both ways, until a plan fails or the range ends.
"""


# %%
def follow(step, end):
    """Warm plans from the scene's own cup to `end` [m]; stops where one is not solved."""
    found, last = [], plan
    count = round((end - scene.target.x) / step)
    for x in scene.target.x + step * np.arange(1, count + 1):
        last = planner.plan(tp.Pose(x, 0.22, -math.pi / 2), warm=last, patience=10.0)
        if not last.solved:
            print(f"x {x:.2f} m: {last.message}")
            break
        found.append(last)
    return found


moved = [*reversed(follow(-0.02, 0.50)), plan, *follow(0.02, 1.50)]
cups = np.array([one.target.x for one in moved])
surface = 1e3 * np.array([one.error_sent()[0] for one in moved])
turned = np.degrees([one.error_sent()[1] for one in moved])
pivot = 1e3 * np.array([one.to_dict()["landing"]["sent"]["x"] for one in moved])
pivot = np.abs(pivot - 1e3 * cups)
times = 1e3 * np.array([one.time["total"] - one.time["build"] for one in moved])
print(f"{len(moved)} cups from {cups.min():.2f} to {cups.max():.2f} m, all solved")

# %%
figure, (top, bottom) = plt.subplots(2, 1, figsize=(9, 5.6), sharex=True, height_ratios=(3, 2))
top.semilogy(cups, pivot, "o-", ms=4, color="#7b4fa3", label="sliding pivot says")
top.semilogy(cups, np.maximum(surface, 1e-3), "o", ms=4, color="#2a9d6f", label="limit surface")
top.axhline(1e3 * tolerance.position, color="#d1495b", lw=1.2, label="tolerance")
top.axhline(0.1, color="#888888", lw=1.2, ls="--", label="what corrections aim at")
top.set(ylabel="position error [mm]", title="Landing error over cup position", ylim=(5e-4, 30))
top.legend(loc="upper center", ncols=4)
warm = cups != scene.target.x
bottom.bar(cups[warm], times[warm], width=0.013, color="#4c78a8")
bottom.set(xlabel="cup at x [m]", ylabel="time [ms]", title="Time of a warm plan, checks included")
plt.show()

# %% [markdown]
"""
Green is what the robot is sent, judged by the limit surface, which decides here (dots below 0.001
mm are drawn there). Violet is the same motion judged by the sliding pivot. Where the two differ by
more than the tolerance, the plan says so. (Both are models: measure your throws.)

The throws themselves, some of the cups. Each line is the CoM from the opening on; the dot is
detach.
"""


# %%
figure, axis = plt.subplots(figsize=(8, 6.4))
shades = plt.get_cmap("viridis")((cups - cups.min()) / np.ptp(cups) * 0.9)
for one, shade in list(zip(moved, shades, strict=True))[::8]:
    pictures.draw_flight(axis, one, color=shade)
    pictures.draw_bars(axis, scene.object, one.path().poses[-1], color=shade)
    pictures.draw_cup(axis, scene.aimed_at(one.target).cup, color=shade)
axis.set(xlabel="x [m]", ylabel="z [m]", title="One scene, many cups (thick: the pads open)")
axis.set_aspect("equal")
plt.show()

# %% [markdown]
"""
There are two kinds of throw here: a short one from low down for near cups, a high one for far
cups. Where a warm start from the one kind does not lead to a solved throw, `plan` searches from its
table of sampled releases as if there had been none; that plan takes longer.

## No throw found

A plan always comes back, with a status. `not_found` says that the search found none; `nearest` is
the throw that it found to land nearest, a plan of its own, and `binding` are the limits that hold
it there.
"""

# %%
far = planner.plan(tp.Pose(x=1.6, z=0.22, theta=-math.pi / 2))
print(far.status, "-", far.message)
nearest, binding = far.nearest.target, far.binding

# %% [markdown]
"""
What is in reach at all? `reach_map` throws sampled motions and sorts the landings. In grey all
landings at the height of the target, in colour the bins in which a throw also goes into a cup
there. The colour is the room that the bin's best throw leaves to the nearest limit of velocity,
acceleration, position or grip.
"""

# %%
whole = tp.reach_map(scene.replace(cup=None), samples=20_000)
into = tp.reach_map(scene, samples=50_000)
where = into.theta_edges[:-1] + np.diff(into.theta_edges) / 2

figure, axis = plt.subplots(figsize=(9, 5))
front = whole.x > 0.3
axis.plot(whole.x[front], np.degrees(whole.theta[front]), ".", color="#c9cdd3", ms=2)
axis.plot([], [], "o", color="#c9cdd3", label="lands, no cup there")
bins = [place for place in np.argwhere(into.landings > 0) if into.x_edges[place[0]] > 0.3]
x, theta = into.x_edges + np.diff(into.x_edges)[0] / 2, where
margin = [100 * into.margin[tuple(place)] for place in bins]
dots = axis.scatter(
    [x[i] for i, _ in bins],
    np.degrees([theta[j] for _, j in bins]),
    c=margin,
    cmap="viridis",
    s=42,
    label="goes into a cup there",
)
axis.plot(cups, np.full(cups.shape, -90), color="#d1495b", lw=2, label="the plans above")
figure.colorbar(dots, label="room to the nearest limit [%]")
axis.set(
    xlabel="x [m]", ylabel="θ at landing [deg]", title="Landings at z = 0.22 m", xlim=(0.3, 1.7)
)
axis.set_yticks(np.arange(-360, 361, 90))
axis.legend(loc="upper right")
plt.show()

# %% [markdown]
"""
The cup takes only bars that come down nearly upright, with either end first: θ near −90° or 90°.
The map is sampled: an empty spot may only have been missed. The planner optimises, and gets to
places where no sample fell.

## Other angles, and turns

Either end may come first. Full turns count: 270° is the same pose as −90°, after one turn more, and
for that the bar would have to leave faster than the Panda's controller lets its tool move.
"""

# %%
aims = {angle: tp.Pose(0.9, 0.22, math.radians(angle)) for angle in (-90, 90)}
others = {angle: planner.plan(aim, patience=30) for angle, aim in aims.items()}
figure, axes = plt.subplots(1, 2, figsize=(6.5, 5.4), sharey=True)
for axis, (angle, one) in zip(axes, others.items(), strict=True):
    path = one.path()
    flying = path.poses[path.times >= one.throw.deciding.detach_time]
    pictures.draw_cup(axis, scene.cup)
    pictures.draw_flight(axis, one)
    for k, pose in enumerate(flying[np.linspace(0, len(flying) - 1, 9).astype(int)]):
        shade = plt.get_cmap("viridis")(0.9 - 0.9 * k / 8)
        pictures.draw_bars(axis, scene.object, pose, color=shade, alpha=0.8)
        tip = pose[:2] + (scene.object.length - scene.object.com) * np.array(
            [math.cos(pose[2]), math.sin(pose[2])]
        )
        axis.plot(*tip, "o", color="#d1495b", ms=4)
    omega = one.throw.deciding.release.detach.omega
    axis.set(title=f"θ = {angle}°, ω = {omega:+.1f} rad/s", xlabel="x [m]")
    axis.set(xlim=(0.5, 1.05), ylim=(-0.07, 1.25))
    axis.set_aspect("equal")
    print(f"theta {angle:4d} deg: {one.status}, {one.message}")
axes[0].set_ylabel("z [m]")
plt.show()
turned_more = planner.plan(tp.Pose(0.9, 0.22, math.radians(270)), patience=30)
print(f"theta  270 deg: {turned_more.message}")

# %% [markdown]
"""
Bars are drawn at even times from detach (yellow) to landing (violet); the red dot marks the end
beyond the CoM.

If it does not matter how many turns it takes, `turns="any"` chooses. An angle between those does
not fit through the rim, and the answer names the nearest throw that was found.
"""

# %%
free = planner.plan(tp.Pose(0.9, 0.22, math.radians(630)), turns="any")
print(f"630 deg, turns free: {free.status}, lands at {math.degrees(free.target.theta):.0f} deg")
tilted = planner.plan(tp.Pose(0.9, 0.22, math.radians(-60)), patience=30)
print("-60 deg:", tilted.message)

# %% [markdown]
"""
The key figures of this notebook, as the tests read them:
"""

# %%
figures = {
    "status": plan.status,
    "cups": len(moved),
    "worst_error_mm": round(float(surface.max()), 4),
    "worst_angle_deg": round(float(turned.max()), 4),
    "far": far.status,
    "nearest_x": round(nearest.x, 3),
    "other_angles": [one.status for one in others.values()],
    "turned_more": turned_more.status,
    "any_turns": free.status,
    "tilted": tilted.status,
}
print(json.dumps(figures))
