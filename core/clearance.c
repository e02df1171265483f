/* How near arm, held bar and flying bar come to obstacles and to the arm itself, in 3-D; the same as
   planner/check/clearance.py. One instant at a time. */
#define LANES 1
#include <stdlib.h>
#include "motion.h"

/* Intervals of so many samples are looked at sample by sample. */
#define STRIDE 8
#define NONE 1e-12
#define ROUNDING 1e-6

/* `Solid` of models/capsules.py, the clearance that is kept from it [m], and whether the bar keeps it
   too. */
typedef struct {
    double centre[3], axes[9], half[3], radius, clearance;
    long bar;
} solid;

/* Arm and bar as capsules; the bar comes after the links. Ends of a link's capsule are as in
   `ArmCapsules`. reach: radii as obstacles meet them. */
typedef struct {
    long links, bar;
    const long *moved_by, *moves;
    const double *places, *radius, *reach;
    long solids;
    const solid *around;
    long held_pairs, flown_pairs;
    const long *held, *flown;
    double behind, ahead, com_offset, grasp_angle, landing;
} bodies;

/* A throw as in check.c, with times [s] of the bar's poses while the pads open. */
typedef struct {
    const path *motion;
    const linkage *arm;
    double tick, opening, detach, flight, gravity;
    long nodes;
    const double *times, *com, *start;
} thrown;

/* Bodies that move together at n times: the links' angles; how far these have turned, and the bar
   moved, at most; whether a sample is placed: joints with their angles' cosines and sines, the bar's
   CoM and angle. */
typedef struct {
    long n, flying, bar, carried;
    double *time, *angle, *turned, *moved, *placed, *joint, *com;
} track;

/* One thing too near: track, body, the solid or (negative, less 1) the link, missing [m], time [s]. */
typedef struct {
    double track, body, other, missing, time;
} contact;

typedef struct {
    double begin[3], end[3];
} segment;

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* hypot takes longer, against overflow. */
static double length(double x, double y)
{
    return sqrt(x * x + y * y);
}

static double clipped(double v, double low, double high)
{
    return v < low ? low : v > high ? high : v;
}

/* Ericson, Real-Time Collision Detection (2005), section 5.1.9. */
static double between_segments(const segment *one, const segment *other)
{
    double d[3], e[3], r[3], off[3];
    for (int i = 0; i < 3; i++) {
        d[i] = one->end[i] - one->begin[i];
        e[i] = other->end[i] - other->begin[i];
        r[i] = one->begin[i] - other->begin[i];
    }
    double a = dot(d, d), b = dot(d, e), c = dot(d, r), g = dot(e, e), f = dot(e, r);
    double cross = a * g - b * b;
    double s = cross > NONE ? clipped((b * f - c * g) / cross, 0.0, 1.0) : 0.0;
    double t = clipped((b * s + f) / (g > NONE ? g : 1.0), 0.0, 1.0);
    s = clipped((b * t - c) / (a > NONE ? a : 1.0), 0.0, 1.0);
    for (int i = 0; i < 3; i++)
        off[i] = r[i] + s * d[i] - t * e[i];
    return sqrt(dot(off, off));
}

/* Of a point at t along a segment, seen from a box: off it, and the slope of half its square. */
static double slope_at(const double p[3], const double d[3], const double half[3], double t,
                       double off[3])
{
    for (int i = 0; i < 3; i++) {
        double x = p[i] + t * d[i];
        off[i] = x - clipped(x, -half[i], half[i]);
    }
    return dot(off, d);
}

static double from_solid(const segment *s, const solid *b)
{
    double p[3], d[3], off[3], low = 0.0, high = 1.0, down = -INFINITY, up = INFINITY;
    for (int i = 0; i < 3; i++) {
        p[i] = d[i] = 0.0;
        for (int k = 0; k < 3; k++) {
            p[i] += b->axes[3 * i + k] * (s->begin[k] - b->centre[k]);
            d[i] += b->axes[3 * i + k] * (s->end[k] - s->begin[k]);
        }
    }
    for (int k = 0; k < 8; k++) {
        double t = k - 6;
        if (k < 6) {
            if (fabs(d[k / 2]) < NONE)
                continue;
            t = clipped(((k % 2 ? 1.0 : -1.0) * b->half[k / 2] - p[k / 2]) / d[k / 2], 0.0, 1.0);
        }
        double slope = slope_at(p, d, b->half, t, off);
        if (slope <= 0.0 && t >= low) {
            low = t;
            down = slope > down ? slope : down;
        }
        if (slope >= 0.0 && t <= high) {
            high = t;
            up = slope < up ? slope : up;
        }
    }
    double best = down == -INFINITY ? 0.0 : low;
    if (down > -INFINITY && up < INFINITY && up - down > NONE)
        best = low - down / (up - down) * (high - low);
    slope_at(p, d, b->half, best, off);
    return sqrt(dot(off, off)) - b->radius;
}

