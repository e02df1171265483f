/* The functions that Python calls. Units and frame are those of structures.h.

   setup.py reads this file. A comment beside a pointer begins with the lengths of its array, in the arguments
   and their fields, which Python gives to `array`: that many elements are read, or written at most. Without
   lengths it points to one structure. NULL: there may be none. `Requires`: what must hold as well. */
#pragma once

#include "structures.h"

/* Batches of releases (batch.c): detach and lost of `b` are written. */
EXPORT void sliding_pivot(const batch *b);
EXPORT void limit_surface(const batch *b);

/* One release by the non-smooth sliding pivot, in about so many steps (0: as many as it takes), cut where
   pivot or slide begins or ends; how many nodes it has. */
EXPORT int64_t pivot_release(const release *r, int64_t steps, int64_t room,
                             double *nodes,  /* [room][7] time [s] from the opening's start, CoM's pose and twist */
                             double *states, /* [room][6] place [m] and angle [rad] on the hand, and rates; NULL:
                                                not written */
                             double *onset,  /* [2] s: when pivot and slide begin, NaN for none */
                             int64_t *lost   /* [1] whether the body left the pads before the end */
);

/* States of the sliding pivot by one step from each node to the next, from sticking at the first. */
EXPORT void pivot_track(const release *r, int64_t count,
                        const double *times, /* [count] s from the opening's start, rising */
                        double *states       /* [count][6] as of `pivot_release` */
);

/* One release by the limit surface; how many nodes it has, 0 where memory or room is lacking. */
EXPORT int64_t surface_release(const release *r, int64_t room,
                               double *nodes /* [room][7] as of `pivot_release` */
);

/* One release by so many even steps on the limit surface. */
EXPORT void surface_steps(const release *r, int64_t steps,
                          double *nodes /* [steps + 1][7] as of `pivot_release` */
);

/* Many releases of one motion, by the limit surface or the sliding pivot; not 0 without memory or room. */
EXPORT int64_t many_releases(const release *shared, int64_t surfaces, int64_t count,
                             const double *numbers, /* [count][12] law, angle, delay, turning, opening [s] */
                             double *detach, /* [count][6] CoM's pose and twist; not finite: blown up */
                             int64_t kept,   /* nodes that are kept: the first ones after even times, and the last; at least 2 */
                             double *track,  /* [count][kept][4] time [s] from the opening's start, CoM's pose */
                             int64_t *lost   /* [count] whether the body left the pads before the end */
);

/* The motion that free numbers plan: cubics that meet in position, rate and acceleration. */
EXPORT void plan_motion(const move *m,
                        const double *u, /* [m->size] as of `move` */
                        double *breaks,  /* [m->stages + 1] s, from 0 on */
                        double *curves   /* [4][m->n][m->stages] as of `path` */
);

/* Moves a known throw to the goal: 1 with its free numbers, motion, samples and release in `found`, 0 where
   no throw within the limits lands there. Requires found->size == m->size && found->stages == m->stages &&
   found->sent.n == m->n && found->sent.rows <= found->room. */
EXPORT int64_t move_throw(const move *m, moved *found);

/* Quintics through samples; the number of kinks. */
EXPORT int64_t quintics(const samples *s,
                        double *curves, /* [6][s->n][s->rows - 1] as of `path` */
                        double *kinks   /* [4 * s->rows] s, rising: where the jerk changes */
);

/* Whether a planned motion keeps the limits along each tick [s]. */
EXPORT void kept_ticks(const path *p, const limits *most, double tick, int64_t ticks,
                       unsigned char *kept /* [ticks] */
);

/* The brake of every axis, as fast as the limits allow, after the last of `given` samples; how many samples
   there are with it. Nothing is written unless s has room for them. Requires 0 < given && given <= s->rows. */
EXPORT int64_t brake(const limits *most, int64_t given, samples *s);

/* Samples of a planned motion that keeps the limits and begins with the first rates and accelerations of
   s, then of its brake. s->rows: how many fit, then how many there are. The number of kinks; below 0 for a
   motion that Ruckig must follow, and without room. Requires s->n == p->n && s->rows > 0. */
