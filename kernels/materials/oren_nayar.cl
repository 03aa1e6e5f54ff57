/* A rough matt material by Oren and Nayar. The first line is for a light at the camera, the second for any light, with
 * lit = cos theta_i, seen = cos theta_r and phi the angle between the planes of light and ray:
 *
 *     c = A cos theta + B sin^2 theta = (A sqrt(1 + t^2) + B t^2) / (1 + t^2),    t = tan theta
 *     c = A lit + B max(0, cos phi) sin theta_i sin theta_r max(0, lit) / max(lit, seen)
 *
 * A and B are the parameters `direct` and `rim`. Functions for the lanes of one vector; they read no memory.
 */
#define NEWTON_STEPS 10 /* of square_of in steepness.cl, at most */

/* -ln c from t^2. */
static inline number minus_log_c(const number square, const parameter_set *parameters)
{
    const number secant = 1 + square;
    return logarithm(secant / multiply_add(parameters->direct, root(secant), parameters->rim * square));
}

/* Its derivative by t^2. */
static inline number minus_log_c_derivative(const number square, const parameter_set *parameters)
{
    const number secant = 1 + square, length = root(secant);
    const number returned = multiply_add(parameters->direct, length, parameters->rim * square);
    return 1 / secant - (parameters->direct / (2 * length) + parameters->rim) / returned;
}

/* c from the cosines between normal and light, normal and ray, and light and ray. Where the surface turns its back to
 * the light, A lit with its sign.
 */
static inline number returned_light(const number lit, const number seen, const number between,
                                    const parameter_set *parameters)
{
    const number azimuthal = most(0, fnma(lit, seen, between));
    const number quotient = most(0, lit) / most(lit, seen);
    return multiply_add(parameters->direct, lit, parameters->rim * azimuthal * quotient);
}

/* The same; writes its derivatives by the three cosines. */
static inline number returned_slopes(const number lit, const number seen, const number between,
                                     const parameter_set *parameters, number *slopes)
{
    const number azimuthal = most(0, fnma(lit, seen, between)), lit_part = most(0, lit);
    const number inverse = 1 / most(lit, seen), rim = parameters->rim;
    const number quotient = lit_part * inverse;
    const number passed = choose(azimuthal > 0, rim * quotient, 0);
    const number lower = choose(lit < seen, rim * azimuthal * inverse, 0);
    slopes[0] = fnma(seen, passed, parameters->direct) + choose(lit > 0, lower, 0);
    slopes[1] = -fnma(-lit, passed, lower * quotient);
    slopes[2] = passed;
    return multiply_add(parameters->direct, lit, rim * azimuthal * quotient);
}
