/* New values of cells with differences of first order: those of the scheme, from the nearest neighbours.
 *
 * The names of the neighbours are those of a sweep to the right and down; in the others the neighbours change places,
 * and `to_p` and `to_q` their signs. For the lanes of one vector; it reads no memory of the device.
 */
static inline number value_of(const number brightness, const number here, const number *left, const number *right,
                              const number *up, const number *down, const real to_p, const real to_q, const axis x,
                              const axis y, const parameter_set *parameters)
{
    return inner_value(brightness, here, left[0], right[0], up[0], down[0], to_p, to_q, x, y, parameters);
}
