# %% [markdown]
"""
# Two links throw a stick

A planar arm swings a stick that two pads hold. While they open, within 50 ms, the stick may pivot
and slide between them. The release is throwplan's model; arm, multiple shooting and cost are
written here, with CasADi and IPOPT. All is in SI units; x is forward, z up, angles count from x to
z.
"""

# %%
import json

import casadi as ca
import matplotlib.pyplot as plt
import numpy as np
from throwplan.models import flight, limit_surface_step, release_dynamics

mass, length = 0.2, 0.30
stick = {"mass": mass, "inertia": mass * length**2 / 12, "com_offset": 0.12}
pads = {"friction": 0.8, "patch_radius": 0.01}
GRIP, OPENING = 80.0, 0.05  # N of one pad, and the time in which it falls evenly to zero
UPPER, FORE, SHOULDER = 0.40, 0.35, 1.0  # lengths of the links, height of the shoulder
START = np.radians([-120.0, 30.0])  # shoulder, from x; elbow, from the upper arm
LOW, HIGH = np.radians([-150.0, 0.0]), np.radians([90.0, 150.0])
SPEED, ACCELERATION = np.array([6.0, 8.0]), np.array([40.0, 60.0])
TARGET = np.array([1.3, 0.3, np.pi])  # of the CoM; it leaves the hand near angle 0
N, K = 20, 10  # intervals of carry and of opening

# %% [markdown]
"""
The hand is the end of the forearm. Its pose, twist and acceleration follow from the joints; the
names of the outputs are those of the model's inputs.
"""

# %%
q, dq, ddq = ca.SX.sym("q", 2), ca.SX.sym("dq", 2), ca.SX.sym("ddq", 2)
angle = ca.sum1(q)
x = UPPER * ca.cos(q[0]) + FORE * ca.cos(angle)
z = SHOULDER + UPPER * ca.sin(q[0]) + FORE * ca.sin(angle)
pose = ca.vertcat(x, z, angle)
twist = ca.jtimes(pose, q, dq)
acceleration = ca.jtimes(twist, q, dq) + ca.jtimes(twist, dq, ddq)
names = ["q", "dq", "ddq"], ["pose", "twist", "acceleration"]
hand = ca.Function("hand", [q, dq, ddq], [pose, twist, acceleration], *names)

# %% [markdown]
"""
The release: `s` is what the stick does against the hand (slip x, z, angle, and their rates).
"""

# %%
model = release_dynamics()
s, force, width = ca.SX.sym("s", 6), ca.SX.sym("force"), ca.SX.sym("width")
at = hand(q=q, dq=dq, ddq=ddq)
ds = model(state=s, **at, normal_force=force, width=width, **stick, **pads)["rates"]
state, control = ca.vertcat(q, dq, s, force), ca.vertcat(ddq, width)
ode = ca.Function("ode", [state, control], [ca.vertcat(dq, ddq, ds, -GRIP / OPENING)])
step = ca.simpleRK(ode, 8)

# %% [markdown]
"""
Unknown are the time T of the carry, the joint accelerations A, constant in each interval, and the
states between them.
"""

# %%
opti = ca.Opti()
T, A, smooth = opti.variable(), opti.variable(2, N + K), opti.parameter()
Q, V, S = opti.variable(2, N + K + 1), opti.variable(2, N + K + 1), opti.variable(6, K + 1)
dt = [T / N] * N + [OPENING / K] * K
opti.subject_to([opti.bounded(0.1, T, 1.0), Q[:, 0] == START, V[:, 0] == 0, S[:, 0] == 0])
for k in range(N + K):
    opti.subject_to(Q[:, k + 1] == Q[:, k] + V[:, k] * dt[k] + A[:, k] * dt[k] ** 2 / 2)
    opti.subject_to(V[:, k + 1] == V[:, k] + A[:, k] * dt[k])
    opti.subject_to(opti.bounded(LOW, Q[:, k + 1], HIGH))
    opti.subject_to(opti.bounded(-SPEED, V[:, k + 1], SPEED))
    opti.subject_to(opti.bounded(-ACCELERATION, A[:, k], ACCELERATION))
