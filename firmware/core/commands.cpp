// Commands: hold, resume, stop, reset, reference.
#include "bytes.h"
#include "machine.h"

namespace gemelo {
namespace {

constexpr size_t kCommandSize = 24;

uint32_t id_of(const Frame& frame) { return load_u32(frame.bytes + 8); }
uint8_t word_of(const Frame& frame) { return frame.bytes[20]; }

}  // namespace

void Machine::receive_command(const Frame& frame, const Arrival& arrival) {
    if (frame.size < kCommandSize || frame.size != kCommandSize + 4 * static_cast<size_t>(frame.joints())) {
        ++bad_frames_;
        return;
    }
    Code code = judge_command(frame, arrival);
    const Code* answered = code == Code::Ok || code == Code::Expired ? commands_.find(id_of(frame)) : nullptr;
    if (answered != nullptr) {
        code = *answered;
    } else {
        if (code == Code::Ok) {
            code = carry_out(frame);
            commands_.add(id_of(frame), code);
        }
        if (code != Code::Ok) ++refused_;
    }
    reporter_.acknowledge_command(id_of(frame), word_of(frame), code, mode_, now_us_);
}

Code Machine::judge_command(const Frame& frame, const Arrival& arrival) const {
    if (arrival.is_retained) return Code::Retained;
    if (frame.boot_id() != identity_.boot_id) return Code::WrongBoot;
    return now_us_ > load_u64(frame.bytes + 12) ? Code::Expired : Code::Ok;
}

Code Machine::carry_out(const Frame& frame) {
    const Command command = static_cast<Command>(word_of(frame));
    if (command != Command::Reference && frame.joints() != 0) return Code::BadJoints;
    switch (command) {
        case Command::Hold:
            if (mode_ == Mode::Run) hold("command");
            return Code::Ok;
        case Command::Resume:
            return resume();
        case Command::Stop:
            return stop();
        case Command::Reset:
            return reset();
        case Command::Reference:
            return reference(frame);
        default:
            return Code::UnknownCommand;
    }
}

Code Machine::resume() {
    if (mode_ != Mode::Hold || is_stopping_) return Code::NotReady;
    mode_ = Mode::Run;
    alive_us_ = now_us_;
    event("resumed", "command");
    return Code::Ok;
}

// Slows down as a hold does; finish_slot() ends the stream once the arm stands.
Code Machine::stop() {
    if (mode_ != Mode::Run && mode_ != Mode::Hold) return Code::Ok;
    if (mode_ == Mode::Run) hold("command");
    is_stopping_ = true;
    return Code::Ok;
}

Code Machine::reset() {
    if (mode_ == Mode::Run || mode_ == Mode::Hold || !is_at_rest()) return Code::NotReady;
    if (mode_ != Mode::Fault) return Code::Ok;
    fault_ = FaultCode::None;
    mode_ = is_referenced_ ? Mode::Idle : Mode::Unreferenced;
    event("reset");
    return Code::Ok;
}

Code Machine::reference(const Frame& frame) {
    if ((mode_ != Mode::Idle && mode_ != Mode::Unreferenced) || !is_at_rest()) return Code::NotReady;
    if (frame.joints() != rules_.joints) return Code::BadJoints;
    int64_t position_q20[kMaxJoints] = {};
    for (uint8_t j = 0; j < rules_.joints; ++j) {
        const int32_t position_q8 = load_i32(frame.bytes + kCommandSize + 4 * j);
        const JointLimits& limits = rules_.limits[j];
        if (position_q8 < limits.lower_q8 || position_q8 > limits.upper_q8) return Code::PositionLimit;
        position_q20[j] = static_cast<int64_t>(position_q8) * 4096;
    }
    place(position_q20);
    is_referenced_ = true;
    mode_ = Mode::Idle;
    event("referenced");
    report_status();
    return Code::Ok;
}

}  // namespace gemelo
