/* What Python gives to the core and gets from it: SI units, angles in rad; x forward and z up in the
   throw's vertical plane, y across it. Arrays are of doubles, the last index counts fastest.
   core/structures.py reads this file: a field is an int64_t, a double, a structure, an array or a pointer. */
#ifndef STRUCTURES_H
#define STRUCTURES_H

#include "core.h"

/* Most coordinates of a motion, and frames of a linkage. */
#define AXES 8
#define FRAMES 24

/* `Path` of models/path.py, of one throw. */
typedef struct {
    int64_t n, powers, pieces, held, corners;
    const double *breaks; /* [pieces + 1] s */
    const double *curves; /* [powers][n][pieces], highest power first, of the time since the break */
    const double *kinks;  /* [corners] s, rising: where acceleration or jerk may step */
} path;

/* `PlanarArm` or `PlanarHand` of models/kinematics.py. A link is a vector that all joints up to its
   own turn; a frame is one that moves with a link, at a place from the link's joint. */
typedef struct {
    int64_t n, arm, frames;
    double x, z, theta; /* origin, and the hand's angle with all joints at 0 */
    double sign[AXES], along[AXES], up[AXES];
    int64_t link[FRAMES];
    double frame_along[FRAMES], frame_up[FRAMES];
} linkage;

/* Of each axis; a jerk is infinite where there is no limit. slowing: deceleration, offset, upper and
   lower as in `Slowing` of models/kinematics.py, where the limits have it. */
typedef struct {
    double q_min[AXES], q_max[AXES], dq[AXES], ddq[AXES], jerk[AXES], slowing[4][AXES];
    int64_t slows;
} limits;

/* Each [rows][n], every `tick` [s]. */
typedef struct {
    int64_t rows, n;
    double tick;
    double *q, *dq, *ddq;
} samples;

/* Grip force of one pad [N] over the opening [s]: linear, or, with pieces, cubics of the time over
   `stretch`. */
typedef struct {
    double full, opening, stretch;
    int64_t pieces;
    const double *breaks; /* [pieces + 1] */
    const double *curves; /* [4][pieces], highest power first */
} grip;

/* A release: numbers of the law, the held body's angle on the hand, when on its motion the opening
   starts [s], and how much faster than that the hand turns from then on [rad/s]. */
typedef struct {
    const path *motion;
    const linkage *arm;
    grip grip;
    double law[8], angle, delay, turning;
} release;

/* A known throw and where it is to land. Its free numbers u [size]: the carry's duration [s], the start
   [n] where none is given, the controls [stages][n], jerks by the `unit` or accelerations. carry: how many
   stages share the duration; opening [stages - carry] s: lengths of the others; before [s]: the pads begin
   to open that long before the carry ends. slope [size][errors]: how u follows the landing, x [m] and,
   with errors = 2, theta [rad]; off: how far it is off the goal (x, z [m], theta [rad]) at u. aim: what is
   near enough. low, high [size]: bounds of u. limits: none for a free hand, whose planned motion counts.
   release: its motion and delay are not read. turned [rad]: of the object against the release's. */
typedef struct {
    int64_t n, carry, stages, size, errors, by_jerk, surface, throws;
    double unit, before, shortest, longest, gravity, turned, nearer, goal[3], aim[2], off[2];
    const double *start, *rate, *acceleration, *opening, *low, *high, *u, *slope;
    const limits *limits;
    const release *release;
} move;

/* The throw that lands there: u [size]; the planned motion's breaks [stages + 1] and cubics
   [4][n][stages]; what is sent, with room for `room` samples, its times [room],
   quintics [6][n][rows - 1] and kinks [corners of at most 4 room]; the release's nodes, each time, CoM
   pose and twist, [nodes of at most release_room][7], when pivot and slide begin, whether it was lost. */
typedef struct {
    samples sent;
    int64_t room, corners, release_room, nodes, lost;
    double *u, *breaks, *cubics, *times, *curves, *kinks, *nodes_at;
    double onset[2];
} moved;

/* A batch, as Python has it. Numbers: those of the laws, then grasp angle, opening, force. Shares of
   the opening and grip force over the full one: for all throws alike, or of each. */
