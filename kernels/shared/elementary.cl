/* ln a, exp a and a^b, from the operations of the prelude alone, for the lanes of one vector; they read no memory.
 *
 *     ln a = e ln 2 + 2 artanh s,   a = 2^e m,  sqrt(1/2) < m <= sqrt(2),  s = (m - 1) / (m + 1)
 *     exp a = 2^n exp r,            |r| <= ln 2 / 2
 *
 * The built-in functions are function calls on some devices, and those for vectors round differently from those for one
 * number, so that strips would not give the bits of the plain loop. These do, and are exact to a few units in the last
 * place. NaN gives NaN.
 */
/* Of ln 2 the first digits, of which products with small integers are exact, and the rest: LN_2_HIGH and LN_2_LOW. */
#if USE_DOUBLE
#define MANTISSA_BITS 52
#define MANTISSA_MASK 0xfffffffffffffL
#define WHOLE ((number)6755399441055744.0)
#define EXPONENT_BIAS 1023
#define LARGEST_EXPONENT 708
#define LN_2 0.693147180559945309417
#define LN_2_HIGH 0.693145751953125
#define LN_2_LOW 1.42860682030941723212e-6
#else
#define MANTISSA_BITS 23
#define MANTISSA_MASK 0x7fffff
#define WHOLE ((number)12582912.0f)
#define EXPONENT_BIAS 127
#define LARGEST_EXPONENT 87
#define LN_2 0.693147180559945309417f
#define LN_2_HIGH 0.693145751953125f
#define LN_2_LOW 1.42860682030941723212e-6f
#endif

/* WHOLE is 3/2 of a power of 2 so large that its last bit counts ones: a number to which it is added is rounded to an
 * integer, which then stands in the last bits. So numbers and integers below a million are converted by no function.
 */
static inline number number_of(const integer whole)
{
    return as_number(as_integer(WHOLE) + whole) - WHOLE;
}

#define POWER_OF_2(exponent) as_number(((exponent) + EXPONENT_BIAS) << MANTISSA_BITS)

/* ln a of a normal number a > 0: the exponent from its bits, and 2 artanh s = 2 (s + s^3 / 3 + s^5 / 5 + ...). */
static inline number logarithm(const number a)
{
    const integer bits = as_integer(a);
    const number whole = number_of((bits >> MANTISSA_BITS) - EXPONENT_BIAS);
    const number part = as_number((bits & MANTISSA_MASK) | as_integer((number)1));
    const number exponent = part > 1.41421356f ? whole + 1 : whole;
    const number mantissa = part > 1.41421356f ? part * 0.5f : part;
    const number s = (mantissa - 1) / (mantissa + 1), square = s * s;
#if USE_DOUBLE
    number sum = 1.0 / 21.0;
    sum = multiply_add(sum, square, 1.0 / 19.0);
    sum = multiply_add(sum, square, 1.0 / 17.0);
    sum = multiply_add(sum, square, 1.0 / 15.0);
    sum = multiply_add(sum, square, 1.0 / 13.0);
    sum = multiply_add(sum, square, 1.0 / 11.0);
    sum = multiply_add(sum, square, 1.0 / 9.0);
#else
    number sum = 1.0f / 9.0f;
#endif
    sum = multiply_add(sum, square, (real)1 / 7);
    sum = multiply_add(sum, square, (real)1 / 5);
    sum = multiply_add(sum, square, (real)1 / 3);
    sum = multiply_add(sum, square, 1);
    const number rest = 2 * s * sum + exponent * LN_2_LOW;
    return multiply_add(exponent, LN_2_HIGH, rest) + (a - a);
}

/* exp a by Taylor's series for exp r; a beyond the range of numbers gives about the largest or the smallest. */
static inline number exponential(const number a)
{
    const number bounded = least(LARGEST_EXPONENT, most(-LARGEST_EXPONENT, a));
    const number shifted = bounded * (1 / LN_2) + WHOLE, whole = shifted - WHOLE;
    const integer n = as_integer(shifted) - as_integer(WHOLE);
    const number r = fnma(whole, LN_2_LOW, fnma(whole, LN_2_HIGH, bounded));
#if USE_DOUBLE
    number sum = 1.0 / 6227020800.0;
    sum = multiply_add(sum, r, 1.0 / 479001600.0);
    sum = multiply_add(sum, r, 1.0 / 39916800.0);
    sum = multiply_add(sum, r, 1.0 / 3628800.0);
    sum = multiply_add(sum, r, 1.0 / 362880.0);
    sum = multiply_add(sum, r, 1.0 / 40320.0);
    sum = multiply_add(sum, r, 1.0 / 5040.0);
#else
    number sum = 1.0f / 5040.0f;
#endif
    sum = multiply_add(sum, r, (real)1 / 720);
    sum = multiply_add(sum, r, (real)1 / 120);
    sum = multiply_add(sum, r, (real)1 / 24);
    sum = multiply_add(sum, r, (real)1 / 6);
    sum = multiply_add(sum, r, (real)1 / 2);
    sum = multiply_add(sum, r, 1);
    sum = multiply_add(sum, r, 1);
    return sum * POWER_OF_2(n) + (a - a);
}

/* a^b = exp(b ln a), a > 0. */
static inline number power(const number a, const real b)
{
    return exponential(b * logarithm(a));
}
