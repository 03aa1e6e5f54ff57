/* One sweep over a strip of the wavefront: vectors skewed over rows, bit for bit what a loop over the cells gives.
 *
 * A strip is STRIP_ROWS = LANES VECTORS rows high. One work-item runs along it; in step t the lane of row r updates
 * column t - r, so that all lanes stand on one anti-diagonal and none reads another's new value of this step:
 *
 *            column  0 1 2 3 4 5 6 7          left of a lane:  its own result of the step before
 *      row 0         0 1 2 3 4 5 6 7          up:              the result of the step before, one lane further up
 *      row 1           1 2 3 4 5 6 7          right:           the old value, which is `here` of the next step
 *      row 2             2 3 4 5 6 7   step   down:            the old value `right` of the lane below
 *
 * With REACH 2 the next neighbours come the same way: left and up from the result of the step before that, up from two
 * lanes further up; right and down from the old values two columns ahead, down from two lanes further down. They are
 * loaded REACH columns ahead.
 *
 * Left and up never leave the registers. A vector has LANES rows, here 8; several of them a strip hide the latency of
 * the square root. LANES steps make a block: as many unaligned loads, one a row and each a column further back,
 * transposed in registers, give the lanes of these steps, and the results go back the same way. So the arrays stay
 * row-major and in place, for all four directions. They are padded by STRIP_ROWS + 2 LANES columns, and by rows to
 * whole strips and REACH more, on either side; the column table holds its numbers once more in reverse, shape
 * (6, stride).
 *
 * With RESTS a block is skipped if nothing has changed in its tiles, and in those that it reads, since a sweep last ran
 * it in the same direction, four sweeps ago: see tiles.cl. It would find the same values again, none of which was
 * lower. For that, tiles are the same in all directions: height and width are counted in whole ones.
 *
 * With RESTS 1 every change counts. With RESTS 2 those count that add up to more than `resting` since the tile last
 * counted as changed; `drift` has the sum so far, of each tile. So nothing that a resting block reads, nor the block
 * itself, has changed by more than `resting` since it was swept. As no monotone scheme makes more of a change than the
 * change itself, its values are within `resting` of what another sweep would make of them.
 */
#define STRIP_ROWS (LANES * VECTORS)
#define APART 32           /* integers from one strip's progress to the next: no common cache line, nor pair of lines */
#define AHEAD 24           /* columns to prefetch: a strip has more rows than the hardware prefetcher follows */
#define LEAD (64 / LANES)  /* blocks that a strip waits for beyond those it needs, so as to wait seldom */
#define EVERY (32 / LANES) /* blocks after which progress is published, since that waits for all stores before it */
#define UNROLLED (REACH == 2 || DIRECTED ? 1 : LANES) /* steps; long ones gain nothing by it */

/* Lanes shifted by one row or by two: TO_BELOW gives each row the lane of the row above it, TO_ABOVE that of the row
 * below. The lanes for which there is none are then overwritten.
 */
#if LANES == 16
#define LAST sf
#define LAST_BUT_ONE se
#define TO_BELOW(lanes) (lanes).s00123456789abcde
#define TO_ABOVE(lanes) (lanes).s123456789abcdeff
#define TWO_TO_BELOW(lanes) (lanes).s000123456789abcd
#define TWO_TO_ABOVE(lanes) (lanes).s23456789abcdefff
#elif LANES == 8
#define LAST s7
#define LAST_BUT_ONE s6
#define TO_BELOW(lanes) (lanes).s00123456
#define TO_ABOVE(lanes) (lanes).s12345677
#define TWO_TO_BELOW(lanes) (lanes).s00012345
#define TWO_TO_ABOVE(lanes) (lanes).s23456777
#elif LANES == 4
#define LAST s3
#define LAST_BUT_ONE s2
#define TO_BELOW(lanes) (lanes).s0012
#define TO_ABOVE(lanes) (lanes).s1233
#define TWO_TO_BELOW(lanes) (lanes).s0001
#define TWO_TO_ABOVE(lanes) (lanes).s2333
#else
#define LAST s1
#define LAST_BUT_ONE s0
#define TO_BELOW(lanes) (lanes).s00
#define TO_ABOVE(lanes) (lanes).s11
#define TWO_TO_BELOW(lanes) (lanes)
#define TWO_TO_ABOVE(lanes) (lanes)
#endif

