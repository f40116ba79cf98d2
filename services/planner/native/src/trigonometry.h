// Sine and cosine of eight angles, to about 2e-7, for angles up to kMostTurn.
#pragma once

#include "lanes.h"

namespace gemelo {
namespace {

// To the nearest whole number: beyond 2^23 a float has no fraction. Exact for |x| < 2^22, half to even.
inline Lanes nearest_whole(const Lanes& x) {
    const Lanes big(12582912.0f);  // 1.5 * 2^23
    return (x + big) - big;
}

// Half turns are taken off in three parts (Cody and Waite 1980), then Taylor's series over a quarter turn on both
// sides.
inline void sine_cosine(const Lanes& angle, Lanes& sine, Lanes& cosine) {
    const Lanes turns = nearest_whole(angle * 0.318309886f);
    const Lanes x = ((angle - turns * 3.140625f) - turns * 9.67502594e-4f) - turns * 1.50995799e-7f;
    const Lanes odd = turns - nearest_whole(turns * 0.5f) * 2.0f;
    const Lanes sign = Lanes(1.0f) - odd * odd * 2.0f;
    const Lanes s = x * x;
    const Lanes sine_tail =
        s *
        (s * (s * (s * (s * -2.50521084e-8f + 2.75573192e-6f) + -1.98412698e-4f) + 8.33333333e-3f) + -1.66666667e-1f);
    const Lanes cosine_tail =
        s * (s * (s * (s * (s * (s * 2.08767570e-9f + -2.75573192e-7f) + 2.48015873e-5f) + -1.38888889e-3f) +
                  4.16666667e-2f) +
             -0.5f);
    sine = sign * (x + x * sine_tail);
    cosine = sign * (cosine_tail + 1.0f);
}

}  // namespace
}  // namespace gemelo