/* The arm at sample k; the hand there. */
static void place_arm(const thrown *t, const track *on, long k, double hand[3])
{
    const linkage *a = t->arm;
    const double *angle = on->angle + k * a->n;
    if (!a->arm) {
        hand[0] = angle[0];
        hand[1] = angle[1];
        hand[2] = a->n > 2 ? angle[2] : a->theta;
        return;
    }
    hand[0] = a->x;
    hand[1] = a->z;
    for (long i = 0; i < a->n; i++) {
        double *j = on->joint + 4 * (k * a->n + i);
        j[0] = hand[0];
        j[1] = hand[1];
        j[2] = cos(angle[i]);
        j[3] = sin(angle[i]);
        hand[0] += a->along[i] * j[2] - a->up[i] * j[3];
        hand[1] += a->along[i] * j[3] + a->up[i] * j[2];
    }
    hand[2] = a->theta + angle[a->n - 1];
}

/* CoM and angle of the bar at sample k. */
static void bar_at(const thrown *t, const bodies *all, const track *on, long k, double com[3])
{
    if (on->flying) {
        double since = on->time[k] - t->detach;
        com[0] = t->start[0] + t->start[3] * since;
        com[1] = t->start[1] + (t->start[4] - t->gravity / 2.0 * since) * since;
        com[2] = t->start[2] + t->start[5] * since;
    } else if (k >= on->carried) {
        for (int i = 0; i < 3; i++)
            com[i] = t->com[i * t->nodes + k - on->carried];
    } else {
        double hand[3];
        place_arm(t, on, k, hand);
        com[2] = hand[2] + all->grasp_angle;
        com[0] = hand[0] + all->com_offset * cos(com[2]);
        com[1] = hand[1] + all->com_offset * sin(com[2]);
    }
}

/* Places sample k. */
static void place(const thrown *t, const bodies *all, const track *on, long k)
{
    double hand[3];
    on->placed[k] = 1.0;
    place_arm(t, on, k, hand);
    if (on->bar)
        bar_at(t, all, on, k, on->com + 3 * k);
}

/* A body at sample k. */
static segment body_at(const thrown *t, const bodies *all, const track *on, long body, long k)
{
    segment s;
    if (!on->placed[k])
        place(t, all, on, k);
    if (body == all->links) {
        const double *com = on->com + 3 * k;
        double c = cos(com[2]), d = sin(com[2]);
        s = (segment){{com[0] - all->behind * c, 0.0, com[1] - all->behind * d},
                      {com[0] + all->ahead * c, 0.0, com[1] + all->ahead * d}};
        return s;
    }
    const double *place = all->places + 6 * body;
    long link = all->moved_by[body];
    for (int e = 0; e < 2; e++, place += 3) {
        double *at = e ? s.end : s.begin;
        at[0] = place[0];
        at[1] = place[1];
        at[2] = place[2];
        if (link < 0)
            continue;
        const double *j = on->joint + 4 * (k * t->arm->n + link);
        at[0] = j[0] + place[0] * j[2] - place[2] * j[3];
        at[2] = j[1] + place[0] * j[3] + place[2] * j[2];
    }
    return s;
}

/* How far a body may have moved since the first sample. */
static double travelled(const thrown *t, const bodies *all, const track *on, long body, long k)
{
    const linkage *a = t->arm;
    if (body == all->links)
        return on->moved[k];
    double sum = 0.0;
    const double *p = all->places + 6 * body;
    for (long i = 0; i <= all->moved_by[body]; i++) {
        double far = length(a->along[i], a->up[i]);
        if (i == all->moved_by[body])
            far = fmax(length(p[0], p[2]), length(p[3], p[5]));
        sum += far * on->turned[k * a->n + i];
    }
    return sum;
}

static double step_of(const segment *a, const segment *b)
{
    double d[3], e[3];
    for (int i = 0; i < 3; i++) {
        d[i] = b->begin[i] - a->begin[i];
        e[i] = b->end[i] - a->end[i];
    }
    return sqrt(fmax(dot(d, d), dot(e, e)));
}

/* What may come too near: a body to a solid, or (NULL) to another body. lands [m]: as near to the
   solid a bar that flies may come in the end, infinite for others. */
typedef struct {
    const thrown *throw;
    const bodies *all;
    const track *on;
    long body, other;
    const solid *from;
    double needed, lands, worst, when;
} pair;

static double distance_at(const pair *p, long k, segment *one, segment *other)
{
    *one = body_at(p->throw, p->all, p->on, p->body, k);
    if (p->from)
        return from_solid(one, p->from);
    *other = body_at(p->throw, p->all, p->on, p->other, k);
    return between_segments(one, other);
}

