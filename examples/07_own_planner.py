# %% [markdown]
r"""
# A planner of your own

A hand that moves in a vertical plane throws a bar with half a turn backwards. Only the model of Liu
and Billard is throwplan's; unknowns, multiple shooting, constraints and cost are written here.
Equation numbers are the paper's. All is in SI units; x is forward, z up, angles count from x to z.

The paper's bar $(m, I, h)$ is held between pads $(\mu, r_p)$. Each presses with 120 N, a force that
falls to zero within 50 ms. The hand has limits of pose, speed and acceleration (x, z, θ).
"""

# %%
import json

import casadi as ca
import matplotlib.pyplot as plt
import numpy as np
from throwplan.models import flight, release_dynamics

bar = {"mass": 0.24, "inertia": 535e-6, "com_offset": 0.10}
pads = {"friction": 1.0, "patch_radius": 0.0025}
GRIP, OPENING = 120.0, 0.05
START, TARGET = np.array([0.0, 0.7, -np.pi / 2]), np.array([1.2, 0.2, -1.5 * np.pi])
LOW, HIGH = np.array([-0.5, 0.3, -2.1]), np.array([0.5, 1.3, 2.1])
SPEED, ACCELERATION = np.array([3.0, 3.0, 12.0]), np.array([30.0, 30.0, 80.0])

# %% [markdown]
r"""
## The release as a differential equation

$q, v, a$: pose, twist and acceleration of the hand, (1)-(3). $s$: slip of the pivot, angle of the
bar against the hand, and their rates. `release_dynamics` returns $\dot s$ by (31)-(33) and (38),
with max and |·| rounded:

$$J = m h^2 + I, \quad \tau^p = J \alpha^h - m (a_x^h z^r - a_z^h x^r) + m g x^r$$
$$f^p = m (a_x^h - \alpha^h z^r - \omega^2 x^r, a_z^h + \alpha^h x^r - \omega^2 z^r + g)$$
$$\alpha^r = -\mathrm{sgn}(\tau^p) \max(|\tau^p| - \tau_{max}, 0) / J - \alpha^s$$

The grip falls evenly: $x = (q, v, s, f_N)$ has the derivative $(v, a, \dot s, \dot f_N)$. With 16
Runge-Kutta steps an interval has a smaller error than the rounding.
"""

# %%
dynamics = release_dynamics()
x, control = ca.SX.sym("x", 13), ca.SX.sym("a", 3)
q, v, s, force = ca.vertsplit(x, [0, 3, 6, 12, 13])
hand = {"pose": q, "twist": v, "acceleration": control}
s_dot = dynamics(state=s, **hand, normal_force=force, **bar, **pads)["rates"]
ode = ca.Function("ode", [x, control], [ca.vertcat(v, control, s_dot, -GRIP / OPENING)])
step = ca.simpleRK(ode, 16)

# %% [markdown]
r"""
## Unknowns, and the hand

The hand carries the bar for the time $T$, in $N$ intervals; then the pads open, in $K$ intervals.
Unknown are $T$, a constant acceleration in each interval, and the states between intervals:
multiple shooting. In an interval the hand's motion has a closed form.
"""

# %%
N, K = 20, 10
opti = ca.Opti()
T, a = opti.variable(), opti.variable(3, N + K)
Q, V, S = opti.variable(3, N + K + 1), opti.variable(3, N + K + 1), opti.variable(6, K + 1)
dt = [T / N] * N + [OPENING / K] * K
opti.subject_to(opti.bounded(0.1, T, 1.0))
opti.subject_to(Q[:, 0] == START)
opti.subject_to(V[:, 0] == 0)
for k in range(N + K):
    opti.subject_to(Q[:, k + 1] == Q[:, k] + V[:, k] * dt[k] + a[:, k] * dt[k] ** 2 / 2)
    opti.subject_to(V[:, k + 1] == V[:, k] + a[:, k] * dt[k])
    opti.subject_to(opti.bounded(LOW, Q[:, k + 1], HIGH))
    opti.subject_to(opti.bounded(-SPEED, V[:, k + 1], SPEED))
    opti.subject_to(opti.bounded(-ACCELERATION, a[:, k], ACCELERATION))
