/* Largest change of Z over an iteration, and the copy that the next iteration is compared with.
 *
 * Each work-item takes its share of an image in vectors, and merges its largest change by an atomic maximum: the bits of
 * floats that are not negative are in the order of the floats. The stored size is a multiple of LANES. Global size
 * (items, images).
 */
__kernel void change(__global const real *log_depth, /* shape (images, size)                                      */
                     __global real *previous,        /* Z before the iteration; Z after it on return, same shape  */
                     __global float *changes,        /* see prelude; zero for this iteration on entry             */
                     const int iteration,            /* index into changes                                        */
                     const float tolerance,          /* on max |dZ|                                               */
                     const int size)                 /* stored cells of an image                                  */
{
    const int image = (int)get_global_id(1), images = (int)get_global_size(1);
    if (finished(changes, iteration, image, images, tolerance))
        return;
    const size_t begin = (size_t)image * (size_t)size, items = get_global_size(0);
    /* On a CPU neighbouring work-items take distant parts, on a GPU neighbouring vectors. */
    const size_t vectors = (size_t)size / LANES, share = (vectors + items - 1) / items;
    const size_t first = LANES == 1 ? get_global_id(0) : get_global_id(0) * share;
    const size_t last = LANES == 1 ? vectors : min(first + share, vectors);
    const size_t step = LANES == 1 ? items : 1;
    number largest = 0;
    for (size_t vector = first; vector < last; vector += step) {
        const size_t cell = begin + vector * LANES;
        const number value = LOAD(log_depth + cell);
        largest = most(largest, LOAD(previous + cell) - value);
        STORE(previous + cell, value);
    }
    real change = 0;
#if LANES == 8
    union {
        number all;
        real lane[8];
    } each;
    each.all = largest;
    for (int k = 0; k < 8; ++k)
        change = each.lane[k] > change ? each.lane[k] : change;
#else
    change = largest;
#endif
    atomic_max((__global int *)(changes + iteration * images + image), as_int((float)change));
}
