#include "servo.h"

namespace gemelo {

void Servo::begin(const ServoConfig& config) {
    config_ = config.pin == kNone ? nullptr : &config;
    release();
}

void Servo::go_to(uint32_t target_us) {
    target_q16_ = target_us << 16;
    if (pulse_q16_ == 0) pulse_q16_ = target_q16_;
}

void Servo::advance() {
    if (!is_moving()) return;
    const uint64_t step_q16 = (static_cast<uint64_t>(config_->speed_us_s) << 16) / kSlotHz;
    const uint32_t left_q16 = target_q16_ > pulse_q16_ ? target_q16_ - pulse_q16_ : pulse_q16_ - target_q16_;
    if (left_q16 <= step_q16) {
        pulse_q16_ = target_q16_;
    } else {
        const uint32_t by_q16 = static_cast<uint32_t>(step_q16);
        pulse_q16_ = target_q16_ > pulse_q16_ ? pulse_q16_ + by_q16 : pulse_q16_ - by_q16;
    }
}

}  // namespace gemelo
