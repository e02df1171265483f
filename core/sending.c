/* What is sent: samples of a planned motion and of its brake, the motion through samples, limits. */
#define LANES 1
#include <stddef.h>

#include "functions.h"
#include "motion.h"

/* Share of the limits that is used, as in planner/throw/sending.py: differences of rounded samples stay
   inside the whole ones. */
#define SHARE 0.999
/* Times of a tick and of a piece's end that differ by less [s] are the same. */
#define SAME 1e-9
/* Acceleration [rad/s^2; m/s^2] that a sample may be off even jerk. */
#define UNEVEN 0.01
/* Rounding in the last digits of samples, as a share of a limit and at least in its unit, breaks none. */
#define ROUNDING 1e-7

INLINE double larger(double a, double b) { return a > b ? a : b; }

/* Value, rate and acceleration of axis i of a cubic piece, u [s] after its begin. */
INLINE void cubic_at(const path *p, int64_t piece, int64_t i, double u, double at[4])
{
    double c[4];
    for (int k = 0; k < 4; k++)
        c[k] = p->curves[(k * p->n + i) * p->pieces + piece];
    at[0] = ((c[0] * u + c[1]) * u + c[2]) * u + c[3];
    at[1] = (3.0 * c[0] * u + 2.0 * c[1]) * u + c[2];
    at[2] = 2.0 * (3.0 * c[0] * u + c[1]);
    at[3] = 6.0 * c[0];
}

/* Clears the flags of the ticks that [begin, end] [s] touches; kept may be NULL. */
static void clear(unsigned char *kept, double tick, double until, double begin, double end)
{
    int64_t ticks = (int64_t)(until / tick + 0.5), k = (int64_t)floor((begin - SAME) / tick);
    for (k = k > 0 ? k : 0; kept && k < ticks && (double)k < (end + SAME) / tick; k++)
        kept[k] = 0;
}

/* Whether the planned motion keeps the limits until then [s], gaps between its pieces included; clears
   `kept`, of each tick, where it does not. Without `kept` it stops at the first place. */
static int keeps(const path *p, const limits *most, double tick, double until, unsigned char *kept)
{
    /* Most jerk, acceleration and rate of a motion of one tick that closes a gap of one in position,
       rate and acceleration, in ticks: by the quintic that is at rest at first. */
    static const double closing[3][3] = {{60.0, 96.0, 75.0}, {5.8, 9.8, 9.0}, {1.9, 3.9, 3.0}};
    int all = 1;
    for (int64_t piece = 0; piece < p->pieces && p->pieces > 1; piece++) {
        double begin = piece ? p->breaks[piece] : -1.0;
        double end = piece + 1 < p->pieces ? p->breaks[piece + 1] : until + 1.0;
        if (end - begin >= tick)
            continue;
        all = 0;
        clear(kept, tick, until, begin, begin);
        clear(kept, tick, until, end, end);
    }
    for (int64_t i = 0; i < p->n && (all || kept); i++) {
        double limit[3] = {SHARE * most->jerk[i], SHARE * most->ddq[i], SHARE * most->dq[i]};
        double before[3] = {0.0, 0.0, 0.0}, end[4] = {0.0, 0.0, 0.0, 0.0};
        for (int64_t piece = 0; piece < p->pieces; piece++) {
            double begin[4], used[3], gap[3], first = p->breaks[piece];
            double last = piece + 1 < p->pieces ? p->breaks[piece + 1] : until;
            cubic_at(p, piece, i, 0.0, begin);
            gap[0] = fabs(begin[0] - end[0]) / (tick * tick * tick);
            gap[1] = fabs(begin[1] - end[1]) / (tick * tick);
            gap[2] = fabs(begin[2] - end[2]) / tick;
            cubic_at(p, piece, i, last - first, end);
            used[0] = fabs(begin[3]);
            used[1] = larger(fabs(begin[2]), fabs(end[2]));
            used[2] = larger(fabs(begin[1]), fabs(end[1]));
            /* Where the acceleration passes zero the rate has its extreme. */
            if (begin[2] * end[2] < 0.0)
                used[2] = larger(used[2], fabs(begin[1] - begin[2] * begin[2] / (2.0 * begin[3])));
            double unit = 1.0;
            for (int k = 0; k < 3; k++, unit *= tick) {
                double close = closing[k][0] * gap[0] + closing[k][1] * gap[1]
                    + closing[k][2] * gap[2];
                int within = used[k] <= limit[k];
                int closes = !piece || larger(used[k], before[k]) + close * unit <= limit[k];
                before[k] = used[k];
                if (within && closes)
                    continue;
                all = 0;
                if (!kept)
                    return 0;
                clear(kept, tick, until, first, within ? first : last);
            }
        }
    }
    return all;
}

