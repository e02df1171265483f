/* The motion of many throws, looked at once. */
#ifndef COURSE_H
#define COURSE_H

#include "motion.h"

/* Tables of a motion at its ticks, and at the instants at which the grip is looked at; rows of `width` and
   `wide` values, whole blocks of lanes, the last value again at the end. After the last tick the arm rests. */
typedef struct {
    const throws *t;
    int64_t ticks, width, instants, wide;
    double *time;        /* [ticks] s */
    double *hand[9];     /* [ticks] pose, twist and acceleration of the hand */
    double *cosine, *sine; /* [ticks] of its angle */
    double *free[AXES];  /* [ticks] share of a joint's torque limit with an empty hand, */
    double *by[3][AXES]; /* and how it grows with force along x and z and torque at the hand */
    double *empty[AXES]; /* at which tick it is largest from a tick on */
    double *jump;        /* [ticks] largest change [N m] of a joint's torque with an empty hand, from a tick on */
    double *joint;       /* [ticks][n][4] x, z of each joint, cosine and sine of its link's angle */
    double *angle, *turned; /* [ticks][n] the links' angles, and how far they have turned, at most */
    double *way, *spun;  /* [ticks] how far the hand has moved and turned, at most */
    double *instant;     /* [instants] s, not in order */
    double *grip[9];     /* [instants] hand, as above */
    double *room;
} course;

/* A tick of the course: the arm rests before the first and after the last. */
static inline int64_t at_tick(const course *c, int64_t tick)
{
    return tick < 0 ? 0 : tick < c->ticks ? tick : c->ticks - 1;
}

/* What is too near in a motion's arm alone; how many, -1 without memory. */
int64_t near_arm(const course *c, contact *found);

/* What is too near to the object of a throw; how many, -1 without memory. */
int64_t near_object(const course *c, const thrown *s, int64_t nodes, const double *track, contact *found);

#endif
