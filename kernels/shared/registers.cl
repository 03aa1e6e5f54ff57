/* What vector registers the compiler uses, by what it defines for the processor that it compiles for. A driver may say that
 * a device has wider ones, and a vector wider than the compiler's own goes through memory wherever a function takes one.
 * 0: it does not say. Nothing but the compiler's own words will do, so compilers without these words are not asked further.
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
