/* What a verdict measures of throws: use of the grip, and how near bar, hand and arm come to things. What
   depends on the motion alone is laid in tables once; each throw looks at these. Eight instants at a time. */
#define LANES 8
#include "functions.h"
#include "course.h"

#include <stdlib.h>

/* The way into a cup: instants on which it is sought, from detach until BEYOND [s] after the landing;
   bisections that locate its ends; instants at which the clearance is measured, and how often it is
   measured anew around the least: a corner that passes the rim is near it for a moment only. */
#define COARSE 48
#define BISECTIONS 15
#define FINE 24
#define ROUNDS 3
#define BEYOND 0.3
/* The acceleration may step at a kink: it is seen from either side so far away [s]. */
#define INSIDE 1e-12

typedef struct {
    lane x, z, cos, sin;
} pose;

INLINE double least(const lane v)
{
    double found = v[0];
    for (int l = 1; l < LANES; l++)
        found = v[l] < found ? v[l] : found;
    return found;
}

/* Takes up the least of some values at times [s]. */
INLINE void lower(extreme *e, const lane found, const lane time)
{
    if (least(found) < e->value)
        for (int l = 0; l < LANES; l++)
            if (found[l] < e->value)
                *e = (extreme){found[l], time[l]};
}

#define LESSER(a, b) ((a) < (b) ? (a) : (b))
#define GREATER(a, b) ((a) > (b) ? (a) : (b))

/* A box lies along its axis from `first` to `last`, `half` to either side. */
typedef struct {
    double first, last, half;
} box;

/* The thrown object: a bar, or capsules in its frame (`outline` of `scene`). reach: from its CoM to its
   farthest point. */
typedef struct {
    box bar;
    int64_t parts;
    const double *outline;
    double reach;
} object;

/* behind [m]: its CoM, from the bar's first end. */
INLINE object object_of(const scene *s, double behind)
{
    double ahead = s->length - behind;
    object o = {{-behind, ahead, s->half_width}, s->parts, s->outline,
                length(GREATER(behind, ahead), s->half_width)};
    return o;
}

/* Part k of an object at poses: the bar; or a capsule's axis, as a box without width at poses of its own.
   The radius around it. */
INLINE double part_of(const object *o, const pose *at, int64_t k, box *part, pose *there)
{
    if (!o->parts) {
        *part = o->bar;
        *there = *at;
        return 0.0;
    }
    const double *c = o->outline + 5 * k;
    double along = c[2] - c[0], across = c[3] - c[1], size = length(along, across);
    double cosine = size > 0.0 ? along / size : 1.0, sine = size > 0.0 ? across / size : 0.0;
    double x = (c[0] + c[2]) / 2.0 + o->bar.first, z = (c[1] + c[3]) / 2.0;
    *part = (box){-size / 2.0, size / 2.0, 0.0};
    EACH_LANE {
        there->x[l] = at->x[l] + at->cos[l] * x - at->sin[l] * z;
        there->z[l] = at->z[l] + at->sin[l] * x + at->cos[l] * z;
        there->cos[l] = at->cos[l] * cosine - at->sin[l] * sine;
        there->sin[l] = at->sin[l] * cosine + at->cos[l] * sine;
    }
    return c[4];
}

/* Takes into `least` the least over an object's parts of what MEASURE writes to `found`, less their radii. */
#define EACH_PART(o, at, least, MEASURE)                                                           \
    do {                                                                                           \
        EACH_LANE (least)[l] = INFINITY;                                                           \
        for (int64_t k_ = 0; k_ < ((o)->parts ? (o)->parts : 1); k_++) {                           \
            box part;                                                                              \
            pose there;                                                                            \
            lane found;                                                                            \
            double radius = part_of(o, at, k_, &part, &there);                                     \
            MEASURE;                                                                               \
            EACH_LANE {                                                                            \
                double away = found[l] - radius;                                                   \
                (least)[l] = LESSER((least)[l], away);                                             \
            }                                                                                      \
        }                                                                                          \
    } while (0)

static const int ALONG[5] = {0, 1, 1, 0, 0}, ACROSS[5] = {-1, -1, 1, 1, -1};

/* Corner k of a box at poses. */
INLINE void corner_of(const box *b, const pose *at, int k, lane x, lane z)
{
    double along = ALONG[k] ? b->last : b->first, across = ACROSS[k] * b->half;
    EACH_LANE {
        x[l] = at->x[l] + at->cos[l] * along - at->sin[l] * across;
        z[l] = at->z[l] + at->sin[l] * along + at->cos[l] * across;
    }
}

INLINE void lowest_of(const box *b, const pose *at, lane z)
{
    lane place[4], numbers[3], lowest[1];
    EACH_LANE {
        place[0][l] = at->x[l];
        place[1][l] = at->z[l];
        place[2][l] = at->cos[l];
        place[3][l] = at->sin[l];
        numbers[0][l] = b->first;
        numbers[1][l] = b->last;
        numbers[2][l] = b->half;
    }
    box_lowest(place, numbers, lowest);
    EACH_LANE z[l] = lowest[0][l];
}

