// Motion that is no stream: homing, and text mode's going to the newest target.
#include "machine.h"
#include "phrase.h"

namespace gemelo {
namespace {

constexpr size_t kDetailSize = kNameSize + 48;  // chosen: the words fit

const char* sentence_of(FaultCode fault) {
    switch (fault) {
        case FaultCode::HomingTimeout:
            return "its homing has taken too long";
        case FaultCode::SwitchNotFound:
            return "its switch was not found";
        default:
            return "its switch is still active after backing off";
    }
}

}  // namespace

Code Machine::home(uint16_t joints) {
    if (mode_ != Mode::Unreferenced && mode_ != Mode::Idle) return Code::NotReady;
    if (!takes_motion()) return Code::NotArmed;
    if ((joints & ~all_joints()) != 0) return Code::BadArgument;
    uint16_t able = 0;
    for (uint8_t j = 0; j < rules_.joints; ++j)
        if (config_->joint[j].homing.input != kNone) able = static_cast<uint16_t>(able | 1u << j);
    const uint16_t chosen = joints != 0 ? joints : able;
    if (chosen == 0 || (chosen & ~able) != 0) return Code::NoHoming;
    was_referenced_ = referenced_;
    referenced_ = static_cast<uint16_t>(referenced_ & ~chosen);
    alive_us_ = now_us_;
    start_ramps();
    homing_.start(chosen);
    mode_ = Mode::Homing;
    guard_switches();
    event("homing");
    report_status();
    return Code::Ok;
}

// From where the prepared slot ends.
void Machine::start_ramps() {
    const Point& prepared = points_[prepared_number_ % kPoints];
    for (uint8_t j = 0; j < rules_.joints; ++j)
        ramp_[j].begin(prepared.position_q20[j], config_->joint[j].max_acceleration_q8);
}

void Machine::advance_ramps(Point* point) {
    const bool brakes = mode_ == Mode::Hold || is_stopping_;
    for (uint8_t j = 0; j < rules_.joints; ++j) {
        ramp_[j].advance(brakes);
        point->position_q20[j] = ramp_[j].position_q20();
    }
    point->scale_q30 = brakes ? 0 : speed_q30();
}

void Machine::watch_homing() {
    if (is_stopping_) {
        if (is_at_rest()) finish_homing();
        return;
    }
    const Mishap mishap = homing_.advance();
    if (mishap.fault != FaultCode::None) {
        char detail[kDetailSize];
        Phrase(detail, sizeof detail).add(config_->joint[mishap.joint].name).add(": ").add(sentence_of(mishap.fault));
        return fail(mishap.fault, detail, mishap.joint);
    }
    if (homing_.arrived() != 0) note_homed();
    if (homing_.is_over()) finish_homing();
}

void Machine::note_homed() {
    for (uint8_t j = 0; j < rules_.joints; ++j) {
        if (((homing_.arrived() >> j) & 1) == 0) continue;
        const int32_t correction = homing_.correction(j);
        shift(j, correction);
        referenced_ = static_cast<uint16_t>(referenced_ | 1u << j);
        char detail[kDetailSize];
        Phrase phrase(detail, sizeof detail);
        phrase.add(config_->joint[j].name);
        if ((was_referenced_ >> j) & 1) phrase.add(": ").add_signed(correction).add(" steps off");
        event("homed", detail);
    }
}

// A home switch that a motion passes on its way, in the direction of homing: where its closing was latched says what
// the joint's count is off by. Nothing is corrected.
void Machine::watch_switches() {
    const uint32_t active = stepper_.active_inputs();
    const uint32_t risen = active & homes_ & ~seen_;
    seen_ = active;
    if (risen != 0 && (mode_ == Mode::Run || mode_ == Mode::Hold)) note_passed(risen);
}

void Machine::note_passed(uint32_t risen) {
    const Point& before = points_[(stepper_.latched_number() + kPoints - 1) % kPoints];
    for (uint8_t j = 0; j < rules_.joints; ++j) {
        const HomingConfig& homing = config_->joint[j].homing;
        if (homing.input == kNone || ((risen >> homing.input) & 1) == 0) continue;
        const int64_t by_q20 = present().position_q20[j] - before.position_q20[j];
        if (homing.direction > 0 ? by_q20 <= 0 : by_q20 >= 0) continue;
        const int32_t off = ((homing.position_q8 + 128) >> 8) - stepper_.closed_at(homing.input);
        char detail[kDetailSize];
        Phrase(detail, sizeof detail).add(config_->joint[j].name).add(": ").add_signed(off).add(" steps off");
        event("passed", detail);
    }
}

void Machine::finish_homing() {
    is_stopping_ = false;
    homing_.stop();
    mode_ = is_referenced() ? Mode::Idle : Mode::Unreferenced;
    report_status();
}

void Machine::stop_homing(const char* cause) {
    if (is_stopping_) return;
    is_stopping_ = true;
    event("homing_stopped", cause);
}

Code Machine::follow(const int32_t* target_q8, uint64_t now_us) {
    now_us_ = now_us;
    const bool is_free = mode_ == Mode::Idle || (mode_ == Mode::Run && is_following_);
    if (!is_free) return Code::NotReady;
    if (!takes_motion()) return Code::NotArmed;
    for (uint8_t j = 0; j < rules_.joints; ++j) {
        const JointLimits& limits = rules_.limits[j];
        if (target_q8[j] < limits.lower_q8 || target_q8[j] > limits.upper_q8) return Code::PositionLimit;
    }
    alive_us_ = now_us;
    if (!is_following_) start_ramps();
    is_following_ = true;
    mode_ = Mode::Run;
    bound_ramps();
    for (uint8_t j = 0; j < rules_.joints; ++j) ramp_[j].go(as_q20(target_q8[j]));
    return Code::Ok;
}

void Machine::bound_ramps() {
    for (uint8_t j = 0; j < rules_.joints; ++j) {
        const int64_t speed_q8 = static_cast<int64_t>(rules_.limits[j].velocity_q8) * speed_permil_ / 1000;
        ramp_[j].set_speed(static_cast<int32_t>(speed_q8));
    }
}

void Machine::watch_following() {
    if (is_stopping_ && is_at_rest()) return end_motion("stopped");
    if (!is_stopping_ && ramps_are_there() && is_at_rest()) end_motion(nullptr);
}

bool Machine::ramps_are_there() const {
    for (uint8_t j = 0; j < rules_.joints; ++j)
        if (!ramp_[j].is_there()) return false;
    return true;
}

}  // namespace gemelo
