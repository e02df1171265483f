/* What a check measures of a throw: use of the grip, and how near bar, hand and arm come to things.
   Eight instants at a time. */
#define LANES 8
#include "motion.h"

/* Instants of a flight at which its surroundings are measured, at even shares of it. */
#define FLIGHT_SAMPLES 400
/* As in planner/check/entry.py. */
#define COARSE 48
#define BISECTIONS 15
#define FINE 24
#define ROUNDS 3
#define BEYOND 0.3
/* As in models/path.py: the acceleration may step at a kink, seen from either side so far away [s]. */
#define INSIDE 1e-12

/* What of the scene counts. Lengths [m]; widths and radii of what it does not have are negative. */
typedef struct {
    double gravity, mass, grasp_inertia, com_offset, grasp_angle;
    double force, torque;                     /* limits under the full grip */
    double behind, ahead, half_width;         /* the bar, from its CoM */
    double column_radius, column_height;
    double palm_back, palm_front, palm_half_width;
    double palm_clearance;
    double tool_length;                       /* from the flange to the pads' centre */
    double cup_x, cup_rim, cup_radius, cup_insertion; /* the radius at the bar's width */
} scene;

/* Masses of an arm, as `PlanarBody` of models/dynamics.py, and its joints' limits [N m]. */
typedef struct {
    double mass[AXES], along[AXES], up[AXES], inertia[AXES], limit[AXES];
} torques;

/* A throw: its motion, seen every `tick` [s], and for the grip every `step`, opening and detach [s],
   the bar while the pads open, com [3][nodes], and its
   flight from detach (x, z, theta and their rates) for `flight` [s]. */
typedef struct {
    const path *motion;
    const linkage *arm;
    const scene *around;
    const torques *torques; /* none where there is no limit to them */
    double tick, step, opening, detach, flight;
    long nodes;
    const double *com, *start;
} throw;

/* Use of the grip; heights of the lowest points, distances, least clearance, infinite where nothing
   was near; the highest speed of flange and pads' centre;
   the largest share of a joint's torque. */
typedef struct {
    double grip, arm, held, column_held, column_flown, palm, palm_time, cup, speed, torque;
} measured;

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

#define LESSER(a, b) ((a) < (b) ? (a) : (b))
#define GREATER(a, b) ((a) > (b) ? (a) : (b))

/* A box lies along its axis from `first` to `last`, `half` to either side. */
typedef struct {
    double first, last, half;
} box;

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

