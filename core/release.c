/* Exact releases of one throw: the non-smooth sliding pivot with located events, and the limit surface
   by extrapolated steps. */
#include <stdlib.h>

#define LANES 1
#include "functions.h"
#include "motion.h"
#include "surface.h"

/* Steps of the first run, doubled until the detach state settles, at most so often. */
#define FIRST 16
#define DOUBLINGS 5
/* A finer run has settled if it changes the landing by less than this [m], roughly: its own error is
   then below a tenth of that. An angle counts by a lever [m], a velocity over a flight [s]. */
#define SETTLED 5e-5
#define LEVER 0.1
#define FLIGHT 0.5
/* Events are located within this share of the opening, and so many of them in a run. */
#define LOCATED 1e-9
#define EVENTS 200
/* Kinks nearer than this share of the opening to each other or to its ends are one. */
#define APART 1e-9
/* The acceleration may step at a kink: seen from either side so far away [s]. */
#define INSIDE 1e-12

/* A release on its way. */
typedef struct {
    const release *r;
    int64_t piece, nodes, room, events;
    double (*rows)[7];   /* node by node: time, CoM pose and twist */
    double (*states)[6]; /* node by node, or NULL: `state` */
    double time, state[6][1], hand[9][1], excess[3];
    double onset[2];
    int lost;
} run;

static void hand_at(run *k, double time, lane hand[9])
{
    lane t = {time + k->r->delay};
    moved_at(k->r->motion, k->r->arm, t, &k->piece, hand);
    hand[2][0] += k->r->turning * time;
    hand[5][0] += k->r->turning;
}

static double force_at(const grip *g, double t)
{
    t = fmin(fmax(t, 0.0), g->opening) / g->stretch;
    int64_t i = piece_at(g->breaks, g->pieces, t);
    double u = t - g->breaks[i], f = 0.0;
    for (int power = 0; power < 4; power++)
        f = f * u + g->curves[power * g->pieces + i];
    return fmax(f, 0.0);
}

/* Nodes are denser towards the opening's end: even in s, where its share is 1 - (1 - s)^1.5. */
static double graded(double s)
{
    double u = 1.0 - s;
    return 1.0 - u * sqrt(u);
}

static double even(double share) { return 1.0 - cbrt((1.0 - share) * (1.0 - share)); }

static const lane *law_of(const run *k) { return (const lane *)k->r->law; }

/* How far torque, force and slip are beyond their limits. */
static void excess_at(run *k, double time, const lane state[6], const lane hand[9], double found[3])
{
    lane force[1] = {{force_at(&k->r->grip, time)}}, over[2];
    pivot_excess(state, hand, force, law_of(k), over);
    found[0] = over[0][0];
    found[1] = over[1][0];
    found[2] = length(state[0][0], state[1][0]) - (fabs(k->r->law[2]) + LOST_SLIP);
}

/* State, hand and excess after a step of h [s]. */
static void stepped(run *k, double h, lane state[6], lane hand[9], double excess[3])
{
    lane middle[9], force[3], dt[1] = {{h}};
    const grip *g = &k->r->grip;
    hand_at(k, k->time + h / 2, middle);
    hand_at(k, k->time + h - INSIDE, hand);
    for (int i = 0; i < 3; i++)
        force[i][0] = force_at(g, k->time + i * h / 2);
    if (k->r->paper)
        paper_step(k->state, k->hand, middle, hand, force, dt, law_of(k), state);
    else
        pivot_step(k->state, k->hand, middle, hand, force, dt, law_of(k), state);
    excess_at(k, k->time + h, state, hand, excess);
}

/* Share of a step at which the first of the event functions changes sign, on a line; 2 if none does. */
static double crossing(const double before[3], const double after[3])
{
    double first = 2.0;
    for (int i = 0; i < 3; i++)
        if ((before[i] > 0) != (after[i] > 0))
            first = fmin(first, before[i] / (before[i] - after[i]));
    return first;
}

