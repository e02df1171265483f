/* What is sent: samples of a planned motion and of its brake, the motion through samples, limits. */
#define LANES 1
#include "motion.h"

/* As in planner/check/sending.py. */
#define SHARE 0.999
#define SAME 1e-9
/* As in models/path.py. */
#define UNEVEN 0.01

/* Of each axis; a jerk is infinite where there is no limit. slowing: deceleration, offset, upper and
   lower as in `Slowing` of models/kinematics.py, where the limits have it. */
typedef struct {
    double q_min[AXES], q_max[AXES], dq[AXES], ddq[AXES], jerk[AXES], slowing[4][AXES];
    long slows;
} limits;

/* Each [rows][n], every `tick` [s]. */
typedef struct {
    long rows, n;
    double tick;
    double *q, *dq, *ddq;
} samples;

INLINE double larger(double a, double b) { return a > b ? a : b; }

/* Value, rate and acceleration of axis i of a cubic piece, u [s] after its begin. */
INLINE void cubic_at(const path *p, long piece, long i, double u, double at[4])
{
    double c[4];
    for (int k = 0; k < 4; k++)
        c[k] = p->curves[(k * p->n + i) * p->pieces + piece];
    at[0] = ((c[0] * u + c[1]) * u + c[2]) * u + c[3];
    at[1] = (3.0 * c[0] * u + 2.0 * c[1]) * u + c[2];
    at[2] = 2.0 * (3.0 * c[0] * u + c[1]);
    at[3] = 6.0 * c[0];
}

/* Whether the planned motion keeps the limits all along, gaps between its pieces included, and
   begins with the first rates and accelerations of s. */
static int keeps(const path *p, const limits *most, const samples *s, double until)
{
    /* CLOSING of planner/check/sending.py: jerk, acceleration, rate by gaps in ticks. */
    static const double closing[3][3] = {{60.0, 96.0, 75.0}, {5.8, 9.8, 9.0}, {1.9, 3.9, 3.0}};
    double tick = s->tick;
    for (long piece = 0; piece + 1 < p->pieces; piece++)
        if (p->breaks[piece + 1] - (piece ? p->breaks[piece] : -1.0) < tick)
            return 0;
    if (p->pieces > 1 && until + 1.0 - p->breaks[p->pieces - 1] < tick)
        return 0;
    for (long i = 0; i < p->n; i++) {
        double limit[3] = {SHARE * most->jerk[i], SHARE * most->ddq[i], SHARE * most->dq[i]};
        double before[3] = {0.0, 0.0, 0.0}, end[4] = {0.0, 0.0, 0.0, 0.0};
        for (long piece = 0; piece < p->pieces; piece++) {
            double begin[4], used[3], gap[3];
            double last = piece + 1 < p->pieces ? p->breaks[piece + 1] : until;
            cubic_at(p, piece, i, 0.0, begin);
            if (piece == 0 && (begin[1] != s->dq[i] || begin[2] != s->ddq[i]))
                return 0;
            gap[0] = fabs(begin[0] - end[0]) / (tick * tick * tick);
            gap[1] = fabs(begin[1] - end[1]) / (tick * tick);
            gap[2] = fabs(begin[2] - end[2]) / tick;
            cubic_at(p, piece, i, last - p->breaks[piece], end);
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
                if (!(used[k] <= limit[k]))
                    return 0;
                if (piece && !(larger(used[k], before[k]) + close * unit <= limit[k]))
                    return 0;
                before[k] = used[k];
            }
        }
    }
    return 1;
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

