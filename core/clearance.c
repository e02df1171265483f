/* How near arm, held bar and flying bar come to obstacles and to the arm itself, in 3-D. Everything that
   moves is a capsule: the arm's links, and the bar with its corners or the parts of an object's outline.
   Between samples a distance falls by no more than half of what the bodies move beyond the half that the
   samples explain, so a clearance that is kept is kept at every instant. One instant at a time. */
#define LANES 1
#include <stdlib.h>
#include "functions.h"
#include "throw.h"

/* Intervals of so many samples are looked at sample by sample. */
#define STRIDE 8
#define NONE 1e-12
#define ROUNDING 1e-6

/* Bodies that move together at n times: the links' angles; how far these have turned, and the bar
   moved, at most; whether a sample is placed: joints with their angles' cosines and sines, the bar's
   CoM and angle. Or else, given, and not written: ends [body][2][3][n] of the bodies, and how far each has moved
   [body][n]. */
typedef struct {
    int64_t n, flying, bar, carried;
    double *time, *angle, *turned, *moved, *placed, *joint, *com;
    const double *ends;
    double *travel;
} track;

typedef struct {
    double begin[3], end[3];
} segment;

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
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
    double s = cross > NONE * a * g ? clipped((b * f - c * g) / cross, 0.0, 1.0) : 0.0;
    double t = clipped((b * s + f) / (g > NONE ? g : 1.0), 0.0, 1.0);
    s = clipped((b * t - c) / (a > NONE ? a : 1.0), 0.0, 1.0);
    for (int i = 0; i < 3; i++)
        off[i] = r[i] + s * d[i] - t * e[i];
    return sqrt(dot(off, off));
}

