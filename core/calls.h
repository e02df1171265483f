/* Functions of one file that another calls. */
#ifndef CALLS_H
#define CALLS_H

#include "structures.h"

int64_t send_motion(const path *p, const limits *most, samples *s, double *curves, double *kinks);
int64_t pivot_release(const release *r, int64_t room, double (*rows)[7], double onset[2], int *lost);
int64_t surface_release(const release *r, int64_t room, double (*rows)[7]);

#endif
