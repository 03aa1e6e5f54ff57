/* Rough matt material by Oren and Nayar under a light at the camera: c = A cos theta + B sin^2 theta. */
#define NEWTON_STEPS 10 /* to the steepness at which it dims so much */

/* -ln c from t^2, t = tan theta: c = (A sqrt(1 + t^2) + B t^2) / (1 + t^2). */
static inline number dimming(const number square, const parameter_set *parameters)
{
    const number secant = (number)1 + square;
    return logarithm(secant / multiply_add(parameters->direct, root(secant), parameters->rim * square));
}

/* Brightness for any directions, from the cosines between normal and light, normal and ray, and light and ray. Where the
 * surface turns its back to the light, the matt part continued with its sign.
 */
static inline number returned_light(const number lit, const number seen, const number between, const parameter_set *parameters)
{
    const number azimuthal = most((number)0, multiply_subtract_from(between, lit, seen));
    const number quotient = most((number)0, lit) / most(lit, seen);
    return multiply_add(parameters->direct, lit, parameters->rim * azimuthal * quotient);
}

/* Derivative of the dimming by t^2. */
static inline number dimming_rate(const number square, const parameter_set *parameters)
{
    const number secant = (number)1 + square, length = root(secant);
    const number returned = multiply_add(parameters->direct, length, parameters->rim * square);
    return (number)1 / secant - (parameters->direct / ((number)2 * length) + (number)parameters->rim) / returned;
}
