/* What a check measures of a throw: use of the grip, and how near bar, hand and arm come to things.
   Eight instants at a time. */
#define LANES 8
#include "functions.h"
#include "surface.h"
#include "throw.h"

#include <stddef.h>

/* Instants of a flight at which its surroundings are measured, at even shares of it. */
#define FLIGHT_SAMPLES 400
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

INLINE object object_of(const scene *s)
{
    object o = {{-s->behind, s->ahead, s->half_width}, s->parts, s->outline,
                length(GREATER(s->behind, s->ahead), s->half_width)};
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
    EACH_LANE {
        double end = LESSER(b->first * at->sin[l], b->last * at->sin[l]);
        z[l] = at->z[l] + end - b->half * fabs(at->cos[l]);
    }
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

/* Hands at times [s], and heights of what moves lowest of arm and hand. */
INLINE void hands_at(const throw *t, const lane time, int64_t *piece, pose *hand, lane theta,
                     lane lowest)
{
    const linkage *a = t->arm;
    lane q[AXES], height[AXES], c[AXES], d[AXES], angle;
    for (int l = 0; l < LANES; l++) {
        double at[AXES];
        coordinates_at(t->motion, time[l], piece, at);
        for (int64_t i = 0; i < a->n; i++)
            q[i][l] = at[i];
    }
    if (!a->arm) {
        EACH_LANE {
            hand->x[l] = q[0][l];
            hand->z[l] = lowest[l] = q[1][l];
            theta[l] = a->n > 2 ? q[2][l] : a->theta;
        }
    } else {
        EACH_LANE {
            angle[l] = 0.0;
            hand->x[l] = a->x;
            hand->z[l] = a->z;
        }
        for (int64_t i = 0; i < a->n; i++)
            EACH_LANE {
                angle[l] += a->sign[i] * q[i][l];
                c[i][l] = cos(angle[l]);
                d[i][l] = sin(angle[l]);
                height[i][l] = hand->z[l];
                hand->x[l] += a->along[i] * c[i][l] - a->up[i] * d[i][l];
                hand->z[l] += a->along[i] * d[i][l] + a->up[i] * c[i][l];
            }
        EACH_LANE {
            lowest[l] = hand->z[l];
            theta[l] = a->theta + angle[l];
        }
        for (int64_t k = 0; k < a->frames; k++) {
            int64_t i = a->link[k];
            EACH_LANE {
                double z = height[i][l] + a->frame_along[k] * d[i][l] + a->frame_up[k] * c[i][l];
                lowest[l] = LESSER(lowest[l], z);
            }
        }
    }
    EACH_LANE {
        hand->cos[l] = cos(theta[l]);
        hand->sin[l] = sin(theta[l]);
    }
}

/* The higher speed, squared, of flange and pads' centre of an arm at times [s]. */
INLINE void speeds_at(const throw *t, const lane time, int64_t *piece, lane fastest)
{
    lane hand[9], length[1], velocity[2];
    moved_at(t->motion, t->arm, time, piece, hand);
    EACH_LANE length[0][l] = t->around->tool_length;
    flange_velocity(hand, length, velocity);
    EACH_LANE {
        double flange = velocity[0][l] * velocity[0][l] + velocity[1][l] * velocity[1][l];
        double pads = hand[3][l] * hand[3][l] + hand[4][l] * hand[4][l];
        fastest[l] = GREATER(flange, pads);
    }
}

/* The highest of them from rest to the motion's end. */
INLINE extreme highest_speed(const throw *t)
{
    double until = t->motion->breaks[t->motion->pieces];
    extreme most = {0.0, 0.0};
    int64_t count = (int64_t)ceil((until + t->tick) / t->tick), piece = 0;
    for (int64_t k = 0; k < count; k += LANES) {
        lane time, found;
        EACH_LANE time[l] = t->tick * (double)(k + l < count ? k + l : count - 1);
        speeds_at(t, time, &piece, found);
        EACH_LANE found[l] = -found[l];
        lower(&most, found, time);
    }
    most.value = sqrt(-most.value);
    return most;
}

/* Force and torque at the pads that a bar held by hands needs. */
INLINE void load_at(const scene *s, lane hand[9], lane load[3])
{
    lane held[4], gravity[1];
    EACH_LANE {
        held[0][l] = s->mass;
        held[1][l] = s->inertia;
        held[2][l] = s->com_offset;
        held[3][l] = s->grasp_angle;
        gravity[0][l] = s->gravity;
    }
    held_load(hand, held, gravity, load);
}

/* The largest share of their limits that the joints' torques take, by Newton and Euler: until the
   opening with the object, then with all of it or nothing, after detach without. */
INLINE void highest_torque(const throw *t, measured *m)
{
    const linkage *a = t->arm;
    const torques *b = t->torques;
    const scene *s = t->around;
    double until = t->motion->breaks[t->motion->pieces];
    int64_t count = (int64_t)ceil((until + 0.5 * t->tick) / t->tick), piece = 0;
    for (int64_t k = 0; k < count; k += LANES) {
        lane time, q[3][AXES], turned[3], link[2], body[4], gravity[1], hand[9], load[3];
        lane joints[AXES + 1][6], pushes[AXES][3];
        EACH_LANE time[l] = t->tick * (double)(k + l < count ? k + l : count - 1);
        EACH_LANE gravity[0][l] = s->gravity;
        states_at(t->motion, time, &piece, q);
        first_joint(a, turned, joints[0]);
        for (int64_t i = 0; i < a->n; i++) {
            next_link(a, i, q, turned, link);
            link_end(joints[i], turned, link, joints[i + 1]);
            EACH_LANE {
                body[0][l] = b->mass[i];
                body[1][l] = b->along[i];
                body[2][l] = b->up[i];
                body[3][l] = b->inertia[i];
            }
            link_push(joints[i], turned, body, gravity, pushes[i]);
        }
        last_hand(a, joints[a->n], turned, hand);
        load_at(s, hand, load);
        /* About the origin. */
        EACH_LANE load[2][l] += hand[0][l] * load[1][l] - hand[1][l] * load[0][l];
        for (int held = 1; held >= 0; held--) {
            lane total[3], torque[1];
            for (int r = 0; r < 3; r++)
                EACH_LANE total[r][l] = held ? load[r][l] : 0.0;
            for (int64_t i = a->n - 1; i >= 0; i--) {
                for (int r = 0; r < 3; r++)
                    EACH_LANE total[r][l] += pushes[i][r][l];
                joint_torque(joints[i], total, torque);
                for (int l = 0; l < LANES; l++) {
                    double share = fabs(torque[0][l]) / b->limit[i];
                    if (share > m->torque.value && (held ? time[l] <= t->detach : time[l] >= t->opening))
                        m->torque = (extreme){share, time[l]};
                }
            }
        }
    }
}

/* The held bar at a hand. */
INLINE void held_at(const throw *t, const pose *hand, const lane theta, pose *bar)
{
    const scene *s = t->around;
    EACH_LANE {
        double angle = theta[l] + s->grasp_angle;
        bar->cos[l] = cos(angle);
        bar->sin[l] = sin(angle);
        bar->x[l] = hand->x[l] + t->error[0] + s->com_offset * bar->cos[l];
        bar->z[l] = hand->z[l] + t->error[1] + s->com_offset * bar->sin[l];
    }
}

INLINE void hold(const scene *s, const object *o, const pose *at, const lane time, measured *m)
{
    lane height;
    EACH_PART(o, at, height, lowest_of(&part, &there, found));
    lower(&m->held, height, time);
    near_column(s, o, at, time, &m->column_held);
}

/* From rest to the motion's end: arm and hand, and the bar until the pads open. */
INLINE void carry(const throw *t, const object *o, const box *body, measured *m)
{
    const scene *s = t->around;
    double until = t->motion->breaks[t->motion->pieces];
    int64_t count = (int64_t)ceil((until + t->tick) / t->tick), piece = 0;
    int64_t holds = (int64_t)ceil(t->opening / t->tick);
    for (int64_t k = 0; k < count; k += LANES) {
        lane time, theta, lowest;
        pose hand, at;
        EACH_LANE time[l] = t->tick * (double)(k + l < count ? k + l : count - 1);
        hands_at(t, time, &piece, &hand, theta, lowest);
        lower(&m->arm, lowest, time);
        if (body->half >= 0.0) {
            lowest_of(body, &hand, lowest);
            lower(&m->arm, lowest, time);
        }
        if (k < holds) {
            /* Instants after the opening's start count as the last before it. */
            int64_t last = (holds - 1 < count ? holds : count) - 1 - k;
            held_at(t, &hand, theta, &at);
            for (int64_t l = last + 1; l < LANES; l++) {
                at.x[l] = at.x[last];
                at.z[l] = at.z[last];
                at.cos[l] = at.cos[last];
                at.sin[l] = at.sin[last];
                time[l] = time[last];
            }
            hold(s, o, &at, time, m);
        }
    }
    for (int64_t k = 0; k < t->nodes; k += LANES) {
        pose at;
        lane time;
        EACH_LANE {
            int64_t node = k + l < t->nodes ? k + l : t->nodes - 1;
            time[l] = t->times[node];
            at.x[l] = t->com[node];
            at.z[l] = t->com[t->nodes + node];
            at.cos[l] = cos(t->com[2 * t->nodes + node]);
            at.sin[l] = sin(t->com[2 * t->nodes + node]);
        }
        hold(s, o, &at, time, m);
    }
}

/* The bar `time` after detach. */
INLINE void flown(const throw *t, const lane time, pose *bar)
{
    EACH_LANE {
        double at[3];
        flight_pose(t->start, time[l], t->around->gravity, at);
        bar->x[l] = at[0];
        bar->z[l] = at[1];
        bar->cos[l] = cos(at[2]);
        bar->sin[l] = sin(at[2]);
    }
}

/* Hands with their errors, at times [s] after the opening's start. */
INLINE void mislead(const throw *t, const lane clock, lane theta, pose *hand)
{
    const double *e = t->error;
    int off = 0;
    for (int i = 0; i < 6; i++)
        off |= e[i] != 0.0;
    if (!off)
        return;
    EACH_LANE {
        double since = clock[l] - t->opening;
        hand->x[l] += e[0] + e[3] * since;
        hand->z[l] += e[1] + e[4] * since;
        theta[l] += e[2] + e[5] * since;
        hand->cos[l] = cos(theta[l]);
        hand->sin[l] = sin(theta[l]);
    }
}

/* How far [m] a flying bar is from where the reference's is, at most, at a time on the motion's clock. */
INLINE double off_reference(const throw *t, const reference *r, double clock)
{
    double a[3], b[3];
    flight_pose(t->start, clock - t->detach, t->around->gravity, a);
    flight_pose(r->start, clock - r->detach, t->around->gravity, b);
    double x = a[0] - b[0], z = a[1] - b[1];
    return sqrt(x * x + z * z) + r->far * fabs(a[2] - b[2]);
}

/* The least room of the reference between two times. */
INLINE double room_in(const reference *r, const double *room, double first, double last)
{
    int64_t begin = (int64_t)floor((first - r->begin) / r->step);
    int64_t end = (int64_t)floor((last - r->begin) / r->step);
    double found = begin < 0 || end >= r->n ? -INFINITY : INFINITY;
    for (int64_t k = begin < 0 ? 0 : begin; k <= end && k < r->n; k++)
        found = LESSER(found, room[k]);
    return found;
}

/* The bar in flight beside the column and the hand's body. r: NULL, or what says where neither is near;
   near: then, whether any body may be. */
INLINE void fly(const throw *t, const object *o, const box *body, const reference *r, measured *m, int *near)
{
    const scene *s = t->around;
    double far = o->reach + s->palm_clearance
        + length(GREATER(fabs(body->first), fabs(body->last)), body->half);
    double before = r ? off_reference(t, r, t->detach) : 0.0;
    int64_t piece = 0;
    for (int64_t k = 0; k < FLIGHT_SAMPLES; k += LANES) {
        lane time, clock, theta, away, gap;
        pose at, hand;
        EACH_LANE {
            time[l] = t->flight * ((double)(k + l) / (FLIGHT_SAMPLES - 1.0));
            clock[l] = t->detach + time[l];
        }
        int column = s->column_radius >= 0.0, palm = s->palm_clearance >= 0.0;
        if (r) {
            double last = clock[LANES - 1] + t->flight / (FLIGHT_SAMPLES - 1.0);
            double after = off_reference(t, r, last), off = GREATER(before, after);
            before = after;
            column = column && room_in(r, r->column, clock[0], last) <= off;
            palm = palm && room_in(r, r->palm, clock[0], last) <= off;
            *near |= room_in(r, r->bodies, clock[0], last) <= off;
            if (!column && !palm)
                continue;
        }
        flown(t, time, &at);
        if (column)
            near_column(s, o, &at, clock, &m->column_flown);
        if (!palm)
            continue;
        hands_at(t, clock, &piece, &hand, theta, gap);
        mislead(t, clock, theta, &hand);
        EACH_LANE {
            double dx = at.x[l] - hand.x[l], dz = at.z[l] - hand.z[l];
            away[l] = dx * dx + dz * dz;
        }
        if (least(away) >= far * far)
            continue;
        EACH_PART(o, &at, gap, between(&part, &there, body, &hand, found));
        EACH_LANE gap[l] = away[l] < far * far ? GREATER(gap[l], 0.0) : INFINITY;
        lower(&m->palm, gap, clock);
        for (int l = 0; l < LANES; l++)
            if (gap[l] <= GREATER(s->palm_clearance - 1e-6, 0.0))
                m->palm_time = fmin(m->palm_time, time[l]);
    }
}

/* Depth of the lowest corner below the rim's plane, `time` after detach. */
INLINE void depths(const throw *t, const object *o, const lane time, lane depth)
{
    pose at;
    flown(t, time, &at);
    EACH_PART(o, &at, depth, lowest_of(&part, &there, found));
    EACH_LANE depth[l] = t->around->cup_rim - depth[l];
}

/* Clearance of the corners of a bar, or of a capsule's axis, below the rim to the wall, and of the rim to it. */
INLINE void clearance_of(const scene *s, const box *bar, const pose *at, lane found)
{
    EACH_LANE found[l] = INFINITY;
    for (int k = 0; k < 4; k++) {
        lane x, z;
        corner_of(bar, at, k, x, z);
        EACH_LANE {
            double free = s->cup_radius - fabs(x[l] - s->cup_x);
            free = z[l] <= s->cup_rim ? free : INFINITY;
            found[l] = LESSER(found[l], free);
        }
    }
    for (int side = -1; side <= 1; side += 2)
        EACH_LANE {
            double x = s->cup_x + side * s->cup_radius - at->x[l], z = s->cup_rim - at->z[l];
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
INLINE void clearances(const throw *t, const object *o, const lane time, lane nearest)
{
    pose at;
    flown(t, time, &at);
    EACH_PART(o, &at, nearest, clearance_of(t->around, &part, &there, found));
}

/* When between low and high [s] the depth passes a level. */
INLINE double passes(const throw *t, const object *o, double low, double high, double level)
{
    for (int i = 0; i < BISECTIONS; i += 3) {
        /* Seven instants between the two: three bisections at once. */
        lane time, depth;
        EACH_LANE time[l] = low + (high - low) * (l + 1) / 8.0;
        depths(t, o, time, depth);
        int first = 7;
        for (int l = 6; l >= 0; l--)
            if (depth[l] >= level)
                first = l;
        double begin = first ? time[first - 1] : low;
        high = first < 7 ? time[first] : high;
        low = begin;
    }
    return (low + high) / 2.0;
}

/* Least clearance on the way into the cup, as a cup that moves sees it: from the lower end's passing the
   rim's plane until it is `cup_insertion` below, the least distance of outline and wall or rim, negative
   outside. -infinity for a bar that misses it. Where the outline passes the rim's height it is no nearer
   to the wall than the rim is to the bar. */
INLINE double enter(const throw *given, const object *o)
{
    double speed = given->around->cup_speed, seen[6];
    for (int i = 0; i < 6; i++)
        seen[i] = given->start[i];
    seen[0] += speed * given->flight;
    seen[3] -= speed;
    throw standing = *given, *t = &standing;
    t->start = seen;
    double times[COARSE], depth[COARSE];
    for (int k = 0; k < COARSE; k += LANES) {
        lane time, found;
        EACH_LANE time[l] = (t->flight + BEYOND) * (k + l) / (COARSE - 1.0);
        depths(t, o, time, found);
        EACH_LANE {
            times[k + l] = time[l];
            depth[k + l] = found[l];
        }
    }
    int deep = 0, above = -1;
    while (deep < COARSE && !(depth[deep] >= t->around->cup_insertion))
        deep++;
    for (int k = 0; k < deep && deep < COARSE; k++)
        above = depth[k] < 0.0 ? k : above;
    if (above < 0)
        return -INFINITY;
    double begin = passes(t, o, times[above], times[above + 1], 0.0), found = INFINITY;
    double end = passes(t, o, times[deep - 1], times[deep], t->around->cup_insertion);
    for (int round = 0; round < ROUNDS; round++) {
        double nearest = INFINITY, step = (end - begin) / (FINE - 1);
        int where = 0;
        for (int k = 0; k < FINE; k += LANES) {
            lane time, free;
            EACH_LANE time[l] = begin + (k + l) * step;
            clearances(t, o, time, free);
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

/* Squared uses of the full grip by hands. */
INLINE void uses_of(const scene *s, lane hand[9], lane use)
{
    lane load[3];
    load_at(s, hand, load);
    EACH_LANE {
        double torque = load[2][l] / s->torque;
        use[l] = (load[0][l] * load[0][l] + load[1][l] * load[1][l]) / (s->force * s->force) + torque * torque;
    }
}

/* Takes up the largest squared use, with its sign turned, at some times. */
INLINE void use_at(const throw *t, const double *times, int count, int64_t *piece, extreme *e)
{
    lane time, hand[9], use;
    EACH_LANE time[l] = times[l < count ? l : count - 1];
    moved_at(t->motion, t->arm, time, piece, hand);
    uses_of(t->around, hand, use);
    EACH_LANE use[l] = -use[l];
    lower(e, use, time);
}

/* The instants before `until` [s] at which the grip is looked at: both sides of each kink, at most `step` apart between, and four inside each piece
   with kinks inside, along which the acceleration swings. What they are does not depend on `until`.
   DO is what is done with `time`. */
#define GRIP_INSTANTS(p, step, until, DO)                                                          \
    do {                                                                                           \
        double begin_ = (p)->breaks[0], last_ = (p)->breaks[(p)->pieces];                          \
        int64_t corner_ = 0, swing_ = -1;                                                             \
        while (begin_ < (until) && begin_ < last_) {                                               \
            while (corner_ < (p)->corners && !((p)->kinks[corner_] > begin_))                      \
                corner_++;                                                                         \
            double end_ = corner_ < (p)->corners && (p)->kinks[corner_] < last_                    \
                ? (p)->kinks[corner_] : last_;                                                     \
            int64_t parts_ = (int64_t)ceil((end_ - begin_) / (step));                                    \
            double length_ = end_ - begin_ - 2.0 * INSIDE;                                         \
            for (int64_t i_ = 0; i_ <= parts_; i_++) {                                                \
                double share = (double)i_ / (double)(parts_ > 1 ? parts_ : 1);                     \
                double time = begin_ + INSIDE + length_ * share;                                   \
                if (time < (until))                                                                \
                    DO(time);                                                                      \
                else                                                                               \
                    break;                                                                         \
            }                                                                                      \
            begin_ = end_;                                                                         \
        }                                                                                          \
        for (int64_t k_ = 0, at_ = 0; k_ < (p)->corners; k_++) {                                      \
            at_ = piece_of((p), (p)->kinks[k_], at_);                                              \
            if (at_ == swing_ || !((p)->kinks[k_] > (p)->breaks[at_]))                             \
                continue;                                                                          \
            swing_ = at_;                                                                          \
            double length_ = (p)->breaks[at_ + 1] - (p)->breaks[at_];                                \
            for (int i_ = 1; i_ < 5; i_++) {                                                       \
                double time = (p)->breaks[at_] + length_ * (0.2 * i_);                               \
                if (time < (until))                                                                \
                    DO(time);                                                                      \
            }                                                                                      \
        }                                                                                          \
    } while (0)

/* The largest use of the full grip from rest to the opening; 1 is the limit. */
INLINE extreme largest_use(const throw *t)
{
    double times[LANES];
    int64_t piece = 0;
    int count = 0;
    extreme most = {0.0, 0.0};
#define TAKE(time)                                                                                 \
    do {                                                                                           \
        times[count++] = (time);                                                                   \
        if (count == LANES) {                                                                      \
            use_at(t, times, count, &piece, &most);                                                \
            count = 0;                                                                             \
        }                                                                                          \
    } while (0)
    GRIP_INSTANTS(t->motion, t->step, t->opening, TAKE);
    TAKE(t->opening + INSIDE);
    if (count)
        use_at(t, times, count, &piece, &most);
    most.value = sqrt(-most.value);
    return most;
}

EXPORT int64_t grip_instants(const path *motion, double step, double until, int64_t room, double *times)
{
    int64_t count = 0;
#define KEEP(time)                                                                                 \
    do {                                                                                           \
        if (count < room)                                                                          \
            times[count] = (time);                                                                 \
        count++;                                                                                   \
    } while (0)
    GRIP_INSTANTS(motion, step, until, KEEP);
    return count;
}

CLONES EXPORT double grip_use(const throw *t)
{
    return largest_use(t).value;
}

CLONES EXPORT void measure(const throw *t, measured *m)
{
    const scene *s = t->around;
    const object o = object_of(s);
    const box body = {-s->palm_back, -s->palm_front, s->palm_half_width};
    const extreme far = {INFINITY, 0.0}, none = {0.0, 0.0};
    *m = (measured){largest_use(t), far, far, far, far, far, none, none, INFINITY, INFINITY};
    carry(t, &o, &body, m);
    fly(t, &o, &body, NULL, m, NULL);
    if (s->cup_radius >= 0.0)
        m->cup = enter(t, &o);
    if (s->tool_length >= 0.0)
        m->speed = highest_speed(t);
    if (t->torques)
        highest_torque(t, m);
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
    const object o = object_of(s);
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
    const object o = object_of(s);
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
    const object o = object_of(s);
    for (int64_t k = 0; k < count; k++) {
        throw t = {.around = s, .start = detach + 6 * k, .flight = flight[k]};
        found[k] = isfinite(flight[k]) ? enter(&t, &o) : -INFINITY;
    }
}

CLONES EXPORT void measure_flights(const throw *shared, const reference *r, int64_t count,
                                   const flown_sample *flights, double *found)
{
    for (int64_t k = 0; k < count; k++, found += 4) {
        scene around;
        throw t = throw_of(shared, flights + k, &around);
        const object o = object_of(&around);
        const box body = {-around.palm_back, -around.palm_front, around.palm_half_width};
        int near = 0;
        measured m;
        m.column_flown = m.palm = (extreme){INFINITY, 0.0};
        m.palm_time = m.cup = INFINITY;
        fly(&t, &o, &body, r, &m, &near);
        if (around.cup_radius >= 0.0)
            m.cup = enter(&t, &o);
        found[0] = m.column_flown.value;
        found[1] = m.palm_time;
        found[2] = m.cup;
        found[3] = near;
    }
}
