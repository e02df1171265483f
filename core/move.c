/* A known throw moved to a target: its free numbers follow a slope until the exact throw lands there. */
#include <string.h>

#define LANES 1
#include "functions.h"
#include "laws.h"

/* A step that changes the landing by less than this, in units of the tolerance, teaches nothing. */
#define TINY 1e-9

/* The planned motion of free numbers, and where it lands. */
typedef struct {
    double *breaks, *curves; /* of the planned motion */
    double *u;               /* tried last */
} trial;

EXPORT void plan_motion(const move *m, const double *u, double *breaks, double *curves)
{
    int64_t n = m->n, first = 1 + (m->start ? 0 : n);
    breaks[0] = 0.0;
    for (int64_t k = 0; k < m->stages; k++) {
        double duration = k < m->carry ? u[0] / (double)m->carry : m->opening[k - m->carry];
        breaks[k + 1] = breaks[k] + duration;
    }
    for (int64_t i = 0; i < n; i++) {
        double q = m->start ? m->start[i] : u[1 + i], v = m->rate[i], a = m->acceleration[i];
        for (int64_t k = 0; k < m->stages; k++) {
            double jerk = m->unit * u[first + k * n + i], h = breaks[k + 1] - breaks[k];
            double *c = curves + i * m->stages + k;
            c[0] = jerk / 6.0;
            c[n * m->stages] = a / 2.0;
            c[2 * n * m->stages] = v;
            c[3 * n * m->stages] = q;
            q += h * (v + h * (a / 2.0 + h * jerk / 6.0));
            v += h * (a + h * jerk / 2.0);
            a += h * jerk;
        }
    }
}

/* Throws the free numbers of the trial: off[0] x [m], off[1] theta [rad]; not 0 where no motion within
   the limits can be sent. */
static int throw_trial(const move *m, trial *t, moved *found, double off[2])
{
    release r = *m->release;
    path planned, sent;
    found->lost = 0;
    plan_motion(m, t->u, t->breaks, t->curves);
    planned = (path){m->n, 4, m->stages, 0, m->stages + 1, t->breaks, t->curves, t->breaks};
    memcpy(found->sent.dq, m->rate, sizeof(double) * (size_t)m->n);
    memcpy(found->sent.ddq, m->acceleration, sizeof(double) * (size_t)m->n);
    found->sent.rows = found->room;
    found->corners = send_motion(&planned, m->limits, &found->sent, found->curves, found->kinks);
    if (found->corners < 0)
        return 1;
    for (int64_t k = 0; k < found->sent.rows; k++)
        found->times[k] = found->sent.tick * (double)k;
    sent = (path){m->n, 6, found->sent.rows - 1, 1, found->corners, found->times, found->curves,
                  found->kinks};
    r.motion = &sent;
    r.delay = t->u[0] - m->before;
    found->nodes = m->surface
        ? surface_release(&r, found->release_room, found->nodes_at)
        : pivot_release(&r, 0, found->release_room, found->nodes_at, NULL, found->onset,
                        &found->lost);
    if (found->nodes <= 0)
        return 1;
    const double *at = found->nodes_at + 7 * (found->nodes - 1);
    double pose[3];
    flight_pose(at + 1, fall_time(at + 1, m->goal[1], m->gravity), m->gravity, pose);
    off[0] = pose[0] - m->goal[0];
    off[1] = m->errors > 1 ? pose[2] - m->goal[2] : 0.0;
    return 0;
}

/* The larger of two errors, each in its unit of the aim; infinite for NaN. */
static double missed(const move *m, const double off[2])
{
    double x = fabs(off[0]) / m->aim[0], theta = fabs(off[1]) / m->aim[1];
    double larger = x > theta ? x : theta;
    return isfinite(x) && isfinite(theta) ? larger : INFINITY;
}

/* A Newton step to the landing: solves `matrix` step = -off; not 0 where that is singular. */
static int newton_step(const move *m, const double matrix[2][2], const double off[2], double step[2])
{
    double determinant = matrix[0][0] * matrix[1][1] - matrix[0][1] * matrix[1][0];
    step[1] = 0.0;
    if (m->errors == 1)
        step[0] = -off[0] / matrix[0][0];
    else {
        step[0] = (matrix[0][1] * off[1] - matrix[1][1] * off[0]) / determinant;
        step[1] = (matrix[1][0] * off[0] - matrix[0][0] * off[1]) / determinant;
    }
    return !isfinite(step[0]) || !isfinite(step[1]);
}

/* The free numbers tried: u + slope (along + step), with a duration within its bounds; not 0 where they
   leave theirs. */
static int try_numbers(const move *m, trial *t, const double along[2], const double step[2])
{
    for (int64_t i = 0; i < m->size; i++) {
        t->u[i] = m->u[i];
        for (int64_t k = 0; k < m->errors; k++)
            t->u[i] += m->slope[i * m->errors + k] * (along[k] + step[k]);
    }
    t->u[0] = fmin(fmax(t->u[0], m->shortest), m->longest);
    for (int64_t i = 0; i < m->size; i++)
        if (!(t->u[i] >= m->low[i] && t->u[i] <= m->high[i]))
            return 1;
    return 0;
}

static int moves(const move *m, trial *t, moved *found)
{
    double matrix[2][2] = {{1.0, 0.0}, {0.0, 1.0}}, along[2] = {0.0, 0.0}, longest = INFINITY;
    double off[2] = {m->off[0], m->off[1]}, last = missed(m, off), step[2], now[2];
    for (int64_t tried = 0; tried < m->throws; tried++) {
        if (newton_step(m, matrix, off, step))
            return 0;
        double length = fmax(fabs(step[0]) / m->aim[0], fabs(step[1]) / m->aim[1]);
        length = length > 0.0 ? length : TINY;
        double share = fmin(longest / length, 1.0);
        step[0] *= share;
        step[1] *= share;
        length = fmin(length, longest);
        if (try_numbers(m, t, along, step) || throw_trial(m, t, found, now))
            return 0;
        double far = missed(m, now);
        if (far <= 1.0)
            return 1;
        if (isfinite(far) && length > TINY) {
            /* Broyden: the matrix now maps this step to the change that it made. */
            double square = step[0] * step[0] + step[1] * step[1];
            for (int i = 0; i < m->errors; i++) {
                double rest = now[i] - off[i];
                for (int k = 0; k < m->errors; k++)
                    rest -= matrix[i][k] * step[k];
                for (int k = 0; k < m->errors; k++)
                    matrix[i][k] += rest * step[k] / square;
            }
        }
        if (far < m->nearer * last) {
            for (int i = 0; i < 2; i++) {
                along[i] += step[i];
                off[i] = now[i];
            }
            last = far;
            longest = INFINITY;
        } else
            longest = length / 2.0;
    }
    return 0;
}

EXPORT int64_t move_throw(const move *m, moved *found)
{
    trial t = {.breaks = found->breaks, .curves = found->cubics, .u = found->u};
    return moves(m, &t, found);
}
