#include "segment.h"

namespace gemelo {
namespace {

int32_t magnitude(int32_t value) { return value < 0 ? -value : value; }

// A velocity as the distance it covers in dt, Q20 steps: v dt 4096 / 1e6, rounded towards zero. Below 2^49 two
// divisions of 32 bits do, which the chip has.
int64_t covered_q20(int32_t v_q8, uint32_t dt_us) {
    constexpr uint32_t kDivisor = 1000000 / 64, kLowBits = 18;
    const uint64_t dividend = static_cast<uint64_t>(magnitude(v_q8)) * dt_us * (4096 / 64);
    const uint32_t high = static_cast<uint32_t>(dividend >> kLowBits);
    const uint32_t low = static_cast<uint32_t>(dividend) & ((1u << kLowBits) - 1);
    const uint32_t rest = (high % kDivisor) << kLowBits | low;
    const int64_t quotient = static_cast<int64_t>(high / kDivisor) << kLowBits | rest / kDivisor;
    return v_q8 < 0 ? -quotient : quotient;
}

}  // namespace

Cubic make_cubic(int32_t p0_q8, int32_t v0_q8, int32_t p1_q8, int32_t v1_q8, uint32_t dt_us) {
    const int64_t distance = as_q20(p1_q8) - as_q20(p0_q8);
    const int64_t m0 = covered_q20(v0_q8, dt_us);
    const int64_t m1 = covered_q20(v1_q8, dt_us);
    Cubic cubic;
    cubic.origin_q20 = as_q20(p0_q8);
    cubic.c1 = m0;
    cubic.c2 = 3 * distance - 2 * m0 - m1;
    cubic.c3 = m0 + m1 - 2 * distance;
    return cubic;
}

Drift drift_between(int32_t v0_q8, int32_t v1_q8) {
    const int32_t s0 = magnitude(v0_q8), s1 = magnitude(v1_q8);
    Drift drift;
    drift.speed_q8 = s0 > s1 ? s0 : s1;
    // Through a reversal the joint first brakes; that is the side that limits a stop.
    drift.reverses = (v0_q8 < 0) != (v1_q8 < 0) && v0_q8 != 0 && v1_q8 != 0;
    drift.gain_q8 = drift.reverses ? -(s0 + s1) : s1 - s0;
    return drift;
}

void Segment::load(const Knot& from, const Knot& to, uint8_t joints) {
    dt_us = to.dt_us;
    per_dt_q48 = (1ull << 48) / dt_us;
    for (uint8_t j = 0; j < joints; ++j) {
        cubic[j] = make_cubic(from.position[j], from.velocity[j], to.position[j], to.velocity[j], to.dt_us);
        drift[j] = drift_between(from.velocity[j], to.velocity[j]);
        own_q16[j] =
            ((drift[j].gain_q8 * static_cast<int64_t>(per_dt_q48)) >> 24) * (256 * static_cast<int64_t>(kSlotUs)) >> 24;
    }
}

// The reciprocal gives the quotient or one less.
uint32_t Segment::share(uint64_t time, uint8_t bits) const {
    const uint32_t quotient = static_cast<uint32_t>((time * per_dt_q48) >> (63 - bits));
    const uint64_t rest = (time << (bits - 15)) - static_cast<uint64_t>(quotient) * dt_us;
    return rest >= dt_us ? quotient + 1 : quotient;
}

}  // namespace gemelo
