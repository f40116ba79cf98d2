#include "machine.h"

#include "phrase.h"

namespace gemelo {
namespace {

// A device without a configuration says how it is, too.
constexpr uint32_t kStateHzInBoot = 50;  // standard: the rate of STATE

constexpr uint64_t kLongestGapUs = 4 * kSlotUs;  // chosen: more than an over-run may put between two slots' starts
constexpr uint64_t kStatusPeriodUs = 10000000;   // chosen: a broker may have lost what it was told

}  // namespace

void Machine::begin(DeviceConfig& config, const Identity& identity, const Sink& sink) {
    config_ = &config;
    identity_ = identity;
    mode_ = Mode::Boot;
    fault_ = FaultCode::None;
    fault_joint_ = kNoJoint;
    referenced_ = was_referenced_ = 0;
    speed_permil_ = 1000;
    is_armed_ = is_following_ = is_stopping_ = is_dry_ = awaits_first_pulse_ = is_opening_ = false;
    is_still_ = true;
    heard_ = 0;
    slots_to_state_ = slots_to_sensors_ = 0;
    reporter_.begin(sink, identity.boot_id, config.joints);
    update_.begin(sink.firmware);  // a transfer that is under way goes on
    rules_.joints = config.joints;
    for (uint8_t j = 0; j < rules_.joints; ++j) {
        const JointConfig& joint = config.joint[j];
        rules_.limits[j] =
            JointLimits{joint.lower_q8, joint.upper_q8, velocity_limit_q8(config, j), joint.max_acceleration_q8};
    }
    begin_inputs();
    begin_outputs();
    servo_.begin(config.servo);
    path_.begin(config);
    homing_.begin(config, stepper_, ramp_);
    prepared_number_ = 1;  // the stepper starts with one empty offer
    for (Point& point : points_) point = Point{};
    stepper_.begin(config);
}

void Machine::begin_inputs() {
    limits_ = homes_ = seen_ = 0;
    for (uint8_t j = 0; j < config_->joints; ++j)
        if (config_->joint[j].homing.input != kNone) homes_ |= 1u << config_->joint[j].homing.input;
    for (uint8_t i = 0; i < config_->inputs; ++i) {
        const InputRole role = config_->input[i].role;
        if (role == InputRole::LimitLower || role == InputRole::LimitUpper) limits_ |= 1u << i;
    }
}

void Machine::begin_outputs() {
    outputs_ = 0;
    for (uint8_t i = 0; i < config_->outputs; ++i)
        if (config_->output[i].at_boot != 0) outputs_ = static_cast<uint16_t>(outputs_ | 1u << i);
}

void Machine::start(uint64_t now_us, const int32_t* steps, bool referenced) {
    now_us_ = alive_us_ = slot_us_ = now_us;
    status_due_us_ = now_us + kStatusPeriodUs;
    if (config_->joints != 0) {
        int64_t position_q20[kMaxJoints] = {};
        for (uint8_t j = 0; j < rules_.joints; ++j) position_q20[j] = static_cast<int64_t>(steps[j]) * kFineStep;
        place(position_q20);
        is_armed_ = config_->is_armed_at_boot != 0;
        armed_us_ = now_us;
        if (is_armed_ && referenced) referenced_ = all_joints();
        mode_ = is_referenced() ? Mode::Idle : Mode::Unreferenced;
    }
    report_status();
    event("boot", identity_.reset_cause);
    if (is_armed_) event("armed", "boot");
}

// The streams and commands of this boot stay known. An e-stop stays too: only a reset leaves it.
void Machine::restart() {
    const bool is_stopped = mode_ == Mode::EStop;
    if (is_armed_) set_armed(false, "configuration");
    begin(*config_, identity_, reporter_.sink());
    const int64_t nowhere_q20[kMaxJoints] = {};
    place(nowhere_q20);
    if (config_->joints != 0) mode_ = Mode::Unreferenced;
    if (is_stopped) enter_estop();
    event("configured");
    report_status();
}

bool Machine::takes_config() const {
    if (mode_ == Mode::Boot) return true;
    return !is_armed_ && (mode_ == Mode::Unreferenced || mode_ == Mode::Fault || mode_ == Mode::EStop);
}

void Machine::place(const int64_t* position_q20) {
    stepper_.place(position_q20);
    for (Point& point : points_) {
        point.is_start = false;
        for (uint8_t j = 0; j < rules_.joints; ++j) point.position_q20[j] = position_q20[j];
    }
}

// A joint that stands gets another count.
void Machine::shift(uint8_t joint, int32_t steps) {
    const int64_t by_q20 = steps * kFineStep;
    stepper_.shift(joint, steps);
    ramp_[joint].shift(by_q20);
    for (Point& point : points_) point.position_q20[joint] += by_q20;
}

void Machine::slot(uint64_t slot_start_us) {
    if (mode_ == Mode::Boot) {
        now_us_ = slot_start_us;
        return report_due();
    }
    if (!stepper_.wants_offer()) return;
    now_us_ = slot_start_us;
    watch_trips();
    watch_ticks(slot_start_us);
    finish_slot();
    watch_heartbeat();
    watch_servo();
    plan_slot();
    guard_switches();
    report_due();
}

// No tick came for so long that the motors have come to a stand: what was missed is not caught up, and a motion goes on
// from rest, if the heartbeat was not lost meanwhile.
void Machine::watch_ticks(uint64_t slot_start_us) {
    const bool is_late = slot_start_us > slot_us_ + kLongestGapUs;
    const uint64_t gap_ms = (slot_start_us - slot_us_) / 1000;
    slot_us_ = slot_start_us;
    has_stood_ = is_late && is_moving();
    if (!has_stood_) return;
    path_.pause();
    for (uint8_t j = 0; j < rules_.joints; ++j) ramp_[j].pause();
    char detail[16];
    Phrase(detail, sizeof detail).add(static_cast<uint32_t>(gap_ms)).add(" ms");
    event("late", detail);
}

void Machine::finish_slot() {
    watch_switches();
    const Point& point = present();
    switch (mode_) {
        case Mode::Fault:
        case Mode::EStop:
            return;
        case Mode::Run:
        case Mode::Hold:
            measure(point);
            return is_following_ ? watch_following() : finish_stream_slot(point);
        case Mode::Homing:
            measure(point);
            return watch_homing();
        default:
            return measure(point);
    }
}

void Machine::finish_stream_slot(const Point& point) {
    announce_start();
    if (point.is_end) return end_motion("finished");
    if (is_stopping_ && is_at_rest()) return end_motion("stopped");
    watch_supply(point);
}

void Machine::measure(const Point& point) {
    for (uint8_t j = 0; j < rules_.joints; ++j) {
        const int64_t executed = static_cast<int64_t>(stepper_.latched(j)) * kFineStep;
        const int64_t error = point.position_q20[j] - executed;
        const int64_t size = error < 0 ? -error : error;
        if (size > max_error_q20_) max_error_q20_ = size;
    }
}

void Machine::announce_start() {
    if (!awaits_first_pulse_ || stepper_.is_watching()) return;
    awaits_first_pulse_ = false;
    const int64_t ago_us = static_cast<int64_t>(stepper_.ticks_since_first_pulse()) * 1000000 / config_->tick_hz;
    const uint64_t t_us = now_us_ - static_cast<uint64_t>(ago_us);
    reporter_.event("started", t_us, streams_.stream(), "");
}

// Of a stream or of text mode; `name` may be null for nothing to say.
void Machine::end_motion(const char* name) {
    path_.flush();
    mode_ = Mode::Idle;
    is_following_ = is_stopping_ = is_dry_ = awaits_first_pulse_ = false;
    if (name != nullptr) event(name);
}

// An under-run is counted once the arm stands for want of knots, not while it slows for it.
void Machine::watch_supply(const Point& point) {
    if (point.is_starved && !is_dry_ && mode_ == Mode::Run) {
        is_dry_ = true;
        ++underruns_;
        event("underrun");
    } else if (!point.is_starved && is_dry_) {
        is_dry_ = false;
        if (mode_ == Mode::Run) event("resumed", "underrun");
    }
}

void Machine::plan_slot() {
    const Point& before = points_[prepared_number_ % kPoints];
    Point& next = points_[(prepared_number_ + 1) % kPoints];
    for (uint8_t j = 0; j < rules_.joints; ++j) next.position_q20[j] = before.position_q20[j];
    path_.advance(mode_ == Mode::Hold ? 0 : speed_q30(), &next);
    next.stream = streams_.stream();
    next.is_start = is_opening_;
    is_opening_ = false;
    if (is_following_ || mode_ == Mode::Homing) advance_ramps(&next);
    const uint8_t limit = find_limit_ahead(before, next);
    if (limit != kNone) return fail(FaultCode::LimitSwitch, config_->input[limit].name, config_->input[limit].joint);
    if (!offer(before, next)) fail(FaultCode::Internal, "more than a step in a tick");
}

bool Machine::offer(const Point& before, const Point& next) {
    int32_t increment_q20[kMaxJoints] = {};
    const int64_t fastest_q20 = static_cast<int64_t>(ticks_per_slot(*config_)) << kFineBits;
    bool is_still = true;
    for (uint8_t j = 0; j < rules_.joints; ++j) {
        const int64_t increment = next.position_q20[j] - before.position_q20[j];
        if (increment > fastest_q20 || increment < -fastest_q20) return false;
        increment_q20[j] = static_cast<int32_t>(increment);
        is_still = is_still && increment == 0;
    }
    is_still_ = is_still;
    ++prepared_number_;
    stepper_.offer(increment_q20);
    return true;
}

void Machine::hold(const char* cause) {
    mode_ = Mode::Hold;
    event("hold", cause);
}

void Machine::halt() {
    if (mode_ == Mode::Run) hold("shutdown");
    if (mode_ == Mode::Homing) stop_homing("shutdown");
    servo_.hold();
}

uint32_t Machine::speed_q30() const {
    return speed_permil_ * (kFullScale / 1000) + speed_permil_ * (kFullScale % 1000) / 1000;
}

uint16_t Machine::buffered_ms() const {
    const uint64_t ms = path_.remaining_us() / 1000;
    return ms > UINT16_MAX ? UINT16_MAX : static_cast<uint16_t>(ms);
}

void Machine::report_due() {
    if (now_us_ >= status_due_us_) {
        status_due_us_ = now_us_ + kStatusPeriodUs;
        report_status();
    }
    if (slots_to_state_ == 0) {
        slots_to_state_ = kSlotHz / (mode_ == Mode::Boot ? kStateHzInBoot : config_->state_hz);
        report_state(present());
    }
    --slots_to_state_;
    if (mode_ == Mode::Boot || heard_ == 0) return;
    if (slots_to_sensors_ == 0) {
        slots_to_sensors_ = kSlotHz / config_->sensor_hz;
        report_sensors();
    }
    --slots_to_sensors_;
}

}  // namespace gemelo
