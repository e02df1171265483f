/* Motions in polynomial pieces, and the hand that they move. */
#ifndef MOTION_H
#define MOTION_H

#include "laws.h"
#include "structures.h"

typedef struct {
    double q[AXES], dq[AXES], ddq[AXES];
} state;

/* Piece that holds time t, sought from the one before. */
INLINE int64_t piece_of(const path *p, double t, int64_t piece)
{
    while (piece > 0 && t < p->breaks[piece])
        piece--;
    while (piece + 1 < p->pieces && t >= p->breaks[piece + 1])
        piece++;
    return piece;
}

/* Time since the begin of the piece that holds time t, and that piece. */
INLINE double time_in(const path *p, double t, int64_t *piece)
{
    if (p->held) {
        t = t > p->breaks[0] ? t : p->breaks[0];
        t = t < p->breaks[p->pieces] ? t : p->breaks[p->pieces];
    }
    *piece = piece_of(p, t, *piece);
    return t - p->breaks[*piece];
}

/* The coordinates at time t [s]; piece: where they were last. */
INLINE void state_at(const path *p, double t, int64_t *piece, state *s)
{
    double u = time_in(p, t, piece);
    for (int64_t i = 0; i < p->n; i++) {
        const double *c = p->curves + i * p->pieces + *piece;
        double q = 0.0, dq = 0.0, ddq = 0.0;
        for (int64_t power = 0; power < p->powers; power++) {
            ddq = ddq * u + dq;
            dq = dq * u + q;
            q = q * u + c[power * p->n * p->pieces];
        }
        s->q[i] = q;
        s->dq[i] = dq;
        s->ddq[i] = 2.0 * ddq;
    }
}

/* The coordinates at time t [s] alone. */
INLINE void coordinates_at(const path *p, double t, int64_t *piece, double q[AXES])
{
    double u = time_in(p, t, piece);
    for (int64_t i = 0; i < p->n; i++) {
        const double *c = p->curves + i * p->pieces + *piece;
        q[i] = 0.0;
        /* Samples lie at breaks. */
        for (int64_t power = u == 0.0 ? p->powers - 1 : 0; power < p->powers; power++)
            q[i] = q[i] * u + c[power * p->n * p->pieces];
    }
}

/* The coordinates of motion p at times [s], and their rates and accelerations. */
INLINE void states_at(const path *p, const lane time, int64_t *piece, lane q[3][AXES])
{
    for (int l = 0; l < LANES; l++) {
        state s;
        state_at(p, time[l], piece, &s);
        for (int64_t i = 0; i < p->n; i++) {
            q[0][i][l] = s.q[i];
            q[1][i][l] = s.dq[i];
            q[2][i][l] = s.ddq[i];
        }
    }
}

/* An arm's link i: how it is turned, after the one before it, and from where to where it goes. The first
   begins where `first_joint` says. */
INLINE void next_link(const linkage *a, int64_t i, lane q[3][AXES], lane turned[3], lane link[2])
{
    for (int k = 0; k < 3; k++)
        EACH_LANE turned[k][l] += a->sign[i] * q[k][i][l];
    EACH_LANE {
        link[0][l] = a->along[i];
        link[1][l] = a->up[i];
    }
}

INLINE void first_joint(const linkage *a, lane turned[3], lane joint[6])
{
    for (int k = 0; k < 3; k++)
        EACH_LANE turned[k][l] = 0.0;
    for (int k = 0; k < 6; k++)
        EACH_LANE joint[k][l] = k == 0 ? a->x : k == 1 ? a->z : 0.0;
}

/* Pose, twist and acceleration of a hand at the end of the last link. */
INLINE void last_hand(const linkage *a, lane joint[6], lane turned[3], lane hand[9])
{
    for (int k = 0; k < 3; k++)
        EACH_LANE {
            hand[3 * k][l] = joint[2 * k][l];
            hand[3 * k + 1][l] = joint[2 * k + 1][l];
            hand[3 * k + 2][l] = turned[k][l] + (k ? 0.0 : a->theta);
        }
}

/* Pose, twist and acceleration (x, z, theta each) of the hands at times [s]. */
INLINE void moved_at(const path *p, const linkage *a, const lane time, int64_t *piece, lane hand[9])
{
    lane q[3][AXES], turned[3], joint[6], link[2], end[6];
    states_at(p, time, piece, q);
    if (!a->arm) {
        for (int k = 0; k < 3; k++)
            for (int i = 0; i < 3; i++)
                EACH_LANE hand[3 * k + i][l] = i < a->n ? q[k][i][l] : k ? 0.0 : a->theta;
        return;
    }
    first_joint(a, turned, joint);
    for (int64_t i = 0; i < a->n; i++) {
        next_link(a, i, q, turned, link);
        link_end(joint, turned, link, end);
        copy_lanes(6, end, joint);
    }
    last_hand(a, joint, turned, hand);
}

#endif