static void onsets(run *k)
{
    for (int i = 0; i < 2; i++)
        if (k->excess[i] > 0 && isnan(k->onset[i]))
            k->onset[i] = k->time;
    k->lost |= k->excess[2] > 0;
}

static void record(run *k)
{
    lane com[6];
    pivot_end(k->state, k->hand, law_of(k), com);
    double *row = k->rows[k->nodes];
    row[0] = k->time;
    for (int i = 0; i < 6; i++) {
        row[1 + i] = com[i][0];
        if (k->states)
            k->states[k->nodes][i] = k->state[i][0];
    }
    k->nodes++;
}

static void arrive(run *k, double time, const lane state[6], const lane hand[9], const double excess[3])
{
    k->time = time;
    copy_lanes(6, state, k->state);
    copy_lanes(9, hand, k->hand);
    for (int i = 0; i < 3; i++)
        k->excess[i] = excess[i];
}

/* One step to `end`, or to just after the first event before it. */
static void advance(run *k, double end)
{
    double state[6][1], hand[9][1], excess[3], h = end - k->time;
    stepped(k, h, state, hand, excess);
    double share = crossing(k->excess, excess), low = 0.0, high = 1.0, from[3];
    double near = LOCATED * k->r->grip.opening / h;
    for (int i = 0; i < 3; i++)
        from[i] = k->excess[i];
    if (share < 2.0 && k->events < EVENTS) {
        k->events++;
        /* Secant steps that aim just behind the root, so that the step ends in the new mode. */
        for (int i = 0; i < 40 && high - low > near; i++) {
            double root = low + (high - low) * share;
            double at = i % 4 < 3 ? root + near / 2 : (low + high) / 2;
            double tried[6][1], there[9][1], found[3];
            at = fmin(at, high - near / 4);
            stepped(k, at * h, tried, there, found);
            double next = crossing(k->excess, found);
            if (next < 2.0) {
                high = at;
                copy_lanes(6, tried, state);
                copy_lanes(9, there, hand);
                for (int j = 0; j < 3; j++)
                    excess[j] = found[j];
                share = crossing(from, found);
                if (at - (low + (high - low) * share) <= near)
                    break;
            } else {
                low = at;
                for (int j = 0; j < 3; j++)
                    from[j] = found[j];
                share = crossing(from, excess);
            }
        }
        end = k->time + high * h;
        if (k->r->paper) {
            /* Its rates jump: a step ends before that, and one that is nearly nothing leads over it. */
            high = fmax(high - 2.0 * near, 0.0);
            stepped(k, high * h, state, hand, excess);
            arrive(k, k->time + high * h, state, hand, excess);
            stepped(k, end - k->time, state, hand, excess);
        }
    }
    arrive(k, end, state, hand, excess);
    onsets(k);
    record(k);
}

/* The opening in about `steps` steps, denser towards its end: a node at each kink. */
static void run_pivot(run *k, int64_t steps)
{
    const release *r = k->r;
    const path *p = r->motion;
    double opening = r->grip.opening;
    k->nodes = k->events = k->piece = k->lost = 0;
    k->time = 0.0;
    k->onset[0] = k->onset[1] = NAN;
    for (int i = 0; i < 6; i++)
        k->state[i][0] = 0.0;
    k->state[2][0] = r->angle;
    hand_at(k, INSIDE, k->hand);
    record(k);
    double begun = 0.0;
    for (int64_t c = 0; c <= p->corners; c++) {
        double end = c < p->corners ? (p->kinks[c] - r->delay) / opening : 1.0;
        if (c < p->corners && (end < begun + APART || end > 1.0 - APART))
            continue;
        double s = even(begun), way = even(end) - s;
        int64_t parts = (int64_t)ceil(way * (double)steps - 1e-6);
        hand_at(k, k->time + INSIDE, k->hand);
        excess_at(k, k->time, k->state, k->hand, k->excess);
        onsets(k);
        for (int64_t i = 1; i <= parts; i++) {
            double node = graded(s + way * (double)i / (double)parts) * opening;
            if (i == parts)
                node = end * opening;
            while (k->time < node - 1e-3 * LOCATED * opening && k->nodes < k->room)
                advance(k, node);
            k->time = node;
        }
        begun = end;
    }
}