/* Lane k of vector i and lane i of vector k change places: a round of shuffles for each doubling of the lanes. */
static inline __attribute__((always_inline)) void transpose(number *vectors)
{
#if LANES == 16
    number pairs[16], fours[16], eights[16];
    __attribute__((opencl_unroll_hint(8))) for (int i = 0; i < 16; i += 2) {
        const number a = vectors[i], b = vectors[i + 1];
        pairs[i] = (number)(a.s0, b.s0, a.s1, b.s1, a.s4, b.s4, a.s5, b.s5,
                            a.s8, b.s8, a.s9, b.s9, a.sc, b.sc, a.sd, b.sd);
        pairs[i + 1] = (number)(a.s2, b.s2, a.s3, b.s3, a.s6, b.s6, a.s7, b.s7,
                                a.sa, b.sa, a.sb, b.sb, a.se, b.se, a.sf, b.sf);
    }
    __attribute__((opencl_unroll_hint(4))) for (int i = 0; i < 16; i += 4) {
        const number a = pairs[i], b = pairs[i + 1], c = pairs[i + 2], d = pairs[i + 3];
        fours[i] = (number)(a.s01, c.s01, a.s45, c.s45, a.s89, c.s89, a.scd, c.scd);
        fours[i + 1] = (number)(a.s23, c.s23, a.s67, c.s67, a.sab, c.sab, a.sef, c.sef);
        fours[i + 2] = (number)(b.s01, d.s01, b.s45, d.s45, b.s89, d.s89, b.scd, d.scd);
        fours[i + 3] = (number)(b.s23, d.s23, b.s67, d.s67, b.sab, d.sab, b.sef, d.sef);
    }
    __attribute__((opencl_unroll_hint(2))) for (int i = 0; i < 16; i += 8)
        __attribute__((opencl_unroll_hint(4))) for (int k = i; k < i + 4; ++k) {
            const number a = fours[k], b = fours[k + 4];
            eights[k] = (number)(a.s0123, b.s0123, a.s89ab, b.s89ab);
            eights[k + 4] = (number)(a.s4567, b.s4567, a.scdef, b.scdef);
        }
    __attribute__((opencl_unroll_hint(8))) for (int i = 0; i < 8; ++i) {
        vectors[i] = (number)(eights[i].lo, eights[i + 8].lo);
        vectors[i + 8] = (number)(eights[i].hi, eights[i + 8].hi);
    }
#elif LANES == 8
    number pairs[8], fours[8];
    __attribute__((opencl_unroll_hint(4))) for (int i = 0; i < 8; i += 2) {
        const number a = vectors[i], b = vectors[i + 1];
        pairs[i] = (number)(a.s0, b.s0, a.s1, b.s1, a.s4, b.s4, a.s5, b.s5);
        pairs[i + 1] = (number)(a.s2, b.s2, a.s3, b.s3, a.s6, b.s6, a.s7, b.s7);
    }
    __attribute__((opencl_unroll_hint(2))) for (int i = 0; i < 8; i += 4) {
        const number a = pairs[i], b = pairs[i + 1], c = pairs[i + 2], d = pairs[i + 3];
        fours[i] = (number)(a.s01, c.s01, a.s45, c.s45);
        fours[i + 1] = (number)(a.s23, c.s23, a.s67, c.s67);
        fours[i + 2] = (number)(b.s01, d.s01, b.s45, d.s45);
        fours[i + 3] = (number)(b.s23, d.s23, b.s67, d.s67);
    }
    __attribute__((opencl_unroll_hint(4))) for (int i = 0; i < 4; ++i) {
        vectors[i] = (number)(fours[i].s0123, fours[i + 4].s0123);
        vectors[i + 4] = (number)(fours[i].s4567, fours[i + 4].s4567);
    }
#elif LANES == 4
    const number a = vectors[0], b = vectors[1], c = vectors[2], d = vectors[3];
    const number ab_low = (number)(a.s0, b.s0, a.s2, b.s2), ab_high = (number)(a.s1, b.s1, a.s3, b.s3);
    const number cd_low = (number)(c.s0, d.s0, c.s2, d.s2), cd_high = (number)(c.s1, d.s1, c.s3, d.s3);
    vectors[0] = (number)(ab_low.s01, cd_low.s01);
    vectors[1] = (number)(ab_high.s01, cd_high.s01);
    vectors[2] = (number)(ab_low.s23, cd_low.s23);
    vectors[3] = (number)(ab_high.s23, cd_high.s23);
#else
    const number a = vectors[0], b = vectors[1];
    vectors[0] = (number)(a.s0, b.s0);
    vectors[1] = (number)(a.s1, b.s1);
#endif
}

