/* Lambertian material under a light at the camera: c = cos theta. */
#define NEWTON_STEPS 0 /* to the steepness at which it dims so much: a formula has it exactly */

/* -ln c from t^2, t = tan theta. */
static inline number dimming(const number square, const parameter_set *parameters)
{
    return (number)0.5f * logarithm((number)1 + square);
}

/* Its derivative by t^2. */
static inline number dimming_rate(const number square, const parameter_set *parameters)
{
    return (number)0.5f / ((number)1 + square);
}
