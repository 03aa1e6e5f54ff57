/* A map smoothed along the edges of a photograph: total variation, with a datum at some pixels (section 7 of the
 * method). Of all maps u that is the one with the least
 *
 *     sum votes huber((u - target) / noise) + sum right |u - u to the right| / noise + sum below |u - u below| / noise
 *
 * found by weights that are renewed from the map so far (`reweigh`), between which the quadratic problem with these
 * weights is relaxed (`relax`), red pixels and black ones in turn. Each pixel is computed from its neighbours in an
 * order of its own, so that a device gives the same bits whatever its work-groups.
 *
 * One work-item for each pixel, and for those that make the width a multiple of the work-group's: global size (columns,
 * height). Maps have a border of at least one pixel on all sides, in which all weights are 0. Where a pixel is not to be
 * smoothed its votes, `right` and `below` are 0, and so are those of its neighbours toward it; it keeps what it has.
 */
__kernel void reweigh(__global const real *map,    /* u so far, shape (height + 2, stride)               */
                      __global const real *target, /* data; anything finite where there are no votes     */
                      __global const real *votes,  /* weight of the data, 0 for none                     */
                      __global const real *right,  /* weight of the step to the right; 0 in the last column */
                      __global const real *below,  /* likewise downwards; 0 in the last row              */
                      __global real *pull,         /* result: weights of the quadratic problem           */
                      __global real *across,
                      __global real *down,
                      const real noise,
                      const real least,            /* share of the noise that a step counts at least     */
                      const real huber,            /* noises from which a datum pulls no harder          */
                      const int stride)
{
    const int here = ((int)get_global_id(1) + 1) * stride + (int)get_global_id(0) + 1;
    const real value = map[here];
    const real error = fabs(target[here] - value) / noise;
    pull[here] = votes[here] * (huber / fmax(huber, error));
    across[here] = right[here] / (fabs(map[here + 1] - value) / noise + least);
    down[here] = below[here] / (fabs(map[here + stride] - value) / noise + least);
}

__kernel void relax(__global const real *map,    /* u, shape (height + 2, stride)      */
                    __global const real *target, /* data                               */
                    __global const real *pull,   /* weights, as above                  */
                    __global const real *across,
                    __global const real *down,
                    __global real *relaxed,      /* result: u with one colour relaxed  */
                    const real relaxation,       /* from 0 to 2: 1 solves each pixel   */
                    const int colour,            /* 0 or 1, of row + column            */
                    const int stride)
{
    const int column = (int)get_global_id(0), row = (int)get_global_id(1);
    const int here = (row + 1) * stride + column + 1;
    const real value = map[here], own = pull[here];
    const real left = across[here - 1], right = across[here], above = down[here - stride], below = down[here];
    const real weight = own + left + right + above + below;
    const real sum = own * target[here] + left * map[here - 1] + right * map[here + 1] + above * map[here - stride] +
                     below * map[here + stride];
    const real change = relaxation * (sum / (weight > 0 ? weight : (real)1) - value);
    relaxed[here] = ((row + column) & 1) == colour && weight > 0 ? value + change : value;
}
