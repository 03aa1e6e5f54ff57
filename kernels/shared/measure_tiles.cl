/* The largest change of an iteration, max |dZ|, as measure.cl finds it, where tiles say what has changed: see tiles.cl.
 *
 * A work-item takes every so manieth row of tiles. Global size (items, images).
 */
__kernel void measure(__global const real *log_depth,         /* shape (images, rows, stride)                        */
                      __global real *previous,                /* Z before the iteration; Z after it on return        */
                      __global float *changes,                /* see prelude; zero for this iteration on entry       */
                      const int iteration,                    /* index into changes                                  */
                      const float tolerance,                  /* on max |dZ|                                         */
                      const int images,                       /* of this run                                         */
                      const int rows,                         /* stored rows, padding included                       */
                      const int stride,                       /* stored columns, padding included                    */
                      const int first_row,                    /* of the image within its padding                     */
                      const int first_column,                 /* likewise                                            */
                      const int height,                       /* pixels                                              */
                      const int width,                        /* pixels                                              */
                      __global const volatile int *changed,   /* of each image                                       */
                      const int measured_sweeps)              /* of this run, before the iteration                   */
{
    const int image = (int)get_global_id(1);
    if (finished(changes, iteration, image, images, tolerance))
        return;
    const size_t first = ((size_t)image * (size_t)rows + (size_t)first_row) * (size_t)stride + (size_t)first_column;
    const float change = largest_change_of_tiles(
        log_depth + first, previous + first, changed + (size_t)image * tiles_of_image(height, width), stride, height,
        width, FIRST_SWEEP + measured_sweeps, (int)get_global_id(0), (int)get_global_size(0));
    atomic_max((__global int *)(changes + iteration * images + image), as_int(change));
}