EXPORT int64_t pivot_release(const release *r, int64_t steps, int64_t room, double *nodes, double *states,
                             double *onset, int64_t *lost)
{
    double (*rows)[7] = (double (*)[7])nodes;
    run k = {.r = r, .room = room, .rows = rows, .states = (double (*)[6])states};
    double before[6];
    int64_t taken = steps ? steps : FIRST;
    for (int i = 0;; i++, taken *= 2) {
        run_pivot(&k, taken);
        const double *com = rows[k.nodes - 1] + 1;
        double far = 0.0;
        for (int j = 0; i && j < 6; j++)
            far += fabs(com[j] - before[j]) * (j % 3 == 2 ? LEVER : 1.0) * (j < 3 ? 1.0 : FLIGHT);
        if (steps || i == DOUBLINGS || (i && far <= SETTLED))
            break;
        for (int j = 0; j < 6; j++)
            before[j] = com[j];
    }
    onset[0] = k.onset[0];
    onset[1] = k.onset[1];
    *lost = k.lost;
    return k.nodes;
}

EXPORT void pivot_track(const release *r, int64_t count, const double *times, double *states)
{
    run k = {.r = r};
    double state[6][1], hand[9][1], excess[3];
    k.state[2][0] = r->angle;
    for (int64_t n = 0; n < count; n++) {
        if (n) {
            hand_at(&k, times[n - 1] + INSIDE, k.hand);
            k.time = times[n - 1];
            stepped(&k, times[n] - times[n - 1], state, hand, excess);
            for (int i = 0; i < 6; i++)
                k.state[i][0] = state[i][0];
        }
        for (int i = 0; i < 6; i++)
            states[6 * n + i] = k.state[i][0];
    }
}

/* The limit surface: first order in its steps, therefore extrapolated. It has nodes where slip stops:
   if friction turns round inside a step, the whole step is taken with the new friction, and once all
   steps are longer than the rest of the old slip takes, that error does not shrink with them. */

/* Even intervals of the stretched opening, and in how many a run takes them at most. */
#define INTERVALS 50
#define MOST 2048
/* Settled [m]: of the first order there is more left than of the sliding pivot. */
#define SURFACE_SETTLED 2.5e-4
/* A node is put where slip stops, if that is farther than this share of the opening from the ends of
   its step, so often at most; stops that are nearer to each other, in two runs, are one. */
#define OFF_NODE 1e-5
#define PLACINGS 6
#define SAME 1e-3
#define STOPS 64
/* Friction of two steps whose directions' cosine is below this may have turned round. */
#define TURNED 0.99

/* Nodes of the finest run and what its steps need; friction in half axes of the surface. */
typedef struct {
    const release *r;
    int64_t steps, stops;
    double stop[STOPS];                 /* [s] */
    double *times, (*hands)[9][1], *forces; /* forces: at and between the inner nodes */
    double (*states)[6][1], (*halved)[6], (*friction)[3][1]; /* halved: states of half as many steps */
} surface;

static const lane *numbers_of(const surface *f) { return (const lane *)f->r->law; }

/* The problem of the step over `stride` intervals from node k on. */
static void posed(const surface *f, int64_t k, int64_t stride, const lane state[6], lane problem[10])
{
    lane dt[1] = {{f->times[k + stride] - f->times[k]}}, force[1] = {{f->forces[2 * k + stride]}};
    surface_problem(state, f->hands[k], f->hands[k + stride], force, dt, numbers_of(f), problem);
}

/* One step over `stride` intervals from node k on: the state after it, and its friction. */
static void stepped_surface(const surface *f, int64_t k, int64_t stride, const lane state[6],
                            lane next[6], lane friction[3])
{
    lane dt[1] = {{f->times[k + stride] - f->times[k]}};
    lane problem[10], found[5], held[1];
    posed(f, k, stride, state, problem);
    solve_impulse(problem, found, held);
    surface_friction(problem, found, held, friction);
    surface_after(state, f->hands[k], f->hands[k + stride], problem, found, held, dt, numbers_of(f), next);
}

