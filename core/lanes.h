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
typedef double lane[LANES];

/* Piece that holds time t; the first or last one beyond their ends. knots [pieces + 1] */
INLINE long piece_at(const double *knots, long pieces, double t)
{
    long low = 0, high = pieces;
    while (high - low > 1) {
        long middle = (low + high) / 2;
        if (t >= knots[middle])
            low = middle;
        else
            high = middle;
    }
    return low;
}

#endif
