/* Motions in polynomial pieces, and the hand that they move. */
#ifndef MOTION_H
#define MOTION_H

#include "lanes.h"

/* Most coordinates of a motion, and frames of a linkage. */
#define AXES 8
#define FRAMES 24

/* `Path` of models/path.py, of one throw. */
typedef struct {
    long n, powers, pieces, held, corners;
    const double *breaks; /* [pieces + 1] s */
    const double *curves; /* [powers][n][pieces], highest power first, of the time since the break */
    const double *kinks;  /* [corners] s, rising: where acceleration or jerk may step */
} path;

/* `PlanarArm` or `PlanarHand` of models/kinematics.py. A link is a vector that all joints up to its
   own turn; a frame is one that moves with a link, at a place from the link's joint. */
typedef struct {
    long n, arm, frames;
    double x, z, theta; /* origin, and the hand's angle with all joints at 0 */
    double sign[AXES], along[AXES], up[AXES];
    long link[FRAMES];
    double frame_along[FRAMES], frame_up[FRAMES];
} linkage;

typedef struct {
    double q[AXES], dq[AXES], ddq[AXES];
} state;

/* Piece that holds time t, sought from the one before. */
INLINE long piece_of(const path *p, double t, long piece)
{
    while (piece > 0 && t < p->breaks[piece])
        piece--;
    while (piece + 1 < p->pieces && t >= p->breaks[piece + 1])
        piece++;
    return piece;
}

/* Time since the begin of the piece that holds time t, and that piece. */
INLINE double time_in(const path *p, double t, long *piece)
{
    if (p->held) {
        t = t > p->breaks[0] ? t : p->breaks[0];
        t = t < p->breaks[p->pieces] ? t : p->breaks[p->pieces];
    }
    *piece = piece_of(p, t, *piece);
    return t - p->breaks[*piece];
}

/* The coordinates at time t [s]; piece: where they were last. */
INLINE void state_at(const path *p, double t, long *piece, state *s)
{
    double u = time_in(p, t, piece);
    for (long i = 0; i < p->n; i++) {
        const double *c = p->curves + i * p->pieces + *piece;
        double q = 0.0, dq = 0.0, ddq = 0.0;
        for (long power = 0; power < p->powers; power++) {
            ddq = ddq * u + dq;
            dq = dq * u + q;
            q = q * u + c[power * p->n * p->pieces];
        }
        s->q[i] = q;
        s->dq[i] = dq;
        s->ddq[i] = 2.0 * ddq;
    }
}

/* Where the coordinates are at time t [s] (order 0), or how fast they are (order 1). */
INLINE void coordinates_at(const path *p, double t, long *piece, long order, double at[AXES])
{
    double u = time_in(p, t, piece);
    long last = p->powers - 1 - order;
    for (long i = 0; i < p->n; i++) {
        const double *c = p->curves + i * p->pieces + *piece;
        double value = 0.0;
        /* Samples lie at breaks. */
        for (long power = u == 0.0 ? last : 0; power <= last; power++)
            value = value * u + (order ? last + 1 - power : 1) * c[power * p->n * p->pieces];
        at[i] = value;
    }
}

/* Pose, twist and acceleration (x, z, theta each) of the hands at times [s]. */
INLINE void moved_at(const path *p, const linkage *a, const lane time, long *piece, lane hand[9])
{
    lane q[3][AXES], angle, rate, turn;
    for (int l = 0; l < LANES; l++) {
        state s;
        state_at(p, time[l], piece, &s);
        for (long i = 0; i < p->n; i++) {
            q[0][i][l] = s.q[i];
            q[1][i][l] = s.dq[i];
            q[2][i][l] = s.ddq[i];
        }
    }
    if (!a->arm) {
        for (int k = 0; k < 3; k++)
            for (int i = 0; i < 3; i++)
                EACH_LANE hand[3 * k + i][l] = i < a->n ? q[k][i][l] : k ? 0.0 : a->theta;
        return;
    }
    EACH_LANE {
        angle[l] = rate[l] = turn[l] = 0.0;
        hand[0][l] = a->x;
        hand[1][l] = a->z;
        hand[3][l] = hand[4][l] = hand[6][l] = hand[7][l] = 0.0;
    }
    for (long i = 0; i < a->n; i++)
        EACH_LANE {
            angle[l] += a->sign[i] * q[0][i][l];
            rate[l] += a->sign[i] * q[1][i][l];
            turn[l] += a->sign[i] * q[2][i][l];
            double c = cos(angle[l]), s = sin(angle[l]);
            double x = a->along[i] * c - a->up[i] * s, z = a->along[i] * s + a->up[i] * c;
            hand[0][l] += x;
            hand[1][l] += z;
            hand[3][l] -= rate[l] * z;
            hand[4][l] += rate[l] * x;
            hand[6][l] -= turn[l] * z + rate[l] * rate[l] * x;
            hand[7][l] += turn[l] * x - rate[l] * rate[l] * z;
        }
    EACH_LANE {
        hand[2][l] = a->theta + angle[l];
        hand[5][l] = rate[l];
        hand[8][l] = turn[l];
    }
}

#endif