/* Squared distance of one box's corners from another, and whether they are apart along the other's
   axes. */
INLINE void corners_from(const box *b, const pose *at, const box *other, const pose *seen,
                         lane square, lane apart)
{
    lane first, last, low, high;
    for (int k = 0; k < 4; k++) {
        lane x, z;
        corner_of(b, at, k, x, z);
        EACH_LANE {
            double dx = x[l] - seen->x[l], dz = z[l] - seen->z[l];
            double along = seen->cos[l] * dx + seen->sin[l] * dz;
            double across = seen->cos[l] * dz - seen->sin[l] * dx;
            double over = GREATER(other->first - along, along - other->last);
            double aside = fabs(across) - other->half;
            over = GREATER(over, 0.0);
            aside = GREATER(aside, 0.0);
            double found = over * over + aside * aside;
            square[l] = LESSER(square[l], found);
            first[l] = k && first[l] < along ? first[l] : along;
            last[l] = k && last[l] > along ? last[l] : along;
            low[l] = k && low[l] < across ? low[l] : across;
            high[l] = k && high[l] > across ? high[l] : across;
        }
    }
    EACH_LANE {
        double over = GREATER(first[l] - other->last, other->first - last[l]);
        double aside = GREATER(low[l] - other->half, -other->half - high[l]);
        over = GREATER(over, aside);
        apart[l] = GREATER(apart[l], over);
    }
}

/* Distance between two boxes; below 0, where they overlap, how deep. Boxes that do not overlap are apart
   along an axis of one of them, and a corner of one is nearest to the other. */
INLINE void between(const box *one, const pose *here, const box *other, const pose *there, lane d)
{
    lane square, apart;
    EACH_LANE {
        square[l] = INFINITY;
        apart[l] = -INFINITY;
    }
    corners_from(one, here, other, there, square, apart);
    corners_from(other, there, one, here, square, apart);
    EACH_LANE d[l] = apart[l] > 0.0 ? sqrt(square[l]) : apart[l];
}

/* Signed distance of a box from a column from the ground up: the least of max(|x| - radius,
   z - height) on its outline. Along an edge that has its least at an end, or where two of the three
   planes meet. */
INLINE void from_column(const box *b, const pose *at, double radius, double height, lane d)
{
    lane x0, z0, x1, z1;
    EACH_LANE d[l] = INFINITY;
    corner_of(b, at, 0, x0, z0);
    for (int k = 1; k < 5; k++) {
        corner_of(b, at, k, x1, z1);
        EACH_LANE {
            double above0 = z0[l] - height, above1 = z1[l] - height;
            double begin[3] = {x0[l], x0[l] - radius - above0, -x0[l] - radius - above0};
            double end[3] = {x1[l], x1[l] - radius - above1, -x1[l] - radius - above1};
            for (int i = 0; i < 3; i++) {
                double t = begin[i] / (begin[i] - end[i]);
                t = t > 0.0 ? t : 0.0; /* NaN too */
                t = t < 1.0 ? t : 1.0;
                double aside = fabs(x0[l] + t * (x1[l] - x0[l])) - radius;
                double above = above0 + t * (above1 - above0);
                above = GREATER(aside, above);
                d[l] = LESSER(d[l], above);
            }
            double aside = fabs(x0[l]) - radius;
            aside = GREATER(aside, above0);
            d[l] = LESSER(d[l], aside);
            x0[l] = x1[l];
            z0[l] = z1[l];
        }
    }
}

/* Takes up the least distance of bars from the column, if it is in their reach. */
INLINE void near_column(const scene *s, const object *o, const pose *bar, const lane time, extreme *e)
{
    lane away, distance;
    if (s->column_radius < 0.0)
        return;
    EACH_LANE {
        double aside = fabs(bar->x[l]) - s->column_radius, above = bar->z[l] - s->column_height;
        away[l] = GREATER(aside, above);
    }
    if (!(least(away) < o->reach))
        return;
    EACH_PART(o, bar, distance, from_column(&part, &there, s->column_radius, s->column_height, found));
    EACH_LANE distance[l] = away[l] < o->reach ? distance[l] : INFINITY;
    lower(e, distance, time);
}

/* The held object at hands. */
INLINE void held_at(const thrown *s, const lane x, const lane z, const lane cosine, const lane sine, pose *bar)
{
    double c = cos(s->angle), d = sin(s->angle);
    EACH_LANE {
        bar->cos[l] = cosine[l] * c - sine[l] * d;
        bar->sin[l] = sine[l] * c + cosine[l] * d;
        bar->x[l] = x[l] + s->error[0] + s->com_offset * bar->cos[l];
        bar->z[l] = z[l] + s->error[1] + s->com_offset * bar->sin[l];
    }
}

/* The load that holds the object at hands: force and torque on it [N, N m]. */
INLINE void load_at(const throws *t, const thrown *s, lane hand[9], const pose *bar, lane load[3])
{
    lane held[4], gravity[1];
    EACH_LANE {
        held[0][l] = s->mass;
        held[1][l] = s->inertia;
        held[2][l] = s->com_offset * bar->cos[l];
        held[3][l] = s->com_offset * bar->sin[l];
        gravity[0][l] = t->around->gravity;
    }
    held_load(hand, held, gravity, load);
}

