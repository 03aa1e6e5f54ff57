/* Phong's material. The first line is for a light at the camera, the second for any light, with alpha the angle between
 * the ray and the mirrored direction of the light:
 *
 *     c = kd cos theta + ks max(0, cos 2 theta)^m,    cos 2 theta = (1 - t^2) / (1 + t^2),    t = tan theta
 *     c = kd lit + ks max(0, cos alpha)^m,            cos alpha = 2 lit seen - between
 *
 * kd, ks and m are the parameters `diffuse`, `specular` and `shininess`. Functions for the lanes of one vector; they
 * read no memory.
 */
#define NEWTON_STEPS 14 /* of square_of in steepness.cl, at most */
#define LEAST_COSINE 1e-30f /* of a highlight: the logarithm in a power wants a normal number above 0 */

/* max(0, cosine)^exponent, but for LEAST_COSINE in place of 0. */
static inline number lobe(const number cosine, const real exponent)
{
    return power(most(cosine, LEAST_COSINE), exponent);
}

/* -ln c from t^2. */
static inline number minus_log_c(const number square, const parameter_set *parameters)
{
    const number secant = 1 + square;
    const number mirrored = (1 - square) / secant;
    const number highlight = parameters->specular * lobe(mirrored, parameters->shininess);
    return -logarithm(parameters->diffuse / root(secant) + highlight);
}

/* Its derivative by t^2. The power is the same as in minus_log_c, so that the compiler need not compute it twice. */
static inline number minus_log_c_derivative(const number square, const parameter_set *parameters)
{
    const number secant = 1 + square, length = root(secant);
    const number mirrored = (1 - square) / secant;
    const number highlight = parameters->specular * lobe(mirrored, parameters->shininess);
    const number returned = parameters->diffuse / length + highlight;
    const number quotient = choose(mirrored > LEAST_COSINE, highlight / mirrored, 0);
    const number fall = parameters->diffuse / (2 * secant * length) +
                        2 * parameters->shininess * quotient / (secant * secant);
    return fall / returned;
}

/* c from the cosines between normal and light, normal and ray, and light and ray; without a highlight in shadow. */
static inline number returned_light(const number lit, const number seen, const number between,
                                    const parameter_set *parameters)
{
    const number mirrored = multiply_add(2 * lit, seen, -between);
    const number highlight = parameters->specular * lobe(mirrored, parameters->shininess);
    return multiply_add(parameters->diffuse, lit, choose(lit > 0, highlight, 0));
}

/* The same; writes its derivatives by the three cosines. */
static inline number returned_slopes(const number lit, const number seen, const number between,
                                     const parameter_set *parameters, number *slopes)
{
    const number mirrored = multiply_add(2 * lit, seen, -between);
    const number highlight = choose(lit > 0, parameters->specular * lobe(mirrored, parameters->shininess), 0);
    const number fall = choose(mirrored > LEAST_COSINE, parameters->shininess * highlight / mirrored, 0);
    slopes[0] = multiply_add(2 * seen, fall, parameters->diffuse);
    slopes[1] = 2 * lit * fall;
    slopes[2] = -fall;
    return multiply_add(parameters->diffuse, lit, highlight);
}