/* States after steps over `stride` intervals; kept for the two finest, with friction for the finest. */
static void run_surface(surface *f, int64_t stride, double end[6])
{
    double state[6][1], next[6][1];
    lane grasp[1] = {{f->r->angle}}, friction[3];
    surface_start(f->hands[0], grasp, numbers_of(f), state);
    for (int64_t k = 0; k < f->steps; k += stride) {
        stepped_surface(f, k, stride, state, next, friction);
        if (stride == 1) {
            copy_lanes(6, state, f->states[k]);
            copy_lanes(3, friction, f->friction[k]);
        }
        if (stride == 2)
            for (int j = 0; j < 6; j++)
                f->halved[k][j] = state[j][0];
        copy_lanes(6, next, state);
    }
    for (int j = 0; j < 6; j++)
        end[j] = state[j][0];
}

/* Slip that step k leaves, and K^-1 times its friction before, in half axes. */
static double slip_of(const surface *f, int64_t k, const lane before[3], double slip[3], double way[3])
{
    double problem[10][1], found[5][1];
    lane held[1];
    const lane *own = f->friction[k];
    posed(f, k, 1, f->states[k], problem);
    double radius = problem[9][0], y[3];
    for (int i = 0; i < 3; i++)
        y[i] = radius * own[i][0];
    slip[0] = problem[0][0] * y[0] + problem[3][0] * y[1] + problem[4][0] * y[2] - problem[6][0];
    slip[1] = problem[3][0] * y[0] + problem[1][0] * y[1] + problem[5][0] * y[2] - problem[7][0];
    slip[2] = problem[4][0] * y[0] + problem[5][0] * y[1] + problem[2][0] * y[2] - problem[8][0];
    for (int i = 0; i < 3; i++)
        problem[6 + i][0] = before[i][0];
    surface_sticking(problem, found, held);
    for (int i = 0; i < 3; i++)
        way[i] = radius * found[1 + i][0];
    return radius;
}

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Share of step k + 1 after which the slip at its start has stopped, or more than 1: had friction not
   turned round in the step, it would have been on the other side of the limit surface, where slip
   differs along its direction before the step only. */
static double stop_of(const surface *f, int64_t k)
{
    double slip[3], later[3], way[3], old[3], new[3], change[3];
    slip_of(f, k, f->friction[k], slip, way);
    double radius = slip_of(f, k + 1, f->friction[k], later, way);
    for (int i = 0; i < 3; i++) {
        old[i] = f->friction[k][i][0];
        new[i] = radius * f->friction[k + 1][i][0];
        change[i] = later[i] - slip[i];
    }
    /* The farther |new + braking way| = radius, in the form that does not cancel. */
    double a = dot(way, way), b = dot(way, new), c = fmin(dot(new, new) - radius * radius, 0.0);
    double root = sqrt(b * b - a * c);
    double braking = b <= 0.0 && a > 0.0 ? (root - b) / a : -c / fmax(root + b, 1e-300);
    double rise = dot(old, change) + radius * braking;
    return rise > 0.0 ? -dot(old, slip) / rise : 2.0;
}