EXPORT int64_t send_motion(const path *p, const limits *most, samples *s,
                           double *curves, /* [6][s->n][s->rows - 1] quintics through them, as of `path` */
                           double *kinks   /* [4 * s->rows] s, rising */
);

/* How far samples and their differences are beyond the limits and their rounding: rows for position, rate,
   acceleration, rate where its limit depends on the position, and jerk. */
EXPORT void excess(const samples *s, const limits *m,
                   double *beyond /* [5][s->n][4] excess; where above 0, also value, limit and time [s] there */
);

/* Lowest and highest rates of n coordinates at `count` positions, where they depend on these. */
EXPORT void velocity_limits(const limits *m, int64_t n, int64_t count,
                            const double *q, /* [count][n] */
                            double *low,     /* [count][n] per s */
                            double *high     /* [count][n] per s */
);

/* Measures throws of a motion; not 0 without memory. */
EXPORT int64_t measure_throws(const throws *t, int64_t count,
                              const thrown *each,  /* [count] */
                              int64_t nodes,
                              const double *track, /* [count][nodes][4] s on the motion's clock, CoM's pose while
                                                      the pads open */
                              measured *found,     /* [count] */
                              int64_t room,        /* for things too near, of each throw */
                              contact *near,       /* [count][room] */
                              int64_t *nears       /* [count] how many there are */
);

/* Signed distances of the scene's bar from its base column, negative inside; infinite out of reach. */
EXPORT void column_distances(const scene *s, int64_t count,
                             const double *com, /* [3][count] the CoM's poses */
                             double *found      /* [count] m */
);

/* Distances of the scene's bar from the hand's body; below 0, where they overlap, how deep. */
EXPORT void palm_distances(const scene *s, int64_t count,
                           const double *com,  /* [3][count] the CoM's poses */
                           const double *hand, /* [3][count] the hand's poses */
                           double *found       /* [count] m */
);

/* Time [s] until a flight falls through `height` [m]; NaN if it never does. gravity [m/s^2]. */
EXPORT double flight_time(const double *start, /* [6] the CoM's pose and twist */
                          double height, double gravity);

/* Least clearances on the way into the scene's cup, from the lower end's passing the rim until it is
   `cup_insertion` below; -infinity for bars that miss it. */
EXPORT void cup_entries(const scene *s, int64_t count,
                        const double *detach, /* [count][6] the CoM's poses and twists */
                        const double *flight, /* [count] s until the landing, NaN or infinite for none */
                        double *found         /* [count] m */
);

/* Distances of segments from each other. */
EXPORT void segment_distances(int64_t count,
                              const double *pairs, /* [count][4][3] m: begin and end of one and of the other */
                              double *found        /* [count] m */
);

/* Bodies on their way at n times that come too near to anything; how many there are, -1 without memory.
   bar: how many of them, after the links, are the object's; flying: whether it lands at the end. */
EXPORT int64_t near_track(const bodies *all, int64_t n, int64_t bar, int64_t flying,
                          const double *times, /* [n] s, rising */
                          const double *ends,  /* [all->links + bar][2][3][n] m, in the throw's plane */
                          contact *found       /* [all->solids * (all->links + bar) + all->pairs] */
);

/* How much farther they are apart than they must be at each time, at least; infinite where there is nothing. */
EXPORT void rooms(const bodies *all, int64_t n, int64_t bar, int64_t flying,
                  const double *times, /* [n] s, rising */
                  const double *ends,  /* [all->links + bar][2][3][n] m, in the throw's plane */
                  double *room         /* [n] m */
);

/* How far two bodies of an arm, or the bar, are nearer than they may be, at most, at each of `count`
   instants; not 0 without memory. */
EXPORT int64_t overlaps(int64_t count, const linkage *arm, const bodies *all,
                        const double *q,   /* [count][arm->n] coordinates */
                        const double *com, /* [count][3] the CoM's poses, NULL without the bar */
                        double *deepest    /* [count] m */
);

/* A hash of the sources, which the loader compares. */
EXPORT extern const char core_sources[];

/* Sizes [bytes] of the structures in the order of their names, which it compares too: all their parts have
   eight bytes, so equal sizes are equal layouts. */
EXPORT extern const int64_t core_sizes[18];
