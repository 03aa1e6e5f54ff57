/* Largest change of Z over an iteration, and the copy that the next iteration is compared with.
 *
 * Each work-group reduces its share of the cells to one number; the host takes the largest. The group size must be a
 * power of two.
 */
__kernel void change(__global const real *log_depth, /* shape (count,)                                   */
                     __global real *previous,        /* Z before the iteration; Z after it on return     */
                     __global real *largest,         /* max |Z - previous| of each group, shape (groups,) */
                     __local real *scratch,          /* one real a work-item                             */
                     const uint count)               /* cells                                            */
{
    const uint items = get_local_size(0);
    const uint share = (count + get_num_groups(0) - 1) / get_num_groups(0);
    const uint begin = get_group_id(0) * share;
    const uint end = min(begin + share, count);
    real change = 0;
    for (uint cell = begin + get_local_id(0); cell < end; cell += items) {
        const real value = log_depth[cell];
        change = fmax(change, fabs(value - previous[cell]));
        previous[cell] = value;
    }
    scratch[get_local_id(0)] = change;
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint half_size = items / 2; half_size > 0; half_size /= 2) {
        if (get_local_id(0) < half_size)
            scratch[get_local_id(0)] = fmax(scratch[get_local_id(0)], scratch[get_local_id(0) + half_size]);
        barrier(CLK_LOCAL_MEM_FENCE);
    }
    if (get_local_id(0) == 0)
        largest[get_group_id(0)] = scratch[0];
}
