/* The steepness that a material's darkness tells, for schemes that follow curves of Z over it. */
#define SETTLED (USE_DOUBLE ? 1e-7f : 1e-4f) /* a step so small, as a share, leaves nothing that the digits can tell */

/* t^2 at which the material has dimmed by so much; in ln(1 + t^2), of which all materials make nearly a straight line. */
static inline number square_of(const number dimmed, const number highest, const parameter_set *parameters)
{
    number low = 0, high = logarithm((number)1 + highest);
    number stretch = least(high, (number)2 * dimmed); /* exact for a Lambertian material */
#if NEWTON_STEPS > 0
    /* A lane that has settled stays, so that its bits do not depend on how long others take. */
    number settled = -1;
    for (int step = 0; step < NEWTON_STEPS && any_sign(as_integer(settled)); ++step) {
        const number square = exponential(stretch) - (number)1;
        const number excess = dimming(square, parameters) - dimmed;
        high = excess > (number)0 ? stretch : high;
        low = excess > (number)0 ? low : stretch;
        const number newton = stretch - excess / (dimming_rate(square, parameters) * ((number)1 + square));
        const number middle = (number)0.5f * (low + high);
        const number next = newton >= low ? (newton <= high ? newton : middle) : middle;
        const number moved = magnitude(next - stretch) - (number)SETTLED * stretch;
        stretch = settled > (number)0 ? stretch : next;
        settled = moved > (number)0 ? settled : (number)1;
    }
#endif
    return exponential(stretch) - (number)1;
}