EXPORT void kept_ticks(const path *p, const limits *most, double tick, int64_t ticks, unsigned char *kept)
{
    for (int64_t k = 0; k < ticks; k++)
        kept[k] = p->powers == 4;
    if (p->powers == 4)
        keeps(p, most, tick, tick * (double)ticks, kept);
}

/* A brake to rest: jerk down for `first`, none for `level`, up for `last` [s]; signs by `side`. */
typedef struct {
    double side, first, level, last;
} braking;

static braking brake_of(double v, double a, double most, double jerk)
{
    braking b;
    b.side = v + a * fabs(a) / (2.0 * jerk) < 0.0 ? -1.0 : 1.0;
    v *= b.side;
    a *= b.side;
    double peak = sqrt(larger(jerk * v + a * a / 2.0, 0.0));
    peak = peak > most ? most : peak;
    peak = larger(peak, -a);
    b.first = (a + peak) / jerk;
    b.last = peak / jerk;
    double rest = v + a * a / (2.0 * jerk) - peak * peak / jerk;
    b.level = peak > 0.0 ? larger(rest / peak, 0.0) : 0.0;
    return b;
}

/* Place, rate and acceleration t [s] after it began at `last`; at rest after its end. */
INLINE void braked(const braking *b, double jerk, double t, const double last[3], double *place,
                   double *rate, double *acceleration)
{
    const double length[3] = {b->first, b->level, b->last};
    double q = last[0], v = last[1], a = last[2];
    for (int k = 0; k < 3; k++) {
        double u = t < length[k] ? t : length[k], j = b->side * jerk * (k - 1);
        q += u * (v + u * (a / 2.0 + u * j / 6.0));
        v += u * (a + u * j / 2.0);
        a += u * j;
        t -= u;
    }
    *place = q;
    *rate = t > 0.0 ? 0.0 : v;
    *acceleration = t > 0.0 ? 0.0 : a;
}

/* As `quintics` of functions.h. */
INLINE int64_t through(const samples *s, double *curves, double *kinks)
{
    int64_t n = s->n, pieces = s->rows - 1, count = 0;
    double h = s->tick, h2 = h * h, per = 1.0 / h, per3 = per * per * per;
    int uneven = 0;
    for (int64_t k = 0; k <= pieces; k++) {
        int corner = uneven; /* the piece before is */
        uneven = 0;
        for (int64_t i = 0; i < n; i++) {
            const double *q = s->q + k * n + i, *dq = s->dq + k * n + i, *ddq = s->ddq + k * n + i;
            if (k < pieces) {
                double v = h * dq[0], a = h2 * ddq[0], d_v = h * dq[n] - v - a;
                double d_a = h2 * ddq[n] - a, d_p = q[n] - q[0] - v - a / 2.0;
                double *c = curves + i * pieces + k;
                c[0] = (6.0 * d_p - 3.0 * d_v + d_a / 2.0) * (per3 * per * per);
                c[n * pieces] = (-15.0 * d_p + 7.0 * d_v - d_a) * (per3 * per);
                c[2 * n * pieces] = (10.0 * d_p - 4.0 * d_v + d_a / 2.0) * per3;
                c[3 * n * pieces] = ddq[0] / 2.0;
                c[4 * n * pieces] = dq[0];
                c[5 * n * pieces] = q[0];
                /* What even jerk would leave of the next sample's rate and position. */
                double off = fabs((dq[n] - dq[0]) * per - (ddq[0] + ddq[n]) / 2.0)
                    + fabs(6.0 * per * ((q[n] - q[0]) * per - dq[0]) - 2.0 * ddq[0] - ddq[n]);
                uneven |= off > UNEVEN;
            }
            if (k > 0 && k < pieces)
                corner |= fabs(ddq[n] - 2.0 * ddq[0] + ddq[-n]) > UNEVEN;
        }
        if (corner || uneven)
            kinks[count++] = h * (double)k;
        if (uneven) {
            kinks[count++] = h * ((double)k + 1.0 / 3.0);
            kinks[count++] = h * ((double)k + 2.0 / 3.0);
        }
    }
    return count;
}

