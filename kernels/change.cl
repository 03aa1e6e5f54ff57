/* Largest change of Z over an iteration, and the copy that the next iteration is compared with.
 *
 * Work-groups reduce their shares of an image to one number each and merge these by an atomic maximum: the bits of
 * floats that are not negative are in the order of the floats. The group size must be a power of two. Global size
 * (groups * items, images), work-group size (items, 1).
 */
#define MOST_ITEMS 64

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
    __local float scratch[MOST_ITEMS];
    const int item = (int)get_local_id(0), items = (int)get_local_size(0);
    const int share = (size + (int)get_num_groups(0) - 1) / (int)get_num_groups(0);
    const size_t first = (size_t)image * (size_t)size;
    const size_t begin = first + (size_t)get_group_id(0) * (size_t)share;
    const size_t end = min(begin + (size_t)share, first + (size_t)size);
    real largest = 0;
    for (size_t cell = begin + (size_t)item; cell < end; cell += (size_t)items) {
        const real value = log_depth[cell];
        largest = most(largest, previous[cell] - value);
        previous[cell] = value;
    }
    scratch[item] = (float)largest;
    barrier(CLK_LOCAL_MEM_FENCE);
    for (int half_size = items / 2; half_size > 0; half_size /= 2) {
        if (item < half_size)
            scratch[item] = fmax(scratch[item], scratch[item + half_size]);
        barrier(CLK_LOCAL_MEM_FENCE);
    }
    if (item == 0)
        atomic_max((__global int *)(changes + iteration * images + image), as_int(scratch[0]));
}