brake = V[:, -1] * ca.fabs(V[:, -1]) / (2 * ACCELERATION)
opti.subject_to(opti.bounded(LOW, Q[:, -1] + brake, HIGH))

# %% [markdown]
r"""
## Carry: the bar sticks

It does where $\tau^p$ and $|f^p|$ are within $\tau_{max}$ and $f_{max}$ of the full grip: `excess`
is what they have beyond. As $a$ jumps between intervals, both ends of each count.
"""

# %%
for k in range(N):
    for end in (k, k + 1):
        hand = {"pose": Q[:, end], "twist": V[:, end], "acceleration": a[:, k]}
        held = dynamics(state=np.zeros(6), **hand, normal_force=GRIP, **bar, **pads)
        opti.subject_to(held["excess"] <= 0)

# %% [markdown]
r"""
## Opening, flight, landing

From $s = 0$ each interval ends where the next one begins. With $f_N = 0$ the bar flies: `object` is
the motion of its CoM, and `flight` says where this falls through the target's height, and at which
angle, turns counted. The landing pose is a constraint, effort and time are the cost.
"""

# %%
opti.subject_to(S[:, 0] == 0)
for k in range(K):
    begin = ca.vertcat(Q[:, N + k], V[:, N + k], S[:, k], GRIP * (1 - k / K))
    opti.subject_to(S[:, k + 1] == step(begin, a[:, N + k], OPENING / K)[6:12])
hand = {"pose": Q[:, -1], "twist": V[:, -1], "acceleration": a[:, -1]}
detach = dynamics(state=S[:, -1], **hand, normal_force=0, **bar, **pads)["object"]
fall = flight()(object=detach, height=TARGET[1])
opti.subject_to(fall["landing"][[0, 2]] == TARGET[[0, 2]])
effort = sum(dt[k] * ca.sumsqr(a[:, k] / ACCELERATION) for k in range(N + K))
opti.minimize(effort + 0.02 * T)

# %% [markdown]
"""
## Solution

IPOPT starts from a hand that swings evenly forward, with the bar stuck in it. It finds a throw in
which the pads begin the turn: the bar pivots between them and leaves faster than the hand turns.
"""

# %%
t = np.append(np.linspace(0, 0.4, N + 1), 0.4 + np.linspace(0, OPENING, K + 1)[1:])
swing = np.array([[5.0], [2.5], [20.0]])
opti.set_initial(T, 0.4)
opti.set_initial(a, np.tile(swing, N + K))
opti.set_initial(V, swing * t)
opti.set_initial(Q, START[:, None] + swing * t**2 / 2)
opti.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes"})
found = opti.solve()
T, Q, V, a, S, detach, landing, flown = map(
    found.value, (T, Q, V, a, S, detach, fall["landing"], fall["time"])
)
print(json.dumps({"opening_time": T, "landing": landing.tolist()}))

figure, (plane, rate) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
u, fall = np.linspace(0, flown, 9), np.array([[0], [-9.81 / 2], [0]])
x, z, angle = detach[:3, None] + detach[3:, None] * u + fall * u**2
ends = np.array([[-0.10], [0.16]])
plane.plot(x + ends * np.cos(angle), z + ends * np.sin(angle), color="tab:red")
plane.plot(*Q[:2], color="tab:blue")
plane.set(xlabel="x [m]", ylabel="z [m]", aspect="equal", title="hand and flying bar")
ms = 1e3 * np.linspace(0, OPENING, K + 1)
rate.plot(ms, V[2, N:] + S[5], color="tab:red", label="bar")
rate.plot(ms, V[2, N:], color="tab:blue", label="hand")
rate.set(xlabel="time since the pads begin to open [ms]", title="turning rate [rad/s]")
rate.legend()
plt.show()