/* The object in a throw's hand at rows of a table of hands from k on; hands are read. */
INLINE void held_in(const thrown *s, double *const table[9], int64_t k, lane hand[9], pose *bar)
{
    lane cosine, sine;
    for (int i = 0; i < 9; i++)
        EACH_LANE hand[i][l] = table[i][k + l];
    EACH_LANE {
        cosine[l] = cos(hand[2][l]);
        sine[l] = sin(hand[2][l]);
    }
    held_at(s, hand[0], hand[1], cosine, sine, bar);
}

/* Squared use of the full grip by hands, with its sign turned. */
INLINE void use_of(const throws *t, const thrown *s, lane hand[9], const pose *bar, lane use)
{
    lane load[3], limit[2], share[1];
    load_at(t, s, hand, bar, load);
    EACH_LANE {
        limit[0][l] = s->force;
        limit[1][l] = s->torque / s->force;
    }
    grip_use(load, limit, share);
    EACH_LANE use[l] = -share[0][l];
}

/* Largest use of the full grip until the opening. */
INLINE extreme largest_use(const course *c, const thrown *s)
{
    const throws *t = c->t;
    extreme most = {0.0, 0.0};
    lane hand[9], use, time;
    pose bar;
    int64_t piece = 0;
    EACH_LANE time[l] = s->opening + INSIDE;
    moved_at(t->motion, t->arm, time, &piece, hand);
    EACH_LANE {
        bar.cos[l] = cos(hand[2][l] + s->angle);
        bar.sin[l] = sin(hand[2][l] + s->angle);
    }
    use_of(t, s, hand, &bar, use);
    lower(&most, use, time);
    for (int64_t k = 0; k < c->wide; k += LANES) {
        held_in(s, c->grip, k, hand, &bar);
        use_of(t, s, hand, &bar, use);
        EACH_LANE {
            time[l] = c->instant[k + l];
            use[l] = time[l] < s->opening ? use[l] : 0.0;
        }
        lower(&most, use, time);
    }
    most.value = sqrt(-most.value);
    return most;
}

INLINE void hold(const scene *s, const object *o, const pose *at, const lane time, measured *m)
{
    lane height;
    EACH_PART(o, at, height, lowest_of(&part, &there, found));
    lower(&m->held, height, time);
    near_column(s, o, at, time, &m->column_held);
}

/* The object until detach: heights and distances, and the torques that it asks for. */
INLINE void carry(const course *c, const thrown *s, const object *o, int64_t nodes, const double *track,
                  measured *m)
{
    const throws *t = c->t;
    int64_t n = t->torques ? t->arm->n : 0, k = 0;
    double before[AXES], change = 0.0;
    /* Until a tick after detach, whose load is gone. */
    for (; k < c->width && (k == 0 || c->time[k - 1] <= s->detach); k += LANES) {
        lane hand[9], load[3], time, left;
        pose bar, seen;
        held_in(s, c->hand, k, hand, &bar);
        EACH_LANE time[l] = c->time[k + l];
        if (time[0] < s->opening) {
            /* Instants after the opening's start count as the last before it. */
            int last = 0;
            for (int l = 1; l < LANES; l++)
                last = time[l] < s->opening ? l : last;
            seen = bar;
            for (int l = last + 1; l < LANES; l++) {
                seen.x[l] = bar.x[last];
                seen.z[l] = bar.z[last];
                seen.cos[l] = bar.cos[last];
                seen.sin[l] = bar.sin[last];
            }
            hold(t->around, o, &seen, time, m);
        }
        if (!n)
            continue;
        load_at(t, s, hand, &bar, load);
        EACH_LANE {
            double share = (s->detach - time[l]) / (s->detach - s->opening);
            share = GREATER(share, 0.0);
            left[l] = LESSER(share, 1.0);
        }
        for (int64_t i = 0; i < n; i++) {
            double most = t->torques->limit[i], last = before[i];
            lane share, total;
            EACH_LANE {
                double held = c->by[0][i][k + l] * load[0][l] + c->by[1][i][k + l] * load[1][l]
                    + c->by[2][i][k + l] * load[2][l];
                double empty = c->free[i][k + l];
                total[l] = empty + left[l] * held;
                share[l] = time[l] <= s->detach ? -fabs(empty + held) : 0.0;
            }
            lower(&m->torque[i], share, time);
            before[i] = total[LANES - 1];
            for (int l = 0; l < LANES; l++) {
                double step = k || l ? fabs(total[l] - last) * most : 0.0;
                change = step > change ? step : change;
                last = total[l];
            }
        }
    }
    if (n) {
        int64_t rest = k < c->ticks ? k - (k > 0) : c->ticks - 1;
        m->rate = GREATER(change, c->jump[rest]) / t->tick;
    }
    /* From the opening on the pads may bear all of the object or nothing. */
    int64_t open = (int64_t)fmin(fmax(ceil(s->opening / t->tick), 0.0), (double)(c->ticks - 1));
    for (int64_t i = 0; i < n; i++) {
        int64_t at = (int64_t)c->empty[i][open];
        if (fabs(c->free[i][at]) > -m->torque[i].value)
            m->torque[i] = (extreme){-fabs(c->free[i][at]), c->time[at]};
        m->torque[i].value = -m->torque[i].value;
    }
    for (k = 0; k < nodes; k += LANES) {
        pose at;
        lane time;
        EACH_LANE {
            const double *node = track + 4 * (k + l < nodes ? k + l : nodes - 1);
            time[l] = node[0];
            at.x[l] = node[1];
            at.z[l] = node[2];
            at.cos[l] = cos(node[3]);
            at.sin[l] = sin(node[3]);
        }
        hold(t->around, o, &at, time, m);
    }
}

