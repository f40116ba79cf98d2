#include "ceiling.h"

namespace gemelo {

void Ceiling::set_dt(uint32_t dt_us) const {
    if (dt_us == dt_us_) return;
    dt_us_ = dt_us;
    for (uint8_t j = 0; j < config_->joints; ++j) {
        const int64_t swing = with_margin(config_->joint[j].max_acceleration_q8) * 2 * dt_us / 1000000;
        swing_q8_[j] = swing > 0 ? swing : 1;
    }
}

uint32_t Ceiling::before(const Knot& from, const Knot& to, uint32_t next_q26) const {
    set_dt(to.dt_us);
    int64_t lowest = kFullCeiling;
    for (uint8_t j = 0; j < config_->joints; ++j) {
        const Drift drift = drift_between(from.velocity[j], to.velocity[j]);
        if (drift.speed_q8 == 0) continue;
        // y_from = (y_to v + 2 dt A) / (v + 2 dt b), where b is what the path itself brakes with.
        const int64_t own_braking = drift.gain_q8 < 0 ? -2 * static_cast<int64_t>(drift.gain_q8) : 0;
        const int64_t above = static_cast<int64_t>(next_q26) * drift.speed_q8 + swing_q8_[j] * kFullCeiling;
        const int64_t below = drift.speed_q8 + own_braking;
        if (above < lowest * below) lowest = above / below;
    }
    return static_cast<uint32_t>(lowest);
}

}  // namespace gemelo