/* The quintics through samples, curves [6][n][rows - 1]; kinks, at most 4 rows; their number. */
INLINE long through(const samples *s, double *curves, double *kinks)
{
    long n = s->n, pieces = s->rows - 1, count = 0;
    double h = s->tick, h2 = h * h, per = 1.0 / h, per3 = per * per * per;
    int uneven = 0;
    for (long k = 0; k <= pieces; k++) {
        int corner = uneven; /* the piece before is */
        uneven = 0;
        for (long i = 0; i < n; i++) {
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
            kinks[count++] = h * k;
        if (uneven) {
            kinks[count++] = h * (k + 1.0 / 3.0);
            kinks[count++] = h * (k + 2.0 / 3.0);
        }
    }
    return count;
}

CLONES EXPORT long quintics(const samples *s, double *curves, double *kinks)
{
    return through(s, curves, kinks);
}

/* Samples of a planned motion that keeps the limits, and of its brake, and the quintics through them.
   s: how many fit, its first rates and accelerations; then how many there are; the number of kinks, or less than 0 where more would
   be needed, and for a motion that Ruckig must follow. */
CLONES EXPORT long send_motion(const path *p, const limits *most, samples *s, double *curves,
                               double *kinks)
{
    double tick = s->tick, until, duration = 0.0;
    long n = p->n, ticks = (long)ceil(p->breaks[p->pieces] / tick - SAME), piece = 0;
    until = tick * ticks;
    if (p->powers != 4 || n > AXES || !keeps(p, most, s, until))
        return -1;
    double last[AXES][4];
    braking brake[AXES];
    piece = piece_of(p, until, piece);
    for (long i = 0; i < n; i++) {
        cubic_at(p, piece, i, until - p->breaks[piece], last[i]);
        brake[i] = brake_of(last[i][1], last[i][2], SHARE * most->ddq[i], SHARE * most->jerk[i]);
        duration = larger(duration, brake[i].first + brake[i].level + brake[i].last);
    }
    long rows = ticks + 1 + (long)ceil(duration / tick) + 1;
    if (rows > s->rows)
        return -1;
    s->rows = rows;
    piece = 0;
    for (long k = 0; k <= ticks; k++) {
        double t = tick * k, at[4];
        piece = piece_of(p, t, piece);
        for (long i = 0; i < n; i++) {
            cubic_at(p, piece, i, t - p->breaks[piece], at);
            s->q[k * n + i] = at[0];
            s->dq[k * n + i] = at[1];
            s->ddq[k * n + i] = at[2];
        }
    }
    for (long k = ticks + 1; k < rows; k++)
        for (long i = 0; i < n; i++)
            braked(&brake[i], SHARE * most->jerk[i], tick * (k - ticks), last[i], &s->q[k * n + i],
                   &s->dq[k * n + i], &s->ddq[k * n + i]);
    return through(s, curves, kinks);
}

/* Lowest and highest velocity of an axis at q. */
INLINE void speeds(const limits *m, long i, double q, double *low, double *high)
{
    double twice = 2.0 * m->slowing[0][i], offset = m->slowing[1][i];
    double up = sqrt(twice * larger(m->slowing[2][i] - q, 0.0)) - offset;
    double down = sqrt(twice * larger(q - m->slowing[3][i], 0.0)) - offset;
    up = larger(up, 0.0);
    down = larger(down, 0.0);
    *high = up < m->dq[i] ? up : m->dq[i];
    *low = down < m->dq[i] ? -down : -m->dq[i];
}

/* Kept back [rad/s] of a velocity limit that depends on the position, as in check/sending.py. */
#define KEPT_BACK 1e-3

/* How far [5][n] position, velocity, acceleration, velocity there and jerk of samples and of their
   differences are beyond their limits. */
CLONES EXPORT void excess(const samples *s, const limits *m, double *beyond)
{
    long n = s->n;
    double per = 1.0 / s->tick;
    for (long i = 0; i < n; i++) {
        double low = INFINITY, high = -INFINITY, most[3] = {0.0, 0.0, 0.0};
        double step[3] = {0.0, 0.0, 0.0}, there = -INFINITY, slowest, fastest;
        const double *rows[3] = {s->q + i, s->dq + i, s->ddq + i};
        for (long k = 0; k < s->rows; k++) {
            for (int d = 0; d < 3; d++) {
                double value = rows[d][k * n];
                most[d] = larger(most[d], fabs(value));
                if (k)
                    step[d] = larger(step[d], fabs(value - rows[d][k * n - n]));
            }
            low = rows[0][k * n] < low ? rows[0][k * n] : low;
            high = larger(high, rows[0][k * n]);
        }
        for (long k = 0; m->slows && k < s->rows; k++) {
            double q = rows[0][k * n], v = rows[1][k * n];
            speeds(m, i, q, &slowest, &fastest);
            there = larger(there, larger(v - fastest, slowest - v));
            if (!k)
                continue;
            v = (q - rows[0][k * n - n]) * per;
            /* As the controller does, at the later sample. */
            there = larger(there, larger(v - fastest, slowest - v));
        }
        beyond[i] = larger(m->q_min[i] - low, high - m->q_max[i]);
        beyond[n + i] = larger(most[1], step[0] * per) - m->dq[i];
        beyond[2 * n + i] = larger(most[2], step[1] * per) - m->ddq[i];
        beyond[3 * n + i] = there + KEPT_BACK;
        beyond[4 * n + i] = step[2] * per - m->jerk[i];
    }
}
