// Eight configurations side by side: one float for each, and the few operations that the check needs.
//
// The same sources are compiled three times (build.sh): with one float at a time, with the vectors of four that every
// 64-bit processor has, and with AVX2's of eight. IEEE operations in the same order, no fused multiply-add, no
// reassociation: the three give the same bits. A vector wider than the processor's would be taken apart by GCC, hence
// the pieces. Everything is in an unnamed namespace, so that no function built for AVX2 can be linked into the others.
#pragma once

#include <stdint.h>
#include <string.h>
#if defined(__SSE2__) && !defined(GEMELO_PLAIN_LANES)
#include <immintrin.h>
#endif

#include "views.h"

namespace gemelo {
namespace {

#if defined(GEMELO_PLAIN_LANES)

using Floats = float;
using Integers = int32_t;
inline Floats root(Floats a) { return __builtin_sqrtf(a); }
inline uint32_t signs(Integers mask) { return mask != 0; }

#elif defined(__AVX2__)

typedef float Floats __attribute__((vector_size(32)));
typedef int32_t Integers __attribute__((vector_size(32)));
inline Floats root(Floats a) { return (Floats)_mm256_sqrt_ps((__m256)a); }
inline uint32_t signs(Integers mask) { return static_cast<uint32_t>(_mm256_movemask_ps((__m256)mask)); }

#else

typedef float Floats __attribute__((vector_size(16)));
typedef int32_t Integers __attribute__((vector_size(16)));
#ifdef __SSE2__
inline Floats root(Floats a) { return (Floats)_mm_sqrt_ps((__m128)a); }
inline uint32_t signs(Integers mask) { return static_cast<uint32_t>(_mm_movemask_ps((__m128)mask)); }
#else
inline Floats root(Floats a) {
    for (int i = 0; i < 4; ++i) a[i] = __builtin_sqrtf(a[i]);
    return a;
}
inline uint32_t signs(Integers mask) {
    const Integers weighted = mask & Integers{1, 2, 4, 8};
    return static_cast<uint32_t>(weighted[0] | weighted[1] | weighted[2] | weighted[3]);
}
#endif

#endif

constexpr int kWide = sizeof(Floats) / sizeof(float);
constexpr int kPieces = kLanes / kWide;

struct Lanes {
    Floats v[kPieces];

    Lanes() = default;
    Lanes(float x) {
        for (Floats& piece : v) piece = x - Floats{};  // x - 0 is x to the bit, x + 0 is not
    }
};

// All bits of a lane, or none; in the plain build 1 or 0.
struct Mask {
    Integers v[kPieces];
};

template <class Result, class Of>
inline Result each(Of of) {
    Result result;
    for (int i = 0; i < kPieces; ++i) result.v[i] = of(i);
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
    return each<Mask>([&](int i) { return a.v[i] > b.v[i]; });
}
inline Lanes select(const Mask& mask, const Lanes& yes, const Lanes& no) {
    return each<Lanes>([&](int i) { return mask.v[i] ? yes.v[i] : no.v[i]; });
}
inline Lanes square_root(const Lanes& a) {
    return each<Lanes>([&](int i) { return root(a.v[i]); });
}

inline uint32_t bits(const Mask& mask) {
    uint32_t result = 0;
    for (int i = 0; i < kPieces; ++i) result |= signs(mask.v[i]) << (i * kWide);
    return result;
}

// Back from one bit for each lane.
inline Mask spread(uint32_t lanes) {
    const int32_t each_bit[kLanes] = {1, 2, 4, 8, 16, 32, 64, 128};
    Mask mask;
    memcpy(&mask.v, each_bit, sizeof mask.v);
    for (Integers& piece : mask.v) piece = (piece & static_cast<int32_t>(lanes)) != 0;
    return mask;
}

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