static inline axis gather_axis(__global const real *table, const int length, const long index, const long apart)
{
    const axis result = {GATHER(number, table + index, apart), GATHER(number, table + length + index, apart),
                         GATHER(number, table + 2 * length + index, apart)};
    return result;
}

/* What a strip carries from step to step. */
typedef struct {
    number old[REACH][VECTORS];    /* old values of the lanes; with reach 2 also to the right of them */
    number result[REACH][VECTORS]; /* new values of the step before; also of the one before that      */
    axis y[VECTORS];               /* of the rows                                                     */
    number moved[VECTORS];         /* largest change on the steps of a block                          */
} lanes;

/* What the outer lanes read from outside the strip, on the steps of a block. */
typedef union {
    number all;
    real step[LANES];
} border;

#define NEAR 0     /* of the row next to the strip, as the outermost lane reads it           */
#define NEXT 1     /* of the row after that, by the same lane                                */
#define NEAR_TOO 2 /* of the row next to the strip, as the next neighbour of the second lane */
#define BORDERS (REACH == 2 ? 3 : 1)
#define DIRECTED_ONLY (DIRECTED && REACH == 1) /* only what the sweep visits before is read */

/* What stays the same along a strip. */
typedef struct {
    long column_step; /* 1 or -1                                              */
    long skew;        /* from a lane to the one below it, on the same step    */
    int leftwards, upwards;
    int stride;
    bounds within;    /* of the image */
    real to_p, to_q;  /* see cell.cl                                          */
} course;

/* One step of a strip: all its lanes. `coming` lies REACH columns ahead. `with_rim` is a constant in each call. */
static inline __attribute__((always_inline)) void
run_step(lanes *state, number coming[VECTORS][LANES], number shading[VECTORS][LANES],
         number limits[LIMITS + 1][VECTORS][LANES], const int k, const border *above, const border *below,
         __global const real *table, __global const uchar *flags, const course *way, const parameter_set *parameters,
         const int with_rim)
{
    /* From the last vector upwards, so that each finds the old results of the vector above it, and of the one below it
     * the values to the right.
     */
    __attribute__((opencl_unroll_hint(VECTORS))) for (int vector = VECTORS - 1; vector >= 0; --vector) {
        const number e = shading[vector][k], here = state->old[0][vector];
        number left[REACH], right[REACH], up[REACH], down[REACH];
        __attribute__((opencl_unroll_hint(REACH))) for (int next = 0; next < REACH; ++next) {
            left[next] = state->result[next][vector];
            right[next] = next < REACH - 1 ? state->old[next + 1][vector] : coming[vector][k];
        }
        up[0] = TO_BELOW(left[0]);
        up[0].s0 = vector == 0 ? above[NEAR].step[k] : state->result[0][vector - 1].LAST;
        down[0] = TO_ABOVE(right[0]);
        down[0].LAST = vector == VECTORS - 1 ? below[NEAR].step[k] : state->old[0][vector + 1].s0;
#if REACH == 2
        up[1] = TWO_TO_BELOW(left[1]);
        up[1].s0 = vector == 0 ? above[NEXT].step[k] : state->result[1][vector - 1].LAST_BUT_ONE;
        up[1].s1 = vector == 0 ? above[NEAR_TOO].step[k] : state->result[1][vector - 1].LAST;
        down[1] = TWO_TO_ABOVE(right[1]);
        down[1].LAST_BUT_ONE = vector == VECTORS - 1 ? below[NEAR_TOO].step[k] : state->old[1][vector + 1].s0;
        down[1].LAST = vector == VECTORS - 1 ? below[NEXT].step[k] : state->old[1][vector + 1].s1;
#endif
        __global const real *at = table + vector * LANES;
        const axis x = {LOAD(at), LOAD(at + way->stride), LOAD(at + 2 * way->stride)};
        const axis y = state->y[vector];
        const number value = value_of(e, here, left, right, up, down, way->to_p, way->to_q, x, y, parameters);
        number own_limits[LIMITS + 1];
        __attribute__((opencl_unroll_hint(2))) for (int limit = 0; limit < LIMITS; ++limit)
            own_limits[limit] = limits[limit][vector][k];
        const number result =
            updated(value, e, here, way->leftwards ? right[0] : left[0], way->leftwards ? left[0] : right[0],
                    way->upwards ? down[0] : up[0], way->upwards ? up[0] : down[0], own_limits,
                    flags + vector * LANES * way->skew, way->skew, x, y, parameters, with_rim);
#if RESTS
        state->moved[vector] = most(state->moved[vector], magnitude(here - result));
#endif
        __attribute__((opencl_unroll_hint(REACH))) for (int next = REACH - 1; next >= 0; --next) {
            state->result[next][vector] = next > 0 ? left[next - 1] : result;
            state->old[next][vector] = right[next];
        }
        shading[vector][k] = result;
    }
}

