/* Anderson acceleration of an iteration Z <- G(Z): launches after every few iterations.
 *
 * X is Z after the last launch, G what the iterations since have made of it, F = G - X. Of these launches the last
 * DEPTH + 1 are kept, slot by slot in a ring: slot `head` is the newest, the one before it that of the launch before.
 * With dG_j and dF_j the differences between the slots j and j + 1 launches ago, the next Z is
 *
 *     G - sum_j w_j dG_j,    where sum_j w_j dF_j is as near to F as can be
 *
 * of which the host finds the w_j, from products that `sum_products` gives.
 *
 * A work-item takes a row of an image. Products are summed in the order of the columns, four lanes wide whatever the
 * device has, so that all orderings whose images lie alike get the same bits. Global size (at least height, images).
 *
 * DEPTH  how many differences there are.
 */
#define SLOTS (DEPTH + 1)
#define SUMS (2 * DEPTH + 5) /* dF_0 dF_j, F dF_j, F F, dG_0 dG_0, dG_0 dF_0, max |F|, and max (G - ceiling) */
#define IDLE (-1)            /* head of an image that takes no part */

static inline size_t begin_of_slot(const int image, const int head, const int age, const int size)
{
    return ((size_t)image * SLOTS + (size_t)((head + SLOTS - age) % SLOTS)) * (size_t)size;
}

/* The cells of a row in the order of their columns: where they begin in the stored image, and how many follow each
 * other. Columns lie in one part, or the even ones before the odd ones.
 */
static inline int2 part_of_row(const int part, const int parts, const int stride, const int first_column,
                               const int width)
{
    return parts == 1 ? (int2)(first_column, width)
                      : (int2)(first_column / 2 + part * (stride / 2), (width + 1 - part) / 2);
}

static inline number only_first(const number value, const int count)
{
    const integer lane = (integer)(0, 1, 2, 3);
    return choose(lane < (integer)count, value, 0);
}

static inline void store_first(__global real *to, const number value, const int count)
{
    if (count >= LANES) {
        STORE(to, value);
        return;
    }
    to[0] = value.s0;
    if (count > 1)
        to[1] = value.s1;
    if (count > 2)
        to[2] = value.s2;
}

static inline real sum_of(const number value)
{
    return (value.s0 + value.s1) + (value.s2 + value.s3);
}

static inline real largest_of(const number value)
{
    return max(max(value.s0, value.s1), max(value.s2, value.s3));
}

