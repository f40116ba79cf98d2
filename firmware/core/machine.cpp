#include "machine.h"

#include "sentence.h"

namespace gemelo {
namespace {

int32_t as_q8(int64_t q20) { return static_cast<int32_t>((q20 + 2048) >> 12); }

}  // namespace

void Machine::begin(DeviceConfig& config, const Identity& identity, const Sink& sink) {
    config_ = &config;
    identity_ = identity;
    mode_ = Mode::Boot;
    reporter_.begin(sink, identity.boot_id, static_cast<uint8_t>(config.joints));
    rules_.joints = static_cast<uint8_t>(config.joints);
    for (uint8_t j = 0; j < rules_.joints; ++j) {
        const JointConfig& joint = config.joint[j];
        rules_.limits[j] = JointLimits{joint.lower_q8, joint.upper_q8, velocity_limit_q8(config, j)};
    }
    path_.begin(config);
    stepper_.begin(config);
    prepared_number_ = 1;  // the stepper starts with one empty offer
    for (Point& point : points_) point = Point{};
}

void Machine::start(uint64_t now_us, const int32_t* steps, bool referenced) {
    now_us_ = alive_us_ = now_us;
    int64_t position_q20[kMaxJoints] = {};
    for (uint8_t j = 0; j < rules_.joints; ++j) position_q20[j] = static_cast<int64_t>(steps[j]) * kFineStep;
    place(position_q20);
    is_armed_ = config_->is_armed_at_boot != 0;
    is_referenced_ = referenced && is_armed_;
    mode_ = is_referenced_ ? Mode::Idle : Mode::Unreferenced;
    report_status();
    event("boot", identity_.reset_cause);
}

void Machine::restart() {
    begin(*config_, identity_, reporter_.sink());
    mode_ = Mode::Unreferenced;
    is_armed_ = is_referenced_ = false;
    event("configured");
    report_status();
}

bool Machine::takes_config() const {
    if (mode_ == Mode::Boot) return true;
    return !is_armed_ && (mode_ == Mode::Unreferenced || mode_ == Mode::Fault || mode_ == Mode::EStop);
}

Code Machine::follow(const int32_t*, uint64_t now_us) {
    now_us_ = now_us;
    return Code::NotReady;
}

void Machine::set_sensor(uint8_t, int32_t) {}

void Machine::report_text_lost(uint32_t lines) {
    Sentence text;
    text.add(lines);
    event("text_lost", text.text());
}

void Machine::place(const int64_t* position_q20) {
    stepper_.place(position_q20);
    for (Point& point : points_)
        for (uint8_t j = 0; j < rules_.joints; ++j) point.position_q20[j] = position_q20[j];
}

void Machine::slot(uint64_t slot_start_us) {
    if (!stepper_.wants_offer()) return;
    now_us_ = slot_start_us;
    if (stepper_.has_overrun() && path_.is_active()) fail(FaultCode::TickOverrun, "no new slot for 3 ms");
    finish_slot();
    watch_heartbeat();
    plan_slot();
    if (slots_++ % (kSlotHz / config_->state_hz) == 0) report_state(present());
}

void Machine::finish_slot() {
    const Point& point = present();
    if (mode_ != Mode::Fault) measure(point);
    if (mode_ != Mode::Run && mode_ != Mode::Hold) return;
    announce_start();
    if (point.is_end) return end_stream("finished");
    if (is_stopping_ && is_at_rest()) return end_stream("stopped");
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

void Machine::end_stream(const char* name) {
    path_.flush();
    mode_ = Mode::Idle;
    is_stopping_ = is_dry_ = awaits_first_pulse_ = false;
    event(name);
}

// An under-run is counted once the arm stands for want of knots, not while it slows for it.
void Machine::watch_supply(const Point& point) {
    if (point.is_starved && !is_dry_ && mode_ == Mode::Run) {
        is_dry_ = true;
        ++underruns_;
        event("underrun");
    } else if (!point.is_starved && is_dry_) {
        is_dry_ = false;
        event("resumed", "underrun");
    }
}

void Machine::watch_heartbeat() {
    const uint64_t timeout_us = static_cast<uint64_t>(config_->hold_timeout_ms) * 1000;
    if (mode_ == Mode::Run && now_us_ > alive_us_ + timeout_us) hold("heartbeat");
}

void Machine::plan_slot() {
    const Point& before = points_[prepared_number_ % kPoints];
    Point& next = points_[(prepared_number_ + 1) % kPoints];
    next = before;
    path_.advance(mode_ == Mode::Hold, &next);
    next.stream = streams_.stream();
    int32_t increment_q20[kMaxJoints] = {};
    const int64_t fastest_q20 = static_cast<int64_t>(ticks_per_slot(*config_)) << kFineBits;
    is_still_ = true;
    for (uint8_t j = 0; j < rules_.joints; ++j) {
        const int64_t increment = next.position_q20[j] - before.position_q20[j];
        if (increment > fastest_q20 || increment < -fastest_q20)
            return fail(FaultCode::Internal, "more than a step in a tick");
        increment_q20[j] = static_cast<int32_t>(increment);
        is_still_ = is_still_ && increment == 0;
    }
    ++prepared_number_;
    stepper_.offer(increment_q20);
}

void Machine::hold(const char* cause) {
    mode_ = Mode::Hold;
    event("hold", cause);
}

// Pulses stop dead, so where a moving joint ends up is not known.
void Machine::fail(FaultCode fault, const char* detail) {
    const bool was_moving = !is_at_rest();
    path_.flush();
    stepper_.silence();
    fault_ = fault;
    mode_ = Mode::Fault;
    is_stopping_ = is_dry_ = awaits_first_pulse_ = false;
    is_still_ = true;
    if (was_moving) is_referenced_ = false;
    int64_t position_q20[kMaxJoints] = {};
    for (uint8_t j = 0; j < rules_.joints; ++j)
        position_q20[j] = static_cast<int64_t>(stepper_.executed(j)) * kFineStep;
    place(position_q20);
    event("fault", detail);
    report_status();
}

uint16_t Machine::buffered_ms() const {
    const uint64_t ms = path_.remaining_us() / 1000;
    return ms > UINT16_MAX ? UINT16_MAX : static_cast<uint16_t>(ms);
}

void Machine::report_state(const Point& point) {
    const Point& before = points_[(stepper_.latched_number() + kPoints - 1) % kPoints];
    StateReport report{};
    report.t_us = now_us_;
    report.mode = mode_;
    report.fault = fault_;
    report.scale_q30 = mode_ == Mode::Run || mode_ == Mode::Hold ? point.scale_q30 : 0;
    report.buffered_ms = buffered_ms();
    report.stream = streams_.stream();
    report.next_seq = streams_.next_seq();
    // Until the first slot of a new stream has been made, the arm stands where that stream begins.
    report.play_us = point.stream == streams_.stream() ? point.play_us : 0;
    report.underruns = underruns_;
    report.refused = refused_;
    report.bad_frames = bad_frames_;
    report.flags = kFlagArmed;
    report.fault_joint = kNoJoint;
    report.referenced = static_cast<uint16_t>(is_referenced_ ? (1u << rules_.joints) - 1 : 0);
    report.speed_permil = 1000;
    for (uint8_t j = 0; j < rules_.joints; ++j) {
        report.steps[j] = stepper_.latched(j);
        report.velocity_q8[j] = as_q8((point.position_q20[j] - before.position_q20[j]) * kSlotHz);
    }
    reporter_.state(report);
}

void Machine::report_status() const {
    reporter_.status(StatusReport{config_, identity_.reset_cause, identity_.boot_id, is_referenced_});
}

void Machine::event(const char* name, const char* detail) { reporter_.event(name, now_us_, streams_.stream(), detail); }

}  // namespace gemelo
