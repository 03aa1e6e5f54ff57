/* A lamp beside the camera that fades with the square of the distance, for the upwind scheme: as flash_light.cl, with the
 * lamp where it is,
 *
 *     I = kappa c(theta) / rho^2,    rho = |X - O|,    X = z (x, y, 1)
 *
 * with O the place of the lamp and theta the angle between the surface's normal and the direction to the lamp. At a given
 * depth that direction is a number of the pixel, as of a parallel light of its own; see light_cone.cl.
 *
 * In `brightness` stands F = I / kappa.
 */
#define LEAST_DEPTH 1e-3f
#define LEAST_AHEAD 0.01f /* share of the depth that a lamp is taken to be nearer than the surface, along the axis */

/* O at the scale of a pixel's ray R = (x, y, 1). */
typedef struct {
    number x, y, z;
    number ray;    /* R R */
    number along;  /* O R */
    number square; /* O O */
} lamp;

static inline lamp lamp_at(const number x, const number y, const parameter_set *parameters)
{
    const number right = parameters->lamp_x, below = parameters->lamp_y;
    const number ahead = parameters->lamp_z;
    const lamp result = {right, below, ahead, multiply_add(x, x, multiply_add(y, y, (number)1)),
                         multiply_add(x, right, multiply_add(y, below, ahead)),
                         multiply_add(right, right, multiply_add(below, below, ahead * ahead))};
    return result;
}

/* The lamp seen from depth 1 / `inverse_depth`, as a parallel light. */
static inline sight towards(const lamp at, const number inverse_depth, const number x, const number y)
{
    const number ahead = most((number)1 - at.z * inverse_depth, (number)LEAST_AHEAD), scale = (number)1 / ahead;
    const number p0 = multiply_subtract_from(x, at.x, inverse_depth) * scale;
    const number q0 = multiply_subtract_from(y, at.y, inverse_depth) * scale;
    return sight_of(x, y, p0, q0, (number)1 / root(multiply_add(p0, p0, multiply_add(q0, q0, (number)1))));
}

/* Where the depth ends: beyond the point of the ray that is nearest to the lamp, by some margin, and beyond the lamp's
 * plane. As in persfs_cl/solver/rounds.py.
 */
static inline number nearest_depth(const lamp at)
{
    const number aside = root(most((number)0, multiply_subtract_from(at.ray * at.square, at.along, at.along)));
    const number nearest = multiply_add((number)1.05f, at.along, (number)0.25f * aside) / at.ray;
    return most((number)LEAST_DEPTH, most((number)1.02f * at.z, nearest));
}

/* -ln c at which the depth is z: how much darker than a surface that faces the lamp. */
static inline number dimmed_at(const lamp at, const number z, const number brightness)
{
    const number square_distance = multiply_add(z, multiply_subtract_from(at.ray * z, (number)2, at.along), at.square);
    return -logarithm(brightness * square_distance);
}

/* t^2 at a depth, up to that of the steepest slope. */
static inline number square_at(const lamp at, const number z, const number brightness, const parameter_set *parameters)
{
    const number dimmed = most((number)0, dimmed_at(at, z, brightness));
    const number steepest = (number)(2 * parameters->steepest) * at.ray;
    return square_of(dimmed, steepest * steepest, parameters);
}

/* The depth at which c is that of t^2: the farther of two that are at the right distance from the lamp. */
static inline number depth_at(const lamp at, const number square, const number inverse_brightness, const parameter_set *parameters)
{
    const number square_distance = exponential(-dimming(square, parameters)) * inverse_brightness;
    const number excess = multiply_add(at.along, at.along, at.ray * (square_distance - at.square));
    /* Written so that the NaN of a cell that is not swept stays one. */
    return most((number)LEAST_DEPTH, (at.along + root(most((number)0, excess))) / at.ray);
}

/* 1 - E^2 with E = cos theta, as light_cone.cl has it. */
static inline number dark_at(const number square)
{
    return square / ((number)1 + square);
}

/* The set of gradients at the present value. */
typedef struct {
    sight at;
    number dark;
    slopes level; /* gradient of Z where the surface faces the lamp: where that of light_cone.cl is 0 */
} present;

static inline present present_set(const number brightness, const number here, const number x, const number y,
                                  const parameter_set *parameters)
{
    const lamp at = lamp_at(x, y, parameters);
    const number z = exponential(here);
    const sight seen = towards(at, (number)1 / z, x, y);
    const present result = {seen,
                            dark_at(square_at(at, z, brightness, parameters)),
                            {-seen.p0 * seen.per_facing, -seen.q0 * seen.per_facing}};
    return result;
}

static inline number middle_gradient(const number brightness, const number here, const number x, const number y,
                                     const int along_y, const parameter_set *parameters)
{
    const present set = present_set(brightness, here, x, y, parameters);
    return (along_y ? set.level.q : set.level.p) + middle_of_set(set.dark, along_y, set.at);
}

static inline slopes outward_normal(const number brightness, const number here, const number p, const number q,
                                    const number x, const number y, const parameter_set *parameters)
{
    const present set = present_set(brightness, here, x, y, parameters);
    return normal_of_set(set.dark, p - set.level.p, q - set.level.q, set.at);
}