/* Every sample from k to last: what is missing at most of the distance that is needed. */
static void look_closely(pair *p, long k, long last)
{
    segment a, b = {{0}}, c, d = {{0}};
    double near = distance_at(p, k, &a, &b), left = p->needed;
    double end = p->on->time[p->on->n - 1];
    for (long i = k; i <= last; i++) {
        double here = distance_at(p, i, &c, &d), least = p->needed;
        double step = step_of(&a, &c) + (p->from ? 0.0 : step_of(&b, &d));
        if (p->lands < INFINITY && p->on->time[i] > end - p->all->landing) {
            segment before = body_at(p->throw, p->all, p->on, p->body, i ? i - 1 : 0);
            least = fmin(p->lands, p->needed) - step_of(&before, &c);
        }
        double lack = fmax(left, least) - (near + here - step) / 2.0;
        if (i > k && lack > p->worst) {
            p->worst = lack;
            p->when = p->on->time[i - 1];
        }
        a = c;
        b = d;
        near = here;
        left = least;
    }
}

/* Distances between samples: halves of an interval until the pair is clear in it. */
static void look_between(pair *p, long first, double near, long last, double far)
{
    double way = 0.0;
    for (int i = 0; i < (p->from ? 1 : 2); i++) {
        long body = i ? p->other : p->body;
        way += travelled(p->throw, p->all, p->on, body, last)
            - travelled(p->throw, p->all, p->on, body, first);
    }
    if ((near + far - way) / 2.0 >= p->needed)
        return;
    if (last - first <= STRIDE) {
        look_closely(p, first, last);
        return;
    }
    segment one, other;
    long middle = (first + last) / 2;
    double here = distance_at(p, middle, &one, &other);
    look_between(p, first, near, middle, here);
    look_between(p, middle, here, last, far);
}

/* What is missing of a distance at most. */
static double missing(const thrown *t, const bodies *all, const track *on, long body,
                      const solid *from, long other, double needed, double *when)
{
    segment one, two;
    pair p = {t, all, on, body, other, from, needed, INFINITY, -INFINITY, 0.0};
    double near = distance_at(&p, 0, &one, &two), far = distance_at(&p, on->n - 1, &one, &two);
    if (from && on->flying && body == all->links)
        p.lands = far;
    look_between(&p, 0, near, on->n - 1, far);
    *when = p.when;
    return p.worst;
}

/* The angles of all samples, and what bounds the motion between them. */
static void follow(const thrown *t, const bodies *all, track *on)
{
    const linkage *a = t->arm;
    long piece = 0;
    double far = fmax(all->behind, all->ahead);
    for (long k = 0; k < on->n; k++) {
        double q[AXES], angle = 0.0, moved = 0.0;
        on->placed[k] = 0.0;
        coordinates_at(t->motion, on->time[k], &piece, 0, q);
        for (long i = 0; i < a->n; i++) {
            long at = k * a->n + i;
            angle = a->arm ? angle + a->sign[i] * q[i] : q[i];
            on->angle[at] = angle;
            double turn = k ? fabs(angle - on->angle[at - a->n]) : 0.0;
            on->turned[at] = turn + (k ? on->turned[at - a->n] : 0.0);
            moved += turn * (a->arm ? length(a->along[i], a->up[i]) : i < 2 ? 1.0 : 0.0);
            if (i == a->n - 1 && (a->arm || i == 2))
                moved += turn * (all->com_offset + far);
        }
        if (on->bar && k && k >= on->carried) {
            double before[3], com[3];
            bar_at(t, all, on, k - 1, before);
            bar_at(t, all, on, k, com);
            moved = length(com[0] - before[0], com[1] - before[1]) + far * fabs(com[2] - before[2]);
        }
        on->moved[k] = moved + (k ? on->moved[k - 1] : 0.0);
    }
}

/* Bodies of a track that are too near to something; how many are found. */
static long look(const thrown *t, const bodies *all, const track *on, double number, contact *found)
{
    long count = 0, bodies_here = all->links + on->bar;
    for (long s = 0; s < all->solids; s++)
        for (long b = 0; b < bodies_here; b++) {
            const solid *from = all->around + s;
            if (b < all->links ? !all->moves[b] : !from->bar)
                continue;
            double when, needed = all->reach[b] + from->clearance;
            double lack = missing(t, all, on, b, from, 0, needed, &when);
            if (lack > ROUNDING)
                found[count++] = (contact){number, b, s, lack, when};
        }
    long pairs = on->flying ? all->flown_pairs : all->held_pairs;
    const long *meet = on->flying ? all->flown : all->held;
    for (long i = 0; i < pairs; i++, meet += 2) {
        if (meet[1] >= bodies_here)
            continue;
        double when, needed = all->radius[meet[0]] + all->radius[meet[1]];
        double lack = missing(t, all, on, meet[1], NULL, meet[0], needed, &when);
        if (lack > ROUNDING)
            found[count++] = (contact){number, meet[1], -1 - meet[0], lack, when};
    }
    return count;
}

