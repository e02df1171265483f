/* What Python gives to the core and gets from it, in SI units and radians. The frame is the one of the
   robot's base: x forward and z up in the throw's vertical plane, y across it; angles turn x towards z. A
   pose is x, z [m] and theta [rad], a twist the rates of a pose [m/s, rad/s]. CoM: the thrown object's,
   a bar's.

   setup.py reads this file. A field is an int64_t, a double, a structure, an array or a pointer. A comment
   beside a pointer begins with the lengths of its array, in fields of its structure, which Python gives to
   `array`; the last index counts fastest. Without lengths it points to one structure. NULL: there may be
   none. */
#pragma once

#include "core.h"

/* Most coordinates of a motion, and frames of a linkage. */
#define AXES 8
#define FRAMES 24

/* A motion: one `Trajectory` of models/trajectory.py. Its n coordinates are joints [rad], or a hand's x, z
   [m] and perhaps theta [rad]. held: whether it stands still before the first break and after the last. */
typedef struct {
    int64_t n, powers, pieces, held, corners;
    const double *breaks; /* [pieces + 1] s, rising */
    const double *curves; /* [powers][n][pieces], highest power first, of the time since the break */
    const double *kinks;  /* [corners] s, rising: where acceleration or jerk may step */
} path;

/* `PlanarArm` (arm = 1) or `PlanarHand` (arm = 0) of models/robot/kinematics.py. A link is a vector that
   all joints up to its own turn; a frame is one that moves with a link, at a place from the link's joint. */
typedef struct {
    int64_t n, arm, frames;
    double x, z, theta;                       /* pose of the first joint; the hand's angle with all joints at 0 */
    double sign[AXES], along[AXES], up[AXES]; /* a joint's sense, 1 or -1; its link's vector [m] */
    int64_t link[FRAMES];                     /* the link that each frame moves with */
    double frame_along[FRAMES], frame_up[FRAMES]; /* m, from the link's joint */
} linkage;

/* Limits of each coordinate, of its rate, acceleration and jerk.
   slowing: deceleration, offset, upper and lower as in `Slowing` of models/robot/arm.py, if `slows`. */
typedef struct {
    double q_min[AXES], q_max[AXES], dq[AXES], ddq[AXES], jerk[AXES], slowing[4][AXES];
    int64_t slows;
} limits;

/* Samples of n coordinates every `tick` [s], with rates and accelerations. */
typedef struct {
    int64_t rows, n;
    double tick;
    double *q;   /* [rows][n] */
    double *dq;  /* [rows][n] NULL where a function reads q only */
    double *ddq; /* [rows][n] NULL where a function reads q only */
} samples;

/* Grip force of one pad [N] over the opening [s]: cubics of the time over `stretch`. */
typedef struct {
    double opening, stretch;
    int64_t pieces;
    const double *breaks; /* [pieces + 1] s */
    const double *curves; /* [4][pieces] N, highest power first */
} grip;

/* A release. law: mass [kg], inertia about the CoM [kg m^2], CoM from the pads [m], friction, radius of
   the contact patch [m], torsion, faces, gravity [m/s^2]; angle [rad]: of the held bar on the hand; delay
   [s]: when on the motion the opening starts; turning [rad/s]: how much faster than the motion the hand
   turns from then on; paper: whether the sliding pivot is in the paper's form. */
typedef struct {
    const path *motion;
    const linkage *arm;
    grip grip;
    double law[8], angle, delay, turning;
    int64_t paper;
} release;

/* A known throw and where it is to land. Its free numbers u: the carry's duration [s], the start [n] where
   none is given, the controls [stages][n], jerks in `unit`. The first
   `carry` stages share the duration. before [s]: the pads begin to open that long before the carry ends;
   shortest, longest [s]: bounds of the duration. off: from the goal (x [m], theta [rad]) at u; aim (the
   same units): what is near enough; errors: 1 for x, 2 for both. nearer: share of the miss before it that
   a throw must come below; throws: at most so many; surface: by the limit surface, else the sliding pivot;
   gravity [m/s^2]. */
typedef struct {
    int64_t n, carry, stages, size, errors, surface, throws;
    double unit, before, shortest, longest, gravity, nearer, goal[3], aim[2], off[2];
    const double *start;        /* [n] NULL where u has it */
    const double *rate;         /* [n] at the start */
    const double *acceleration; /* [n] at the start */
    const double *opening;      /* [stages - carry] s, lengths of the stages after the carry */
    const double *low;          /* [size] bounds of u */
    const double *high;         /* [size] */
    const double *u;            /* [size] */
    const double *slope;        /* [size][errors] how u follows the landing, per m and per rad */
    const limits *limits;
    const release *release;     /* its motion and delay are not read */
} move;

/* The throw that lands there: its u, the planned motion, what is sent for it, and the release. sent: rows
   are given back, arrays have room for `room` of them; stages, size: those of the move. */
typedef struct {
    samples sent;
    int64_t room, stages, size, corners, release_room, nodes, lost;
    double *u;        /* [size] */
    double *breaks;   /* [stages + 1] s, of the planned motion */
    double *cubics;   /* [4][sent.n][stages], as a path's curves */
    double *times;    /* [room] s, of the samples */
    double *curves;   /* [6][sent.n][room] quintics through the samples, given back as [6][n][rows - 1] */
    double *kinks;    /* [4 * room] s, `corners` are given back */
    double *nodes_at; /* [release_room][7] time [s], CoM's pose and twist; `nodes` are given back */
    double onset[2];  /* s from the opening's start: when pivot and slide begin, NaN for none */
} moved;