for k in range(N):  # carry: the full grip holds the stick, at both ends of each interval
    for end in (k, k + 1):
        at = hand(q=Q[:, end], dq=V[:, end], ddq=A[:, k])
        held = model(state=np.zeros(6), **at, normal_force=GRIP, **stick, **pads)
        opti.subject_to(held["excess"] <= 0)
for k in range(K):  # opening
    begin = ca.vertcat(Q[:, N + k], V[:, N + k], S[:, k], GRIP * (1 - k / K))
    opti.subject_to(S[:, k + 1] == step(begin, ca.vertcat(A[:, N + k], smooth), OPENING / K)[4:10])
at = hand(q=Q[:, -1], dq=V[:, -1], ddq=A[:, -1])
detach = model(state=S[:, -1], **at, normal_force=0, **stick, **pads)["object"]
landing = flight()(object=detach, height=TARGET[1])["landing"]
opti.subject_to(landing[[0, 2]] == TARGET[[0, 2]])
opti.minimize(sum(dt[k] * ca.sumsqr(A[:, k] / ACCELERATION) for k in range(N + K)) + 0.02 * T)

# %% [markdown]
"""
IPOPT starts from an even swing. It solves with a much smoothed release first, and from there with a
sharper one.
"""

# %%
t = np.append(np.linspace(0, 0.4, N + 1), 0.4 + np.linspace(0, OPENING, K + 1)[1:])
swing = np.array([[12.0], [5.0]])
opti.set_initial(T, 0.4)
opti.set_initial(A, np.tile(swing, N + K))
opti.set_initial(V, swing * t)
opti.set_initial(Q, START[:, None] + swing * t**2 / 2)
opti.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes"})
for share in (0.1, 0.01):
    opti.set_value(smooth, share)
    found = opti.solve()
    opti.set_initial(found.value_variables())
T, A, planned = (found.value(v) for v in (T, A, landing))

# %% [markdown]
"""
The check throws the whole motion, from rest, on the limit surface without smoothing, in 100 steps
an interval.
"""

# %%
h = np.repeat([T / N] * N + [OPENING / K] * K, 100) / 100
a = np.repeat(A, 100, axis=1)
dq = np.cumsum(np.hstack([np.zeros((2, 1)), a * h]), axis=1)
q = np.cumsum(np.hstack([START[:, None], dq[:, :-1] * h + a * h**2 / 2]), axis=1)
at = hand(q=q, dq=dq, ddq=np.zeros(q.shape))
force = GRIP * np.clip((T + OPENING - np.cumsum(h) + h / 2) / OPENING, 0, 1)  # in mid-step
poses, still = at["pose"], {"twist": np.zeros(3), "acceleration": np.zeros(3)}
held = model(state=np.zeros(6), pose=poses[:, 0], **still, **stick)["object"]
motion = {"pose": poses[:, :-1], "next_pose": poses[:, 1:], "next_twist": at["twist"][:, 1:]}
rest = {"mass": mass, "inertia": stick["inertia"], "torsion": 0.6, "faces": 2, "gravity": 9.81}
run = limit_surface_step().mapaccum(h.size)  # all steps in one call; no input may be left out
path = run(object=held, **motion, **rest, **pads, normal_force=force, dt=h)["next_object"].full()
fall = flight()(object=path[:, -1], height=TARGET[1])
checked = fall["landing"].full().ravel()

# %% [markdown]
"""
The path of the hand, the stick in the hand (blue) and in flight (red), and the target (cross).
"""

# %%
u = np.linspace(0, float(fall["time"]), 9)
flying = path[:3, -1:] + path[3:, -1:] * u - np.array([[0], [9.81 / 2], [0]]) * u**2
for (x, z, theta), colour in ((path[:3, ::300], "tab:blue"), (flying, "tab:red")):
    ends = np.array([[-length / 2], [length / 2]])
    plt.plot(x + ends * np.cos(theta), z + ends * np.sin(theta), color=colour)
plt.plot(*poses.full()[:2], "k:", *TARGET[:2], "kx")
plt.gca().set(xlabel="x [m]", ylabel="z [m]", aspect="equal")
plt.show()
print(json.dumps({"planned": planned.tolist(), "checked": checked.tolist()}))