/* Adds the stops of the finest run to those that have nodes; whether there are any. */
static int placed(surface *f)
{
    double opening = f->r->grip.opening, found[STOPS];
    int64_t count = 0, kept = 0;
    for (int64_t k = 0; k + 1 < f->steps && count < STOPS / 2; k++) {
        double old[3], new[3];
        for (int i = 0; i < 3; i++) {
            old[i] = f->friction[k][i][0];
            new[i] = f->friction[k + 1][i][0];
        }
        if (dot(old, new) >= TURNED || dot(old, old) <= 1.0 - 2e-6)
            continue;
        double begin = f->times[k + 1], end = f->times[k + 2];
        double stop = begin + (end - begin) * stop_of(f, k);
        if (begin + OFF_NODE * opening < stop && stop < end - OFF_NODE * opening)
            found[count++] = stop;
    }
    /* Better known now are those that had a node close by. */
    for (int64_t i = 0; i < f->stops && count; i++) {
        int far = 1;
        for (int64_t j = 0; j < count; j++)
            far &= fabs(f->stop[i] - found[j]) > SAME * opening;
        if (far && kept < STOPS / 2)
            f->stop[kept++] = f->stop[i];
    }
    for (int64_t j = 0; j < count; j++)
        f->stop[kept++] = found[j];
    if (count)
        f->stops = kept;
    return count > 0;
}

static int rising(const void *a, const void *b)
{
    double d = *(const double *)a - *(const double *)b;
    return d < 0.0 ? -1 : d > 0.0;
}

/* Lays the nodes, `parts` to each interval, and asks for hand and grip there; whether there was room. */
static int lay(surface *f, int64_t parts)
{
    const release *r = f->r;
    const path *p = r->motion;
    double opening = r->grip.opening;
    double *cuts = malloc((size_t)(p->corners + f->stops + 1) * sizeof *cuts);
    if (!cuts)
        return 0;
    int64_t count = 0;
    for (int64_t c = 0; c < p->corners; c++) {
        double cut = (p->kinks[c] - r->delay) / opening;
        /* Most of a motion's kinks are outside, and what is asked for here is freed at once. */
        if (cut > APART && cut < 1.0)
            cuts[count++] = cut;
    }
    for (int64_t c = 0; c < f->stops; c++)
        cuts[count++] = f->stop[c] / opening;
    int64_t room = (INTERVALS + count + 1) * parts + 1;
    qsort(cuts, (size_t)count, sizeof *cuts, rising);
    cuts[count] = 1.0;
    f->times = realloc(f->times, (size_t)room * sizeof *f->times);
    f->forces = realloc(f->forces, 2 * (size_t)room * sizeof *f->forces);
    f->hands = realloc(f->hands, (size_t)room * sizeof *f->hands);
    f->states = realloc(f->states, (size_t)room * sizeof *f->states);
    f->halved = realloc(f->halved, (size_t)room * sizeof *f->halved);
    f->friction = realloc(f->friction, (size_t)room * sizeof *f->friction);
    if (!f->times || !f->forces || !f->hands || !f->states || !f->halved || !f->friction) {
        free(cuts);
        return 0;
    }
    run k = {.r = r};
    double begun = 0.0;
    f->steps = 0;
    for (int64_t c = 0; c <= count; c++) {
        double end = cuts[c];
        if (c < count && (end < begun + APART || end > 1.0 - APART))
            continue;
        double s = even(begun), way = even(end) - s;
        int64_t pieces = parts * (int64_t)ceil(way * INTERVALS - 1e-6);
        for (int64_t i = 0; i < 2 * pieces; i++) {
            double t = graded(s + way * (double)i / (double)(2 * pieces)) * opening;
            if (i == 0)
                t = begun * opening;
            f->forces[2 * f->steps + i % 2] = force_at(&r->grip, t);
            if (i % 2 == 0) {
                f->times[f->steps] = t;
                hand_at(&k, t, f->hands[f->steps]);
            } else
                f->steps++;
        }
        begun = end;
    }
    f->times[f->steps] = opening;
    hand_at(&k, opening, f->hands[f->steps]);
    free(cuts);
    return 1;
}