/* Blocks of a strip. */
static inline int blocks_of(const int width)
{
    return tiles_of(width) + VECTORS;
}

/* The tiles of the first vector of a block, in the order of the sweep: of the next vector they are one row further down
 * and one tile further back.
 */
typedef struct {
    __global volatile int *at; /* the tile that the block begins with; it ends in the one before */
    __global real *drift;      /* likewise: what its changes add up to */
    int step, row_step;
} tiles;

static inline tiles tiles_at(__global volatile int *changed, __global real *drift, const int height, const int width,
                             const int leftwards, const int upwards, const int strip, const int block)
{
    const int high = tiles_of(height), wide = tiles_of(width), stride = wide + 2 * BORDER;
    const int row = upwards ? high - 1 - strip * VECTORS : strip * VECTORS;
    const int column = leftwards ? wide - 1 - block : block;
    const int first = (BORDER + row) * stride + BORDER + column;
    const tiles result = {
        changed + first,
        drift + first,
        leftwards ? -1 : 1,
        upwards ? -stride : stride,
    };
    return result;
}

/* The last sweep that changed a tile which a block covers or reads. */
static inline int last_change(const tiles all)
{
    int latest = 0;
    __attribute__((opencl_unroll_hint(VECTORS))) for (int vector = -1; vector < VECTORS + !DIRECTED_ONLY; ++vector)
        for (int back = DIRECTED_ONLY - 1; back <= REACH; ++back)
            latest = max(latest, all.at[vector * all.row_step - (max(vector, 0) + back) * all.step]);
    return latest;
}

/* Notes that a sweep has changed a tile; `moved` is its largest change. By one work-item at a time. */
static inline void note_change(__global volatile int *tile, __global real *drift, const real moved, const int sweep,
                               const real resting)
{
#if RESTS == 2
    const real sum = *drift + moved;
    *drift = sum > resting ? 0 : sum;
    if (sum > resting)
        *tile = sweep;
#else
    *tile = sweep;
#endif
}

/* Notes what a sweep has changed in the tiles of those vectors whose lanes have moved. */
static inline void note_changes(const tiles all, const number *moved, const int sweep, const real resting)
{
    __attribute__((opencl_unroll_hint(VECTORS))) for (int vector = 0; vector < VECTORS; ++vector)
        if (any_sign(as_integer(0 - moved[vector]))) {
            const int tile = vector * (all.row_step - all.step);
            const real most_moved = largest_of_lanes(moved[vector]);
            note_change(all.at + tile, all.drift + tile, most_moved, sweep, resting);
            note_change(all.at + tile - all.step, all.drift + tile - all.step, most_moved, sweep, resting);
        }
}

/* Publishes how many blocks of a strip are done, after their stores. */
static inline void publish(__global volatile int *progress, const int blocks)
{
    FENCE();
    atomic_xchg(progress, blocks);
}

/* How many blocks of a strip are done, once they are as many as `wanted`, or no more for `patience` polls. */
static inline int wait_for(__global volatile int *progress, const int wanted, const int patience)
{
    int done = atomic_add(progress, 0);
    for (int polls = 0; done < wanted && polls < patience; ++polls) {
        const int now = atomic_add(progress, 0);
        polls = now > done ? 0 : polls;
        done = now;
    }
    FENCE();
    return done;
}

/* Polls in about the time that a strip takes; a few hundred microseconds at least, which are so many `polls`. */
static inline int patience_for(const int polls, const int width)
{
    return polls + polls / 256 * blocks_of(width);
}

/* Puts the lanes on the steps that begin at `cell`, that of the first lane. */
static inline __attribute__((always_inline)) void
begin_at(lanes *state, __global const real *cell, const course *way)
{
    __attribute__((opencl_unroll_hint(VECTORS))) for (int vector = 0; vector < VECTORS; ++vector) {
        __global const real *first = cell + vector * LANES * way->skew;
        for (int k = 0; k < REACH; ++k) {
            state->old[k][vector] = GATHER(number, first + k * way->column_step, way->skew);
            state->result[k][vector] = GATHER(number, first - (k + 1) * way->column_step, way->skew);
        }
    }
}