/* A batch, as Python has it. width: 1 where all throws share shares and grip, else count; rows: 1 where
   they share a motion, else count; paper: as of `release`; gap [s]: hands are looked at so far inside a
   step's ends. */
typedef struct {
    int64_t count, steps, pieces, rows, width, paper;
    double gap;
    const double *shares;  /* [2 * steps + 1][width] of the opening: nodes of the steps and their middles */
    const double *grip;    /* [2 * steps + 1][width] force over the full one, there */
    const double *numbers; /* [11][count] law of `release`, grasp angle [rad], opening [s], full force [N] */
    const double *knots;   /* [pieces + 1] s, rising */
    const double *curves;  /* [4][pieces][rows][3] hands' poses: cubics, highest power first */
    const double *delays;  /* [count] s, when on its motion each opening starts */
    const double *drift;   /* [3][count] rates added to the hands' twists; NULL for none */
    double *detach;        /* [count][6] CoM's pose and twist */
    unsigned char *lost;   /* [count] whether the body left the pads before the end */
} batch;

/* What of the scene counts for every throw of a motion. Lengths [m]; widths and radii of what it does not have
   are negative. */
typedef struct {
    double gravity;                           /* m/s^2 */
    double behind, length, half_width;        /* the bar, or the rectangle around an outline; behind: its CoM */
    int64_t parts;                            /* capsules of the object's outline; 0 for a bar */
    const double *outline; /* [parts][5] m, both ends along and across the axis from the bar's first end, and
                              radius; NULL for a bar */
    double column_radius, column_height;
    double palm_back, palm_front, palm_half_width; /* the hand's body, from the pads' centre */
    double palm_clearance;
    double tool_length;                       /* from the flange to the pads' centre */
    double cup_x, cup_rim, cup_radius, cup_insertion; /* a bar's radius is that at its width */
    double cup_speed;                         /* m/s */
    double bin_depth, bin_lead; /* of a bin in the place of a cup: its depth, below 0 for a cup; how far above
                                   the rim the way in begins */
} scene;

/* Links' masses [kg], CoM from their joints [m] and inertias about it [kg m^2], as `PlanarBody` of
   models/robot/kinematics.py, and joints' limits [N m]. */
typedef struct {
    double mass[AXES], along[AXES], up[AXES], inertia[AXES], limit[AXES];
} torques;

/* `Solid` of models/robot/capsules.py: centre [m], rows of axes, half lengths [m] along them, radius [m]
   around that; the clearance that is kept from it [m], and whether the bar keeps it too: 2 for a bin's wall, from
   which a bar that flies keeps it until it comes down to the rim, the solid's top, for the last time. */
typedef struct {
    double centre[3], axes[9], half[3], radius, clearance;
    int64_t bar;
} solid;

/* Arm and object as capsules; the `bar` capsules of the object come after the links. behind, length [m]:
   CoM and length of a bar; landing [s]: before its end the bar may come as near to a solid as it lands, but not within the share
   `middle` of its radius. */
typedef struct {
    int64_t links, bar;
    const int64_t *moved_by; /* [links] the joint that moves it, -1 for none */
    const int64_t *moves;    /* [links + bar] whether it moves */
    const double *places;    /* [links][2][3] m, ends x, y, z, x and z along and up from that joint */
    const double *radius;    /* [links + bar] m */
    const double *outline;   /* [bar][5] as of `scene`; NULL for a bar */
    int64_t solids;
    const solid *around; /* [solids] */
    int64_t pairs, always; /* the first `always` pairs at all times, the others in flight only */
    const int64_t *meet;   /* [pairs][2] bodies that may meet each other */
    const double *apart;   /* [pairs] m, clearance between them; below 0: an overlap that is allowed */
    double behind, length, landing, middle;
} bodies;

/* Throws of one motion, which is looked at every `tick` [s], and for the grip every `step` [s]. */
typedef struct {
    const path *motion;
    const linkage *arm;
    const scene *around;
    const torques *torques; /* NULL where there is no limit to them */
    const bodies *bodies;   /* NULL where there is nothing to meet */
    double tick, step;
} throws;

/* One of them. mass [kg], inertia about the pads [kg m^2], CoM from the pads [m], angle on the hand [rad]; limits
   under the full grip [N, N m]; the CoM from the bar's first end [m]; opening and detach [s] on the motion's
   clock, time from there to the landing [s], not finite without one; where the cup is at the landing [m]; the
   CoM's pose and twist at detach; how far the hand is off its motion, x, z [m] and theta [rad] all along, and as
   rates from the opening on: the object's numbers have it already. */
typedef struct {
    double mass, inertia, com_offset, angle, force, torque, behind, opening, detach, flight, cup_x;
    double start[6], error[6];
} thrown;

/* A least or largest value, and when [s]. */
typedef struct {
    double value, time;
} extreme;

/* What a verdict on a throw measures. Use of the full grip until the opening, 1 is the limit; of each joint's
   torque. Heights of the lowest points of the arm and of the bar until detach; the bar's distances from the
   column until detach and in flight, from the palm in flight, and when [s after detach] it first is too near to
   that; the highest speed of flange and pads' centre; the highest rate [N m/s] by which the motion's commands change a joint's
   torque, the load falling linearly while the pads open; least clearance in the cup, -infinity for a bar that
   misses it. Infinite where nothing was near. */
typedef struct {
    extreme grip, arm, held, column_held, column_flown, palm, speed, torque[AXES];
    double palm_time, rate, cup;
} measured;

/* One thing too near: body, whether it flies, the solid or (negative, less 1) the link, missing [m], time [s]. */
typedef struct {
    double body, flying, other, missing, time;
} contact;
