// The machine's reports: state, status, sensors, events.
#include "machine.h"
#include "phrase.h"

namespace gemelo {
namespace {

// So often a reading is told if no other one comes (standard: PROTOCOL.md): a sensor that is unplugged falls silent.
constexpr uint8_t kTellings = 3;

int32_t saturate(int64_t value) {
    if (value > INT32_MAX) return INT32_MAX;
    return value < INT32_MIN ? INT32_MIN : static_cast<int32_t>(value);
}

}  // namespace

void Machine::report_state(const Point& point) {
    const Point& before = points_[(stepper_.latched_number() + kPoints - 1) % kPoints];
    StateReport report{};
    report.t_us = now_us_;
    report.mode = mode_;
    report.fault = fault_;
    report.fault_joint = fault_joint_;
    report.inputs = static_cast<uint16_t>(stepper_.active_inputs());
    report.outputs = outputs_;
    report.flags = is_armed_ ? kFlagArmed : static_cast<uint8_t>(0);
    report.referenced = referenced_;
    report.speed_permil = speed_permil_;
    const bool has_scale = (mode_ == Mode::Run || mode_ == Mode::Hold) && !has_stood_;
    report.scale_q30 = has_scale ? point.scale_q30 : 0;
    report.buffered_ms = buffered_ms();
    report.stream = streams_.stream();
    report.next_seq = streams_.next_seq();
    // Until the first slot of a new stream has been made, the arm stands where that stream begins.
    report.play_us = point.stream == streams_.stream() ? point.play_us : 0;
    report.underruns = underruns_;
    report.refused = refused_;
    report.bad_frames = bad_frames_;
    for (uint8_t j = 0; j < rules_.joints; ++j) {
        report.steps[j] = stepper_.latched(j);
        // A stream may begin up to a step from where the arm stands: that step is no velocity of its path.
        const int64_t from_q20 = point.is_start ? as_q20(start_q8_[j]) : before.position_q20[j];
        if (!has_stood_) report.velocity_q8[j] = as_q8((point.position_q20[j] - from_q20) * kSlotHz);
    }
    report.has_servo = servo_.is_there();
    report.servo_us = servo_.pulse_us();
    report.servo_target_us = servo_.target_us();
    reporter_.state(report);
}

void Machine::report_status() const {
    StatusReport report{};
    report.config = config_;
    report.device = config_->joints != 0 ? config_->name : identity_.device;
    report.reset_cause = identity_.reset_cause;
    report.boot_id = identity_.boot_id;
    report.is_referenced = is_referenced();
    report.is_armed = is_armed_;
    report.is_virtual = identity_.is_virtual;
    report.slot = identity_.slot;
    reporter_.status(report);
}

void Machine::set_sensor(uint8_t index, int32_t raw) {
    if (index >= config_->sensors) return;
    const SensorConfig& sensor = config_->sensor[index];
    const int64_t scaled = (static_cast<int64_t>(raw) * sensor.scale_q16) >> 16;
    sensor_milli_[index] = saturate(scaled + sensor.offset_milli);
    sensor_tellings_[index] = kTellings;
    heard_ = static_cast<uint16_t>(heard_ | 1u << index);
}

void Machine::report_sensors() {
    reporter_.sensors(SensorReport{config_, now_us_, heard_, sensor_milli_});
    for (uint8_t i = 0; i < config_->sensors; ++i)
        if (((heard_ >> i) & 1) != 0 && --sensor_tellings_[i] == 0) heard_ = static_cast<uint16_t>(heard_ & ~(1u << i));
}

void Machine::report_text_lost(uint32_t lines) {
    char detail[11];
    Phrase(detail, sizeof detail).add(lines);
    event("text_lost", detail);
}

void Machine::event(const char* name, const char* detail) { reporter_.event(name, now_us_, streams_.stream(), detail); }

}  // namespace gemelo