/* Runs the steps of a block, the first lane of which stands at `cell`; `table` has the numbers of its column. */
static inline __attribute__((always_inline)) void
run_block(lanes *state, __global real *log_depth, __global const real *brightness, __global const uchar *flags,
          const long cell, __global const real *table, const course *way, const parameter_set *parameters,
          const int alone)
{
    const int leftwards = way->leftwards;
    const long column_step = way->column_step, skew = way->skew, row_step = skew + column_step;
    /* Where the first of a block's steps lies in memory, seen from the cell of the step that comes first in time. */
    const long low = leftwards ? -(LANES - 1) : 0;
    number coming[VECTORS][LANES], shading[VECTORS][LANES], limits[LIMITS + 1][VECTORS][LANES];
    integer signs = 0;
    for (int vector = 0; vector < VECTORS; ++vector)
        state->moved[vector] = 0;
    __attribute__((opencl_unroll_hint(VECTORS))) for (int vector = 0; vector < VECTORS; ++vector) {
        __attribute__((opencl_unroll_hint(LANES))) for (int r = 0; r < LANES; ++r) {
            const long at = cell + (vector * LANES + r) * skew + low;
            coming[vector][r] = LOAD(log_depth + at + REACH * column_step);
            shading[vector][r] = LOAD(brightness + at);
            signs |= as_integer(shading[vector][r]);
            PREFETCH(log_depth + at + AHEAD * column_step);
            PREFETCH(brightness + at + AHEAD * column_step);
        }
        transpose(coming[vector]);
        transpose(shading[vector]);
        __attribute__((opencl_unroll_hint(2))) for (int limit = 0; limit < LIMITS; ++limit) {
            __global const real *bound = limit == 0 ? way->within.lower : way->within.upper;
            __attribute__((opencl_unroll_hint(LANES))) for (int r = 0; r < LANES; ++r)
                limits[limit][vector][r] = LOAD(bound + cell + (vector * LANES + r) * skew + low);
            transpose(limits[limit][vector]);
        }
    }
    border above[BORDERS], below[BORDERS];
    __global const real *first = log_depth + cell, *last = log_depth + cell + (STRIP_ROWS - 1) * skew;
    if (!alone)
        /* Rows that another group may have in its cache. */
        for (int k = 1; k <= REACH; ++k) {
            PREFETCH(first - k * row_step + AHEAD * column_step);
            PREFETCH(last + k * row_step + AHEAD * column_step);
        }
    above[NEAR].all = LOAD(first - row_step + low);
    below[NEAR].all = LOAD(last + row_step + low);
#if REACH == 2
    above[NEXT].all = LOAD(first - 2 * row_step + low);
    below[NEXT].all = LOAD(last + 2 * row_step + low);
    above[NEAR_TOO].all = LOAD(first + skew - 2 * row_step + low);
    below[NEAR_TOO].all = LOAD(last - skew + 2 * row_step + low);
#endif
    if (RIM_CELLS && any_sign(signs)) {
        /* Rare, and large: a loop over copies, so that the arrays of the other branch can live in registers. */
        number coming_copy[VECTORS][LANES], shading_copy[VECTORS][LANES], limits_copy[LIMITS + 1][VECTORS][LANES];
        __attribute__((opencl_unroll_hint(VECTORS))) for (int vector = 0; vector < VECTORS; ++vector)
            __attribute__((opencl_unroll_hint(LANES))) for (int k = 0; k < LANES; ++k) {
                coming_copy[vector][k] = coming[vector][k];
                shading_copy[vector][k] = shading[vector][k];
                __attribute__((opencl_unroll_hint(2))) for (int limit = 0; limit < LIMITS; ++limit)
                    limits_copy[limit][vector][k] = limits[limit][vector][k];
            }
        __attribute__((opencl_unroll_hint(1))) for (int step = 0; step < LANES; ++step) {
            const int k = leftwards ? LANES - 1 - step : step;
            run_step(state, coming_copy, shading_copy, limits_copy, k, above, below, table - step,
                     flags + cell + step * column_step, way, parameters, 1);
        }
        __attribute__((opencl_unroll_hint(VECTORS))) for (int vector = 0; vector < VECTORS; ++vector)
            __attribute__((opencl_unroll_hint(LANES))) for (int k = 0; k < LANES; ++k)
                shading[vector][k] = shading_copy[vector][k];
    } else {
        __attribute__((opencl_unroll_hint(UNROLLED))) for (int step = 0; step < LANES; ++step) {
            const int k = leftwards ? LANES - 1 - step : step;
            run_step(state, coming, shading, limits, k, above, below, table - step, flags, way, parameters, 0);
        }
    }
    __attribute__((opencl_unroll_hint(VECTORS))) for (int vector = 0; vector < VECTORS; ++vector) {
        transpose(shading[vector]);
        __attribute__((opencl_unroll_hint(LANES))) for (int r = 0; r < LANES; ++r)
            STORE(log_depth + cell + (vector * LANES + r) * skew + low, shading[vector][r]);
    }
}

