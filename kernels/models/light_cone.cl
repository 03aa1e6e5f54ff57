/* The sublevel set K = {P : H(P) <= 0} of a Lambertian surface under the light s = (-p0, -q0, 1), for the upwind
 * scheme: the gradients of surfaces at least as bright as the pixel, whose normals form a circular cone around the
 * direction to the light. P is the gradient of Z + ln f, f = 1 + p0 x + q0 y, which is level where the surface faces
 * the light: 0 always lies in K. With dark = 1 - E^2, the square of the sine between normal and light, K is
 *
 *     xx p^2 + 2 xy p q + yy q^2 + 2 x p + 2 y q + free <= 0,        n >= 0
 *
 * The last three coefficients are proportional to dark: no small difference of large numbers where the surface faces
 * the light.
 *
 * For the lanes of one vector; it reads no memory. `at` is the pixel (x, y) and the light there.
 */
typedef struct {
    number x, y;
    number p0, q0, inverse_norm; /* of the light; the latter 1 / k, k = sqrt(1 + p0^2 + q0^2) */
    number facing, per_facing;   /* f and 1 / f                                               */
} light_frame;

static inline light_frame light_frame_of(const number x, const number y, const number p0, const number q0,
                                         const number inverse_norm)
{
    const number facing = multiply_add(x, p0, multiply_add(y, q0, 1));
    const light_frame result = {x, y, p0, q0, inverse_norm, facing, 1 / facing};
    return result;
}

typedef struct {
    number xx, xy, yy, x, y, free;
} conic;

/* The coefficients of K. */
static inline conic sublevel_set(const number dark, const light_frame at)
{
    const number a = (at.x - at.p0) * at.inverse_norm, b = (at.y - at.q0) * at.inverse_norm;
    const number bright = 1 - dark, scale = dark * at.per_facing;
    const number square_norm = multiply_add(at.p0, at.p0, multiply_add(at.q0, at.q0, 1));
    const conic result = {
        multiply_add(bright * at.x, at.x, bright - a * a),
        bright * at.x * at.y - a * b,
        multiply_add(bright * at.y, at.y, bright - b * b),
        (at.p0 - at.x) * scale,
        (at.q0 - at.y) * scale,
        -scale * at.per_facing * square_norm,
    };
    return result;
}

/* The quadratic in p whose roots are the ends of K along one axis: bend p^2 - 2 tilt p - rest = 0. They belong to the
 * two tangent planes of the cone that contain the other axis. `spread` is tilt^2 + bend rest.
 */
typedef struct {
    number bend, tilt, rest, spread;
} extent;

static inline extent extent_along(const number dark, const int along_y, const light_frame at)
{
    const number along = along_y ? at.y : at.x, across = along_y ? at.x : at.y;
    const number facing = at.facing * at.inverse_norm, shift = (along_y ? at.q0 : at.p0) * at.per_facing;
    const number apart = multiply_add(across, across, 1), ray = multiply_add(along, along, apart);
    /* From the axis and the pixel's ray, the direction along which the surface facing the light does not change. */
    const number radial = fnma(shift, ray, along);
    const number square = fnma(shift, along + radial, 1);
    const number lit = facing * facing * square;
    const extent result = {fnma(dark, ray, facing * facing), dark * radial, dark * square,
                           dark * fnma(dark, apart, lit)};
    return result;
}

/* max p over K, with `along_y` max q, and with `turn` -1 max -p or -q; NOWHERE where K is unbounded. Of two forms of
 * the root the one in which nothing cancels.
 */
static inline number steepest_climb(const number dark, const int along_y, const sided turn, const light_frame at)
{
    const extent ends = extent_along(dark, along_y, at);
    const number square_root = root(most(ends.spread, 0)), tilt = turn * ends.tilt;
    const number above = tilt < 0 ? ends.rest : tilt + square_root;
    const number below = tilt < 0 ? square_root - tilt : ends.bend;
    /* Written so that a NaN stays one. */
    const number climb = choose(below <= 0, NOWHERE, above / below);
    return choose(ends.spread < 0, NOWHERE, climb);
}

/* The middle between max p and min p over K, or with `along_y` of q; 0 where K is unbounded. */
static inline number middle_of_set(const number dark, const int along_y, const light_frame at)
{
    const extent ends = extent_along(dark, along_y, at);
    return choose(ends.bend > 0, ends.tilt / ends.bend, 0);
}

/* The outward normal of the conic through P: the direction of the characteristic. */
static inline slopes normal_of_set(const number dark, const number p, const number q, const light_frame at)
{
    const conic set = sublevel_set(dark, at);
    const slopes normal = {set.xx * p + set.xy * q + set.x, set.xy * p + set.yy * q + set.y};
    return normal;
}

/* n f, above 0 on the side of the surface that is lit. */
static inline number lit_side(const number p, const number q, const light_frame at)
{
    const number square_norm = multiply_add(at.p0, at.p0, multiply_add(at.q0, at.q0, 1));
    return multiply_add(at.facing, multiply_add(at.x - at.p0, p, (at.y - at.q0) * q), square_norm);
}
