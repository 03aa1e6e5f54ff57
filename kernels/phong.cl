/* Phong's material under a light at the camera: c = kd cos theta + ks max(cos 2 theta, 0)^m. */
#define NEWTON_STEPS 14 /* of the upwind scheme */
#define DIFFUSE 0   /* kd */
#define SPECULAR 1  /* ks */
#define SHININESS 2 /* m  */

/* -ln c from t^2, t = tan theta: cos theta = 1 / sqrt(1 + t^2), cos 2 theta = (1 - t^2) / (1 + t^2). */
static inline number dimming(const number square, const real *material)
{
    const number secant = (number)1 + square;
    const number mirrored = most(((number)1 - square) / secant, (number)0);
    return -log(material[DIFFUSE] / root(secant) + material[SPECULAR] * pow(mirrored, (number)material[SHININESS]));
}

/* Its derivative by t^2. */
static inline number dimming_rate(const number square, const real *material)
{
    const number secant = (number)1 + square, length = root(secant);
    const number mirrored = most(((number)1 - square) / secant, (number)0);
    const number highlight = material[SPECULAR] * pow(mirrored, (number)(material[SHININESS] - 1));
    const number returned = material[DIFFUSE] / length + highlight * mirrored;
    const number fall = material[DIFFUSE] / ((number)2 * secant * length) +
                        (number)(2 * material[SHININESS]) * highlight / (secant * secant);
    return fall / returned;
}
