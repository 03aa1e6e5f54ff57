/* The new value of cells, from the `value` that the scheme gives for inner cells:
 *
 *     Z <- V if V < bound_of(Z),    V = min(max(rim_value at the rim,  `value` elsewhere,  lower), upper)
 *
 * with the bounds that the cell has. A maximum with a constant keeps a monotone scheme monotone, and its limit is the
 * viscosity solution of the obstacle problem. Values that only fall stay below the upper bound if they begin there, and
 * are compared with the lower one alone.
 *
 * `brightness` says what a cell is. NaN marks a cell that is not swept: its V is NaN, which no comparison accepts. For
 * schemes with RIM_CELLS the sign bit marks a cell of the rim, which has a neighbour missing; only its flags are
 * read.
 *
 * For the lanes of one vector. `left`, `right`, `up` and `down` are neighbours in the image, whatever the direction of
 * the sweep; `limits` are as many bounds as LIMITS says; the flags of the lanes lie `apart` from each other. `with_rim`
 * is a constant in each call: 0 where no lane lies at the rim.
 */
static inline __attribute__((always_inline)) number
updated(const number value, const number brightness, const number here, const number left, const number right,
        const number up, const number down, const number *limits, __global const uchar *flags, const long apart,
        const axis x, const axis y, const parameter_set *parameters, const int with_rim)
{
    number candidate = value;
#if RIM_CELLS
    if (with_rim && any_sign(as_integer(brightness))) {
        const integer missing = GATHER(integer, flags, apart);
        const number rim = rim_value(magnitude(brightness), missing, here, left, right, up, down, x, y, parameters);
        candidate = as_integer(brightness) < 0 ? rim : candidate;
    }
#endif
    candidate = limited(candidate, limits);
    return candidate < bound_of(here) ? candidate : here;
}
