/* Batches: LANES throws side by side, all in equally many steps. */
#define LANES 16
#include "functions.h"
#include "surface.h"

/* Some throws of a batch side by side, and the cubics their hands are on. */
typedef struct {
    int64_t throws[LANES], piece[LANES];
    lane law[8], grasp[1], opening, force, delay, drift[3], knot, cubic[12];
} block;

INLINE void enter_piece(const batch *b, block *k, int l)
{
    int64_t row = b->rows == 1 ? 0 : k->throws[l];
    for (int power = 0; power < 4; power++)
        for (int i = 0; i < 3; i++)
            k->cubic[3 * power + i][l]
                = b->curves[((power * b->pieces + k->piece[l]) * b->rows + row) * 3 + i];
    k->knot[l] = b->knots[k->piece[l]];
}

/* The last block is filled up with its last throw. */
INLINE void load(const batch *b, int64_t first, block *k)
{
    EACH_LANE {
        int64_t n = first + l < b->count ? first + l : b->count - 1;
        k->throws[l] = n;
        for (int i = 0; i < 8; i++)
            k->law[i][l] = b->numbers[i * b->count + n];
        k->grasp[0][l] = b->numbers[8 * b->count + n];
        k->opening[l] = b->numbers[9 * b->count + n];
        k->force[l] = b->numbers[10 * b->count + n];
        k->delay[l] = b->delays[n];
        for (int i = 0; b->drift && i < 3; i++)
            k->drift[i][l] = b->drift[i * b->count + n];
        k->piece[l] = piece_at(b->knots, b->pieces, k->delay[l]);
        enter_piece(b, k, l);
    }
}

INLINE void store(const batch *b, const block *k, const lane com[6], const lane lost[1])
{
    EACH_LANE {
        for (int i = 0; i < 6; i++)
            b->detach[6 * k->throws[l] + i] = com[i][l];
        b->lost[k->throws[l]] = lost[0][l] != 0.0;
    }
}

/* A row of shares or grip forces. */
INLINE void row_of(const batch *b, const block *k, const double *rows, int64_t row, lane value)
{
    const double *begin = rows + row * b->width;
    if (b->width == 1)
        EACH_LANE value[l] = *begin;
    else
        EACH_LANE value[l] = begin[k->throws[l]];
}

/* Pose, twist and acceleration of the hands at times [s]; they must not go back. */
INLINE void hands_at(const batch *b, block *k, const lane time, lane hand[9])
{
    lane t;
    EACH_LANE t[l] = time[l] + k->delay[l];
    if (b->pieces > 1)
        EACH_LANE {
            int64_t before = k->piece[l];
            while (k->piece[l] + 1 < b->pieces && t[l] >= b->knots[k->piece[l] + 1])
                k->piece[l]++;
            if (k->piece[l] != before)
                enter_piece(b, k, l);
        }
    EACH_LANE t[l] -= k->knot[l];
    for (int i = 0; i < 3; i++)
        EACH_LANE {
            double u = t[l], c3 = k->cubic[i][l], c2 = k->cubic[3 + i][l];
            double c1 = k->cubic[6 + i][l], c0 = k->cubic[9 + i][l];
            hand[i][l] = c0 + u * (c1 + u * (c2 + u * c3));
            hand[3 + i][l] = c1 + u * (2.0 * c2 + u * 3.0 * c3);
            hand[6 + i][l] = 2.0 * c2 + 6.0 * u * c3;
        }
    if (b->drift)
        for (int i = 0; i < 3; i++)
            EACH_LANE {
                hand[i][l] += time[l] * k->drift[i][l];
                hand[3 + i][l] += k->drift[i][l];
            }
}

WIDE_CLONES EXPORT void sliding_pivot(const batch *b)
{
    for (int64_t first = 0; first < b->count; first += LANES) {
        block k;
        lane state[6], next[6], start[9], middle[9], end[9], force[3], dt[1], out[1], lost[1];
        lane share, begun, time, inside;
        load(b, first, &k);
        for (int i = 0; i < 6; i++)
            EACH_LANE state[i][l] = 0.0;
        EACH_LANE state[2][l] = k.grasp[0][l];
        EACH_LANE lost[0][l] = 0.0;
        row_of(b, &k, b->shares, 0, share);
        EACH_LANE begun[l] = share[l] * k.opening[l];
        hands_at(b, &k, begun, end);
        for (int64_t s = 0; s < b->steps; s++) {
            row_of(b, &k, b->shares, 2 * s + 2, share);
            EACH_LANE dt[0][l] = share[l] * k.opening[l] - begun[l];
            EACH_LANE inside[l] = b->gap < dt[0][l] / 4.0 ? b->gap : dt[0][l] / 4.0;
            if (b->gap > 0.0) {
                EACH_LANE time[l] = begun[l] + inside[l];
                hands_at(b, &k, time, start);
            } else
                copy_lanes(9, end, start);
            EACH_LANE begun[l] = share[l] * k.opening[l];
            row_of(b, &k, b->shares, 2 * s + 1, share);
            EACH_LANE time[l] = share[l] * k.opening[l];
            hands_at(b, &k, time, middle);
            EACH_LANE time[l] = begun[l] - inside[l];
            hands_at(b, &k, time, end);
            for (int i = 0; i < 3; i++) {
                row_of(b, &k, b->grip, 2 * s + i, share);
                EACH_LANE force[i][l] = k.force[l] * share[l];
            }
            if (b->paper)
                paper_step(state, start, middle, end, force, dt, k.law, next);
            else
                pivot_step(state, start, middle, end, force, dt, k.law, next);
            copy_lanes(6, next, state);
            pivot_lost(state, k.law, out);
            EACH_LANE lost[0][l] = lost[0][l] + out[0][l];
        }
        pivot_end(state, end, k.law, next);
        store(b, &k, next, lost);
    }
}

WIDE_CLONES EXPORT void limit_surface(const batch *b)
{
    for (int64_t first = 0; first < b->count; first += LANES) {
        block k;
        lane state[6], next[6], start[9], end[9], force[1], dt[1], lost[1], share, begun;
        lane problem[10], found[5], held[1];
        load(b, first, &k);
        row_of(b, &k, b->shares, 0, share);
        EACH_LANE begun[l] = share[l] * k.opening[l];
        hands_at(b, &k, begun, end);
        surface_start(end, k.grasp, k.law, state);
        EACH_LANE lost[0][l] = 0.0;
        for (int64_t s = 0; s < b->steps; s++) {
            copy_lanes(9, end, start);
            row_of(b, &k, b->shares, 2 * s + 2, share);
            EACH_LANE dt[0][l] = share[l] * k.opening[l] - begun[l];
            EACH_LANE begun[l] = share[l] * k.opening[l];
            hands_at(b, &k, begun, end);
            row_of(b, &k, b->grip, 2 * s + 1, share);
            EACH_LANE force[0][l] = k.force[l] * share[l];
            surface_problem(state, start, end, force, dt, k.law, problem);
            solve_impulse(problem, found, held);
            surface_after(state, start, end, problem, found, held, dt, k.law, next);
            copy_lanes(6, next, state);
        }
        store(b, &k, state, lost);
    }
}

const char core_sources[] = CORE_SOURCES;

const int64_t core_sizes[] = {
    sizeof(batch), sizeof(bodies), sizeof(contact), sizeof(extreme), sizeof(grip), sizeof(limits),
    sizeof(linkage), sizeof(measured), sizeof(move), sizeof(moved), sizeof(path), sizeof(release),
    sizeof(samples), sizeof(scene), sizeof(solid), sizeof(thrown), sizeof(throws), sizeof(torques),
};
