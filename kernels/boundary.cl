/* Renewal of the boundary cells after a sweep, eq. (12) as Kao, Osher and Qian meant it:
 *
 *     outflow:      Z_0 = min(max(2 Z_1 - Z_2, Z_2), Z_0)
 *     extrapolate:  Z_0 = min(max(2 Z_1 - Z_2, lowest), Z_0)
 *
 * with Z_1 and Z_2 the next two cells inwards. A cell may look inwards along x, along y, or both (corners): the smaller
 * value counts. As in a sweep, no cell may lie more than one step above a neighbour.
 *
 * One work-group renews the cells of an image in two passes, edges first and corners last, since a corner may look along
 * an edge. Within a pass all values are computed before the first is written, so that their order is of no consequence.
 * Global size (items, images), work-group size (items, 1).
 */
#define NONE (-1)

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
    return most(2 * first - second, linear ? lowest : second);
}

__kernel void renew_boundary(__global real *log_depth,        /* shape (images, size)                               */
                             __global const real *parameters, /* shape (images, PARAMETERS)                         */
                             __global const int *counts,      /* where an image's cells begin, how many edges, how
                                                                 many corners, shape (images, 3)                    */
                             __global const int *cells,       /* indices into the image, shape (all cells,)         */
                             __global const int4 *inwards,    /* near and far cell along x, near and far along y, NONE
                                                                 where the cell does not look, shape (all cells,)   */
                             __global const int4 *beside,     /* cells left, right, up and down, or NONE, same shape */
                             __global real *renewed,          /* scratch, same shape                                */
                             __global const float *changes,   /* see prelude                                        */
                             const int iteration,             /* index into changes                                 */
                             const float tolerance,           /* on max |dZ|                                        */
                             const int size,                  /* stored cells of an image                           */
                             const int linear,                /* 1: extrapolate, 0: outflow                         */
                             const float lowest)              /* floor of the linear extrapolation                  */
{
    const int image = (int)get_global_id(1);
    if (finished(changes, iteration, image, (int)get_global_size(1), tolerance))
        return;
    __global real *values = log_depth + (size_t)image * (size_t)size;
    __global const real *numbers = parameters + image * PARAMETERS;
    const int item = (int)get_local_id(0), items = (int)get_local_size(0);
    const int edges = counts[3 * image + 1], corners = counts[3 * image + 2];
    for (int pass = 0; pass < 2; ++pass) {
        const int begin = counts[3 * image] + (pass == 0 ? 0 : edges);
        const int end = begin + (pass == 0 ? edges : corners);
        for (int k = begin + item; k < end; k += items) {
            const int4 look = inwards[k], next = beside[k];
            const real outwards = least(inward(values, look.x, look.y, linear, (real)lowest),
                                        inward(values, look.z, look.w, linear, (real)lowest));
            const real highest = least(least(value_at(values, next.x), value_at(values, next.y)) + numbers[STEP_X],
                                       least(value_at(values, next.z), value_at(values, next.w)) + numbers[STEP_Y]);
            renewed[k] = least(outwards, highest);
        }
        barrier(CLK_GLOBAL_MEM_FENCE);
        for (int k = begin + item; k < end; k += items)
            if (renewed[k] < values[cells[k]])
                values[cells[k]] = renewed[k];
        barrier(CLK_GLOBAL_MEM_FENCE);
    }
}
