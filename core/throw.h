/* A throw as the core measures it. */
#ifndef THROW_H
#define THROW_H

#include "motion.h"

/* The throw whose flight a sample is; `around` is where its scene goes. */
static inline throw throw_of(const throw *shared, const flown_sample *f, scene *around)
{
    throw t = *shared;
    *around = *shared->around;
    around->ahead += around->behind - f->behind;
    around->behind = f->behind;
    around->cup_x = f->cup_x;
    t.around = around;
    t.opening = f->opening;
    t.detach = f->detach;
    t.flight = f->flight;
    t.start = f->start;
    for (int i = 0; i < 6; i++)
        t.error[i] = f->error[i];
    return t;
}

#endif
