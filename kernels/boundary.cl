/* Renewal of the boundary cells after a sweep, eq. (12) as Kao, Osher and Qian meant it:
 *
 *     outflow:      Z_0 = min(max(2 Z_1 - Z_2, Z_2), Z_0)
 *     extrapolate:  Z_0 = min(max(2 Z_1 - Z_2, lowest), Z_0)
 *
 * with Z_1 and Z_2 the next two cells inwards. A cell may look inwards along x, along y, or both (corners): the smaller
 * value counts. As in a sweep, no cell may lie more than one step above a neighbour.
 *
 * One work-group renews all cells in two passes, edges first and corners last, since a corner may look along an edge.
 * Within a pass all values are computed before the first is written, so that the order of the cells is of no consequence.
 */
#define NONE (-1)

static inline real inward(__global const real *log_depth, const int near, const int far, const int linear,
                          const real lowest)
{
    if (near == NONE)
        return (real)INFINITY;
    const real first = log_depth[near], second = log_depth[far];
    return fmax((real)2 * first - second, linear ? lowest : second);
}

static inline real lowest_neighbour_and_step(__global const real *log_depth, const size_t cell, const uint flag,
                                             const int width, __constant const real *parameters)
{
    const real none = (real)INFINITY;
    const real left = flag & NO_LEFT ? none : log_depth[cell - 1];
    const real right = flag & NO_RIGHT ? none : log_depth[cell + 1];
    const real up = flag & NO_UP ? none : log_depth[cell - (size_t)width];
    const real down = flag & NO_DOWN ? none : log_depth[cell + (size_t)width];
    return fmin(fmin(left, right) + parameters[STEP_X], fmin(up, down) + parameters[STEP_Y]);
}

__kernel void renew_boundary(__global real *log_depth,          /* shape (height, width)                           */
                             __global const uchar *flags,       /* shape (height, width)                           */
                             __constant const real *parameters, /* see prelude                                     */
                             __global const int *cells,         /* flat indices, shape (edges + corners,)          */
                             __global const int4 *inwards,      /* near and far cell along x, near and far along y;
                                                                   NONE where the cell does not look, same length  */
                             __global real *renewed,            /* scratch, same length                            */
                             const int width,                   /* pixels                                          */
                             const int edges,                   /* how many cells come first                       */
                             const int corners,                 /* how many come last                              */
                             const int linear,                  /* 1: extrapolate, 0: outflow                      */
                             const real lowest)                 /* floor of the linear extrapolation               */
{
    const int item = (int)get_local_id(0), items = (int)get_local_size(0);
    for (int pass = 0; pass < 2; ++pass) {
        const int begin = pass == 0 ? 0 : edges;
        const int end = pass == 0 ? edges : edges + corners;
        for (int k = begin + item; k < end; k += items) {
            const int4 look = inwards[k];
            const size_t cell = (size_t)cells[k];
            const real outwards = fmin(inward(log_depth, look.x, look.y, linear, lowest),
                                       inward(log_depth, look.z, look.w, linear, lowest));
            renewed[k] = fmin(outwards, lowest_neighbour_and_step(log_depth, cell, flags[cell], width, parameters));
        }
        barrier(CLK_GLOBAL_MEM_FENCE);
        for (int k = begin + item; k < end; k += items)
            if (renewed[k] < log_depth[cells[k]])
                log_depth[cells[k]] = renewed[k];
        barrier(CLK_GLOBAL_MEM_FENCE);
    }
}