/* A flying bar at times after detach [s]. */
INLINE void flown(const double start[6], double gravity, const lane time, pose *bar)
{
    EACH_LANE {
        double at[3];
        flight_pose(start, time[l], gravity, at);
        bar->x[l] = at[0];
        bar->z[l] = at[1];
        bar->cos[l] = cos(at[2]);
        bar->sin[l] = sin(at[2]);
    }
}

/* The bar in flight beside the column and the hand's body, at detach, at ticks, and at the landing. */
INLINE void fly(const course *c, const thrown *s, const object *o, const box *body, measured *m)
{
    const throws *t = c->t;
    const scene *around = t->around;
    const double *e = s->error;
    int column = around->column_radius >= 0.0, palm = around->palm_clearance >= 0.0;
    double far = o->reach + around->palm_clearance
        + length(GREATER(fabs(body->first), fabs(body->last)), body->half);
    int64_t first = (int64_t)floor(s->detach / t->tick) + 1, last = (int64_t)ceil((s->detach + s->flight) / t->tick);
    for (int64_t k = first - 1; k <= last && (column || palm); k += LANES) {
        lane clock, time, away, gap;
        pose at, hand;
        EACH_LANE {
            double tick = t->tick * (double)(k + l);
            clock[l] = LESSER(GREATER(tick, s->detach), s->detach + s->flight);
            time[l] = clock[l] - s->detach;
        }
        flown(s->start, around->gravity, time, &at);
        if (column)
            near_column(around, o, &at, clock, &m->column_flown);
        if (!palm)
            continue;
        /* The first is between two ticks, as the last. */
        if (k < first || k + LANES > last) {
            lane moved[9];
            int64_t piece = 0;
            moved_at(t->motion, t->arm, clock, &piece, moved);
            EACH_LANE {
                hand.x[l] = moved[0][l];
                hand.z[l] = moved[1][l];
                hand.cos[l] = cos(moved[2][l]);
                hand.sin[l] = sin(moved[2][l]);
            }
        } else
            EACH_LANE {
                int64_t tick = at_tick(c, k + l);
                hand.x[l] = c->hand[0][tick];
                hand.z[l] = c->hand[1][tick];
                hand.cos[l] = c->cosine[tick];
                hand.sin[l] = c->sine[tick];
            }
        EACH_LANE {
            double since = clock[l] - s->opening, turn = e[2] + e[5] * since;
            double cosine = hand.cos[l], sine = hand.sin[l], cos_off = cos(turn), sin_off = sin(turn);
            hand.x[l] += e[0] + e[3] * since;
            hand.z[l] += e[1] + e[4] * since;
            hand.cos[l] = cosine * cos_off - sine * sin_off;
            hand.sin[l] = sine * cos_off + cosine * sin_off;
            double dx = at.x[l] - hand.x[l], dz = at.z[l] - hand.z[l];
            away[l] = dx * dx + dz * dz;
        }
        if (least(away) >= far * far)
            continue;
        EACH_PART(o, &at, gap, between(&part, &there, body, &hand, found));
        EACH_LANE gap[l] = away[l] < far * far ? gap[l] : INFINITY;
        lower(&m->palm, gap, clock);
        for (int l = 0; l < LANES; l++)
            if (gap[l] <= GREATER(around->palm_clearance - 1e-6, 0.0))
                m->palm_time = fmin(m->palm_time, time[l]);
    }
}

/* Depth of the lowest corner below the rim's plane, `time` after detach. */
INLINE void depths(const scene *s, const double start[6], const object *o, const lane time, lane depth)
{
    pose at;
    flown(start, s->gravity, time, &at);
    EACH_PART(o, &at, depth, lowest_of(&part, &there, found));
    EACH_LANE depth[l] = s->cup_rim - depth[l];
}

/* The highest point of a box, below 0. */
INLINE void highest_of(const box *b, const pose *at, lane found)
{
    EACH_LANE {
        double first = b->first * at->sin[l], last = b->last * at->sin[l];
        found[l] = -(at->z[l] + GREATER(first, last) + b->half * fabs(at->cos[l]));
    }
}

/* How far the way in is over, `time` after detach: the lowest corner is `cup_insertion` below the rim; of a bin
   the highest corner is at the rim, or the lowest at the bottom. */
