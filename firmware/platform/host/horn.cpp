#include "horn.h"

#include <math.h>

namespace gemelo {

void Horn::begin(const HornConfig& config) {
    config_ = config;
    place_us_ = config.open_us;
    has_object_ = false;
}

void Horn::advance(uint32_t pulse_us, double seconds) {
    if (!is_there() || pulse_us == 0) return;
    double target_us = pulse_us;
    const bool closes_downwards = config_.closed_us < config_.open_us;
    if (has_object_) target_us = closes_downwards ? fmax(target_us, stop_us_) : fmin(target_us, stop_us_);
    const double most_us = config_.speed_us_s * seconds;
    place_us_ += fmin(fmax(target_us - place_us_, -most_us), most_us);
}

void Horn::put_object(double stop_us) {
    has_object_ = true;
    stop_us_ = stop_us;
}

double Horn::value() const {
    const double share = (place_us_ - config_.closed_us) / (config_.open_us - config_.closed_us);
    return config_.closed_value + share * (config_.open_value - config_.closed_value);
}

}  // namespace gemelo
