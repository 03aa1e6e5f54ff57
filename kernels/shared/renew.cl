/* The renewal of the boundary cells, eq. (12) by boundary.cl, as a launch of its own.
 *
 * A work-group takes an image, whose boundary cells its work-items share: global size (items, images), work-group size
 * (items, 1). Reads and writes log_depth in place.
 */
__kernel void renew_boundary(__global real *log_depth,        /* shape (images, size)                     */
                             __global const real *limits,     /* as LIMITS says, of that shape each      */
                             __global const parameter_set *parameters, /* shape (images,)                          */
                             __global const int *counts,      /* this and the next three: see boundary.cl */
                             __global const int *cells,
                             __global const int4 *inwards,
                             __global const int4 *beside,
                             __global real *renewed,          /* scratch, one for each cell of the lists  */
                             __global const float *changes,   /* see prelude                              */
                             const int iteration,             /* index into changes                       */
                             const float tolerance,           /* on max |dZ|                              */
                             const int images,                /* of this run                              */
                             const int size,                  /* stored cells of an image                 */
                             const int linear,                /* 1: extrapolate, 0: outflow               */
                             const float lowest)              /* floor of the linear extrapolation        */
{
    const int image = (int)get_global_id(1);
    if (finished(changes, iteration, image, images, tolerance))
        return;
    const size_t begin = (size_t)image * (size_t)size;
    __global real *values = log_depth + begin;
    const bounds within = bounds_from(limits, (size_t)images * (size_t)size, begin);
    const parameter_set numbers = parameters[image];
    const int item = (int)get_local_id(0), items = (int)get_local_size(0);
    for (int pass = 0; pass < 2; ++pass) {
        const int2 part = part_of(counts, image, pass);
        compute_renewed(values, &numbers, inwards, beside, renewed, part.x, part.y, item, items, linear, (real)lowest);
        barrier(CLK_GLOBAL_MEM_FENCE);
        apply_renewed(values, within, cells, renewed, part.x, part.y, item, items);
        barrier(CLK_GLOBAL_MEM_FENCE);
    }
}