INLINE void entry_excess(const scene *s, const double start[6], const object *o, const lane time, lane over)
{
    pose at;
    lane below;
    depths(s, start, o, time, over);
    if (s->bin_depth < 0.0) {
        EACH_LANE over[l] -= s->cup_insertion;
        return;
    }
    flown(start, s->gravity, time, &at);
    EACH_PART(o, &at, below, highest_of(&part, &there, found));
    EACH_LANE {
        double whole = s->cup_rim + below[l], deep = over[l] - s->bin_depth;
        over[l] = GREATER(whole, deep);
    }
}

/* Clearance of the corners of a bar, or of a capsule's axis, below the rim to the wall, and of the rim to it. */
INLINE void clearance_of(const scene *s, double cup_x, const box *bar, const pose *at, lane found)
{
    EACH_LANE found[l] = INFINITY;
    for (int k = 0; k < 4; k++) {
        lane x, z;
        corner_of(bar, at, k, x, z);
        EACH_LANE {
            double free = s->cup_radius - fabs(x[l] - cup_x);
            free = z[l] <= s->cup_rim ? free : INFINITY;
            found[l] = LESSER(found[l], free);
        }
    }
    for (int side = -1; side <= 1; side += 2)
        EACH_LANE {
            double x = cup_x + side * s->cup_radius - at->x[l], z = s->cup_rim - at->z[l];
            double along = at->cos[l] * x + at->sin[l] * z, across = at->cos[l] * z - at->sin[l] * x;
            double over = GREATER(bar->first - along, along - bar->last);
            double aside = fabs(across) - bar->half;
            over = GREATER(over, 0.0);
            aside = GREATER(aside, 0.0);
            double away = sqrt(over * over + aside * aside);
            found[l] = LESSER(found[l], away);
        }
}

/* The least of them over the object's parts. */
INLINE void clearances(const scene *s, double cup_x, const double start[6], const object *o, const lane time,
                       lane nearest)
{
    pose at;
    flown(start, s->gravity, time, &at);
    EACH_PART(o, &at, nearest, clearance_of(s, cup_x, &part, &there, found));
}

/* When between low and high [s] the lowest corner passes a depth, or, `ends`, the way in is over: the first
   instant found at which it is so. A bar without width that falls level is below the rim all at once, and then. */
INLINE double passes(const scene *s, const double start[6], const object *o, double low, double high,
                     double level, int ends)
{
    for (int i = 0; i < BISECTIONS; i += 3) {
        /* Seven instants between the two: three bisections at once. */
        lane time, depth;
        EACH_LANE time[l] = low + (high - low) * (l + 1) / 8.0;
        if (ends)
            entry_excess(s, start, o, time, depth);
        else
            depths(s, start, o, time, depth);
        int first = 7;
        for (int l = 6; l >= 0; l--)
            if (depth[l] >= level)
                first = l;
        double begin = first ? time[first - 1] : low;
        high = first < 7 ? time[first] : high;
        low = begin;
    }
    return high;
}

/* Least clearance on the way into the cup, as a cup that moves sees it: from the lower end's passing the
   rim's plane, or a plane `bin_lead` above it, until the way in is over (`entry_excess`), the least distance of
   outline and wall or rim, negative outside. -infinity for a bar that misses it. Where the outline passes
   the rim's height it is no nearer to the wall than the rim is to the bar. */
INLINE double enter(const scene *s, double cup_x, const double from[6], double flight, const object *o)
{
    double speed = s->cup_speed, start[6];
    for (int i = 0; i < 6; i++)
        start[i] = from[i];
    start[0] += speed * flight;
    start[3] -= speed;
    double times[COARSE], depth[COARSE], over[COARSE], lead = -s->bin_lead;
    for (int k = 0; k < COARSE; k += LANES) {
        lane time, found, ended;
        EACH_LANE time[l] = (flight + BEYOND) * (k + l) / (COARSE - 1.0);
        depths(s, start, o, time, found);
        entry_excess(s, start, o, time, ended);
        EACH_LANE {
            times[k + l] = time[l];
            depth[k + l] = found[l];
            over[k + l] = ended[l];
        }
    }
    int deep = 0, above = -1;
    /* An object below a bin's rim outside, before it rises above it, is not in the bin. */
    if (s->bin_depth >= 0.0)
        for (int k = 0; k < COARSE && times[k] <= flight; k++)
            deep = depth[k] < lead ? k : deep;
    while (deep < COARSE && !(over[deep] >= 0.0))
        deep++;
    for (int k = 0; k < deep && deep < COARSE; k++)
        above = depth[k] < lead ? k : above;
    if (above < 0)
        return -INFINITY;
    double begin = passes(s, start, o, times[above], times[above + 1], lead, 0), found = INFINITY;
    double end = passes(s, start, o, times[deep - 1], times[deep], 0.0, 1);
    for (int round = 0; round < ROUNDS; round++) {
        double nearest = INFINITY, step = (end - begin) / (FINE - 1);
        int where = 0;
        for (int k = 0; k < FINE; k += LANES) {
            lane time, free;
            EACH_LANE time[l] = begin + (k + l) * step;
            clearances(s, cup_x, start, o, time, free);
            for (int l = 0; l < LANES; l++)
                if (free[l] < nearest) {
                    nearest = free[l];
                    where = k + l;
                }
        }
        found = fmin(found, nearest);
        end = begin + step * (where < FINE - 1 ? where + 1 : FINE - 1);
        begin += step * (where ? where - 1 : 0);
    }
    return found;
}

