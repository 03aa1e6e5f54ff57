/* A lamp off the optical axis that fades with the square of the distance, for the upwind scheme: flash_light.cl with
 * the lamp at O,
 *
 *     I = kappa c(theta) / rho^2,    rho = |X - O|,    X = z R,    R = (x, y, 1)
 *     H(Z, P) = ln(F rho^2) - ln c(theta),    F = I / kappa
 *
 * where theta is the angle between the normal and the direction to the lamp. At a given depth that direction is one of
 * the pixel, as that of a parallel light of its own; see light_cone.cl. `brightness` is F.
 *
 * For the lanes of one vector; it reads no memory.
 */
#define LEAST_DEPTH 1e-3f
#define LEAST_AHEAD 0.01f /* least distance along the axis from the lamp to the surface, as a share of the depth */

/* O, and its products with a pixel's ray. */
typedef struct {
    number x, y, z;
    number ray;    /* R.R */
    number along;  /* O.R */
    number square; /* O.O */
} lamp;

static inline lamp lamp_at(const number x, const number y, const parameter_set *parameters)
{
    const number right = parameters->lamp_x, below = parameters->lamp_y, ahead = parameters->lamp_z;
    const lamp result = {
        right,
        below,
        ahead,
        multiply_add(x, x, multiply_add(y, y, 1)),
        multiply_add(x, right, multiply_add(y, below, ahead)),
        multiply_add(right, right, multiply_add(below, below, ahead * ahead)),
    };
    return result;
}

/* The parallel light that shines on the point at depth 1 / `inverse_depth` as the lamp does. */
static inline light_frame towards(const lamp at, const number inverse_depth, const number x, const number y)
{
    const number ahead = most(1 - at.z * inverse_depth, LEAST_AHEAD), scale = 1 / ahead;
    const number p0 = fnma(at.x, inverse_depth, x) * scale;
    const number q0 = fnma(at.y, inverse_depth, y) * scale;
    return light_frame_of(x, y, p0, q0, 1 / root(multiply_add(p0, p0, multiply_add(q0, q0, 1))));
}

/* The least depth at which this equation is solved: beyond the point of the ray that is nearest to the lamp, by some
 * margin, and beyond the lamp's plane. As nearest_depth of persfs_cl/shading/flash_light.py, but for LEAST_DEPTH, which is
 * in the unit of exp Z.
 */
static inline number nearest_depth(const lamp at)
{
    const number aside = root(most(0, fnma(at.along, at.along, at.ray * at.square)));
    const number nearest = multiply_add(1.05f, at.along, 0.25f * aside) / at.ray;
    return most(LEAST_DEPTH, most(1.02f * at.z, nearest));
}

/* The -ln c that the brightness tells at depth z, ln(F rho^2) with its sign turned. */
static inline number minus_log_c_at(const lamp at, const number z, const number brightness)
{
    const number square_distance = multiply_add(z, fnma(2, at.along, at.ray * z), at.square);
    return -logarithm(brightness * square_distance);
}

/* The t^2 that the brightness tells at depth z, at most that of the steepest slope. */
static inline number square_at(const lamp at, const number z, const number brightness, const parameter_set *parameters)
{
    const number target = most(0, minus_log_c_at(at, z, brightness));
    const number steepest = 2 * parameters->steepest * at.ray;
    return square_of(target, steepest * steepest, parameters);
}

/* The depth that the brightness tells at steepness t: of the two with rho^2 = c / F the farther one. */
static inline number depth_at(const lamp at, const number square, const number inverse_brightness,
                              const parameter_set *parameters)
{
    const number square_distance = exponential(-minus_log_c(square, parameters)) * inverse_brightness;
    const number excess = multiply_add(at.along, at.along, at.ray * (square_distance - at.square));
    /* Written so that the NaN of a cell that is not swept stays one. */
    return most(LEAST_DEPTH, (at.along + root(most(0, excess))) / at.ray);
}

/* 1 - E^2 with E = cos theta, for light_cone.cl, from t^2. */
static inline number dark_at(const number square)
{
    return square / (1 + square);
}

/* The sublevel set {P : H(Z, P) <= 0} at the present Z. */
typedef struct {
    light_frame at;
    number dark;
    slopes level; /* the gradient of Z of a surface that faces the lamp, from which light_cone.cl counts */
} present;

static inline present present_set(const number brightness, const number here, const number x, const number y,
                                  const parameter_set *parameters)
{
    const lamp at = lamp_at(x, y, parameters);
    const number z = exponential(here);
    const light_frame seen = towards(at, 1 / z, x, y);
    const present result = {
        seen,
        dark_at(square_at(at, z, brightness, parameters)),
        {-seen.p0 * seen.per_facing, -seen.q0 * seen.per_facing},
    };
    return result;
}

/* The middle of that set along x, or with `along_y` along y. */
static inline number middle_gradient(const number brightness, const number here, const number x, const number y,
                                     const int along_y, const parameter_set *parameters)
{
    const present set = present_set(brightness, here, x, y, parameters);
    return (along_y ? set.level.q : set.level.p) + middle_of_set(set.dark, along_y, set.at);
}

/* Its outward normal through P. */
static inline slopes outward_normal(const number brightness, const number here, const number p, const number q,
                                    const number x, const number y, const parameter_set *parameters)
{
    const present set = present_set(brightness, here, x, y, parameters);
    return normal_of_set(set.dark, p - set.level.p, q - set.level.q, set.at);
}
