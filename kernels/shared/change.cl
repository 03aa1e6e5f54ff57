/* The largest change of an iteration, max |Z - Z_previous|, by which it is decided whether the iteration has converged.
 *
 * Reads the vectors `first`, `first + step`, ... of cells up to `last`; `previous` becomes the present Z. NaN counts as
 * no change.
 */

/* Of numbers that are not negative; NaN counts as 0. */
static inline real largest_of_lanes(const number lanes)
{
#if LANES > 1
    union {
        number all;
        real lane[LANES];
    } each;
    each.all = lanes;
    real largest = 0;
    for (int k = 0; k < LANES; ++k)
        largest = each.lane[k] > largest ? each.lane[k] : largest;
    return largest;
#else
    return lanes;
#endif
}

static inline float largest_change(__global const real *log_depth, __global real *previous, const size_t first,
                                   const size_t last, const size_t step)
{
    number largest = 0;
    for (size_t vector = first; vector < last; vector += step) {
        const number value = LOAD(log_depth + vector * LANES);
        largest = most(largest, magnitude(LOAD(previous + vector * LANES) - value));
        STORE(previous + vector * LANES, value);
    }
    return (float)largest_of_lanes(largest);
}