/* The instants before `until` [s] at which the grip is looked at: both sides of each kink, at most `step` apart
   between, and four inside each piece with kinks inside, along which the acceleration swings. What they are does
   not depend on `until`. How many; times: NULL to count them only. */
static int64_t grip_instants(const path *p, double step, double until, double *times)
{
    int64_t count = 0, corner = 0, swing = -1, at = 0;
    double last = p->breaks[p->pieces];
    for (double begin = p->breaks[0], end; begin < until && begin < last; begin = end) {
        while (corner < p->corners && !(p->kinks[corner] > begin))
            corner++;
        end = corner < p->corners && p->kinks[corner] < last ? p->kinks[corner] : last;
        int64_t parts = (int64_t)ceil((end - begin) / step);
        for (int64_t i = 0; i <= parts; i++) {
            double share = (double)i / (double)(parts > 1 ? parts : 1);
            double time = begin + INSIDE + (end - begin - 2.0 * INSIDE) * share;
            if (!(time < until))
                break;
            if (times)
                times[count] = time;
            count++;
        }
    }
    for (int64_t k = 0; k < p->corners; k++) {
        at = piece_of(p, p->kinks[k], at);
        if (at == swing || !(p->kinks[k] > p->breaks[at]))
            continue;
        swing = at;
        for (int i = 1; i < 5; i++) {
            double time = p->breaks[at] + (p->breaks[at + 1] - p->breaks[at]) * (0.2 * i);
            if (time < until && times)
                times[count] = time;
            count += time < until;
        }
    }
    return count;
}

/* Torques of the joints at ticks from k on, by Newton and Euler, as shares of their limits: with an empty hand,
   and by unit loads at the hand. */
INLINE void lay_torques(const course *c, int64_t k, lane joints[AXES + 1][6], lane pushes[AXES][3])
{
    const linkage *a = c->t->arm;
    const double *most = c->t->torques->limit;
    lane total[4][3], torque[1];
    EACH_LANE {
        double x = c->hand[0][k + l], z = c->hand[1][k + l];
        /* About the origin. */
        const double loads[4][3] = {{0.0, 0.0, 0.0}, {1.0, 0.0, -z}, {0.0, 1.0, x}, {0.0, 0.0, 1.0}};
        for (int w = 0; w < 4; w++)
            for (int r = 0; r < 3; r++)
                total[w][r][l] = loads[w][r];
    }
    for (int64_t i = a->n - 1; i >= 0; i--)
        for (int w = 0; w < 4; w++) {
            for (int r = 0; r < 3 && !w; r++)
                EACH_LANE total[0][r][l] += pushes[i][r][l];
            joint_torque(joints[i], total[w], torque);
            double *row = (w ? c->by[w - 1][i] : c->free[i]) + k;
            EACH_LANE row[l] = torque[0][l] / most[i];
        }
}

/* The motion's ticks from k on; m: takes up heights and speeds of the arm. */
INLINE void lay_ticks(const course *c, int64_t k, int64_t *piece, const box *body, measured *m)
{
    const throws *t = c->t;
    const linkage *a = t->arm;
    const scene *s = t->around;
    const torques *b = t->torques;
    lane time, q[3][AXES], turned[3], link[2], numbers[4], gravity[1], hand[9], lowest;
    lane joints[AXES + 1][6], pushes[AXES][3], c_[AXES], d_[AXES];
    EACH_LANE time[l] = c->time[k + l];
    states_at(t->motion, time, piece, q);
    EACH_LANE gravity[0][l] = s->gravity;
    first_joint(a, turned, joints[0]);
    for (int64_t i = 0; i < a->n && a->arm; i++) {
        next_link(a, i, q, turned, link);
        link_end(joints[i], turned, link, joints[i + 1]);
        EACH_LANE {
            c_[i][l] = cos(turned[0][l]);
            d_[i][l] = sin(turned[0][l]);
            if (k + l < c->ticks) {
                double *j = c->joint + 4 * ((k + l) * a->n + i);
                j[0] = joints[i][0][l];
                j[1] = joints[i][1][l];
                j[2] = c_[i][l];
                j[3] = d_[i][l];
                c->angle[(k + l) * a->n + i] = turned[0][l];
            }
        }
        if (b) {
            EACH_LANE {
                numbers[0][l] = b->mass[i];
                numbers[1][l] = b->along[i];
                numbers[2][l] = b->up[i];
                numbers[3][l] = b->inertia[i];
            }
            link_push(joints[i], turned, numbers, gravity, pushes[i]);
        }
    }
    if (a->arm)
        last_hand(a, joints[a->n], turned, hand);
    else
        for (int i = 0; i < 3; i++)
            for (int r = 0; r < 3; r++)
                EACH_LANE hand[3 * r + i][l] = i < a->n ? q[r][i][l] : r ? 0.0 : a->theta;
    for (int i = 0; i < 9; i++)
        EACH_LANE c->hand[i][k + l] = hand[i][l];
    pose at;
    EACH_LANE {
        at.x[l] = hand[0][l];
        at.z[l] = lowest[l] = hand[1][l];
        at.cos[l] = c->cosine[k + l] = cos(hand[2][l]);
        at.sin[l] = c->sine[k + l] = sin(hand[2][l]);
    }
    for (int64_t f = 0; f < a->frames && a->arm; f++) {
        int64_t i = a->link[f];
        EACH_LANE {
            double z = joints[i][1][l] + a->frame_along[f] * d_[i][l] + a->frame_up[f] * c_[i][l];
            lowest[l] = LESSER(lowest[l], z);
        }
    }
    lower(&m->arm, lowest, time);
    if (body->half >= 0.0) {
        lowest_of(body, &at, lowest);
        lower(&m->arm, lowest, time);
    }
    if (s->tool_length >= 0.0) {
        lane tool[1], velocity[2], fastest;
        EACH_LANE tool[0][l] = s->tool_length;
        flange_velocity(hand, tool, velocity);
        EACH_LANE {
            double flange = velocity[0][l] * velocity[0][l] + velocity[1][l] * velocity[1][l];
            double pads = hand[3][l] * hand[3][l] + hand[4][l] * hand[4][l];
            fastest[l] = -GREATER(flange, pads);
        }
        lower(&m->speed, fastest, time);
    }
    if (b)
        lay_torques(c, k, joints, pushes);
}

