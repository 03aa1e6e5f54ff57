/* The largest change of an iteration, max |dZ|, see change.cl, as a launch of its own.
 *
 * A work-item takes its share of an image in vectors, and merges its largest change into `changes` by an atomic
 * maximum: the bits of floats that are not negative are in the order of the floats. Of the stored cells those that
 * fill no vector, at the end, are padding. Global size (items, images).
 */
__kernel void measure(__global const real *log_depth, /* shape (images, size)                                      */
                      __global real *previous,        /* Z before the iteration; Z after it on return, same shape  */
                      __global float *changes,        /* see prelude; zero for this iteration on entry             */
                      const int iteration,            /* index into changes                                        */
                      const float tolerance,          /* on max |dZ|                                               */
                      const int images,               /* of this run                                               */
                      const int size)                 /* stored cells of an image                                  */
{
    const int image = (int)get_global_id(1);
    if (finished(changes, iteration, image, images, tolerance))
        return;
    const size_t begin = (size_t)image * (size_t)size, items = get_global_size(0);
    const size_t vectors = (size_t)size / LANES, share = (vectors + items - 1) / items;
#if LANES == 1
    /* Neighbouring items take neighbouring cells, as a GPU wants it. */
    const size_t first = get_global_id(0), last = vectors, step = items;
#else
    /* Each item takes a part of its own, as a CPU wants it. */
    const size_t first = get_global_id(0) * share, last = min(first + share, vectors), step = 1;
#endif
    const float change = largest_change(log_depth + begin, previous + begin, first, last, step);
    atomic_max((__global int *)(changes + iteration * images + image), as_int(change));
}