/* All contacts of a throw, `found` has room for them; -1 without memory. */
CLONES EXPORT long near_bodies(const thrown *t, const bodies *all, contact *found)
{
    long count = 0;
    double until = t->motion->breaks[t->motion->pieces], lands = t->detach + t->flight;
    long carried = (long)ceil(t->opening / t->tick), flown = (long)ceil(t->flight / t->tick) + 1;
    long rests = t->arm->arm && until > lands ? (long)ceil((until - lands) / t->tick) + 1 : 0;
    long most = carried + t->nodes > flown ? carried + t->nodes : flown;
    most = rests > most ? rests : most;
    long each[] = {1, AXES, AXES, 1, 1, 4 * AXES, 3}, all_of = 0;
    for (int i = 0; i < 7; i++)
        all_of += each[i];
    double *room = malloc(sizeof(double) * most * all_of), *next = room;
    if (!room)
        return -1;
    track on = {carried + t->nodes, 0, 1, carried};
    double **parts[] = {&on.time, &on.angle, &on.turned, &on.moved, &on.placed, &on.joint, &on.com};
    for (int i = 0; i < 7; next += most * each[i++])
        *parts[i] = next;
    for (long k = 0; k < on.n; k++)
        on.time[k] = k < carried ? k * t->tick : t->times[k - carried];
    follow(t, all, &on);
    count += look(t, all, &on, 0.0, found);
    on.n = flown;
    on.flying = 1;
    on.carried = 0;
    for (long k = 0; k < flown; k++)
        on.time[k] = t->detach + (flown > 1 ? t->flight * k / (flown - 1) : 0.0);
    follow(t, all, &on);
    count += look(t, all, &on, 1.0, found + count);
    if (rests > 1) {
        on.n = rests;
        on.flying = on.bar = 0;
        for (long k = 0; k < rests; k++)
            on.time[k] = k < rests - 1 ? lands + k * t->tick : until;
        follow(t, all, &on);
        count += look(t, all, &on, 2.0, found + count);
    }
    free(room);
    return count;
}

/* How far two bodies are nearer than they may be, at most, at each of `count` instants: coordinates q
   [count][n], CoM and angle of the bar com [count][3] or NULL without it. Not 0 without memory. */
CLONES EXPORT int overlaps(long count, const linkage *arm, const bodies *all, long flying,
                           const double *q, const double *com, double *deepest)
{
    double angle[AXES], joint[4 * AXES], placed = 1.0, hand[3], pose[3];
    long links = all->links, pairs = flying ? all->flown_pairs : all->held_pairs;
    segment *ends = malloc(sizeof(segment) * (links + 1));
    double *middle = malloc(sizeof(double) * 4 * (links + 1));
    thrown t = {0};
    track on = {1, flying, com != NULL, 0};
    t.arm = arm;
    on.angle = angle;
    on.joint = joint;
    on.placed = &placed;
    on.com = pose;
    for (long k = 0; ends && middle && k < count; k++, q += arm->n) {
        for (long i = 0; i < arm->n; i++)
            angle[i] = (i ? angle[i - 1] : 0.0) + arm->sign[i] * q[i];
        place_arm(&t, &on, 0, hand);
        for (int i = 0; com && i < 3; i++)
            pose[i] = com[3 * k + i];
        for (long b = 0; b < links + on.bar; b++) {
            ends[b] = body_at(&t, all, &on, b, 0);
            double half = 0.0, *m = middle + 4 * b;
            for (int i = 0; i < 3; i++) {
                double e = (ends[b].end[i] - ends[b].begin[i]) / 2.0;
                m[i] = ends[b].begin[i] + e;
                half += e * e;
            }
            m[3] = sqrt(half) + all->radius[b];
        }
        double most = -INFINITY;
        const long *meet = flying ? all->flown : all->held;
        for (long p = 0; p < pairs; p++, meet += 2) {
            if (meet[1] >= links + on.bar)
                continue;
            /* No nearer than the balls around both. */
            const double *a = middle + 4 * meet[0], *b = middle + 4 * meet[1];
            double off[3] = {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
            double away = a[3] + b[3] - most;
            if (away > 0.0 && dot(off, off) > away * away)
                continue;
            double lack = all->radius[meet[0]] + all->radius[meet[1]]
                - between_segments(ends + meet[0], ends + meet[1]);
            most = fmax(most, lack);
        }
        deepest[k] = most;
    }
    int failed = !ends || !middle;
    free(ends);
    free(middle);
    return failed;
}