/* How far links and hand have turned and moved from tick to tick; from which tick on an empty hand asks for the
   most torque when. */
static void lay_ways(const course *c)
{
    const linkage *a = c->t->arm;
    for (int64_t k = 0; k < c->ticks; k++) {
        double way = 0.0, spun = 0.0;
        for (int64_t i = 0; i < a->n && a->arm && k; i++) {
            int64_t at = k * a->n + i;
            double turn = fabs(c->angle[at] - c->angle[at - a->n]);
            c->turned[at] = c->turned[at - a->n] + turn;
            way += turn * length(a->along[i], a->up[i]);
        }
        if (k) {
            spun = fabs(c->hand[2][k] - c->hand[2][k - 1]);
            if (!a->arm)
                way = length(c->hand[0][k] - c->hand[0][k - 1], c->hand[1][k] - c->hand[1][k - 1]);
        }
        for (int64_t i = 0; i < a->n && !k; i++)
            c->turned[i] = 0.0;
        c->way[k] = way + (k ? c->way[k - 1] : 0.0);
        c->spun[k] = spun + (k ? c->spun[k - 1] : 0.0);
    }
    for (int64_t k = c->ticks - 1; k >= 0 && c->t->torques; k--) {
        c->jump[k] = k + 1 < c->ticks ? c->jump[k + 1] : 0.0;
        for (int64_t i = 0; i < a->n; i++) {
            double *row = c->free[i], *from = c->empty[i];
            from[k] = k + 1 < c->ticks && fabs(row[(int64_t)from[k + 1]]) >= fabs(row[k]) ? from[k + 1] : (double)k;
            double step = k + 1 < c->ticks ? fabs(row[k + 1] - row[k]) * c->t->torques->limit[i] : 0.0;
            c->jump[k] = GREATER(c->jump[k], step);
        }
    }
}

/* The tables of a motion; 0 without memory. until [s]: the latest opening; m: takes up heights and speeds of
   the arm. */
INLINE int lay(course *c, const throws *t, double until, const box *body, measured *m)
{
    int64_t n = t->arm->n, block = LANES - 1, piece = 0;
    double end = t->motion->breaks[t->motion->pieces], **rows[15 + 5 * AXES];
    int64_t count = 0;
    c->t = t;
    c->ticks = (int64_t)ceil((end + t->tick) / t->tick);
    c->width = (c->ticks + block) / LANES * LANES;
    c->instants = grip_instants(t->motion, t->step, until, NULL);
    c->wide = (c->instants + block) / LANES * LANES;
    double **plain[] = {&c->time, &c->cosine, &c->sine, &c->way, &c->spun, &c->jump};
    for (int i = 0; i < 6; i++)
        rows[count++] = plain[i];
    for (int i = 0; i < 9; i++)
        rows[count++] = c->hand + i;
    for (int64_t i = 0; i < n && t->torques; i++) {
        rows[count++] = c->free + i;
        rows[count++] = c->empty + i;
        for (int w = 0; w < 3; w++)
            rows[count++] = c->by[w] + i;
    }
    size_t size = (size_t)(count * c->width + 6 * c->ticks * n + 10 * c->wide);
    double *next = c->room = malloc(sizeof(double) * size);
    if (!next)
        return 0;
    for (int64_t i = 0; i < count; i++, next += c->width)
        *rows[i] = next;
    c->joint = next;
    c->angle = (next += 4 * c->ticks * n);
    c->turned = (next += c->ticks * n);
    c->instant = (next += c->ticks * n);
    for (int i = 0; i < 9; i++)
        c->grip[i] = (next += c->wide);
    for (int64_t k = 0; k < c->width; k++)
        c->time[k] = t->tick * (double)(k < c->ticks ? k : c->ticks - 1);
    for (int64_t k = 0; k < c->width; k += LANES)
        lay_ticks(c, k, &piece, body, m);
    lay_ways(c);
    grip_instants(t->motion, t->step, until, c->instant);
    for (int64_t k = c->instants; k < c->wide; k++)
        c->instant[k] = k ? c->instant[k - 1] : 0.0;
    for (int64_t k = 0; k < c->wide; k += LANES) {
        lane time, hand[9];
        EACH_LANE time[l] = c->instant[k + l];
        moved_at(t->motion, t->arm, time, &piece, hand);
        for (int i = 0; i < 9; i++)
            EACH_LANE c->grip[i][k + l] = hand[i][l];
    }
    return 1;
}

