/* One step of one cell with differences of second order, in place, once the first-order values have converged.
 *
 *     (Z - Z_l) / dx   becomes   (3 Z - 4 Z_l + Z_ll) / (2 dx) = (Z - (4 Z_l - Z_ll) / 3) / (2 dx / 3)
 *
 * where there is a next neighbour behind the neighbour and the information comes from there: where the gradient between
 * the two lies on that side of the middle of the gradients that the pixel allows. Elsewhere, beside ridges and edges, the
 * difference stays of first order. So the upwind scheme serves unchanged, with other neighbours and other spacings. The
 * value is assigned even where it lies above the present one: this correction is not monotone. Pixels that look smooth in
 * one iteration and not in the next may keep it going for ever. With ONLY_LOWER values only fall, as in all other sweeps,
 * and it ends.
 */
typedef struct {
    real value;  /* corrected where that is possible */
    real nearer; /* spacing over corrected spacing   */
    real first;  /* uncorrected                      */
} neighbour;

#define SMOOTH ((real)0.6f) /* largest share of the second difference in the first ones; a parabola's is at most a half */

static inline neighbour corrected(const real here, const real near, const real next, const real rise)
{
    const real step = here - near - rise, step_before = near - next - rise;
    const int smooth = fabs(step - step_before) <= SMOOTH * (fabs(step) + fabs(step_before));
    const neighbour second = {near + (near - next) / 3, (real)1.5f, near}, first = {near, 1, near};
    return step_before >= 0 && smooth && next < NOWHERE / 2 && near < NOWHERE / 2 ? second : first;
}

static inline void update_cell(__global real *log_depth,        /* Z or W = -Z, shape (rows, stride) */
                               __global const real *brightness, /* NaN: not swept, same shape        */
                               __global const uchar *flags,     /* not used                          */
                               const size_t cell, const int stride, const int leftwards, const int upwards,
                               const axis x, const axis y, const real *parameters)
{
    const real shading = brightness[cell];
    if (isnan(shading))
        return;
    const size_t row = (size_t)stride;
    const real here = log_depth[cell];
    const real to_p = parameters[SURFACE_SIGN] * parameters[HALF_INVERSE_DX];
    const real to_q = parameters[SURFACE_SIGN] * parameters[HALF_INVERSE_DY];
    const real rise_x = middle_gradient(shading, x.coordinate, y.coordinate, 0, parameters) / (2 * to_p);
    const real rise_y = middle_gradient(shading, y.coordinate, x.coordinate, 1, parameters) / (2 * to_q);
    const neighbour across[2] = {corrected(here, log_depth[cell - 1], log_depth[cell - 2], rise_x),
                                 corrected(here, log_depth[cell + 1], log_depth[cell + 2], -rise_x)};
    const neighbour along[2] = {corrected(here, log_depth[cell - row], log_depth[cell - 2 * row], rise_y),
                                corrected(here, log_depth[cell + row], log_depth[cell + 2 * row], -rise_y)};
    /* Which quadrant the information comes from the normal of the level set tells, at central differences. A missing
     * neighbour is very high, so that the other is taken for the one upwind.
     */
    const slopes normal =
        outward_normal(shading, (across[1].first - across[0].first) * to_p, (along[1].first - along[0].first) * to_q,
                       x.coordinate, y.coordinate, parameters);
    const int from_right = parameters[SURFACE_SIGN] * normal.p < 0, from_below = parameters[SURFACE_SIGN] * normal.q < 0;
    /* Where the surface is smooth that one suffices: between two quadrants both give the same. Elsewhere all compete. */
    const int smooth = across[from_right].nearer > 1 && along[from_below].nearer > 1;
    real value = NOWHERE;
    for (int i = smooth ? from_right : 0; i <= (smooth ? from_right : 1); ++i)
        for (int j = smooth ? from_below : 0; j <= (smooth ? from_below : 1); ++j)
            value = least(inner_value(shading, here, across[i].value, NOWHERE, along[j].value, NOWHERE,
                                      (i ? -to_p : to_p) * across[i].nearer, (j ? -to_q : to_q) * along[j].nearer, x, y,
                                      parameters),
                          value);
    if (value < (ONLY_LOWER ? here : NOWHERE / 2))
        log_depth[cell] = value;
}
