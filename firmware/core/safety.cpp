// Safety of people and machine: e-stop, switches, faults, arming, and a gateway that has gone silent.
#include "bytes.h"
#include "machine.h"

namespace gemelo {
namespace {

// Until so many slots after the start an input has had the readings it needs to be known (follows from InputWatch).
constexpr uint32_t kSlotsToKnowInputs = 1;

}  // namespace

// The tick has silenced the pulses already; this is what follows from it.
void Machine::watch_trips() {
    if (stepper_.trip() == Trip::EStop && mode_ != Mode::EStop) return press_estop();
    if (mode_ == Mode::Fault || mode_ == Mode::EStop) return;
    if (stepper_.trip() == Trip::Limit) {
        const InputConfig& input = config_->input[stepper_.trip_input()];
        fail(FaultCode::LimitSwitch, input.name, input.joint, stepper_.was_moving_at_trip());
    } else if (stepper_.has_overrun() && is_moving()) {
        fail(FaultCode::TickOverrun, "no new slot for 3 ms");
    }
}

void Machine::press_estop() {
    stop_dead(true);
    enter_estop();
    event("estop", config_->input[stepper_.trip_input()].name);
    if (is_armed_) set_armed(false, "estop");
    report_status();
}

void Machine::enter_estop() {
    fault_ = FaultCode::EmergencyStop;
    fault_joint_ = kNoJoint;
    mode_ = Mode::EStop;
    for (uint8_t i = 0; i < config_->outputs; ++i)
        if (config_->output[i].is_off_at_estop != 0) outputs_ = static_cast<uint16_t>(outputs_ & ~(1u << i));
    if (config_->servo.is_off_at_estop != 0) servo_.release();
    servo_.hold();
}

void Machine::fail(FaultCode fault, const char* detail, uint8_t joint, bool was_moving) {
    stop_dead(was_moving || !is_at_rest());
    fault_ = fault;
    fault_joint_ = joint;
    mode_ = Mode::Fault;
    event("fault", detail);
    report_status();
}

// Pulses stop dead, so where a moving joint ends up is not known.
void Machine::stop_dead(bool was_moving) {
    path_.flush();
    homing_.stop();
    stepper_.silence();
    is_following_ = is_stopping_ = is_dry_ = awaits_first_pulse_ = false;
    is_still_ = true;
    if (was_moving) referenced_ = 0;
    int64_t position_q20[kMaxJoints] = {};
    for (uint8_t j = 0; j < rules_.joints; ++j)
        position_q20[j] = static_cast<int64_t>(stepper_.executed(j)) * kFineStep;
    place(position_q20);
}

// Limit switches are passed over as long as it is not known which are active already, and those that homing needs.
void Machine::guard_switches() {
    const bool is_guarded = mode_ != Mode::Fault && mode_ != Mode::EStop;
    if (!is_guarded || stepper_.latched_number() < kSlotsToKnowInputs) return stepper_.guard(0);
    stepper_.guard(mode_ == Mode::Homing ? limits_ & ~homing_.own_inputs() : limits_);
}

// The switch that a joint is on and would be driven further into, or kNone: it may only move off it.
uint8_t Machine::find_limit_ahead(const Point& before, const Point& next) const {
    uint32_t active = stepper_.active_inputs() & limits_;
    if (mode_ == Mode::Homing) active &= ~homing_.own_inputs();
    for (uint8_t i = 0; active != 0; ++i, active >>= 1) {
        if ((active & 1) == 0) continue;
        const InputConfig& input = config_->input[i];
        const int64_t by_q20 = next.position_q20[input.joint] - before.position_q20[input.joint];
        if (input.role == InputRole::LimitLower ? by_q20 < 0 : by_q20 > 0) return i;
    }
    return kNone;
}

// In text mode a joint goes to the last target that it was given, and that is all.
void Machine::watch_heartbeat() {
    const uint64_t timeout_us = static_cast<uint64_t>(config_->hold_timeout_ms) * 1000;
    if (now_us_ <= alive_us_ + timeout_us) return;
    if (mode_ == Mode::Run && !is_following_ && !path_.is_braking()) hold("heartbeat");
    if (mode_ == Mode::Homing) stop_homing("heartbeat");
}

// A gripper on its way stops where it is when nobody watches it any more; one that holds keeps its hold.
void Machine::watch_servo() {
    const uint64_t heard_us = beat_us_ > servo_us_ ? beat_us_ : servo_us_;
    if (now_us_ > heard_us + static_cast<uint64_t>(config_->hold_timeout_ms) * 1000) servo_.hold();
    servo_.advance();
}

void Machine::set_armed(bool armed, const char* cause) {
    is_armed_ = armed;
    armed_us_ = now_us_;
    event(armed ? "armed" : "disarmed", cause);
}

bool Machine::takes_motion() const {
    return is_armed_ && now_us_ - armed_us_ >= static_cast<uint64_t>(config_->enable_lead_ms) * 1000;
}

Code Machine::arm() {
    if (is_armed_) return Code::Ok;
    if (stepper_.is_estop_active()) return Code::EstopPressed;
    if (mode_ != Mode::Unreferenced) return Code::NotReady;
    set_armed(true, "command");
    report_status();
    return Code::Ok;
}

// A motor without current may be turned by hand.
Code Machine::disarm() {
    if (!is_armed_) return Code::Ok;
    if (is_moving() || mode_ == Mode::Hold) return Code::NotReady;
    referenced_ = 0;
    if (mode_ == Mode::Idle) mode_ = Mode::Unreferenced;
    set_armed(false, "command");
    report_status();
    return Code::Ok;
}

Code Machine::reset() {
    if (mode_ != Mode::Fault && mode_ != Mode::EStop) return Code::Ok;
    if (!is_at_rest()) return Code::NotReady;
    // Pressed in this slot, perhaps released already: the next slot takes note of it.
    if (stepper_.trip() == Trip::EStop && mode_ != Mode::EStop) return Code::EstopPressed;
    stepper_.release();
    if (stepper_.trip() == Trip::EStop) return Code::EstopPressed;
    fault_ = FaultCode::None;
    fault_joint_ = kNoJoint;
    mode_ = is_referenced() && is_armed_ ? Mode::Idle : Mode::Unreferenced;
    event("reset");
    return Code::Ok;
}

Code Machine::reference(const Frame& frame, uint16_t joints) {
    if ((mode_ != Mode::Idle && mode_ != Mode::Unreferenced) || !is_at_rest()) return Code::NotReady;
    if (!is_armed_) return Code::NotArmed;
    if (frame.joints() != rules_.joints) return Code::BadJoints;
    if ((joints & ~all_joints()) != 0) return Code::BadArgument;
    const uint16_t chosen = joints != 0 ? joints : all_joints();
    int64_t position_q20[kMaxJoints] = {};
    for (uint8_t j = 0; j < rules_.joints; ++j) {
        position_q20[j] = present().position_q20[j];
        if (((chosen >> j) & 1) == 0) continue;
        const int32_t position_q8 = load_i32(frame.bytes + kCommandSize + 4 * j);
        const JointLimits& limits = rules_.limits[j];
        if (position_q8 < limits.lower_q8 || position_q8 > limits.upper_q8) return Code::PositionLimit;
        position_q20[j] = as_q20(position_q8);
    }
    place(position_q20);
    referenced_ = static_cast<uint16_t>(referenced_ | chosen);
    if (is_referenced()) mode_ = Mode::Idle;
    event("referenced");
    report_status();
    return Code::Ok;
}

}  // namespace gemelo