EXPORT int64_t quintics(const samples *s, double *curves, double *kinks)
{
    return through(s, curves, kinks);
}

/* The brake of every axis, as fast as the limits allow, after the last of `given` samples; how many
   samples there are with it. Nothing is written unless s has room for them. */
static int64_t brake_after(const limits *most, int64_t given, samples *s, int64_t room)
{
    int64_t n = s->n, last = (given - 1) * n;
    braking by[AXES];
    double duration = 0.0;
    for (int64_t i = 0; i < n; i++) {
        by[i] = brake_of(s->dq[last + i], s->ddq[last + i], SHARE * most->ddq[i],
                         SHARE * most->jerk[i]);
        duration = larger(duration, by[i].first + by[i].level + by[i].last);
    }
    int64_t rows = given + (int64_t)ceil(duration / s->tick) + 1;
    for (int64_t k = given; k < rows && rows <= room; k++)
        for (int64_t i = 0; i < n; i++) {
            const double end[3] = {s->q[last + i], s->dq[last + i], s->ddq[last + i]};
            braked(&by[i], SHARE * most->jerk[i], s->tick * (double)(k + 1 - given), end,
                   &s->q[k * n + i], &s->dq[k * n + i], &s->ddq[k * n + i]);
        }
    return rows;
}

EXPORT int64_t brake(const limits *most, int64_t given, samples *s)
{
    return brake_after(most, given, s, s->rows);
}

EXPORT int64_t send_motion(const path *p, const limits *most, samples *s, double *curves, double *kinks)
{
    double tick = s->tick;
    int64_t n = p->n, ticks = (int64_t)ceil(p->breaks[p->pieces] / tick - SAME), piece = 0;
    if (p->powers != 4 || ticks >= s->rows)
        return -1;
    for (int64_t i = 0; i < n; i++) {
        double first[4];
        cubic_at(p, 0, i, 0.0, first);
        if (first[1] != s->dq[i] || first[2] != s->ddq[i])
            return -1;
    }
    if (!keeps(p, most, tick, tick * (double)ticks, NULL))
        return -1;
    for (int64_t k = 0; k <= ticks; k++) {
        double t = tick * (double)k, at[4];
        piece = piece_of(p, t, piece);
        for (int64_t i = 0; i < n; i++) {
            cubic_at(p, piece, i, t - p->breaks[piece], at);
            s->q[k * n + i] = at[0];
            s->dq[k * n + i] = at[1];
            s->ddq[k * n + i] = at[2];
        }
    }
    int64_t rows = brake_after(most, ticks + 1, s, s->rows);
    if (rows > s->rows)
        return -1;
    s->rows = rows;
    return through(s, curves, kinks);
}

/* Lowest and highest velocity of an axis at q. */
INLINE void speeds(const limits *m, int64_t i, double q, double *low, double *high)
{
    double twice = 2.0 * m->slowing[0][i], offset = m->slowing[1][i];
    double up = sqrt(twice * larger(m->slowing[2][i] - q, 0.0)) - offset;
    double down = sqrt(twice * larger(q - m->slowing[3][i], 0.0)) - offset;
    up = larger(up, 0.0);
    down = larger(down, 0.0);
    *high = up < m->dq[i] ? up : m->dq[i];
    *low = down < m->dq[i] ? -down : -m->dq[i];
}

EXPORT void velocity_limits(const limits *m, int64_t n, int64_t count, const double *q, double *low,
                            double *high)
{
    for (int64_t k = 0; k < n * count; k++)
        speeds(m, k % n, q[k], low + k, high + k);
}