typedef struct {
    int64_t count, steps, pieces, rows;
    int64_t width;            /* 1, or count */
    double gap;            /* hands are asked for so far inside a step's ends [s] */
    const double *shares;  /* [2 steps + 1][width]: nodes of the steps, and their middles */
    const double *grip;    /* [2 steps + 1][width] */
    const double *numbers; /* [11][count] */
    const double *knots;   /* [pieces + 1] */
    const double *curves;  /* [4][pieces][rows][3] */
    const double *delays;  /* [count] */
    const double *drift;   /* [3][count]: rates added to the hands', or none */
    double *detach;        /* [count][6] */
    double *stray;         /* [count][2]: how far CoM [m] and angle [rad] leave a held body at most */
    unsigned char *lost;   /* [count] */
} batch;

/* What of the scene counts. Lengths [m]; widths and radii of what it does not have are negative. */
typedef struct {
    double gravity, mass, inertia, com_offset, grasp_angle;
    double force, torque;                     /* limits under the full grip */
    double behind, ahead, half_width;         /* the bar, from its CoM */
    double column_radius, column_height;
    double palm_back, palm_front, palm_half_width;
    double palm_clearance;
    double tool_length;                       /* from the flange to the pads' centre */
    double cup_x, cup_rim, cup_radius, cup_insertion; /* the radius at the bar's width */
    double cup_speed;                         /* [m/s]; cup_x is where it is at the landing */
} scene;

/* Masses of an arm, as `PlanarBody` of models/dynamics.py, and its joints' limits [N m]. */
typedef struct {
    double mass[AXES], along[AXES], up[AXES], inertia[AXES], limit[AXES];
} torques;

/* A throw: its motion, seen every `tick` [s], and for the grip every `step`; opening and detach [s];
   the bar while the pads open, at times [nodes] [s], com [3][nodes]; its flight from detach (x, z,
   theta and their rates) for `flight` [s]. error: how far the hand is off its motion, x, z [m] and
   theta [rad] all along, and as rates from the opening on; the bar's numbers have it already, its
   grasp angle too. */
typedef struct {
    const path *motion;
    const linkage *arm;
    const scene *around;
    const torques *torques; /* none where there is no limit to them */
    double tick, step, opening, detach, flight;
    int64_t nodes;
    const double *times, *com, *start;
    double error[6];
} throw;

/* A flight of one of many throws that share a motion: opening and detach [s], time to the landing [s],
   the CoM from the bar's end [m], where the cup is at the landing [m]; the state at detach; the hand's
   error, as of `throw`. */
typedef struct {
    double opening, detach, flight, behind, cup_x, start[6], error[6];
} flown_sample;

/* How much room the bar of a reference flight has to palm, column and bodies in windows of `step` [s] from
   `begin` on, each [n]; its state at `detach`, extrapolated to both sides; from its CoM to its farthest
   point at most [m]. At any time a bar is no farther from the reference's than at the ends of the time
   around it, since gravity is the same for both. */
typedef struct {
    double begin, step;
    int64_t n;
    const double *palm, *column, *bodies;
    double detach, far, start[6];
} reference;

/* A least or largest value, and when [s]. */
typedef struct {
    double value, time;
} extreme;

/* Use of the grip; heights of the lowest points of the arm and of the bar until detach; the bar's
   distances from the column until detach and in flight, from the palm in flight, and when it first is
   too near to that; the highest speed of flange and pads' centre; the largest share of a joint's torque,
   and the joint; least clearance in the cup. Infinite where nothing was near. */
typedef struct {
    extreme grip, arm, held, column_held, column_flown, palm, speed, torque;
    double palm_time, cup;
    int64_t joint;
} measured;

/* `Solid` of models/capsules.py, the clearance that is kept from it [m], and whether the bar keeps it
   too. */
typedef struct {
    double centre[3], axes[9], half[3], radius, clearance;
    int64_t bar;
} solid;

/* Arm and bar as capsules; the bar comes after the links. Ends of a link's capsule are as in
   `ArmCapsules`. reach: radii as obstacles meet them. */
typedef struct {
    int64_t links, bar;
    const int64_t *moved_by, *moves;
    const double *places, *radius, *reach;
    int64_t solids;
    const solid *around;
    int64_t pairs;
    const int64_t *meet; /* [pairs][2]: bodies that may meet each other */
    double behind, ahead, com_offset, grasp_angle, landing;
} bodies;

/* One thing too near: track, body, the solid or (negative, less 1) the link, missing [m], time [s]. */
typedef struct {
    double track, body, other, missing, time;
} contact;

#endif