CLONES EXPORT void segment_distances(int64_t count, const double *pairs, double *found)
{
    const segment *ends = (const segment *)pairs;
    for (int64_t k = 0; k < count; k++)
        found[k] = between_segments(ends + 2 * k, ends + 2 * k + 1);
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
static void place_arm(const throw *t, const track *on, int64_t k, double hand[3])
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
    for (int64_t i = 0; i < a->n; i++) {
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
static void bar_at(const throw *t, const bodies *all, const track *on, int64_t k, double com[3])
{
    if (on->flying) {
        flight_pose(t->start, on->time[k] - t->detach, t->around->gravity, com);
    } else if (k >= on->carried) {
        for (int i = 0; i < 3; i++)
            com[i] = t->com[i * t->nodes + k - on->carried];
    } else {
        double hand[3];
        place_arm(t, on, k, hand);
        com[2] = hand[2] + all->grasp_angle;
        com[0] = hand[0] + t->error[0] + all->com_offset * cos(com[2]);
        com[1] = hand[1] + t->error[1] + all->com_offset * sin(com[2]);
    }
}

/* Places sample k. */
static void place(const throw *t, const bodies *all, const track *on, int64_t k)
{
    double hand[3];
    on->placed[k] = 1.0;
    place_arm(t, on, k, hand);
    if (on->bar)
        bar_at(t, all, on, k, on->com + 3 * k);
}

/* A body at sample k. */
static segment body_at(const throw *t, const bodies *all, const track *on, int64_t body, int64_t k)
{
    segment s;
    if (on->ends) {
        for (int i = 0; i < 3; i++) {
            s.begin[i] = on->ends[(6 * body + i) * on->n + k];
            s.end[i] = on->ends[(6 * body + 3 + i) * on->n + k];
        }
        return s;
    }
    if (on->placed[k] == 0.0)
        place(t, all, on, k);
    if (body >= all->links) {
        const double *com = on->com + 3 * k, *part = all->outline;
        double c = cos(com[2]), d = sin(com[2]);
        if (!part)
            return (segment){{com[0] - all->behind * c, 0.0, com[1] - all->behind * d},
                             {com[0] + all->ahead * c, 0.0, com[1] + all->ahead * d}};
        part += 5 * (body - all->links);
        for (int e = 0; e < 2; e++, part += 2) {
            double along = part[0] - all->behind, *at = e ? s.end : s.begin;
            at[0] = com[0] + along * c - part[1] * d;
            at[1] = 0.0;
            at[2] = com[1] + along * d + part[1] * c;
        }
        return s;
    }
    const double *place = all->places + 6 * body;
    int64_t link = all->moved_by[body];
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
static double travelled(const throw *t, const bodies *all, const track *on, int64_t body, int64_t k)
{
    if (on->ends)
        return on->travel[body * on->n + k];
    if (body >= all->links)
        return on->moved[k];
    const linkage *a = t->arm;
    double sum = 0.0;
    const double *p = all->places + 6 * body;
    for (int64_t i = 0; i <= all->moved_by[body]; i++) {
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
    const throw *throw;
    const bodies *all;
    const track *on;
    int64_t body, other;
    const solid *from;
    double needed, lands, worst, when;
} pair;

static double distance_at(const pair *p, int64_t k, segment *one, segment *other)
{
    *one = body_at(p->throw, p->all, p->on, p->body, k);
    if (p->from)
        return from_solid(one, p->from);
    *other = body_at(p->throw, p->all, p->on, p->other, k);
    return between_segments(one, other);
}

/* The distance that is needed at sample k: at the end of its flight the bar may come as near to a solid
   as it lands; step [m]: how far it moved since the sample before. */
static double needed_at(const pair *p, int64_t k, double step)
{
    const track *on = p->on;
    if (p->lands == INFINITY || on->time[k] <= on->time[on->n - 1] - p->all->landing)
        return p->needed;
    return fmin(p->lands, p->needed) - step;
}

/* Every sample from k to last: what is missing at most of the distance that is needed. */
static void look_closely(pair *p, int64_t k, int64_t last)
{
    segment a, b = {{0}, {0}}, c, d = {{0}, {0}};
    double near = distance_at(p, k, &a, &b), left = p->needed;
    for (int64_t i = k; i <= last; i++) {
        segment before = body_at(p->throw, p->all, p->on, p->body, i ? i - 1 : 0);
        double here = distance_at(p, i, &c, &d), least = needed_at(p, i, step_of(&before, &c));
        double step = step_of(&a, &c) + (p->from ? 0.0 : step_of(&b, &d));
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
static void look_between(pair *p, int64_t first, double near, int64_t last, double far)
{
    double way = 0.0;
    for (int i = 0; i < (p->from ? 1 : 2); i++) {
        int64_t body = i ? p->other : p->body;
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
    int64_t middle = (first + last) / 2;
    double here = distance_at(p, middle, &one, &other);
    look_between(p, first, near, middle, here);
    look_between(p, middle, here, last, far);
}

/* What is missing of a distance at most. */
static double missing(const throw *t, const bodies *all, const track *on, int64_t body,
                      const solid *from, int64_t other, double needed, double *when)
{
    segment one, two;
    pair p = {t, all, on, body, other, from, needed, INFINITY, -INFINITY, 0.0};
    double near = distance_at(&p, 0, &one, &two), far = distance_at(&p, on->n - 1, &one, &two);
    if (from && on->flying && body >= all->links)
        p.lands = fmax(far, all->middle * all->radius[body]);
    look_between(&p, 0, near, on->n - 1, far);
    *when = p.when;
    return p.worst;
}

/* How far the object's axes reach from its CoM. */
static double far_of(const bodies *all)
{
    double far = fmax(all->behind, all->ahead);
    for (int64_t i = 0; all->outline && i < 2 * all->bar; i++) {
        const double *end = all->outline + 5 * (i / 2) + 2 * (i % 2);
        far = fmax(far, length(end[0] - all->behind, end[1]));
    }
    return far;
}

/* The angles of all samples, and what bounds the motion between them. */
static void follow(const throw *t, const bodies *all, track *on)
{
    const linkage *a = t->arm;
    int64_t piece = 0;
    double far = far_of(all);
    for (int64_t k = 0; k < on->n; k++) {
        double q[AXES], angle = 0.0, moved = 0.0;
        on->placed[k] = 0.0;
        coordinates_at(t->motion, on->time[k], &piece, q);
        for (int64_t i = 0; i < a->n; i++) {
            int64_t at = k * a->n + i;
            angle = a->arm ? angle + a->sign[i] * q[i] : q[i];
            on->angle[at] = angle;
            double turn = k ? fabs(angle - on->angle[at - a->n]) : 0.0;
            on->turned[at] = turn + (k ? on->turned[at - a->n] : 0.0);
            moved += turn * (a->arm ? length(a->along[i], a->up[i]) : i < 2 ? 1.0 : 0.0);
            if (i == a->n - 1 && (a->arm || i == 2))
                moved += turn * (fabs(all->com_offset) + far);
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

/* How many pairs of bodies have to keep clear of each other on a track. */
static int64_t pairs_on(const bodies *all, const track *on)
{
    return on->flying ? all->pairs : all->always;
}

/* The distance that the axes of a pair of bodies need. */
static double apart_of(const bodies *all, int64_t i)
{
    const int64_t *meet = all->meet + 2 * i;
    return all->radius[meet[0]] + all->radius[meet[1]] + all->apart[i];
}

/* Bodies of a track that are too near to something; how many are found. */
static int64_t look(const throw *t, const bodies *all, const track *on, double number, contact *found)
{
    int64_t count = 0, bodies_here = all->links + on->bar;
    for (int64_t s = 0; s < all->solids; s++)
        for (int64_t b = 0; b < bodies_here; b++) {
            const solid *from = all->around + s;
            if (b < all->links ? !all->moves[b] : !from->bar)
                continue;
            double when, needed = all->radius[b] + from->clearance;
            double lack = missing(t, all, on, b, from, 0, needed, &when);
            if (lack > ROUNDING)
                found[count++] = (contact){number, (double)b, (double)s, lack, when};
        }
    const int64_t *meet = all->meet;
    for (int64_t i = 0; i < pairs_on(all, on); i++, meet += 2) {
        if (meet[1] >= bodies_here)
            continue;
        double when, needed = apart_of(all, i);
        double lack = missing(t, all, on, meet[1], NULL, meet[0], needed, &when);
        if (lack > ROUNDING)
            found[count++] = (contact){number, (double)meet[1], (double)(-1 - meet[0]), lack, when};
    }
    return count;
}

/* Room for a track of `most` samples; NULL without memory. */
static double *room_for(track *on, int64_t most)
{
    const int64_t each[] = {1, AXES, AXES, 1, 1, 4 * AXES, 3};
    int64_t all_of = 0;
    for (int i = 0; i < 7; i++)
        all_of += each[i];
    double *room = malloc(sizeof(double) * (size_t)(most * all_of)), *next = room;
    double **parts[]
        = {&on->time, &on->angle, &on->turned, &on->moved, &on->placed, &on->joint, &on->com};
    for (int i = 0; room && i < 7; next += most * each[i++])
        *parts[i] = next;
    return room;
}

/* The track from detach to the landing. */
static void follow_flight(const throw *t, const bodies *all, track *on)
{
    on->n = (int64_t)ceil(t->flight / t->tick) + 1;
    on->flying = 1;
    on->bar = all->bar;
    on->carried = 0;
    for (int64_t k = 0; k < on->n; k++)
        on->time[k] = t->detach + (on->n > 1 ? t->flight * (double)k / (double)(on->n - 1) : 0.0);
    follow(t, all, on);
}

CLONES EXPORT int64_t near_bodies(const throw *t, const bodies *all, contact *found)
{
    int64_t count = 0;
    double until = t->motion->breaks[t->motion->pieces], lands = t->detach + t->flight;
    int64_t carried = (int64_t)ceil(t->opening / t->tick), flown = (int64_t)ceil(t->flight / t->tick) + 1;
    int64_t rests = t->arm->arm && until > lands ? (int64_t)ceil((until - lands) / t->tick) + 1 : 0;
    carried = carried > 0 ? carried : 0;
    int64_t most = carried + t->nodes > flown ? carried + t->nodes : flown;
    most = rests > most ? rests : most;
    track on = {.n = carried + t->nodes, .bar = all->bar, .carried = carried};
    double *room = room_for(&on, most);
    if (!room)
        return -1;
    for (int64_t k = 0; k < on.n; k++)
        on.time[k] = k < carried ? (double)k * t->tick : t->times[k - carried];
    follow(t, all, &on);
    count += look(t, all, &on, 0.0, found);
    follow_flight(t, all, &on);
    count += look(t, all, &on, 1.0, found + count);
    if (rests > 1) {
        on.n = rests;
        on.flying = on.bar = 0;
        for (int64_t k = 0; k < rests; k++)
            on.time[k] = k < rests - 1 ? lands + (double)k * t->tick : until;
        follow(t, all, &on);
        count += look(t, all, &on, 2.0, found + count);
    }
    free(room);
    return count;
}

CLONES EXPORT int64_t near_flights(const throw *shared, const bodies *all, int64_t count,
                                   const flown_sample *flights, double *missed)
{
    int64_t most = 2;
    for (int64_t k = 0; k < count; k++) {
        int64_t n = (int64_t)ceil(flights[k].flight / shared->tick) + 1;
        most = n > most ? n : most;
    }
    track on = {0};
    double *room = room_for(&on, most);
    if (!room)
        return 1;
    for (int64_t k = 0; k < count; k++) {
        scene around;
        bodies here = *all;
        throw t = throw_of(shared, flights + k, &around);
        double when, worst = -INFINITY;
        here.behind = around.behind;
        here.ahead = around.ahead;
        follow_flight(&t, &here, &on);
        for (int64_t s = 0; s < all->solids; s++) {
            const solid *from = all->around + s;
            for (int64_t b = all->links; from->bar && b < all->links + all->bar; b++) {
                double needed = all->radius[b] + from->clearance;
                worst = fmax(worst, missing(&t, &here, &on, b, from, 0, needed, &when));
            }
        }
        const int64_t *meet = all->meet;
        for (int64_t i = 0; i < all->pairs; i++, meet += 2) {
            double needed = apart_of(all, i);
            if (meet[1] >= all->links)
                worst = fmax(worst,
                             missing(&t, &here, &on, meet[1], NULL, meet[0], needed, &when));
        }
        missed[k] = worst;
    }
    free(room);
    return 0;
}

CLONES EXPORT int64_t near_track(const bodies *all, int64_t n, int64_t bar, int64_t flying,
                                 const double *times, const double *ends, contact *found)
{
    int64_t count = all->links + bar;
    double *travel = malloc(sizeof(double) * (size_t)(n * count + 1));
    track on = {.n = n, .flying = flying, .bar = bar, .time = (double *)times, .ends = ends, .travel = travel};
    if (!travel)
        return -1;
    for (int64_t b = 0; b < count; b++)
        for (int64_t k = 0; k < n; k++) {
            segment here = body_at(NULL, all, &on, b, k), last = body_at(NULL, all, &on, b, k ? k - 1 : 0);
            travel[b * n + k] = step_of(&last, &here) + (k ? travel[b * n + k - 1] : 0.0);
        }
    count = look(NULL, all, &on, 0.0, found);
    free(travel);
    return count;
}

/* Takes up how much room a pair has at each sample. */
static void room_of(pair *p, double *room)
{
    segment last = {{0}, {0}}, one, other;
    for (int64_t k = 0; k < p->on->n; k++) {
        double away = distance_at(p, k, &one, &other);
        away -= needed_at(p, k, k ? step_of(&last, &one) : 0.0);
        room[k] = fmin(room[k], away);
        last = one;
    }
}

CLONES EXPORT void rooms(const bodies *all, int64_t n, int64_t bar, int64_t flying, int64_t alone,
                         const double *times, const double *ends, double *room)
{
    track on = {.n = n, .flying = flying, .bar = bar, .time = (double *)times, .ends = ends};
    segment one;
    for (int64_t k = 0; k < n; k++)
        room[k] = INFINITY;
    for (int64_t s = 0; s < all->solids; s++)
        for (int64_t b = alone ? all->links : 0; b < all->links + bar; b++) {
            const solid *from = all->around + s;
            if (b < all->links ? !all->moves[b] : !from->bar)
                continue;
            pair p = {NULL, all, &on, b, 0, from, all->radius[b] + from->clearance, INFINITY, 0.0, 0.0};
            if (flying && !alone && b >= all->links && n)
                p.lands = fmax(distance_at(&p, n - 1, &one, NULL), all->middle * all->radius[b]);
            room_of(&p, room);
        }
    const int64_t *meet = all->meet;
    for (int64_t i = 0; i < pairs_on(all, &on); i++, meet += 2) {
        if (meet[1] >= all->links + bar || (alone && meet[1] < all->links))
            continue;
        double needed = apart_of(all, i);
        pair p = {NULL, all, &on, meet[1], meet[0], NULL, needed, INFINITY, 0.0, 0.0};
        room_of(&p, room);
    }
}

CLONES EXPORT int64_t overlaps(int64_t count, const linkage *arm, const bodies *all, const double *q,
                               const double *com, double *deepest)
{
    double angle[AXES], joint[4 * AXES], placed = 1.0, hand[3], pose[3];
    int64_t links = all->links;
    segment *ends = malloc(sizeof(segment) * (size_t)(links + all->bar));
    double *middle = malloc(sizeof(double) * 4 * (size_t)(links + all->bar));
    throw t = {0};
    track on = {.n = 1, .bar = com ? all->bar : 0};
    t.arm = arm;
    on.angle = angle;
    on.joint = joint;
    on.placed = &placed;
    on.com = pose;
    for (int64_t k = 0; ends && middle && k < count; k++, q += arm->n) {
        for (int64_t i = 0; i < arm->n; i++)
            angle[i] = (i ? angle[i - 1] : 0.0) + arm->sign[i] * q[i];
        place_arm(&t, &on, 0, hand);
        for (int i = 0; com && i < 3; i++)
            pose[i] = com[3 * k + i];
        for (int64_t b = 0; b < links + on.bar; b++) {
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
        const int64_t *meet = all->meet;
        for (int64_t p = 0; p < all->pairs; p++, meet += 2) {
            if (meet[1] >= links + on.bar)
                continue;
            /* No nearer than the balls around both. */
            const double *a = middle + 4 * meet[0], *b = middle + 4 * meet[1];
            double off[3] = {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
            double away = a[3] + b[3] - most;
            if (away > 0.0 && dot(off, off) > away * away)
                continue;
            double needed = apart_of(all, p), lack = needed - between_segments(ends + meet[0], ends + meet[1]);
            most = fmax(most, lack);
        }
        deepest[k] = most;
    }
    int failed = !ends || !middle;
    free(ends);
    free(middle);
    return failed;
}
