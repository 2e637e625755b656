// Vectors of one number a robot, and the reciprocal square root: AVX-512 where the processor has it,
// else the compiler's own vector types of the widest register there is.
#pragma once
#include <cmath>

#ifdef __AVX512F__
#include <immintrin.h>
#define VECTOR_BYTES 64
#elif defined(__AVX__)
#define VECTOR_BYTES 32
#else
#define VECTOR_BYTES 16
#endif

#define INLINE inline __attribute__((always_inline))

typedef float Float __attribute__((vector_size(VECTOR_BYTES)));
typedef double Double __attribute__((vector_size(VECTOR_BYTES)));

template <typename Real> struct VectorOf;
template <> struct VectorOf<float> { using type = Float; };
template <> struct VectorOf<double> { using type = Double; };

#ifdef __AVX512F__

// Whether any lane is below zero (or -0.0).
INLINE bool negative(Float x) { return _mm512_movepi32_mask(_mm512_castps_si512((__m512)x)) != 0; }
INLINE bool negative(Double x) { return _mm512_movepi64_mask(_mm512_castpd_si512((__m512d)x)) != 0; }

// k - q / sqrt(x) where the parameter h is q / 2: one Newton step on the estimate (2^-14), its
// factors folded into h. Accurate to 2^-26, and to the last bit of float32 once rounded.
INLINE Float tension(Float k, Float h, Float x) {
    const Float y = (Float)_mm512_rsqrt14_ps((__m512)x);
    const Float t = x * y;
    return k - (h * y) * (3.0f - t * y);
}
// The same where h is q: with e = 1 - x y^2 the series 1 + e/2 + 3/8 e^2 + 5/16 e^3, to 2^-54.
INLINE Double tension(Double k, Double h, Double x) {
    const Double y = (Double)_mm512_rsqrt14_pd((__m512d)x);
    const Double e = 1.0 - (x * y) * y;
    const Double series = 1.0 + e * (0.5 + e * (0.375 + e * 0.3125));
    return k - (h * y) * series;
}
INLINE Float root(Float x) { return (Float)_mm512_sqrt_ps((__m512)x); }
INLINE Double root(Double x) { return (Double)_mm512_sqrt_pd((__m512d)x); }
#else
template <typename V>
INLINE bool negative(V x) {
    bool found = false;
    for (unsigned l = 0; l < VECTOR_BYTES / sizeof(x[0]); ++l) found |= x[l] < 0;
    return found;
}
template <typename V>
INLINE V root(V x) {
    for (unsigned l = 0; l < VECTOR_BYTES / sizeof(x[0]); ++l) x[l] = std::sqrt(x[l]);
    return x;
}
INLINE Float tension(Float k, Float h, Float x) { return k - 2.0f * h / root(x); }
INLINE Double tension(Double k, Double h, Double x) { return k - h / root(x); }
#endif

// The part of q that tension() wants.
INLINE double tension_part(float) { return 0.5; }
INLINE double tension_part(double) { return 1.0; }
