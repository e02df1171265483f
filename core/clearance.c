/* How near arm, held bar and flying bar come to obstacles and to the arm itself, in 3-D. Everything that
   moves is a capsule: the arm's links, and the bar with its corners or the parts of an object's outline.
   Between samples a distance falls by no more than half of what the bodies move beyond the half that the
   samples explain, so a clearance that is kept is kept at every instant. One instant at a time. */
#define LANES 1
#include <stdlib.h>
#include "course.h"
#include "functions.h"

/* Intervals of so many samples are looked at sample by sample. */
#define STRIDE 8
#define NONE 1e-12
#define ROUNDING 1e-6

/* Bodies that move together at n instants. Of a throw: `before` instants of the track's own, then `ticks` of the
   course from tick `first` on, then own ones again. Own instants have times, the links' angles, how far these
   have turned, joints as in a course, and how far the object has moved. far: from the object's CoM to where its
   axes end; cosine, sine: of its angle on the hand. Of bodies that are given: ends [body][2][3][n], and how far
   each has moved [body][n]. */
typedef struct {
    const course *c;
    const thrown *s;
    int64_t n, first, before, ticks, flying, bar;
    double far, cosine, sine;
    double *time, *angle, *turned, *joint, *moved;
    const double *com; /* [4] of own instants while the pads open: time and pose */
    const double *times, *ends;
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

/* The tick of instant k; below 0 for one of the track's own, which is -1 less its number. */
static int64_t tick_of(const track *on, int64_t k)
{
    int64_t tick = on->first + k - on->before;
    if (k < on->before)
        return -1 - k;
    if (k >= on->before + on->ticks)
        return -1 - (k - on->ticks);
    return at_tick(on->c, tick);
}

static double time_at(const track *on, int64_t k)
{
    if (on->ends)
        return on->times[k];
    if (k < on->before || k >= on->before + on->ticks)
        return on->time[k < on->before ? k : k - on->ticks];
    return on->c->t->tick * (double)(on->first + k - on->before);
}

/* CoM and angle of the object at instant k. */
static void object_at(const track *on, int64_t k, double com[3])
{
    const course *c = on->c;
    const thrown *s = on->s;
    int64_t tick = tick_of(on, k);
    if (on->flying) {
        flight_pose(s->start, time_at(on, k) - s->detach, c->t->around->gravity, com);
    } else if (tick < 0) {
        for (int i = 0; i < 3; i++)
            com[i] = on->com[4 * (-1 - tick) + 1 + i];
    } else {
        com[2] = c->hand[2][tick] + s->angle;
        double cosine = c->cosine[tick] * on->cosine - c->sine[tick] * on->sine;
        double sine = c->sine[tick] * on->cosine + c->cosine[tick] * on->sine;
        com[0] = c->hand[0][tick] + s->error[0] + s->com_offset * cosine;
        com[1] = c->hand[1][tick] + s->error[1] + s->com_offset * sine;
    }
}

/* Joints of an arm at coordinates q, as in a course, and its links' angles. */
static void place_arm(const linkage *a, const double *q, double *joint, double *angle)
{
    double at[2] = {a->x, a->z}, turned = 0.0;
    for (int64_t i = 0; i < a->n; i++, joint += 4) {
        const double link[2] = {a->along[i], a->up[i]};
        angle[i] = turned += a->sign[i] * q[i];
        joint[0] = at[0];
        joint[1] = at[1];
        joint[2] = cos(turned);
        joint[3] = sin(turned);
        link_place(joint, link, at);
    }
}

/* A joint of the arm at instant k: place, cosine and sine of its link's angle. */
static const double *joint_at(const track *on, int64_t k, int64_t link)
{
    int64_t tick = tick_of(on, k), n = on->c->t->arm->n;
    return tick < 0 ? on->joint + 4 * ((-1 - tick) * n + link) : on->c->joint + 4 * (tick * n + link);
}

/* Part of the object at a pose of its CoM; behind [m]: the CoM, from its first end. */
static segment part_at(const bodies *all, int64_t number, const double com[3], double behind)
{
    segment s;
    const double pose[4] = {com[0], com[1], cos(com[2]), sin(com[2])}, *part = all->outline;
    for (int e = 0; e < 2; e++) {
        double point[2] = {(e ? all->length : 0.0) - behind, 0.0}, *end = e ? s.end : s.begin, at[2];
        if (part) {
            point[0] = part[5 * number + 2 * e] - behind;
            point[1] = part[5 * number + 2 * e + 1];
        }
        link_place(pose, point, at);
        end[0] = at[0];
        end[1] = 0.0;
        end[2] = at[1];
    }
    return s;
}

/* A link with its joint, NULL for one that stands still. */
static segment link_at(const bodies *all, int64_t body, const double *j)
{
    segment s;
    const double *place = all->places + 6 * body, still[4] = {0.0, 0.0, 1.0, 0.0};
    for (int e = 0; e < 2; e++, place += 3) {
        const double link[2] = {place[0], place[2]};
        double *end = e ? s.end : s.begin, at[2];
        link_place(j ? j : still, link, at);
        end[0] = at[0];
        end[1] = place[1];
        end[2] = at[1];
    }
    return s;
}

/* How far the object's axes reach from its CoM. */
static double far_of(const bodies *all, double behind)
{
    double far = fmax(behind, all->length - behind);
    for (int64_t i = 0; all->outline && i < 2 * all->bar; i++) {
        const double *end = all->outline + 5 * (i / 2) + 2 * (i % 2);
        far = fmax(far, length(end[0] - behind, end[1]));
    }
    return far;
}

static double turned_at(const track *on, int64_t k, int64_t link)
{
    int64_t tick = tick_of(on, k), n = on->c->t->arm->n;
    return tick < 0 ? on->turned[(-1 - tick) * n + link] : on->c->turned[tick * n + link];
}

/* How far the carried object has moved until instant k, at most. */
static double moved_until(const track *on, int64_t k)
{
    int64_t tick = tick_of(on, k);
    if (tick < 0)
        return on->moved[-1 - tick];
    return on->c->way[tick] + on->c->spun[tick] * (fabs(on->s->com_offset) + on->far);
}

/* A body at sample k. */
static segment body_at(const bodies *all, const track *on, int64_t body, int64_t k)
{
    segment s;
    if (on->ends) {
        for (int i = 0; i < 3; i++) {
            s.begin[i] = on->ends[(6 * body + i) * on->n + k];
            s.end[i] = on->ends[(6 * body + 3 + i) * on->n + k];
        }
        return s;
    }
    if (body >= all->links) {
        double com[3];
        object_at(on, k, com);
        return part_at(all, body - all->links, com, on->s->behind);
    }
    return link_at(all, body, all->moved_by[body] < 0 ? NULL : joint_at(on, k, all->moved_by[body]));
}

/* How far a body may move from one instant to another. */
static double travelled(const bodies *all, const track *on, int64_t body, int64_t first, int64_t last)
{
    if (on->ends)
        return on->travel[body * on->n + last] - on->travel[body * on->n + first];
    const course *c = on->c;
    if (body >= all->links && on->flying) {
        /* The speed of a body in free fall is convex. */
        const double *v = on->s->start + 3, g = c->t->around->gravity;
        double since = time_at(on, first) - on->s->detach, until = time_at(on, last) - on->s->detach;
        double mean = (length(v[0], v[1] - g * since) + length(v[0], v[1] - g * until)) / 2.0;
        return (until - since) * (mean + on->far * fabs(v[2]));
    }
    if (body >= all->links)
        return moved_until(on, last) - moved_until(on, first);
    double sum = 0.0;
    const double *p = all->places + 6 * body;
    const linkage *a = c->t->arm;
    for (int64_t i = 0; i <= all->moved_by[body]; i++) {
        double far = length(a->along[i], a->up[i]);
        if (i == all->moved_by[body])
            far = fmax(length(p[0], p[2]), length(p[3], p[5]));
        sum += far * (turned_at(on, last, i) - turned_at(on, first, i));
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
   solid a bar that flies may come in the end, infinite for others. inside: the first sample at which it comes
   down to a bin's rim for the last time. */
typedef struct {
    const bodies *all;
    const track *on;
    int64_t body, other;
    const solid *from;
    double needed, lands, worst, when;
    int64_t inside;
} pair;

static double distance_at(const pair *p, int64_t k, segment *one, segment *other)
{
    *one = body_at(p->all, p->on, p->body, k);
    if (p->from)
        return from_solid(one, p->from);
    *other = body_at(p->all, p->on, p->other, k);
    return between_segments(one, other);
}

/* The distance that is needed at sample k: at the end of its flight the bar may come as near to a solid
   as it lands; step [m]: how far it moved since the sample before. */
static double needed_at(const pair *p, int64_t k, double step)
{
    const track *on = p->on;
    if (k >= p->inside)
        return -INFINITY;
    if (p->lands == INFINITY || time_at(on, k) <= time_at(on, on->n - 1) - p->all->landing)
        return p->needed;
    return fmin(p->lands, p->needed) - step;
}

/* The end of the flight of a bar to a solid: `lands` and `inside` of its pair. */
static void look_at_end(pair *p)
{
    segment one, other;
    int64_t k = p->on->n;
    p->lands = fmax(distance_at(p, k - 1, &one, &other), p->all->middle * p->all->radius[p->body]);
    if (p->from->bar < 2)
        return;
    /* A bin's walls are upright. */
    double top = p->from->centre[2] + p->from->half[2] + p->needed;
    for (; k > 0; k--) {
        one = body_at(p->all, p->on, p->body, k - 1);
        if (fmin(one.begin[2], one.end[2]) >= top)
            break;
    }
    p->inside = k ? k : p->on->n;
}

/* Every sample from k to last: what is missing at most of the distance that is needed. */
static void look_closely(pair *p, int64_t k, int64_t last)
{
    segment a, b = {{0}, {0}}, c, d = {{0}, {0}};
    double near = distance_at(p, k, &a, &b), left = p->needed;
    for (int64_t i = k; i <= last; i++) {
        segment before = body_at(p->all, p->on, p->body, i ? i - 1 : 0);
        double here = distance_at(p, i, &c, &d), least = needed_at(p, i, step_of(&before, &c));
        double step = step_of(&a, &c) + (p->from ? 0.0 : step_of(&b, &d));
        double lack = fmax(left, least) - (near + here - step) / 2.0;
        if (i > k && lack > p->worst) {
            p->worst = lack;
            p->when = time_at(p->on, i - 1);
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
        way += travelled(p->all, p->on, body, first, last);
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
static double missing(const bodies *all, const track *on, int64_t body, const solid *from, int64_t other,
                      double needed, double *when)
{
    segment one, two;
    pair p = {all, on, body, other, from, needed, INFINITY, -INFINITY, 0.0, on->n};
    double near = distance_at(&p, 0, &one, &two), far = distance_at(&p, on->n - 1, &one, &two);
    if (from && on->flying && body >= all->links)
        look_at_end(&p);
    look_between(&p, 0, near, on->n - 1, far);
    *when = p.when;
    return p.worst;
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

/* Bodies of a track, from `from` on, that are too near to something; how many are found. */
static int64_t look(const bodies *all, const track *on, int64_t from, contact *found)
{
    int64_t count = 0, bodies_here = all->links + on->bar;
    double when, flying = (double)on->flying;
    for (int64_t s = 0; s < all->solids; s++)
        for (int64_t b = from; b < bodies_here; b++) {
            const solid *solid = all->around + s;
            if (b < all->links ? !all->moves[b] : !solid->bar)
                continue;
            double lack = missing(all, on, b, solid, 0, all->radius[b] + solid->clearance, &when);
            if (lack > ROUNDING)
                found[count++] = (contact){(double)b, flying, (double)s, lack, when};
        }
    const int64_t *meet = all->meet;
    for (int64_t i = 0; i < pairs_on(all, on); i++, meet += 2) {
        if (meet[1] >= bodies_here || meet[1] < from)
            continue;
        double lack = missing(all, on, meet[1], NULL, meet[0], apart_of(all, i), &when);
        if (lack > ROUNDING)
            found[count++] = (contact){(double)meet[1], flying, (double)(-1 - meet[0]), lack, when};
    }
    return count;
}

int64_t near_arm(const course *c, contact *found)
{
    if (!c->t->arm->arm)
        return 0;
    track on = {.c = c, .n = c->ticks, .ticks = c->ticks};
    return look(c->t->bodies, &on, 0, found);
}

/* Places the arm at `count` instants of a track's own; each has the tick `beside` it. */
static void place_own(track *on, int64_t count, const int64_t *beside)
{
    const linkage *a = on->c->t->arm;
    int64_t piece = 0;
    for (int64_t k = 0; k < count && a->arm; k++) {
        double q[AXES], *angle = on->angle + k * a->n;
        coordinates_at(on->c->t->motion, on->time[k], &piece, q);
        place_arm(a, q, on->joint + 4 * k * a->n, angle);
        for (int64_t i = 0; i < a->n && beside; i++) {
            int64_t there = beside[k] * a->n + i;
            double turn = fabs(angle[i] - on->c->angle[there]);
            on->turned[k * a->n + i] = on->c->turned[there] + (k ? turn : -turn);
        }
    }
}

int64_t near_object(const course *c, const thrown *s, int64_t nodes, const double *rows, contact *found)
{
    const bodies *all = c->t->bodies;
    const double tick = c->t->tick, lands = s->detach + s->flight;
    int64_t n = c->t->arm->n, own = nodes > 2 ? nodes : 2, count;
    double *room = malloc(sizeof(double) * (size_t)(own * (2 + 6 * n)));
    if (!room)
        return -1;
    int64_t carried = (int64_t)fmax(ceil(s->opening / tick), 0.0);
    carried = carried < c->ticks ? carried : c->ticks;
    track on = {.c = c, .s = s, .n = carried + nodes, .ticks = carried, .bar = all->bar, .com = rows};
    on.far = far_of(all, s->behind);
    on.cosine = cos(s->angle);
    on.sine = sin(s->angle);
    on.time = room;
    on.moved = room + own;
    on.angle = room + 2 * own;
    on.turned = on.angle + n * own;
    on.joint = on.turned + n * own;
    for (int64_t k = 0; k < nodes; k++)
        on.time[k] = rows[4 * k];
    place_own(&on, nodes, NULL);
    for (int64_t k = 0; k < nodes; k++) {
        double com[3], before[3];
        int64_t at = carried + k;
        for (int64_t i = 0; i < n; i++)
            on.turned[k * n + i] = !at || !c->t->arm->arm ? 0.0
                : turned_at(&on, at - 1, i) + fabs(on.angle[k * n + i]
                    - (k ? on.angle[(k - 1) * n + i] : c->angle[(carried - 1) * n + i]));
        on.moved[k] = 0.0;
        if (!at)
            continue;
        object_at(&on, at - 1, before);
        object_at(&on, at, com);
        on.moved[k] = moved_until(&on, at - 1) + length(com[0] - before[0], com[1] - before[1])
            + on.far * fabs(com[2] - before[2]);
    }
    count = on.n ? look(all, &on, all->links, found) : 0;
    int64_t first = (int64_t)floor(s->detach / tick) + 1, last = (int64_t)ceil(lands / tick) - 1;
    int64_t beside[2] = {at_tick(c, first), at_tick(c, last)};
    on.first = first;
    on.before = 1;
    on.ticks = last >= first ? last - first + 1 : 0;
    on.n = on.ticks + 2;
    on.flying = 1;
    on.time[0] = s->detach;
    on.time[1] = lands;
    place_own(&on, 2, beside);
    count += look(all, &on, all->links, found + count);
    free(room);
    return count;
}

CLONES EXPORT int64_t near_track(const bodies *all, int64_t n, int64_t bar, int64_t flying,
                                 const double *times, const double *ends, contact *found)
{
    int64_t count = all->links + bar;
    double *travel = malloc(sizeof(double) * (size_t)(n * count + 1));
    track on = {.n = n, .flying = flying, .bar = bar, .times = times, .ends = ends, .travel = travel};
    if (!travel)
        return -1;
    for (int64_t b = 0; b < count; b++)
        for (int64_t k = 0; k < n; k++) {
            segment here = body_at(all, &on, b, k), last = body_at(all, &on, b, k ? k - 1 : 0);
            travel[b * n + k] = step_of(&last, &here) + (k ? travel[b * n + k - 1] : 0.0);
        }
    count = look(all, &on, 0, found);
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

CLONES EXPORT void rooms(const bodies *all, int64_t n, int64_t bar, int64_t flying,
                         const double *times, const double *ends, double *room)
{
    track on = {.n = n, .flying = flying, .bar = bar, .times = times, .ends = ends};
    for (int64_t k = 0; k < n; k++)
        room[k] = INFINITY;
    for (int64_t s = 0; s < all->solids; s++)
        for (int64_t b = 0; b < all->links + bar; b++) {
            const solid *from = all->around + s;
            if (b < all->links ? !all->moves[b] : !from->bar)
                continue;
            double needed = all->radius[b] + from->clearance;
            pair p = {all, &on, b, 0, from, needed, INFINITY, 0.0, 0.0, n};
            if (flying && b >= all->links && n)
                look_at_end(&p);
            room_of(&p, room);
        }
    const int64_t *meet = all->meet;
    for (int64_t i = 0; i < pairs_on(all, &on); i++, meet += 2) {
        if (meet[1] >= all->links + bar)
            continue;
        double needed = apart_of(all, i);
        pair p = {all, &on, meet[1], meet[0], NULL, needed, INFINITY, 0.0, 0.0, n};
        room_of(&p, room);
    }
}

CLONES EXPORT int64_t overlaps(int64_t count, const linkage *arm, const bodies *all, const double *q,
                               const double *com, double *deepest)
{
    int64_t links = all->links, bar = com ? all->bar : 0;
    segment *ends = malloc(sizeof(segment) * (size_t)(links + all->bar));
    double *middle = malloc(sizeof(double) * 4 * (size_t)(links + all->bar));
    for (int64_t k = 0; ends && middle && k < count; k++, q += arm->n) {
        double joint[4 * AXES], angle[AXES];
        place_arm(arm, q, joint, angle);
        for (int64_t b = 0; b < links + bar; b++) {
            int64_t by = b < links ? all->moved_by[b] : -1;
            ends[b] = b < links ? link_at(all, b, by < 0 ? NULL : joint + 4 * by)
                                : part_at(all, b - links, com + 3 * k, all->behind);
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
            if (meet[1] >= links + bar)
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
