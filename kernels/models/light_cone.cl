/* The gradients under which a pixel is at least so bright: the brighter normals form a circular cone around the direction
 * to a light s = (-p0, -q0, 1), seen by a Lambertian surface. P is the gradient of Z + ln f, f = 1 + p0 x + q0 y, which is
 * level where the surface faces the light: 0 is always among them. With dark = 1 - E^2, the square of the sine between
 * normal and light, they are a conic
 *
 *     xx p^2 + 2 xy p q + yy q^2 + 2 x p + 2 y q + free <= 0,        n >= 0
 *
 * whose last three coefficients are proportional to dark: no small difference of large numbers where the surface faces the
 * light.
 */
typedef struct {
    number x, y;
    number p0, q0, inverse_norm;  /* of the light; the latter 1 / k, k = sqrt(1 + p0^2 + q0^2) */
    number facing, per_facing;    /* f and 1 / f                                               */
} sight;

static inline sight sight_of(const number x, const number y, const number p0, const number q0,
                             const number inverse_norm)
{
    const number facing = multiply_add(x, p0, multiply_add(y, q0, (number)1));
    const sight result = {x, y, p0, q0, inverse_norm, facing, (number)1 / facing};
    return result;
}

typedef struct {
    number xx, xy, yy, x, y, free;
} conic;

static inline conic lit_gradients(const number dark, const sight at)
{
    const number a = (at.x - at.p0) * at.inverse_norm, b = (at.y - at.q0) * at.inverse_norm;
    const number bright = (number)1 - dark, pull = dark * at.per_facing;
    const number square_norm = multiply_add(at.p0, at.p0, multiply_add(at.q0, at.q0, (number)1));
    const conic result = {
        multiply_add(bright * at.x, at.x, bright - a * a),
        bright * at.x * at.y - a * b,
        multiply_add(bright * at.y, at.y, bright - b * b),
        (at.p0 - at.x) * pull,
        (at.q0 - at.y) * pull,
        -pull * at.per_facing * square_norm,
    };
    return result;
}

/* The quadratic in p whose roots are the ends of that set along one axis: bend p^2 - 2 tilt p - rest = 0. They are where
 * the cone's two tangent planes lie that contain the other axis. `spread` is tilt^2 + bend rest.
 */
typedef struct {
    number bend, tilt, rest, spread;
} extent;

static inline extent extent_along(const number dark, const int along_y, const sight at)
{
    const number along = along_y ? at.y : at.x, across = along_y ? at.x : at.y;
    const number facing = at.facing * at.inverse_norm, shift = (along_y ? at.q0 : at.p0) * at.per_facing;
    const number apart = multiply_add(across, across, (number)1), ray = multiply_add(along, along, apart);
    /* From the axis and the pixel's ray, the direction along which the surface facing the light does not change. */
    const number radial = multiply_subtract_from(along, shift, ray);
    const number square = multiply_subtract_from((number)1, shift, along + radial);
    const number lit = facing * facing * square;
    const extent result = {multiply_subtract_from(facing * facing, dark, ray), dark * radial, dark * square,
                           dark * multiply_subtract_from(lit, dark, apart)};
    return result;
}

/* The largest p in that set, with `along_y` the largest q, very large where there is none; with `turn` -1 the largest -p
 * or -q. Of two forms of the root the one in which nothing cancels.
 */
static inline number steepest_climb(const number dark, const int along_y, const sided turn, const sight at)
{
    const extent ends = extent_along(dark, along_y, at);
    const number square_root = root(most(ends.spread, (number)0)), tilt = turn * ends.tilt;
    const number above = tilt < (number)0 ? ends.rest : tilt + square_root;
    const number below = tilt < (number)0 ? square_root - tilt : ends.bend;
    /* Written so that a NaN stays one. */
    const number climb = below <= (number)0 ? (number)NOWHERE : above / below;
    return ends.spread < (number)0 ? (number)NOWHERE : climb;
}

/* Middle between the largest and the smallest p of that set, or with `along_y` of q; 0 where it is unbounded. */
static inline number middle_of_set(const number dark, const int along_y, const sight at)
{
    const extent ends = extent_along(dark, along_y, at);
    return ends.bend > (number)0 ? ends.tilt / ends.bend : (number)0;
}

/* The normal of the conic through P, pointing outwards: where the information at a pixel comes from, reversed. */
static inline slopes normal_of_set(const number dark, const number p, const number q, const sight at)
{
    const conic lit = lit_gradients(dark, at);
    const slopes normal = {lit.xx * p + lit.xy * q + lit.x, lit.xy * p + lit.yy * q + lit.y};
    return normal;
}

/* n, the sign of which tells the lit side from the other; times f. */
static inline number lit_side(const number p, const number q, const sight at)
{
    const number square_norm = multiply_add(at.p0, at.p0, multiply_add(at.q0, at.q0, (number)1));
    return multiply_add(at.facing, multiply_add(at.x - at.p0, p, (at.y - at.q0) * q), square_norm);
}
