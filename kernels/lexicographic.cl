/* One sweep as the paper writes it: a single work-item runs the plain double loop. The yardstick for the others.
 *
 * Global size 1. Reads and writes log_depth in place.
 */
__kernel void sweep(__global real *log_depth,          /* shape (height, width)                  */
                    __global const real *brightness,   /* shape (height, width)                  */
                    __global const uchar *flags,       /* shape (height, width)                  */
                    __constant const real *parameters, /* see prelude and model                  */
                    const int width,                   /* pixels                                 */
                    const int height,                  /* pixels                                 */
                    const int leftwards,               /* 1: columns from the right              */
                    const int upwards)                 /* 1: rows from the bottom                */
{
    if (get_global_id(0) != 0)
        return;
    for (int i = 0; i < height; ++i)
        for (int j = 0; j < width; ++j)
            update_cell(log_depth, brightness, flags, parameters, width, leftwards ? width - 1 - j : j,
                        upwards ? height - 1 - i : i);
}
