/* Phong's material under a light at the camera: c = kd cos theta + ks max(cos 2 theta, 0)^m. */
#define NEWTON_STEPS 14 /* to the steepness at which it dims so much */
#define DIMMEST 1e-30f /* least cosine of a highlight: the logarithm in a power wants a normal number above 0 */

/* A power of a cosine, of 0 where that is below. */
static inline number lobe(const number cosine, const real exponent)
{
    return power(most(cosine, (number)DIMMEST), exponent);
}

/* -ln c from t^2, t = tan theta: cos theta = 1 / sqrt(1 + t^2), cos 2 theta = (1 - t^2) / (1 + t^2). */
static inline number dimming(const number square, const parameter_set *parameters)
{
    const number secant = (number)1 + square;
    const number mirrored = ((number)1 - square) / secant;
    return -logarithm(parameters->diffuse / root(secant) + parameters->specular * lobe(mirrored, parameters->shininess));
}

/* Brightness for any directions, as in oren_nayar.cl; without a highlight in shadow. */
static inline number returned_light(const number lit, const number seen, const number between, const parameter_set *parameters)
{
    const number mirrored = multiply_subtract_from(-between, (number)-2 * lit, seen);
    const number highlight = parameters->specular * lobe(mirrored, parameters->shininess);
    return multiply_add(parameters->diffuse, lit, lit > (number)0 ? highlight : (number)0);
}

/* Derivative of the dimming by t^2. The power is that of the dimming, which the compiler need not take twice. */
static inline number dimming_rate(const number square, const parameter_set *parameters)
{
    const number secant = (number)1 + square, length = root(secant);
    const number mirrored = ((number)1 - square) / secant;
    const number highlight = parameters->specular * lobe(mirrored, parameters->shininess);
    const number returned = parameters->diffuse / length + highlight;
    const number dimmer = mirrored > (number)DIMMEST ? highlight / mirrored : (number)0;
    const number fall = parameters->diffuse / ((number)2 * secant * length) +
                        (number)(2 * parameters->shininess) * dimmer / (secant * secant);
    return fall / returned;
}