__kernel void sum_products(__global const real *log_depth, /* G, shape (images, size)                       */
                           __global const real *base,      /* X, same shape                                 */
                           __global real *residuals,       /* F, shape (images, SLOTS, size)                */
                           __global real *values,          /* G, same shape                                 */
                           __global const real *ceiling,   /* above the limit, shape (images, size)         */
                           __global real *sums,            /* shape (images, height, SUMS)                  */
                           __global const int *heads,      /* slot that is written, or IDLE; shape (images,) */
                           __global const int *counts,     /* slots before it that count, shape (images,)   */
                           const int size,                 /* stored cells of an image                      */
                           const int stride,               /* of a stored row                               */
                           const int first_row,            /* stored row and column of the first pixel      */
                           const int first_column,
                           const int height,
                           const int width,
                           const int parts)                /* of a stored row                               */
{
    const int row = (int)get_global_id(0), image = (int)get_global_id(1), head = heads[image];
    if (row >= height || head == IDLE)
        return;
    const size_t line = (size_t)(first_row + row) * (size_t)stride, cells = (size_t)image * (size_t)size;
    const int differences = min(counts[image], DEPTH);
    const size_t newest = begin_of_slot(image, head, 0, size), before = begin_of_slot(image, head, 1, size);
    number of_steps[DEPTH], of_residual[DEPTH];
    for (int j = 0; j < DEPTH; ++j)
        of_steps[j] = of_residual[j] = 0;
    number squares = 0, steps = 0, across = 0, largest = 0, rise = 0;
    for (int part = 0; part < parts; ++part) {
        const int2 here = part_of_row(part, parts, stride, first_column, width);
        for (int column = 0; column < here.y; column += LANES) {
            const size_t at = line + (size_t)(here.x + column);
            const int count = here.y - column;
            const number value = LOAD(log_depth + cells + at);
            const number whole = value - LOAD(base + cells + at);
            const number residual = count < LANES ? only_first(whole, count) : whole;
            store_first(values + newest + at, value, count);
            store_first(residuals + newest + at, residual, count);
            squares += residual * residual;
            largest = most(magnitude(residual), largest);
            const number above = value - LOAD(ceiling + cells + at);
            rise = most(count < LANES ? only_first(above, count) : above, rise);
            if (differences == 0)
                continue;
            const number value_step = value - LOAD(values + before + at);
            const number residual_step = residual - LOAD(residuals + before + at);
            const number value_moved = count < LANES ? only_first(value_step, count) : value_step;
            const number moved = count < LANES ? only_first(residual_step, count) : residual_step;
            steps += value_moved * value_moved;
            across += value_moved * moved;
            number younger = LOAD(residuals + before + at);
            of_steps[0] += moved * moved;
            of_residual[0] += moved * residual;
            for (int j = 1; j < differences; ++j) {
                const number older = LOAD(residuals + begin_of_slot(image, head, j + 1, size) + at);
                const number step = count < LANES ? only_first(younger - older, count) : younger - older;
                of_steps[j] += moved * step;
                of_residual[j] += residual * step;
                younger = older;
            }
        }
    }
    __global real *own = sums + ((size_t)image * (size_t)height + (size_t)row) * SUMS;
    for (int j = 0; j < DEPTH; ++j) {
        own[j] = sum_of(of_steps[j]);
        own[DEPTH + j] = sum_of(of_residual[j]);
    }
    own[2 * DEPTH] = sum_of(squares);
    own[2 * DEPTH + 1] = sum_of(steps);
    own[2 * DEPTH + 2] = sum_of(across);
    own[2 * DEPTH + 3] = largest_of(largest);
    own[2 * DEPTH + 4] = largest_of(rise);
}

__kernel void mix_values(__global real *log_depth,     /* the next Z, shape (images, size)                  */
                  __global real *base,          /* as well                                           */
                  __global real *previous,      /* as well: the change to it is not the iteration's  */
                  __global const real *values,  /* G, shape (images, SLOTS, size)                    */
                  __global const real *weights, /* w_j, shape (images, DEPTH)                        */
                  __global const int *counts,   /* how many w_j there are, shape (images,)           */
                  __global const int *heads,    /* this and the following as above                   */
                  const int size,
                  const int stride,
                  const int first_row,
                  const int first_column,
                  const int height,
                  const int width,
                  const int parts)
{
    const int row = (int)get_global_id(0), image = (int)get_global_id(1), head = heads[image];
    if (row >= height || head == IDLE)
        return;
    const size_t line = (size_t)(first_row + row) * (size_t)stride, cells = (size_t)image * (size_t)size;
    for (int part = 0; part < parts; ++part) {
        const int2 here = part_of_row(part, parts, stride, first_column, width);
        for (int column = 0; column < here.y; column += LANES) {
            const size_t at = line + (size_t)(here.x + column);
            const int count = here.y - column;
            const number newest = LOAD(values + begin_of_slot(image, head, 0, size) + at);
            number correction = 0, younger = newest;
            for (int j = 0; j < counts[image]; ++j) {
                const number older = LOAD(values + begin_of_slot(image, head, j + 1, size) + at);
                correction += weights[image * DEPTH + j] * (younger - older);
                younger = older;
            }
            const number next = newest - correction;
            store_first(log_depth + cells + at, next, count);
            store_first(base + cells + at, next, count);
            store_first(previous + cells + at, next, count);
        }
    }
}
