/* A Lambertian material under a light at the camera:
 *
 *     c = cos theta = 1 / sqrt(1 + t^2),    t = tan theta
 *
 * Functions of t^2 for the lanes of one vector; they read no memory. Under a parallel light this material has a model
 * of its own, parallel_light.cl.
 */
#define NEWTON_STEPS 0 /* of square_of in steepness.cl, whose first guess is exact here */

/* -ln c from t^2. */
static inline number minus_log_c(const number square, const parameter_set *parameters)
{
    return 0.5f * logarithm(1 + square);
}

/* Its derivative by t^2. */
static inline number minus_log_c_derivative(const number square, const parameter_set *parameters)
{
    return 0.5f / (1 + square);
}

/* c for a light anywhere, from the cosines between normal and light, normal and ray, and light and ray; writes its
 * derivatives by these.
 */
static inline number returned_slopes(const number lit, const number seen, const number between,
                                     const parameter_set *parameters, number *slopes)
{
    slopes[0] = 1;
    slopes[1] = slopes[2] = 0;
    return lit;
}