/* Runs a strip from `first_block` on, as far as the strip before it allows: returns 1 when the strip is done, 0 when
 * the wait for the one before has timed out. All that a strip carries from block to block can be read from memory, so
 * that any work-item may take it up again where it was left. `progress` counts the blocks that each strip has finished,
 * `done_before` of them before this sweep. Reads brightness, flags and tables, and reads and writes log_depth in place.
 *
 * `changed` is that of tiles.cl, `drift` and `resting` are as above, and `sweep` is the number of this one, from
 * FIRST_SWEEP.
 *
 * `leftwards` is a constant in each call, so that the compiler makes two loops with straight addressing. `alone` says
 * that all strips are run by this work-item, in order: then nothing is waited for, and `progress` is not used.
 */
static inline __attribute__((always_inline)) int
run_strip(__global real *log_depth, __global const real *brightness, const bounds within,
          __global const uchar *flags, const parameter_set *parameters, __global const real *column_table,
          __global const real *row_table,
          __global volatile int *progress, __global volatile int *changed, __global real *drift, const int rows,
          const int stride,
          const int first_row, const int first_column, const int height, const int width, const int leftwards,
          const int upwards, const int strip, const int first_block, const int done_before, const int patience,
          const int sweep, const real resting, const int alone)
{
    const int blocks = blocks_of(width);
    const long column_step = leftwards ? -1 : 1;
    const long row_step = upwards ? -(long)stride : (long)stride;
    const long skew = row_step - column_step;
    const long row = first_row + (upwards ? LANES * tiles_of(height) - 1 - strip * STRIP_ROWS : strip * STRIP_ROWS);
    const long column =
        first_column + (leftwards ? LANES * (tiles_of(width) - first_block) - 1 : LANES * first_block);
    /* The names are those of a sweep to the right and down. In the others the neighbours change places. */
    const real to_p = parameters->sign * parameters->half_inverse_dx;
    const real to_q = parameters->sign * parameters->half_inverse_dy;
    const course way = {
        column_step, skew, leftwards, upwards, stride, within, leftwards ? -to_p : to_p, upwards ? -to_q : to_q,
    };

    long cell = row * stride + column; /* of lane 0 */
    /* Lanes run against the columns: rightwards through the reversed half of the table. */
    __global const real *table = column_table + (leftwards ? column : 3 * stride + stride - 1 - column);

    lanes state;
    for (int vector = 0; vector < VECTORS; ++vector) {
        const long at = row + (upwards ? -LANES * vector : LANES * vector);
        state.y[vector] = gather_axis(row_table, rows, at, upwards ? -1 : 1);
    }
    tiles covered = tiles_at(changed, drift, height, width, leftwards, upwards, strip, first_block);
    int rested = 1;
    int ahead = strip > 0 && !alone ? done_before : INT_MAX; /* blocks the strip before is known to have finished */
    for (int block = first_block; block < blocks; ++block) {
        const int needed = block + STRIP_ROWS / LANES + 1;
        if (ahead < done_before + min(needed, blocks)) {
            ahead = wait_for(progress - APART, done_before + min(needed + LEAD, blocks), patience);
            if (ahead < done_before + min(needed, blocks)) {
                publish(progress, done_before + block);
                return 0;
            }
        }
        if (RESTS && last_change(covered) < sweep - 4)
            rested = 1;
        else {
            if (rested)
                begin_at(&state, log_depth + cell, &way);
            rested = 0;
            run_block(&state, log_depth, brightness, flags, cell, table, &way, parameters, alone);
            if (RESTS)
                note_changes(covered, state.moved, sweep, resting);
        }
        covered.at += covered.step;
        covered.drift += covered.step;
        cell += LANES * column_step;
        table -= LANES;
        if (!alone && (block % EVERY == EVERY - 1 || block == blocks - 1))
            publish(progress, done_before + block + 1);
    }
    return 1;
}
