/* The contact impulse of a step on the limit surface. */
#ifndef SURFACE_H
#define SURFACE_H

#include "laws.h"
#include "structures.h"

INLINE int any(const lane flag[1])
{
    double sum = 0.0;
    EACH_LANE sum += flag[0][l];
    return sum != 0.0;
}

/* Newton's method until all lanes have settled; held: which of them stick. */
INLINE void solve_impulse(const lane problem[10], lane found[5], lane held[1])
{
    lane better[5], moving[1];
    surface_sticking(problem, found, held);
    for (int i = 0; i < ITERATIONS; i++) {
        surface_moving(problem, found, held, moving);
        if (!any(moving))
            break;
        surface_refined(problem, found, moving, better);
        copy_lanes(5, better, found);
    }
}

/* Size of wrenches w on a surface of another shape: 1 on it, for limits of 1. */
INLINE void shape_use(const shape *f, const lane w[3], lane use[1])
{
    lane quartic[15];
    for (int i = 0; i < 15; i++)
        EACH_LANE quartic[i][l] = f->quartic[i];
    if (f->points)
        points_use(w, use);
    else
        quartic_use(w, quartic, use);
}

/* Takes over the lanes that move: rows of `from`, and whether they have settled. */
INLINE void take_moving(int rows, const lane *from, const lane way[1], lane moving[1], lane *to)
{
    for (int k = 0; k < rows; k++)
        EACH_LANE to[k][l] = moving[0][l] != 0.0 ? from[k][l] : to[k][l];
    EACH_LANE moving[0][l] = moving[0][l] != 0.0 && !(way[0][l] <= SETTLED_SHARE) ? 1.0 : 0.0;
}

/* The impulse w of largest dissipation on a surface of another shape, and its use of the limit. */
INLINE void solve_shaped(const shape *f, const lane base[10], lane w[3], lane use[1])
{
    lane found[5], held[1], moving[1], way[1], problem[10], factor[9], quartic[15], share[1];
    lane next[3], unknowns[7], better[7];
    surface_sticking(base, found, held);
    copy_lanes(3, found + 1, w);
    shape_use(f, w, use);
    EACH_LANE {
        double radius = base[9][l];
        moving[0][l] = use[0][l] > radius && radius > 0.0 ? 1.0 : 0.0;
        use[0][l] = use[0][l] < radius ? use[0][l] / radius : 1.0;
        for (int i = 0; i < 3; i++)
            w[i][l] = radius > 0.0 ? w[i][l] : 0.0;
        share[0][l] = FIRST_SHARE;
    }
    for (int i = 0; i < 15; i++)
        EACH_LANE quartic[i][l] = f->quartic[i];
    for (int i = 0; i < 7; i++)
        EACH_LANE unknowns[i][l] = 0.0;
    for (int i = 0; f->points && i < POINT_ITERATIONS && any(moving); i++) {
        points_refined(base, unknowns, better, way);
        take_moving(7, better, way, moving, unknowns);
    }
    if (f->points) {
        points_wrench(base, unknowns, next);
        for (int i = 0; i < 3; i++)
            EACH_LANE w[i][l] = use[0][l] < 1.0 || !(base[9][l] > 0.0) ? w[i][l] : next[i][l];
    }
    for (int i = 0; !f->points && i < QUARTIC_ITERATIONS && any(moving); i++) {
        quartic_tangent(base, w, quartic, share, problem, factor);
        solve_impulse(problem, found, held);
        quartic_wrench(base, found, factor, w, quartic, next, way);
        take_moving(3, next, way, moving, w);
        EACH_LANE share[0][l] = share[0][l] * LEFT > 1e-7 ? share[0][l] * LEFT : 1e-7;
    }
}

/* State after a step on a surface of another shape, and its friction: along w, as long as its use. */
INLINE void shaped_step(const shape *f, const lane state[6], const lane start[9], const lane end[9],
                        const lane force[1], const lane dt[1], const lane law[8], lane next[6],
                        lane friction[3])
{
    lane base[10], w[3], use[1];
    shaped_problem(state, start, end, force, dt, law, base);
    solve_shaped(f, base, w, use);
    EACH_LANE {
        double size = sqrt(w[0][l] * w[0][l] + w[1][l] * w[1][l] + w[2][l] * w[2][l]) + 1e-300;
        for (int i = 0; i < 3; i++)
            friction[i][l] = w[i][l] / size * use[0][l];
    }
    shaped_after(state, start, end, w, dt, law, next);
}

#endif
