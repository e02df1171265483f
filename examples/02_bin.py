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
# Into a bin, and stay there

Whoever sorts with a robot wants the object *in the bin*. A throw that lands in it may still
topple or bounce out. Here a Panda throws a bar of 30 cm into a bin that is 12 cm deep, and we ask
that the bar comes to rest in the bin. (This needs MuJoCo: `pip install mujoco-core`.)
"""

# %%
import dataclasses
import json
import math
import tempfile

import matplotlib.pyplot as plt
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
## An upright landing

First a target as for a cup: the bar upright over the middle of the bin, its lower end 5 cm
inside. At first the gripper opens exactly as planned.
"""

# %%
exact = tp.Distribution(uniform=0.0)
scene = tp.load_scene("cup").replace(
    name="bin",
    object=tp.Object(mass=0.15, inertia=1.14e-3, length=0.30, width=0.02, com=0.15),
    cup=tp.Cup(x=1.08, rim=0.125, radius=0.075, depth=0.12, clearance=0.005, insertion=0.05),
    target=tp.Pose(x=1.08, z=0.225, theta=math.radians(-90)),
    uncertainty=tp.Uncertainty(delay=exact, opening=exact),
)
plain = tp.plan(scene)
print(plain.summary())

# %% [markdown]
"""
The plan is solved: the bar enters the bin and touches neither wall nor rim on its way in. Whether
it stays there is not counted, as the plan says.

## Will it stay?

`[rest]` says where the object is to come to rest, and what is known of its contacts: how much of
its speed a bounce leaves (restitution) and the friction, each as a range. The flight goes on in
MuJoCo, 64 times with contacts from these ranges, until the bar rests. If it does not always stay,
the planner looks for a throw that stays more often: one that is slower where it lands. Here it
finds none, and the plan says so.
"""

# %%
rest = tp.Rest(in_="cup", restitution=(0.05, 0.25), friction=(0.15, 0.45))
slow = tp.plan(scene.replace(rest=rest))
print(slow.summary())

# %% [markdown]
"""
## A region instead of a pose

A bar that stands upright in a shallow bin topples out. But nobody asked for an upright landing: a
bin's user does not mind where in the bin it lands, and at which angle. So the target becomes a
*region*, with bounds for x and θ. The planner takes the cheapest landing between them.
"""

# %%
region = tp.Region(x=(1.05, 1.11), z=0.225, theta=(math.radians(-125), math.radians(-55)))
free = tp.plan(scene.replace(rest=rest, target=region))
print(free.summary())

# %% [markdown]
"""
The three throws, each with contacts in the middle of their ranges, until the bar rests. The path
of the centre of mass begins where the pads start to open; the dot is where the bar is free.
"""

# %%
shown = {"upright": plain, "with [rest]": slow, "a region": free}
figure, axes = plt.subplots(1, 3, figsize=(11, 4.4), sharex=True, sharey=True)
for axis, (name, one) in zip(axes, shown.items(), strict=True):
    # The plain throw goes on until rest, too, once its scene has [rest].
    throw = one.throw.deciding
    throw = throw.in_scene(throw.scene.replace(rest=rest))
    pictures.draw_cup(axis, scene.cup)
    pictures.draw_flight(axis, throw)
    landing = throw.landing
    pictures.draw_bars(axis, scene.object, landing.pose, color="#2a9d6f", alpha=0.5)
    speed = math.hypot(landing.state.v_x, landing.state.v_z)
    axis.set(title=f"{name}: {speed:.1f} m/s, {landing.state.omega:+.1f} rad/s", xlabel="x [m]")
    axis.set_aspect("equal")
axes[0].set_ylabel("z [m]")
plt.show()

# %% [markdown]
"""
## All that is uncertain

`sweep` throws a plan with other values of all that is uncertain, and counts how many stay. What a
scene does not say of the opening is assumed: up to 10 ms early or late, and half its time more or
less. The plain plan is counted in the scene with `[rest]`, too.
"""

# %%
shares = {}
for name, one in shown.items():
    unknown = one.scene.replace(rest=rest, uncertainty=None)
    wanted = dataclasses.replace(one, scene=unknown)
    shares[name] = tp.sweep(wanted, samples=256).rests.share
    print(f"{name:12} {100 * shares[name]:5.1f} % of 256 throws come to rest in the bin")

# %% [markdown]
"""
## The film

`save` writes the throw as a picture and as a film, at a fifth of the speed, that ends where the
bar rests. `throwplan view` shows the same in 3-D, and `--mp4` films it there.
"""

# %%
with tempfile.TemporaryDirectory() as folder:
    pictures.save(free, folder)
    display(Image(f"{folder}/throw.gif", width=576))

# %% [markdown]
"""
The key figures of this notebook, as the tests read them:
"""

# %%
figures = {
    "status": [one.status for one in shown.values()],
    "counted": [slow.rests.share, free.rests.share],
    "swept": list(shares.values()),
}
print(json.dumps(figures))
