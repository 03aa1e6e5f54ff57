/* Padded arrays, and sums and largest values over the work-items of a group, in an order of their own: a device gives
 * the same bits every time.
 *
 * Arrays of the energy have PAD cells more than the image on each side. They hold 0 there, so that no kernel asks where
 * the image ends.
 *
 * GROUP  a power of two: work-items of a group, which stand side by side in a row.
 */
#define PAD 2

/* Place of a pixel in a padded array of which rows are `stride` apart. */
static inline size_t cell_at(const int column, const int row, const int stride)
{
    return (size_t)(row + PAD) * (size_t)stride + (size_t)(column + PAD);
}

/* Sum over the group, for its first work-item; `shared` has room for a number of each. */
static inline real sum_of_group(const real value, __local real *shared)
{
    const int item = (int)get_local_id(0);
    shared[item] = value;
    barrier(CLK_LOCAL_MEM_FENCE);
    for (int half_group = GROUP / 2; half_group > 0; half_group /= 2) {
        if (item < half_group)
            shared[item] += shared[item + half_group];
        barrier(CLK_LOCAL_MEM_FENCE);
    }
    const real result = shared[0];
    barrier(CLK_LOCAL_MEM_FENCE);
    return result;
}

/* Likewise the largest of values that are not negative. */
static inline real most_of_group(const real value, __local real *shared)
{
    const int item = (int)get_local_id(0);
    shared[item] = value;
    barrier(CLK_LOCAL_MEM_FENCE);
    for (int half_group = GROUP / 2; half_group > 0; half_group /= 2) {
        if (item < half_group)
            shared[item] = most(shared[item], shared[item + half_group]);
        barrier(CLK_LOCAL_MEM_FENCE);
    }
    const real result = shared[0];
    barrier(CLK_LOCAL_MEM_FENCE);
    return result;
}
