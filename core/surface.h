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

#endif