CLONES EXPORT int64_t measure_throws(const throws *t, int64_t count, const thrown *each, int64_t nodes,
                                     const double *track, measured *found, int64_t room, contact *near,
                                     int64_t *nears)
{
    const scene *s = t->around;
    const box body = {-s->palm_back, -s->palm_front, s->palm_half_width};
    const extreme far = {INFINITY, 0.0}, none = {0.0, 0.0};
    measured arm = {.arm = far, .held = far, .column_held = far, .column_flown = far, .palm = far, .speed = none,
                    .palm_time = INFINITY, .cup = INFINITY};
    double latest = 0.0;
    course c;
    if (!count)
        return 0;
    for (int64_t k = 0; k < count; k++)
        latest = fmax(latest, each[k].opening);
    int there = lay(&c, t, latest, &body, &arm);
    arm.speed.value = sqrt(-arm.speed.value);
    int64_t still = 0;
    if (there && t->bodies)
        still = near_arm(&c, near);
    for (int64_t k = 0; k < count && there && still >= 0; k++, track += 4 * nodes) {
        const thrown *one = each + k;
        measured *m = found + k;
        const object o = object_of(s, one->behind);
        *m = arm;
        m->grip = largest_use(&c, one);
        nears[k] = 0;
        carry(&c, one, &o, nodes, track, m);
        if (!isfinite(one->flight))
            continue;
        fly(&c, one, &o, &body, m);
        if (s->cup_radius >= 0.0)
            m->cup = enter(s, one->cup_x, one->start, one->flight, &o);
        if (!t->bodies)
            continue;
        for (int64_t i = 0; i < still && k; i++)
            near[k * room + i] = near[i];
        int64_t more = near_object(&c, one, nodes, track, near + k * room + still);
        nears[k] = still + more;
        still = more < 0 ? more : still;
    }
    free(c.room);
    return !there || still < 0;
}

/* Poses [3][count] from one on; the last again where there are no more. */
INLINE void poses_at(const double *rows, int64_t count, int64_t first, pose *at)
{
    EACH_LANE {
        int64_t k = first + l < count ? first + l : count - 1;
        at->x[l] = rows[k];
        at->z[l] = rows[count + k];
        at->cos[l] = cos(rows[2 * count + k]);
        at->sin[l] = sin(rows[2 * count + k]);
    }
}

CLONES EXPORT void column_distances(const scene *s, int64_t count, const double *com, double *found)
{
    const object o = object_of(s, s->behind);
    for (int64_t k = 0; k < count; k += LANES) {
        pose at;
        lane distance;
        poses_at(com, count, k, &at);
        EACH_PART(&o, &at, distance, from_column(&part, &there, s->column_radius, s->column_height, found));
        for (int l = 0; l < LANES && k + l < count; l++) {
            double aside = fabs(at.x[l]) - s->column_radius, above = at.z[l] - s->column_height;
            found[k + l] = GREATER(aside, above) < o.reach ? distance[l] : INFINITY;
        }
    }
}

CLONES EXPORT void palm_distances(const scene *s, int64_t count, const double *com, const double *hand,
                                  double *found)
{
    const object o = object_of(s, s->behind);
    const box body = {-s->palm_back, -s->palm_front, s->palm_half_width};
    for (int64_t k = 0; k < count; k += LANES) {
        pose at, hand_at;
        lane distance;
        poses_at(com, count, k, &at);
        poses_at(hand, count, k, &hand_at);
        EACH_PART(&o, &at, distance, between(&part, &there, &body, &hand_at, found));
        for (int l = 0; l < LANES && k + l < count; l++)
            found[k + l] = distance[l];
    }
}

EXPORT double flight_time(const double *start, double height, double gravity)
{
    return fall_time(start, height, gravity);
}

CLONES EXPORT void cup_entries(const scene *s, int64_t count, const double *detach, const double *flight,
                               double *found)
{
    const object o = object_of(s, s->behind);
    for (int64_t k = 0; k < count; k++)
        found[k] = isfinite(flight[k]) ? enter(s, s->cup_x, detach + 6 * k, flight[k], &o) : -INFINITY;
}
