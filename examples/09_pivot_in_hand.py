# %% [markdown]
r"""
# Pivot in the hand

A hand carries a level bar upward at 2 m/s, between two pads 10 cm from its centre of mass (CoM).
It brakes to rest. Meanwhile the pads are eased, so that the bar's inertia turns it by 60° against
the hand; then they grip again. Nothing is thrown. Unknown are the hand's acceleration and the rate
of the grip force. All is in SI units; x is forward, z up, angles count from x to z.
"""

# %%
import json

import casadi as ca
import matplotlib.pyplot as plt
import numpy as np
from throwplan.models import limit_surface_step, release_dynamics

body, h = {"mass": 0.24, "inertia": 535e-6}, 0.10  # h: from the pads to the CoM
pads = {"friction": 1.0, "patch_radius": 0.0025}
TURN, LIFT = np.pi / 3, 2.0  # wanted angle of the bar against the hand; speed of the hand at first
GRIP, LOW, GRIP_RATE, ACCELERATION = 120.0, 20.0, 2000.0, 20.0  # pad [N]; [N/s]; [m/s²]
N, DT, TAU = 20, 0.02, 0.005  # intervals; length of one; time in which friction stops small slip

# %% [markdown]
r"""
## Friction that brakes

The state has height and speed of the hand, what the bar does against it (slip x, z, angle, and
their rates $\dot s$), and the grip force. The controls are the hand's acceleration and the grip's
rate. Forces are shares of their limits, so that the NLP's numbers are about 1.

The sliding pivot is made for letting go. Its friction keeps a bar from *accelerating* against the
hand; it does not brake a bar that turns already. So we tell it of a hand with the acceleration
$a - \dot s / \tau$, with which slip would fade within $\tau$. Friction follows as far as its limits
allow, which is Coulomb friction, smoothed. A $\tau$ below $m h \omega / f_{max}$ asks for more than
friction can give: then the bar slides where it should not.
"""

# %%
x, u = ca.SX.sym("x", 9), ca.SX.sym("u", 2)
z, v, s, grip = ca.vertsplit(x, [0, 1, 2, 8, 9])
a, fade = ACCELERATION * u[0], s[3:] / TAU
pivot = release_dynamics()(
    state=s,
    pose=ca.vertcat(0, z, 0),
    twist=ca.vertcat(0, v, 0),
    acceleration=ca.vertcat(0, a, 0) - fade,
    normal_force=GRIP * grip,
    com_offset=h,
    **(body | pads),
)
x_dot = ca.vertcat(v, a, s[3:], pivot["rates"][3:] - fade, GRIP_RATE / GRIP * u[1])
step = ca.simpleRK(ca.Function("ode", [x, u], [x_dot]), 5).expand()

# %% [markdown]
"""
## The optimal control problem

Each interval ends where the next one begins. At the end the hand rests, the bar has turned, and the
grip is full. The bar's last rate is below 0.01 rad/s and not zero: smoothed friction lets a held
bar creep.
"""

# %%
opti = ca.Opti()
X, U = opti.variable(9, N + 1), opti.variable(2, N)
start = np.array([0, LIFT, 0, 0, 0, 0, 0, 0, 1.0])
opti.subject_to(X[:, 0] == start)
opti.subject_to(X[:, 1:] == step.map(N)(X[:, :-1], U, DT))
opti.subject_to(X[[1, 4, 8], -1] == np.array([0, TURN, 1]))  # hand at rest, bar turned, full grip
opti.subject_to(opti.bounded(-0.01, X[7, -1], 0.01))
opti.subject_to(opti.bounded(LOW / GRIP, ca.vec(X[8, 1:]), 1))
opti.subject_to(opti.bounded(-1, ca.vec(U), 1))
opti.minimize(DT * ca.sumsqr(U))

# %% [markdown]
"""
IPOPT starts from a guess in which the bar turns: ease and brake, then grip and push up a little.
"""

# %%
t = DT * np.arange(N + 1)
u_guess = np.array([np.interp(t[:-1], [0.04, 0.06, 0.24, 0.26], [0, -0.8, -0.8, 0.3]), np.zeros(N)])
f_guess = np.interp(t, [0.04, 0.08, 0.2, 0.26], [1, LOW / GRIP, LOW / GRIP, 1])
u_guess[1] = np.diff(f_guess) / DT * GRIP / GRIP_RATE
opti.set_initial(U, u_guess)
opti.set_initial(X, ca.horzcat(start, step.mapaccum(N)(start, u_guess, DT)))
opti.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes"})
found = opti.solve()
X, U = found.value(X), found.value(U)

# %% [markdown]
r"""
## An independent check

The same motion and force on the limit surface, without smoothing and in $M$ steps an interval. Its
state is the CoM in the world; the pads hold the point $h$ behind the CoM.
"""

# %%
M, surface, com = 100, limit_surface_step(), [[h, 0, 0, 0, LIFT, 0]]
for k in range(N):
    tau = DT * np.arange(M + 1) / M
    height = X[0, k] + X[1, k] * tau + ACCELERATION * U[0, k] * tau**2 / 2
    speed = X[1, k] + ACCELERATION * U[0, k] * tau
    force = GRIP * X[8, k] + GRIP_RATE * U[1, k] * (tau + tau[1] / 2)  # in the middle of each step
    for i in range(M):
        hand = {"pose": [0, height[i], 0], "next_pose": [0, height[i + 1], 0]}
        hand |= {"next_twist": [0, speed[i + 1], 0], "normal_force": force[i], "dt": tau[1]}
        com.append(surface(object=com[-1], **hand, **body, **pads)["next_object"].full()[:, 0])
com = np.array(com).T
held = com[:2, -1] - h * np.array([np.cos(com[2, -1]), np.sin(com[2, -1])]) - [0, X[0, -1]]

# %% [markdown]
"""
Both agree on the angle. This is one motion without feedback: pads of other friction turn the bar
farther or less far.
"""

# %%
figure, (plane, turn, press) = plt.subplots(1, 3, figsize=(11, 3.5), layout="constrained")
for k in range(0, N + 1, 2):
    along, z = np.array([-0.03, 0.23]), X[0, k]  # both ends of the bar, from the pads
    plane.plot(along * np.cos(X[4, k]), z + along * np.sin(X[4, k]), color=plt.cm.viridis(k / N))
plane.set(xlabel="x [m]", ylabel="z [m]", aspect="equal", title="bar every 40 ms, dark first")
turn.plot(1e3 * t, np.degrees(X[4]), "o", label="NLP")
turn.plot(np.linspace(0, 1e3 * t[-1], N * M + 1), np.degrees(com[2]), label="limit surface")
turn.set(xlabel="t [ms]", title="angle against the hand [deg]")
press.plot(1e3 * t, GRIP * X[8], label="force of one pad [N]")
press.stairs(ACCELERATION * U[0], 1e3 * t, label="hand's acceleration [m/s²]")
press.set(xlabel="t [ms]", title="grip and hand")
turn.legend()
press.legend()
plt.show()

print(
    json.dumps(
        {
            "angle_deg": [np.degrees(X[4, -1]), np.degrees(com[2, -1])],
            "slip_mm": [1e3 * np.linalg.norm(X[2:4, -1]), 1e3 * np.linalg.norm(held)],
            "rate": [X[7, -1], com[5, -1]],
        }
    )
)