/* All nodes are extrapolated. */
EXPORT int64_t surface_release(const release *r, int64_t room, double *nodes)
{
    double (*rows)[7] = (double (*)[7])nodes;
    surface f = {.r = r};
    double detach[6];
    int64_t parts = 4, count = 0;
    int placings = 0, there;
    while ((there = lay(&f, parts))) {
        double fine[6], middle[6], coarse[6], far = 0.0;
        run_surface(&f, 1, fine);
        if (placings < PLACINGS && placed(&f)) {
            placings++;
            continue;
        }
        run_surface(&f, 2, middle);
        run_surface(&f, 4, coarse);
        for (int i = 0; i < 6; i++) {
            double before = 2.0 * middle[i] - coarse[i];
            detach[i] = 2.0 * fine[i] - middle[i];
            far += fabs(detach[i] - before) * (i % 3 == 2 ? LEVER : 1.0) * (i < 3 ? 1.0 : FLIGHT);
        }
        if (f.steps >= MOST || far <= SURFACE_SETTLED)
            break;
        parts *= 2;
    }
    if (there && room < 2 * f.steps / parts + 1)
        there = 0;
    for (int64_t k = 0; there && k < f.steps; k += parts / 2, count++) {
        rows[count][0] = f.times[k];
        for (int i = 0; i < 6; i++)
            rows[count][1 + i] = 2.0 * f.states[k][i][0] - f.halved[k][i];
    }
    if (count) {
        rows[count][0] = r->grip.opening;
        for (int i = 0; i < 6; i++)
            rows[count][1 + i] = detach[i];
        count++;
    }
    free(f.times);
    free(f.forces);
    free(f.hands);
    free(f.states);
    free(f.halved);
    free(f.friction);
    return count;
}

EXPORT void surface_steps(const release *r, int64_t steps, double *nodes)
{
    run k = {.r = r};
    double state[6][1], next[6][1], start[9][1], end[9][1], problem[10][1], found[5][1];
    double opening = r->grip.opening, step = opening / (double)steps;
    lane held[1], dt[1] = {{step}}, grasp[1] = {{r->angle}};
    hand_at(&k, 0.0, end);
    surface_start(end, grasp, law_of(&k), state);
    for (int64_t n = 0;; n++, nodes += 7) {
        nodes[0] = n < steps ? step * (double)n : opening;
        for (int i = 0; i < 6; i++)
            nodes[1 + i] = state[i][0];
        if (n >= steps)
            return;
        lane force[1] = {{force_at(&r->grip, step * ((double)n + 0.5))}};
        copy_lanes(9, end, start);
        hand_at(&k, n + 1 < steps ? step * (double)(n + 1) : opening, end);
        surface_problem(state, start, end, force, dt, law_of(&k), problem);
        solve_impulse(problem, found, held);
        surface_after(state, start, end, problem, found, held, dt, law_of(&k), next);
        copy_lanes(6, next, state);
    }
}

EXPORT int64_t many_releases(const release *shared, int64_t surfaces, int64_t count, const double *numbers,
                             double *detach, int64_t kept, double *track, int64_t *lost)
{
    const int64_t room = 4096 + 2 * shared->motion->corners;
    double (*rows)[7] = malloc(sizeof *rows * (size_t)room), onset[2];
    if (!rows)
        return 1;
    for (int64_t k = 0; k < count; k++) {
        release r = *shared;
        const double *n = numbers + 12 * k;
        for (int i = 0; i < 8; i++)
            r.law[i] = n[i];
        r.angle = n[8];
        r.delay = n[9];
        r.turning = n[10];
        r.grip.stretch = n[11] / shared->grip.opening;
        r.grip.opening = n[11];
        lost[k] = 0;
        int64_t nodes = surfaces ? surface_release(&r, room, rows[0])
                              : pivot_release(&r, 0, room, rows[0], NULL, onset, lost + k);
        if (!nodes) {
            free(rows);
            return 1;
        }
        for (int i = 0; i < 6; i++)
            detach[6 * k + i] = rows[nodes - 1][1 + i];
        for (int64_t i = 0, at = 0; i < kept; i++, track += 4) {
            double time = r.grip.opening * (double)i / (double)(kept - 1);
            while (at < nodes - 1 && (i == kept - 1 || rows[at][0] < time))
                at++;
            for (int j = 0; j < 4; j++)
                track[j] = rows[at][j];
        }
    }
    free(rows);
    return 0;
}
