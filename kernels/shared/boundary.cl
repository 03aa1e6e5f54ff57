/* Renewal of the boundary cells after a sweep, eq. (12) as Kao, Osher and Qian meant it:
 *
 *     outflow:      Z_0 = min(max(2 Z_1 - Z_2, Z_2), Z_0)
 *     extrapolate:  Z_0 = min(max(2 Z_1 - Z_2, lowest), Z_0)
 *
 * with Z_1 and Z_2 the next two cells inwards. A cell may look inwards along x, along y, or both (corners): the smaller
 * value counts. As in a sweep, no cell may lie more than one step, step_x or step_y, above a neighbour, nor below a
 * bound that it has.
 *
 * The cells of an image are renewed in two passes, edges first and corners last, since a corner may look along an edge.
 * Within a pass all values are computed, from `log_depth` to `renewed`, before the first is written back, so that the
 * order of the cells does not matter. Work-item `item` of `items` takes every `items`-th cell from `begin` to `end` of
 * the lists:
 *
 *     cells         indices into the stored image
 *     inwards       near and far cell along x, near and far along y, NONE where the cell does not look that way
 *     neighbours    cells left, right, up and down, or NONE
 *     counts        where an image's cells begin, how many edges, how many corners, shape (images, 3)
 */
#define NONE (-1)

static inline real lower(const real a, const real b)
{
    return a < b ? a : b;
}

static inline real value_at(__global const real *log_depth, const int cell)
{
    return cell == NONE ? (real)INFINITY : log_depth[cell];
}

static inline real inward(__global const real *log_depth, const int near, const int far, const int linear,
                          const real lowest)
{
    if (near == NONE)
        return (real)INFINITY;
    const real first = log_depth[near], second = log_depth[far];
    const real outwards = 2 * first - second, floor_value = linear ? lowest : second;
    return outwards > floor_value ? outwards : floor_value;
}

/* Begin and end of an image's edges (pass 0) or corners (pass 1). */
static inline int2 part_of(__global const int *counts, const int image, const int pass)
{
    const int begin = counts[3 * image] + (pass == 0 ? 0 : counts[3 * image + 1]);
    return (int2)(begin, begin + counts[3 * image + 1 + pass]);
}

static inline void compute_renewed(__global const real *log_depth, const parameter_set *parameters,
                                   __global const int4 *inwards, __global const int4 *neighbours,
                                   __global real *renewed, const int begin, const int end, const int item,
                                   const int items, const int linear, const real lowest)
{
    for (int k = begin + item; k < end; k += items) {
        const int4 look = inwards[k], next = neighbours[k];
        const real outwards = lower(inward(log_depth, look.x, look.y, linear, lowest),
                                    inward(log_depth, look.z, look.w, linear, lowest));
        const real highest =
            lower(lower(value_at(log_depth, next.x), value_at(log_depth, next.y)) + parameters->step_x,
                  lower(value_at(log_depth, next.z), value_at(log_depth, next.w)) + parameters->step_y);
        renewed[k] = lower(outwards, highest);
    }
}

static inline void apply_renewed(__global real *log_depth, const bounds within, __global const int *cells,
                                 __global const real *renewed, const int begin, const int end, const int item,
                                 const int items)
{
    for (int k = begin + item; k < end; k += items) {
        real value = renewed[k];
#if LIMITS > 0
        value = within.lower[cells[k]] > value ? within.lower[cells[k]] : value;
#endif
        if (value < log_depth[cells[k]])
            log_depth[cells[k]] = value;
    }
}
