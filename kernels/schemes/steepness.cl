/* The steepness t = tan theta at which a material has a given -ln c, for schemes that follow curves of Z over t. It is
 * the root of
 *
 *     -ln c(t^2) = target,    t^2 = e^s - 1
 *
 * in s, of which -ln c is nearly a linear function for all materials, by Newton's method, kept between bounds. A
 * Lambertian material needs none, s = 2 target. For the lanes of one vector; it reads no memory.
 */
#define SETTLED (USE_DOUBLE ? 1e-7f : 1e-4f) /* relative step after which the next one, its square, is below rounding */

/* t^2 at which -ln c is `target`, at most `highest`. */
static inline number square_of(const number target, const number highest, const parameter_set *parameters)
{
#if NEWTON_STEPS > 0
    number low = 0, high = logarithm(1 + highest), s = least(high, 2 * target);
    /* A lane that has settled stays, so that its bits do not depend on how long others take. */
    number settled = -1;
    for (int step = 0; step < NEWTON_STEPS && any_sign(as_integer(settled)); ++step) {
        const number square = exponential(s) - 1;
        const number excess = minus_log_c(square, parameters) - target;
        high = excess > 0 ? s : high;
        low = excess > 0 ? low : s;
        const number newton = s - excess / (minus_log_c_derivative(square, parameters) * (1 + square));
        const number middle = 0.5f * (low + high);
        const number next = newton >= low ? (newton <= high ? newton : middle) : middle;
        const number moved = magnitude(next - s) - SETTLED * s;
        s = settled > 0 ? s : next;
        settled = choose(moved > 0, settled, 1);
    }
    return exponential(s) - 1;
#else
    return least(highest, exponential(2 * target) - 1);
#endif
}

/* Above 0 where -ln c at t^2 = steep / wide is more than `target`: the difference, or for a Lambertian material, which
 * so needs no division, that of t^2, times `wide`.
 */
static inline number excess_of(const number steep, const number wide, const number target,
                               const parameter_set *parameters)
{
#if NEWTON_STEPS > 0
    return minus_log_c(steep / wide, parameters) - target;
#else
    return fnma(exponential(2 * target) - 1, wide, steep);
#endif
}

/* Whether -ln c at t^2 = steep / wide is more than `target` by ln 2 / 2; `excess` is what excess_of() gave. */
static inline integer far_beyond(const number excess, const number wide, const number target)
{
#if NEWTON_STEPS > 0
    return excess > (real)(0.5 * LN_2);
#else
    return excess > wide * exponential(2 * target);
#endif
}
