"""C text around the generated loops of a batch: blocks of throws, hands, steps.

The functions called pivot_... and surface_... are generated, see batch_functions.
"""

BLOCKS = """
/* A batch, as Python has it. Numbers: those of the laws, then grasp angle, opening, force. */
typedef struct {
    long count, steps, pieces, rows;
    const double *shares;  /* instants, as shares of the opening */
    const double *grip;    /* force at the instants that need it, over the full force */
    const double *numbers; /* [11][count] */
    const double *knots;   /* [pieces + 1] */
    const double *curves;  /* [4][pieces][rows][3] */
    const double *delays;  /* [count] */
    double *detach;        /* [count][6] */
    unsigned char *lost;   /* [count] */
} batch;

/* Some throws of a batch side by side, and the cubics their hands are on. */
typedef struct {
    long throws[LANES], piece[LANES];
    lane law[8], grasp[1], opening, force, delay, knot, cubic[12];
} block;

static void enter_piece(const batch *b, block *k, int l)
{
    long row = b->rows == 1 ? 0 : k->throws[l];
    for (int power = 0; power < 4; power++)
        for (int i = 0; i < 3; i++)
            k->cubic[3 * power + i][l]
                = b->curves[((power * b->pieces + k->piece[l]) * b->rows + row) * 3 + i];
    k->knot[l] = b->knots[k->piece[l]];
}

/* Piece that holds time t; the first or last one beyond their ends. */
static long piece_at(const batch *b, double t)
{
    long low = 0, high = b->pieces;
    while (high - low > 1) {
        long middle = (low + high) / 2;
        if (t >= b->knots[middle])
            low = middle;
        else
            high = middle;
    }
    return low;
}

/* The last block is filled up with its last throw. */
static void load(const batch *b, long first, block *k)
{
    EACH_LANE {
        long n = first + l < b->count ? first + l : b->count - 1;
        k->throws[l] = n;
        for (int i = 0; i < 8; i++)
            k->law[i][l] = b->numbers[i * b->count + n];
        k->grasp[0][l] = b->numbers[8 * b->count + n];
        k->opening[l] = b->numbers[9 * b->count + n];
        k->force[l] = b->numbers[10 * b->count + n];
        k->delay[l] = b->delays[n];
        k->piece[l] = piece_at(b, k->delay[l]);
        enter_piece(b, k, l);
    }
}

static void store(const batch *b, const block *k, const lane com[6], const lane lost[1])
{
    EACH_LANE {
        for (int i = 0; i < 6; i++)
            b->detach[6 * k->throws[l] + i] = com[i][l];
        b->lost[k->throws[l]] = lost[0][l] != 0.0;
    }
}

/* Pose, twist and acceleration of the hands; instants must not go back. */
static void hands_at(const batch *b, block *k, double share, lane hand[9])
{
    lane t;
    EACH_LANE t[l] = share * k->opening[l] + k->delay[l];
    if (b->pieces > 1)
        EACH_LANE {
            long before = k->piece[l];
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
}

static void copy(int rows, const lane from[], lane to[])
{
    for (int i = 0; i < rows; i++)
        EACH_LANE to[i][l] = from[i][l];
}
"""

SLIDING_PIVOT = """
void sliding_pivot(const batch *b)
{
    for (long first = 0; first < b->count; first += LANES) {
        block k;
        lane state[6], next[6], start[9], middle[9], end[9], force[3], dt[1], out[1], lost[1];
        load(b, first, &k);
        for (int i = 0; i < 6; i++)
            EACH_LANE state[i][l] = 0.0;
        EACH_LANE state[2][l] = k.grasp[0][l];
        EACH_LANE lost[0][l] = 0.0;
        hands_at(b, &k, b->shares[0], end);
        for (long s = 0; s < b->steps; s++) {
            const double *share = b->shares + 2 * s, *grip = b->grip + 2 * s;
            copy(9, end, start);
            hands_at(b, &k, share[1], middle);
            hands_at(b, &k, share[2], end);
            for (int i = 0; i < 3; i++)
                EACH_LANE force[i][l] = k.force[l] * grip[i];
            EACH_LANE dt[0][l] = (share[2] - share[0]) * k.opening[l];
            pivot_step(state, start, middle, end, force, dt, k.law, next);
            copy(6, next, state);
            pivot_lost(state, k.law, out);
            EACH_LANE lost[0][l] = lost[0][l] + out[0][l];
        }
        pivot_end(state, end, k.law, next);
        store(b, &k, next, lost);
    }
}
"""

LIMIT_SURFACE = """
static int any(const lane flag[1])
{
    double sum = 0.0;
    EACH_LANE sum += flag[0][l];
    return sum != 0.0;
}

void limit_surface(const batch *b)
{
    for (long first = 0; first < b->count; first += LANES) {
        block k;
        lane state[6], next[6], start[9], end[9], force[1], dt[1], lost[1];
        lane problem[10], found[5], better[5], held[1], moving[1];
        load(b, first, &k);
        hands_at(b, &k, b->shares[0], end);
        surface_start(end, k.grasp, k.law, state);
        EACH_LANE lost[0][l] = 0.0;
        for (long s = 0; s < b->steps; s++) {
            copy(9, end, start);
            hands_at(b, &k, b->shares[s + 1], end);
            EACH_LANE force[0][l] = k.force[l] * b->grip[s];
            EACH_LANE dt[0][l] = (b->shares[s + 1] - b->shares[s]) * k.opening[l];
            surface_problem(state, start, end, force, dt, k.law, problem);
            surface_sticking(problem, found, held);
            for (int i = 0; i < ITERATIONS; i++) {
                surface_moving(problem, found, held, moving);
                if (!any(moving))
                    break;
                surface_refined(problem, found, moving, better);
                copy(5, better, found);
            }
            surface_after(state, start, end, problem, found, held, dt, k.law, next);
            copy(6, next, state);
        }
        store(b, &k, state, lost);
    }
}
"""