/* Margin [rad/s] of a velocity limit that depends on the position, as libfranka keeps it (kLimitEps of
   rate_limiting.h) and an FR3's controller requires. */
#define KEPT_BACK 1e-3

/* Takes up a value that is farther beyond its limits than those before. */
static void take(double found[4], double value, double low, double high, double time)
{
    double beyond = larger(value - high, low - value);
    if (beyond <= found[0])
        return;
    found[0] = beyond;
    found[1] = value;
    found[2] = value > high ? high : low;
    found[3] = time;
}

/* Where axis i is farthest beyond its limits, of each kind; a difference counts at its later sample, as
   the controller counts it. */
static void locate(const samples *s, const limits *m, int64_t i, double (*found)[4])
{
    int64_t n = s->n;
    double per = 1.0 / s->tick, low, high;
    const double most[3] = {m->dq[i], m->ddq[i], m->jerk[i]};
    const double *rows[3] = {s->q + i, s->dq + i, s->ddq + i};
    for (int kind = 0; kind < 5; kind++)
        found[kind * n][0] = -INFINITY;
    for (int after = 0; after < 2; after++)
        for (int64_t k = after; k < s->rows; k++) {
            double time = s->tick * (double)k, value[3];
            for (int d = 0; d < 3; d++)
                value[d] = after ? (rows[d][k * n] - rows[d][k * n - n]) * per : rows[d][k * n];
            if (!after)
                take(found[0], value[0], m->q_min[i], m->q_max[i], time);
            for (int d = 0; d < 3; d++) {
                int order = after ? d : d - 1; /* of the limit: rate, acceleration, jerk */
                if (order >= 0)
                    take(found[(order < 2 ? order + 1 : 4) * n], value[d], -most[order], most[order],
                         time);
            }
            if (!m->slows)
                continue;
            speeds(m, i, rows[0][k * n], &low, &high);
            take(found[3 * n], value[after ? 0 : 1], low + KEPT_BACK, high - KEPT_BACK, time);
        }
}

EXPORT void excess(const samples *s, const limits *m, double *beyond)
{
    double (*found)[4] = (double (*)[4])beyond;
    int64_t n = s->n;
    double per = 1.0 / s->tick;
    for (int64_t i = 0; i < n; i++) {
        double low = INFINITY, high = -INFINITY, most[3] = {0.0, 0.0, 0.0};
        double step[3] = {0.0, 0.0, 0.0}, there = -INFINITY, slowest, fastest;
        const double *rows[3] = {s->q + i, s->dq + i, s->ddq + i};
        for (int64_t k = 0; k < s->rows; k++) {
            for (int d = 0; d < 3; d++) {
                double value = rows[d][k * n];
                most[d] = larger(most[d], fabs(value));
                if (k)
                    step[d] = larger(step[d], fabs(value - rows[d][k * n - n]));
            }
            low = rows[0][k * n] < low ? rows[0][k * n] : low;
            high = larger(high, rows[0][k * n]);
        }
        for (int64_t k = 0; m->slows && k < s->rows; k++) {
            double q = rows[0][k * n], v = rows[1][k * n];
            speeds(m, i, q, &slowest, &fastest);
            there = larger(there, larger(v - fastest, slowest - v));
            if (!k)
                continue;
            v = (q - rows[0][k * n - n]) * per;
            there = larger(there, larger(v - fastest, slowest - v));
        }
        const double far[5] = {
            larger(m->q_min[i] - low, high - m->q_max[i]),
            larger(most[1], step[0] * per) - m->dq[i],
            larger(most[2], step[1] * per) - m->ddq[i],
            there + KEPT_BACK,
            step[2] * per - m->jerk[i],
        };
        const double scale[5] = {1.0, m->dq[i], m->ddq[i], 1.0, m->jerk[i]};
        int breaks = 0;
        for (int kind = 0; kind < 5; kind++) {
            found[kind * n + i][0] = far[kind];
            breaks |= far[kind] > 0.0;
        }
        if (breaks)
            locate(s, m, i, found + i);
        for (int kind = 0; kind < 5; kind++)
            found[kind * n + i][0] -= ROUNDING * larger(scale[kind], 1.0);
    }
}