/* Distance between two boxes, 0 where they overlap. */
INLINE void between(const box *one, const pose *here, const box *other, const pose *there, lane d)
{
    lane square, apart;
    EACH_LANE {
        square[l] = INFINITY;
        apart[l] = -INFINITY;
    }
    corners_from(one, here, other, there, square, apart);
    corners_from(other, there, one, here, square, apart);
    EACH_LANE d[l] = apart[l] > 0.0 ? sqrt(square[l]) : 0.0;
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

/* The least distance of bars from the column; infinite where it is out of their reach. */
INLINE double near_column(const scene *s, const box *b, const pose *bar, double reach)
{
    lane away, found;
    if (s->column_radius < 0.0)
        return INFINITY;
    EACH_LANE {
        double aside = fabs(bar->x[l]) - s->column_radius, above = bar->z[l] - s->column_height;
        away[l] = GREATER(aside, above);
    }
    if (!(least(away) < reach))
        return INFINITY;
    from_column(b, bar, s->column_radius, s->column_height, found);
    EACH_LANE found[l] = away[l] < reach ? found[l] : INFINITY;
    return least(found);
}

/* Hands at times [s], and heights of what moves lowest of arm and hand. */
INLINE void hands_at(const throw *t, const lane time, long *piece, pose *hand, lane theta,
                     lane lowest)
{
    const linkage *a = t->arm;
    lane q[AXES], height[AXES], c[AXES], d[AXES], angle;
    for (int l = 0; l < LANES; l++) {
        double at[AXES];
        coordinates_at(t->motion, time[l], piece, 0, at);
        for (long i = 0; i < a->n; i++)
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
        for (long i = 0; i < a->n; i++)
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
        for (long k = 0; k < a->frames; k++) {
            long i = a->link[k];
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
INLINE void speeds_at(const throw *t, const lane time, long *piece, lane fastest)
{
    const linkage *a = t->arm;
    lane angle, rate, x, z;
    double q[LANES][AXES], dq[LANES][AXES];
    for (int l = 0; l < LANES; l++) {
        coordinates_at(t->motion, time[l], piece, 0, q[l]);
        coordinates_at(t->motion, time[l], piece, 1, dq[l]);
    }
    EACH_LANE angle[l] = rate[l] = x[l] = z[l] = 0.0;
    for (long i = 0; i < a->n; i++)
        EACH_LANE {
            angle[l] += a->sign[i] * q[l][i];
            rate[l] += a->sign[i] * dq[l][i];
            double c = cos(angle[l]), s = sin(angle[l]);
            x[l] -= rate[l] * (a->along[i] * s + a->up[i] * c);
            z[l] += rate[l] * (a->along[i] * c - a->up[i] * s);
        }
    EACH_LANE {
        double theta = a->theta + angle[l], turning = rate[l] * t->around->tool_length;
        double back = x[l] + turning * sin(theta), up = z[l] - turning * cos(theta);
        double flange = back * back + up * up, pads = x[l] * x[l] + z[l] * z[l];
        fastest[l] = GREATER(flange, pads);
    }
}

/* The highest of them from rest to the motion's end. */
INLINE double highest_speed(const throw *t)
{
    double until = t->motion->breaks[t->motion->pieces], most = 0.0;
    long count = (long)ceil((until + t->tick) / t->tick), piece = 0;
    for (long k = 0; k < count; k += LANES) {
        lane time, found;
        EACH_LANE time[l] = t->tick * (k + l < count ? k + l : count - 1);
        speeds_at(t, time, &piece, found);
        EACH_LANE most = GREATER(most, found[l]);
    }
    return sqrt(most);
}

/* The largest share of their limits that the joints' torques take, by Newton and Euler: until the
   opening with the object, then with all of it or nothing, after detach without. */
INLINE double highest_torque(const throw *t)
{
    const linkage *a = t->arm;
    const torques *b = t->torques;
    const scene *s = t->around;
    double until = t->motion->breaks[t->motion->pieces], most = 0.0;
    long count = (long)ceil((until + 0.5 * t->tick) / t->tick), piece = 0;
    for (long k = 0; k < count; k++) {
        double time = t->tick * k, angle = 0.0, rate = 0.0, turn = 0.0;
        double x = 0.0, z = 0.0, a_x = 0.0, a_z = 0.0; /* of the joint, then of the pads */
        double place[AXES][2], force[AXES][2], moment[AXES];
        state now;
        state_at(t->motion, time, &piece, &now);
        for (long i = 0; i < a->n; i++) {
            angle += a->sign[i] * now.q[i];
            rate += a->sign[i] * now.dq[i];
            turn += a->sign[i] * now.ddq[i];
            double c = cos(angle), d = sin(angle);
            double to_x = b->along[i] * c - b->up[i] * d, to_z = b->along[i] * d + b->up[i] * c;
            force[i][0] = b->mass[i] * (a_x - turn * to_z - rate * rate * to_x);
            force[i][1] = b->mass[i] * (a_z + turn * to_x - rate * rate * to_z + s->gravity);
            moment[i] = (x + to_x) * force[i][1] - (z + to_z) * force[i][0] + b->inertia[i] * turn;
            place[i][0] = x;
            place[i][1] = z;
            to_x = a->along[i] * c - a->up[i] * d;
            to_z = a->along[i] * d + a->up[i] * c;
            a_x -= turn * to_z + rate * rate * to_x;
            a_z += turn * to_x - rate * rate * to_z;
            x += to_x;
            z += to_z;
        }
        double theta = a->theta + angle + s->grasp_angle, g_z = a_z + s->gravity;
        double r_x = s->com_offset * cos(theta), r_z = s->com_offset * sin(theta);
        double load_x = s->mass * (a_x - turn * r_z - rate * rate * r_x);
        double load_z = s->mass * (g_z + turn * r_x - rate * rate * r_z);
        double load = s->grasp_inertia * turn - s->mass * (a_x * r_z - g_z * r_x);
        for (int held = time > t->detach ? 0 : 1; held >= (time < t->opening ? 1 : 0); held--) {
            double f_x = held * load_x, f_z = held * load_z;
            double total = held * (load + x * load_z - z * load_x);
            for (long i = a->n - 1; i >= 0; i--) {
                f_x += force[i][0];
                f_z += force[i][1];
                total += moment[i];
                double share = fabs(total - place[i][0] * f_z + place[i][1] * f_x) / b->limit[i];
                most = GREATER(most, share);
            }
        }
    }
    return most;
}

/* The held bar at a hand. */
INLINE void held_at(const scene *s, const pose *hand, const lane theta, pose *bar)
{
    EACH_LANE {
        double angle = theta[l] + s->grasp_angle;
        bar->cos[l] = cos(angle);
        bar->sin[l] = sin(angle);
        bar->x[l] = hand->x[l] + s->com_offset * bar->cos[l];
        bar->z[l] = hand->z[l] + s->com_offset * bar->sin[l];
    }
}

INLINE void hold(const scene *s, const box *bar, double reach, const pose *at, measured *m)
{
    lane found;
    lowest_of(bar, at, found);
    m->held = fmin(m->held, least(found));
    m->column_held = fmin(m->column_held, near_column(s, bar, at, reach));
}

/* From rest to the motion's end: arm and hand, and the bar until the pads open. */
INLINE void carry(const throw *t, const box *bar, const box *body, double reach, measured *m)
{
    const scene *s = t->around;
    double until = t->motion->breaks[t->motion->pieces];
    long count = (long)ceil((until + t->tick) / t->tick), piece = 0;
    long holds = (long)ceil(t->opening / t->tick);
    for (long k = 0; k < count; k += LANES) {
        lane time, theta, lowest;
        pose hand, at;
        EACH_LANE time[l] = t->tick * (k + l < count ? k + l : count - 1);
        hands_at(t, time, &piece, &hand, theta, lowest);
        m->arm = fmin(m->arm, least(lowest));
        if (body->half >= 0.0) {
            lowest_of(body, &hand, lowest);
            m->arm = fmin(m->arm, least(lowest));
        }
        if (k < holds) {
            /* Instants after the opening's start count as the last before it. */
            long last = (holds - 1 < count ? holds : count) - 1 - k;
            held_at(s, &hand, theta, &at);
            for (long l = last + 1; l < LANES; l++) {
                at.x[l] = at.x[last];
                at.z[l] = at.z[last];
                at.cos[l] = at.cos[last];
                at.sin[l] = at.sin[last];
            }
            hold(s, bar, reach, &at, m);
        }
    }
    for (long k = 0; k < t->nodes; k += LANES) {
        pose at;
        EACH_LANE {
            long node = k + l < t->nodes ? k + l : t->nodes - 1;
            at.x[l] = t->com[node];
            at.z[l] = t->com[t->nodes + node];
            at.cos[l] = cos(t->com[2 * t->nodes + node]);
            at.sin[l] = sin(t->com[2 * t->nodes + node]);
        }
        hold(s, bar, reach, &at, m);
    }
}

/* The bar `time` after detach. */
INLINE void flown(const throw *t, const lane time, pose *bar)
{
    const double *at = t->start;
    EACH_LANE {
        double theta = at[2] + at[5] * time[l];
        bar->x[l] = at[0] + at[3] * time[l];
        bar->z[l] = at[1] + at[4] * time[l] - 0.5 * t->around->gravity * time[l] * time[l];
        bar->cos[l] = cos(theta);
        bar->sin[l] = sin(theta);
    }
}

/* The bar in flight beside the column and the hand's body. */
INLINE void fly(const throw *t, const box *bar, const box *body, double reach, measured *m)
{
    const scene *s = t->around;
    double far = reach + s->palm_clearance
        + hypot(GREATER(fabs(body->first), fabs(body->last)), body->half);
    long piece = 0;
    for (long k = 0; k < FLIGHT_SAMPLES; k += LANES) {
        lane time, clock, theta, away, found;
        pose at, hand;
        EACH_LANE {
            time[l] = t->flight * ((k + l) / (FLIGHT_SAMPLES - 1.0));
            clock[l] = t->detach + time[l];
        }
        flown(t, time, &at);
        m->column_flown = fmin(m->column_flown, near_column(s, bar, &at, reach));
        if (s->palm_clearance < 0.0)
            continue;
        hands_at(t, clock, &piece, &hand, theta, found);
        EACH_LANE {
            double dx = at.x[l] - hand.x[l], dz = at.z[l] - hand.z[l];
            away[l] = dx * dx + dz * dz;
        }
        if (least(away) >= far * far)
            continue;
        between(bar, &at, body, &hand, found);
        EACH_LANE found[l] = away[l] < far * far ? found[l] : INFINITY;
        m->palm = fmin(m->palm, least(found));
        for (int l = 0; l < LANES; l++)
            if (found[l] < s->palm_clearance - 1e-6)
                m->palm_time = fmin(m->palm_time, time[l]);
    }
}

/* Depth of the lowest corner below the rim's plane, `time` after detach. */
INLINE void depths(const throw *t, const box *bar, const lane time, lane depth)
{
    pose at;
    flown(t, time, &at);
    lowest_of(bar, &at, depth);
    EACH_LANE depth[l] = t->around->cup_rim - depth[l];
}

/* Clearance of the corners below the rim to the wall, and of the rim to the bar. */
INLINE void clearances(const throw *t, const box *bar, const lane time, lane found)
{
    const scene *s = t->around;
    pose at;
    flown(t, time, &at);
    EACH_LANE found[l] = INFINITY;
    for (int k = 0; k < 4; k++) {
        lane x, z;
        corner_of(bar, &at, k, x, z);
        EACH_LANE {
            double free = s->cup_radius - fabs(x[l] - s->cup_x);
            free = z[l] <= s->cup_rim ? free : INFINITY;
            found[l] = LESSER(found[l], free);
        }
    }
    for (int side = -1; side <= 1; side += 2)
        EACH_LANE {
            double x = s->cup_x + side * s->cup_radius - at.x[l], z = s->cup_rim - at.z[l];
            double along = at.cos[l] * x + at.sin[l] * z, across = at.cos[l] * z - at.sin[l] * x;
            double over = GREATER(bar->first - along, along - bar->last);
            double aside = fabs(across) - bar->half;
            over = GREATER(over, 0.0);
            aside = GREATER(aside, 0.0);
            double away = sqrt(over * over + aside * aside);
            found[l] = LESSER(found[l], away);
        }
}

/* When between low and high [s] the depth passes a level. */
INLINE double passes(const throw *t, const box *bar, double low, double high, double level)
{
    for (int i = 0; i < BISECTIONS; i += 3) {
        /* Seven instants between the two: three bisections at once. */
        lane time, depth;
        EACH_LANE time[l] = low + (high - low) * (l + 1) / 8.0;
        depths(t, bar, time, depth);
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

/* Least clearance on the way into the cup; -infinity for a bar that misses it. */
INLINE double enter(const throw *t, const box *bar)
{
    double times[COARSE], depth[COARSE];
    for (int k = 0; k < COARSE; k += LANES) {
        lane time, found;
        EACH_LANE time[l] = (t->flight + BEYOND) * (k + l) / (COARSE - 1.0);
        depths(t, bar, time, found);
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
    double begin = passes(t, bar, times[above], times[above + 1], 0.0), found = INFINITY;
    double end = passes(t, bar, times[deep - 1], times[deep], t->around->cup_insertion);
    for (int round = 0; round < ROUNDS; round++) {
        double nearest = INFINITY, step = (end - begin) / (FINE - 1);
        int where = 0;
        for (int k = 0; k < FINE; k += LANES) {
            lane time, free;
            EACH_LANE time[l] = begin + (k + l) * step;
            clearances(t, bar, time, free);
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

/* Largest squared use of the full grip at some times. */
INLINE double use_at(const throw *t, const double *times, int count, long *piece)
{
    const scene *s = t->around;
    lane time, hand[9], use;
    EACH_LANE time[l] = times[l < count ? l : count - 1];
    moved_at(t->motion, t->arm, time, piece, hand);
    EACH_LANE {
        double theta = hand[2][l] + s->grasp_angle, square = hand[5][l] * hand[5][l];
        double x = s->com_offset * cos(theta), z = s->com_offset * sin(theta);
        double a_x = hand[6][l], a_z = hand[7][l], alpha = hand[8][l];
        double f_x = s->mass * (a_x - alpha * z - square * x);
        double f_z = s->mass * (a_z + alpha * x - square * z + s->gravity);
        double torque = s->grasp_inertia * alpha - s->mass * (a_x * z - (a_z + s->gravity) * x);
        torque /= s->torque;
        use[l] = (f_x * f_x + f_z * f_z) / (s->force * s->force) + torque * torque;
    }
    double most = use[0];
    for (int l = 1; l < LANES; l++)
        most = use[l] > most ? use[l] : most;
    return most;
}

/* The largest use of the full grip from rest to the opening; 1 is the limit. Instants are those of
   `Path.closely` of models/path.py. */
INLINE double grip(const throw *t)
{
    const path *p = t->motion;
    double most = 0.0, times[LANES], begin = p->breaks[0], until = t->opening;
    long corner = 0, piece = 0, swing = -1;
    int count = 0;
#define TAKE(time)                                                                                 \
    do {                                                                                           \
        times[count++] = (time);                                                                   \
        if (count == LANES) {                                                                      \
            most = fmax(most, use_at(t, times, count, &piece));                                    \
            count = 0;                                                                             \
        }                                                                                          \
    } while (0)
    while (begin < until) {
        while (corner < p->corners && !(p->kinks[corner] > begin))
            corner++;
        double end = corner < p->corners && p->kinks[corner] < until ? p->kinks[corner] : until;
        long parts = (long)ceil((end - begin) / t->step);
        double length = end - begin - 2.0 * INSIDE;
        for (long i = 0; i <= parts; i++)
            TAKE(begin + INSIDE + length * i / (parts > 1 ? parts : 1));
        begin = end;
    }
    /* Inside pieces that have kinks inside the acceleration swings. */
    for (long k = 0, at = 0; k < p->corners; k++) {
        at = piece_of(p, p->kinks[k], at);
        if (at == swing || !(p->kinks[k] > p->breaks[at]))
            continue;
        swing = at;
        for (int i = 1; i < 5; i++) {
            double time = p->breaks[at] + (p->breaks[at + 1] - p->breaks[at]) * (0.2 * i);
            if (time < until)
                TAKE(time);
        }
    }
    TAKE(until + INSIDE);
    if (count)
        most = fmax(most, use_at(t, times, count, &piece));
    return sqrt(most);
}

CLONES EXPORT double grip_use(const throw *t)
{
    return grip(t);
}

CLONES EXPORT void measure(const throw *t, measured *m)
{
    const scene *s = t->around;
    const box bar = {-s->behind, s->ahead, s->half_width};
    const box body = {-s->palm_back, -s->palm_front, s->palm_half_width};
    double reach = hypot(GREATER(s->behind, s->ahead), s->half_width);
    *m = (measured){grip(t), INFINITY, INFINITY, INFINITY, INFINITY, INFINITY, INFINITY, INFINITY,
                    0.0, 0.0};
    carry(t, &bar, &body, reach, m);
    fly(t, &bar, &body, reach, m);
    if (s->cup_radius >= 0.0)
        m->cup = enter(t, &bar);
    if (s->tool_length >= 0.0)
        m->speed = highest_speed(t);
    if (t->torques)
        m->torque = highest_torque(t);
}
