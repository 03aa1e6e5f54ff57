/* Bits of the vector registers that the compiler uses, by the macros that it defines for its target processor; 0 where
 * it defines none. A driver may claim wider registers than its compiler uses, and a vector wider than these is passed
 * to functions in memory: so no other source is asked.
 *
 * One work-item writes the one number: global size (1,).
 */
#if defined(__AVX512F__)
#define REGISTER_BITS 512
#elif defined(__AVX__)
#define REGISTER_BITS 256
#elif defined(__SSE2__) || defined(__ARM_NEON) || defined(__ALTIVEC__)
#define REGISTER_BITS 128
#else
#define REGISTER_BITS 0
#endif

__kernel void registers(__global int *bits) /* shape (1,) */
{
    *bits = REGISTER_BITS;
}
