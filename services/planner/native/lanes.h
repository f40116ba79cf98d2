// Eight configurations side by side: one float for each, and the few operations that the check needs.
//
// The same sources are compiled three times (build.sh): as plain loops over eight floats, with the compiler's vectors,
// and with these for AVX2. IEEE operations in the same order, no fused multiply-add, no reassociation: the three give
// the same bits. Everything is in an unnamed namespace, so that no function built for AVX2 can be linked into the
// others.
#pragma once

#include <stdint.h>
#include <string.h>
#if defined(__SSE2__) && !defined(GEMELO_PLAIN_LANES)
#include <immintrin.h>
#endif

#include "views.h"

namespace gemelo {
namespace {

#ifdef GEMELO_PLAIN_LANES

struct Lanes {
    float v[kLanes];

    Lanes() = default;
    Lanes(float x) {
        for (float& lane : v) lane = x;
    }
};

struct Mask {
    int32_t v[kLanes];
};

template <class Result, class Of>
inline Result each(Of of) {
    Result result;
    for (int i = 0; i < kLanes; ++i) result.v[i] = of(i);
    return result;
}

inline Lanes operator+(const Lanes& a, const Lanes& b) {
    return each<Lanes>([&](int i) { return a.v[i] + b.v[i]; });
}
inline Lanes operator-(const Lanes& a, const Lanes& b) {
    return each<Lanes>([&](int i) { return a.v[i] - b.v[i]; });
}
inline Lanes operator*(const Lanes& a, const Lanes& b) {
    return each<Lanes>([&](int i) { return a.v[i] * b.v[i]; });
}
inline Mask operator>(const Lanes& a, const Lanes& b) {
    return each<Mask>([&](int i) { return a.v[i] > b.v[i] ? -1 : 0; });
}
inline Mask operator&(const Mask& a, const Mask& b) {
    return each<Mask>([&](int i) { return a.v[i] & b.v[i]; });
}
inline Lanes select(const Mask& mask, const Lanes& yes, const Lanes& no) {
    return each<Lanes>([&](int i) { return mask.v[i] ? yes.v[i] : no.v[i]; });
}
inline Lanes square_root(const Lanes& a) {
    return each<Lanes>([&](int i) { return __builtin_sqrtf(a.v[i]); });
}
inline uint32_t bits(const Mask& mask) {
    uint32_t result = 0;
    for (int i = 0; i < kLanes; ++i) result |= (mask.v[i] & 1u) << i;
    return result;
}
// Back from one bit for each lane.
inline Mask spread(uint32_t lanes) {
    return each<Mask>([&](int i) { return (lanes >> i & 1u) ? -1 : 0; });
}

#else

typedef float Floats __attribute__((vector_size(4 * kLanes)));
typedef int32_t Integers __attribute__((vector_size(4 * kLanes)));

struct Lanes {
    Floats v;

    Lanes() = default;
    Lanes(Floats floats) : v(floats) {}
    Lanes(float x) : v(x - Floats{}) {}  // x - 0 is x to the bit, x + 0 is not
};

struct Mask {
    Integers v;
};

inline Lanes operator+(Lanes a, Lanes b) { return a.v + b.v; }
inline Lanes operator-(Lanes a, Lanes b) { return a.v - b.v; }
inline Lanes operator*(Lanes a, Lanes b) { return a.v * b.v; }
inline Mask operator>(Lanes a, Lanes b) { return {a.v > b.v}; }
inline Mask operator&(Mask a, Mask b) { return {a.v & b.v}; }
inline Lanes select(Mask mask, Lanes yes, Lanes no) { return mask.v ? yes.v : no.v; }

// Back from one bit for each lane.
inline Mask spread(uint32_t lanes) {
    const Integers each_bit = {1, 2, 4, 8, 16, 32, 64, 128};
    return {(each_bit & static_cast<int32_t>(lanes)) != 0};
}

#ifdef __AVX2__
inline Lanes square_root(Lanes a) { return (Floats)_mm256_sqrt_ps((__m256)a.v); }
inline uint32_t bits(Mask mask) { return static_cast<uint32_t>(_mm256_movemask_ps((__m256)mask.v)); }
#else
inline Lanes square_root(Lanes a) {
    for (int i = 0; i < kLanes; ++i) a.v[i] = __builtin_sqrtf(a.v[i]);
    return a;
}
inline uint32_t bits(Mask mask) {
#ifdef __SSE2__
    __m128 half[2];
    memcpy(half, &mask.v, sizeof half);
    return static_cast<uint32_t>(_mm_movemask_ps(half[0]) | _mm_movemask_ps(half[1]) << 4);
#else
    uint32_t result = 0;
    for (int i = 0; i < kLanes; ++i) result |= (static_cast<uint32_t>(mask.v[i]) & 1u) << i;
    return result;
#endif
}
#endif

#endif  // GEMELO_PLAIN_LANES

inline Lanes load(const float* eight) {
    Lanes lanes;
    memcpy(&lanes.v, eight, sizeof lanes.v);
    return lanes;
}

inline void store(const Lanes& lanes, float* eight) { memcpy(eight, &lanes.v, sizeof lanes.v); }

inline Lanes larger(const Lanes& a, const Lanes& b) { return select(a > b, a, b); }
inline Lanes smaller(const Lanes& a, const Lanes& b) { return select(b > a, a, b); }
inline Lanes magnitude(const Lanes& a) { return larger(a, Lanes(0.0f) - a); }

// The lanes in which `a` is NOT beyond `b`: what is not a number counts as too near.
inline uint32_t not_beyond(const Lanes& a, const Lanes& b) { return ~bits(a > b) & kAllLanes; }

}  // namespace
}  // namespace gemelo
