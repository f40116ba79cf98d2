#include "homing.h"

#include "segment.h"

namespace gemelo {
namespace {

// Slots from a ramp's last movement to the last pulse of it and the reading of the switch there; chosen.
constexpr uint8_t kSettled = 4;

}  // namespace

void Homing::begin(const DeviceConfig& config, Stepper& stepper, Ramp* ramps) {
    config_ = &config;
    stepper_ = &stepper;
    ramp_ = ramps;
    open_ = group_ = arrived_ = 0;
    own_inputs_ = 0;
}

void Homing::start(uint16_t joints) {
    open_ = joints;
    group_ = arrived_ = 0;
    begin_group();
}

bool Homing::is_active(uint8_t joint) const { return ((stepper_->active_inputs() >> homing(joint).input) & 1) != 0; }

// The joints of the lowest group that are left.
void Homing::begin_group() {
    uint8_t lowest = UINT8_MAX;
    for (uint8_t j = 0; j < config_->joints; ++j)
        if (((open_ >> j) & 1) != 0 && homing(j).group < lowest) lowest = homing(j).group;
    group_ = 0;
    own_inputs_ = 0;
    for (uint8_t j = 0; j < config_->joints; ++j) {
        if (((open_ >> j) & 1) == 0 || homing(j).group != lowest) continue;
        group_ = static_cast<uint16_t>(group_ | 1u << j);
        own_inputs_ |= 1u << homing(j).input;
        way_[j] = Way{};
        approach(j);
    }
}

Mishap Homing::advance() {
    arrived_ = 0;
    for (uint8_t j = 0; j < config_->joints; ++j) {
        if (((group_ >> j) & 1) == 0) continue;
        const FaultCode fault = advance(j);
        if (fault != FaultCode::None) return Mishap{fault, j};
    }
    open_ = static_cast<uint16_t>(open_ & ~arrived_);
    group_ = static_cast<uint16_t>(group_ & ~arrived_);
    if (group_ == 0 && open_ != 0) begin_group();
    return Mishap{};
}

FaultCode Homing::advance(uint8_t joint) {
    Way& way = way_[joint];
    if (++way.slots > homing(joint).timeout_ms * (kSlotHz / 1000)) return FaultCode::HomingTimeout;
    switch (way.phase) {
        case Phase::Releasing:
            if (!is_active(joint)) {
                approach(joint);
            } else if (has_travelled(joint)) {
                return FaultCode::SwitchStuck;
            }
            break;
        case Phase::Fast:
        case Phase::Slow:
            if (stepper_->has_closed(homing(joint).input)) {
                leave_switch(joint, way.phase == Phase::Fast ? Phase::BackingOff : Phase::Leaving);
            } else if (has_travelled(joint)) {
                return FaultCode::SwitchNotFound;
            }
            break;
        case Phase::BackingOff:
        case Phase::Leaving:
            if (!stands(joint)) break;
            if (is_active(joint)) return FaultCode::SwitchStuck;
            if (way.phase == Phase::BackingOff) {
                approach(joint);
            } else {
                arrived_ = static_cast<uint16_t>(arrived_ | 1u << joint);
            }
            break;
    }
    return FaultCode::None;
}

// Fast, or slowly once it has backed off; away from the switch first, if that is active. The switch is forgotten before
// it is looked at: so no closing is missed.
void Homing::approach(uint8_t joint) {
    const HomingConfig& own = homing(joint);
    stepper_->forget(own.input);
    // Farther than it may travel, so that it does not slow down before.
    const int64_t far = 4 * as_q20(own.max_travel_q8);
    if (way_[joint].phase == Phase::BackingOff) {
        enter(joint, Phase::Slow, own.direction, far, own.slow_q8);
    } else if (is_active(joint)) {
        enter(joint, Phase::Releasing, -own.direction, far, own.fast_q8);
    } else {
        enter(joint, Phase::Fast, own.direction, far, own.fast_q8);
    }
}

void Homing::enter(uint8_t joint, Phase phase, int32_t direction, int64_t distance_q20, int32_t speed_q8) {
    Way& way = way_[joint];
    way.phase = phase;
    way.still = 0;
    way.began_q20 = ramp_[joint].position_q20();
    ramp_[joint].set_speed(speed_q8);
    ramp_[joint].go(way.began_q20 + direction * distance_q20);
}

void Homing::leave_switch(uint8_t joint, Phase phase) {
    const HomingConfig& own = homing(joint);
    way_[joint].closed_at = stepper_->closed_at(own.input);
    enter(joint, phase, 0, 0, own.fast_q8);
    ramp_[joint].go(way_[joint].closed_at * kFineStep - own.direction * as_q20(own.back_off_q8));
}

bool Homing::has_travelled(uint8_t joint) const {
    const int64_t travelled = ramp_[joint].position_q20() - way_[joint].began_q20;
    return (travelled < 0 ? -travelled : travelled) >= as_q20(homing(joint).max_travel_q8);
}

bool Homing::stands(uint8_t joint) {
    if (!ramp_[joint].is_there()) return false;
    return ++way_[joint].still >= kSettled;
}

int32_t Homing::correction(uint8_t joint) const {
    const int32_t position = (homing(joint).position_q8 + 128) >> 8;
    return position - way_[joint].closed_at;
}

}  // namespace gemelo
