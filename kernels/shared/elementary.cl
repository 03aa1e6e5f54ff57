/* Logarithm, exponential and power, in the operations of the prelude alone.
 *
 * The library's are calls out of line on some devices, and those for vectors round otherwise than those for one number:
 * then strips would not give the bits of the plain loop. These do, and are exact to a few units in the last place. A NaN
 * stays one.
 */
#if USE_DOUBLE
#define MANTISSA_BITS 52
#define MANTISSA_MASK 0xfffffffffffffL
#define WHOLE ((number)6755399441055744.0)
#define EXPONENT_BIAS 1023
#define LARGEST_EXPONENT ((number)708)
#else
#define MANTISSA_BITS 23
#define MANTISSA_MASK 0x7fffff
#define WHOLE ((number)12582912.0f)
#define EXPONENT_BIAS 127
#define LARGEST_EXPONENT ((number)87)
#endif
#define LN_2 ((number)0.693147180559945309417)
/* Its first digits, of which products with small whole numbers are exact, and the rest. */
#define LN_2_HIGH ((number)0.693145751953125)
#define LN_2_LOW ((number)1.42860682030941723212e-6)

/* WHOLE is 3/2 of a power of 2 so large that its last bit counts ones: added to a number it rounds it to a whole one, which
 * then stands in the last bits. So numbers and integers, of less than a million, become each other without the library.
 */
static inline number number_of(const integer whole)
{
    return as_number(as_integer(WHOLE) + whole) - WHOLE;
}

#define POWER_OF_2(exponent) as_number(((exponent) + EXPONENT_BIAS) << MANTISSA_BITS)

/* ln a of a normal number above 0: the exponent by its bits, and 2 artanh s = 2 (s + s^3 / 3 + s^5 / 5 + ...). */
static inline number logarithm(const number a)
{
    const integer bits = as_integer(a);
    const number whole = number_of((bits >> MANTISSA_BITS) - EXPONENT_BIAS);
    const number part = as_number((bits & MANTISSA_MASK) | as_integer((number)1));
    const number exponent = part > (number)1.41421356f ? whole + (number)1 : whole;
    const number mantissa = part > (number)1.41421356f ? part * (number)0.5f : part;
    const number s = (mantissa - (number)1) / (mantissa + (number)1), square = s * s;
#if USE_DOUBLE
    number sum = (number)(1.0 / 21.0);
    sum = multiply_add(sum, square, (number)(1.0 / 19.0));
    sum = multiply_add(sum, square, (number)(1.0 / 17.0));
    sum = multiply_add(sum, square, (number)(1.0 / 15.0));
    sum = multiply_add(sum, square, (number)(1.0 / 13.0));
    sum = multiply_add(sum, square, (number)(1.0 / 11.0));
    sum = multiply_add(sum, square, (number)(1.0 / 9.0));
#else
    number sum = (number)(1.0f / 9.0f);
#endif
    sum = multiply_add(sum, square, (number)((real)1 / 7));
    sum = multiply_add(sum, square, (number)((real)1 / 5));
    sum = multiply_add(sum, square, (number)((real)1 / 3));
    sum = multiply_add(sum, square, (number)1);
    const number rest = (number)2 * s * sum + exponent * LN_2_LOW;
    return multiply_add(exponent, LN_2_HIGH, rest) + (a - a);
}

/* exp a = 2^n exp r with |r| <= ln 2 / 2, by Taylor; at most about the largest number. */
static inline number exponential(const number a)
{
    const number bounded = least(LARGEST_EXPONENT, most(-LARGEST_EXPONENT, a));
    const number shifted = bounded * ((number)1 / LN_2) + WHOLE, whole = shifted - WHOLE;
    const integer n = as_integer(shifted) - as_integer(WHOLE);
    const number r = multiply_subtract_from(multiply_subtract_from(bounded, whole, LN_2_HIGH), whole, LN_2_LOW);
#if USE_DOUBLE
    number sum = (number)(1.0 / 6227020800.0);
    sum = multiply_add(sum, r, (number)(1.0 / 479001600.0));
    sum = multiply_add(sum, r, (number)(1.0 / 39916800.0));
    sum = multiply_add(sum, r, (number)(1.0 / 3628800.0));
    sum = multiply_add(sum, r, (number)(1.0 / 362880.0));
    sum = multiply_add(sum, r, (number)(1.0 / 40320.0));
    sum = multiply_add(sum, r, (number)(1.0 / 5040.0));
#else
    number sum = (number)(1.0f / 5040.0f);
#endif
    sum = multiply_add(sum, r, (number)((real)1 / 720));
    sum = multiply_add(sum, r, (number)((real)1 / 120));
    sum = multiply_add(sum, r, (number)((real)1 / 24));
    sum = multiply_add(sum, r, (number)((real)1 / 6));
    sum = multiply_add(sum, r, (number)((real)1 / 2));
    sum = multiply_add(sum, r, (number)1);
    sum = multiply_add(sum, r, (number)1);
    return sum * POWER_OF_2(n) + (a - a);
}

/* a^b, a > 0. */
static inline number power(const number a, const real b)
{
    return exponential((number)b * logarithm(a));
}
