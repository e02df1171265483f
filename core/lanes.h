/* What the generated laws are written with. */
#ifndef LANES_H
#define LANES_H

#include "core.h"

/* glibc's libmvec has sines of several lanes. GCC takes them for functions that are declared like
   this, but not for its own built-in ones (-fno-builtin-sin). */
#if defined __GLIBC__ && defined __x86_64__ && defined __GNUC__ && !defined __clang__
__attribute__((simd("notinbranch"), const)) double sin(double);
__attribute__((simd("notinbranch"), const)) double cos(double);
#endif

#define EACH_LANE for (int l = 0; l < LANES; l++)
/* Before a loop over lanes: no lane loads what another one stores. Clang finds that by itself. */
#if defined __clang__
#define LANES_APART
#else
#define LANES_APART _Pragma("GCC ivdep")
#endif
typedef double lane[LANES];

INLINE void copy_lanes(int rows, const lane *from, lane *to)
{
    for (int k = 0; k < rows; k++)
        EACH_LANE to[k][l] = from[k][l];
}

/* Piece that holds time t; the first or last one beyond their ends. knots [pieces + 1] */
INLINE int64_t piece_at(const double *knots, int64_t pieces, double t)
{
    int64_t low = 0, high = pieces;
    while (high - low > 1) {
        int64_t middle = (low + high) / 2;
        if (t >= knots[middle])
            low = middle;
        else
            high = middle;
    }
    return low;
}

#endif
