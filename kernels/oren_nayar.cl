/* Rough matt material by Oren and Nayar under a light at the camera: c = A cos theta + B sin^2 theta. */
#define NEWTON_STEPS 10 /* of the upwind scheme */
#define DIRECT 0 /* A */
#define RIM 1    /* B */

/* -ln c from t^2, t = tan theta: c = (A sqrt(1 + t^2) + B t^2) / (1 + t^2). */
static inline number dimming(const number square, const real *material)
{
    const number secant = (number)1 + square;
    return log(secant / multiply_add(material[DIRECT], root(secant), material[RIM] * square));
}

/* Its derivative by t^2. */
static inline number dimming_rate(const number square, const real *material)
{
    const number secant = (number)1 + square, length = root(secant);
    const number returned = multiply_add(material[DIRECT], length, material[RIM] * square);
    return (number)1 / secant - (material[DIRECT] / ((number)2 * length) + (number)material[RIM]) / returned;
}
