// Commands: each once, in its time, for this boot; those that steer what moves, and the outputs.
#include "bytes.h"
#include "machine.h"

namespace gemelo {
namespace {

uint32_t id_of(const Frame& frame) { return load_u32(frame.bytes + 8); }
uint8_t word_of(const Frame& frame) { return frame.bytes[20]; }

// What ends a motion may be said by somebody who does not know yet which boot this is.
bool is_stop(const Frame& frame) {
    const Command command = static_cast<Command>(word_of(frame));
    return command == Command::Hold || command == Command::Stop || command == Command::Disarm;
}

}  // namespace

void Machine::receive_command(const Frame& frame, const Arrival& arrival) {
    if (frame.size < kCommandSize || frame.size != kCommandSize + 4 * static_cast<size_t>(frame.joints())) {
        ++bad_frames_;
        return;
    }
    Code code = judge_command(frame, arrival);
    const Code* answered =
        code == Code::Ok || code == Code::Expired ? commands_.find(id_of(frame), word_of(frame)) : nullptr;
    if (answered != nullptr) {
        code = *answered;
    } else {
        if (code == Code::Ok) {
            code = carry_out(frame);
            commands_.add(id_of(frame), word_of(frame), code);
        }
        if (code != Code::Ok) ++refused_;
    }
    reporter_.acknowledge_command(id_of(frame), word_of(frame), code, mode_, now_us_);
}

Code Machine::judge_command(const Frame& frame, const Arrival& arrival) const {
    if (arrival.is_retained) return Code::Retained;
    const bool is_for_any_boot = frame.boot_id() == 0 && is_stop(frame);
    if (frame.boot_id() != identity_.boot_id && !is_for_any_boot) return Code::WrongBoot;
    return now_us_ > load_u64(frame.bytes + 12) ? Code::Expired : Code::Ok;
}

Code Machine::carry_out(const Frame& frame) {
    const Command command = static_cast<Command>(word_of(frame));
    const uint16_t argument = load_u16(frame.bytes + 22);
    if (command != Command::Reference && frame.joints() != 0) return Code::BadJoints;
    switch (command) {
        case Command::Hold:
            return carry_out_hold();
        case Command::Resume:
            return resume();
        case Command::Stop:
            return stop();
        case Command::Reset:
            return reset();
        case Command::Reference:
            return reference(frame, argument);
        case Command::Arm:
            return arm();
        case Command::Disarm:
            return disarm();
        case Command::Home:
            return home(argument);
        case Command::Output:
            return switch_output(frame.bytes[21], argument);
        case Command::Speed:
            return change_speed(argument);
        case Command::Servo:
            return turn_servo(frame.bytes[21], argument);
        case Command::Status:
            report_status();
            return Code::Ok;
        default:
            return Code::UnknownCommand;
    }
}

Code Machine::carry_out_hold() {
    servo_.hold();
    if (mode_ == Mode::Run) hold("command");
    if (mode_ == Mode::Homing) stop_homing("command");
    return Code::Ok;
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
    servo_.hold();
    if (mode_ == Mode::Homing) stop_homing("command");
    if (mode_ != Mode::Run && mode_ != Mode::Hold) return Code::Ok;
    if (mode_ == Mode::Run) hold("command");
    is_stopping_ = true;
    return Code::Ok;
}

// What an e-stop switches off stays off until that is reset.
Code Machine::switch_output(uint8_t index, uint16_t level) {
    if (mode_ == Mode::Boot) return Code::NotReady;
    if (index >= config_->outputs || level > 1) return Code::BadArgument;
    const uint16_t bit = static_cast<uint16_t>(1u << index);
    if (level == 1 && mode_ == Mode::EStop && config_->output[index].is_off_at_estop != 0) return Code::EstopPressed;
    outputs_ = static_cast<uint16_t>(level == 1 ? outputs_ | bit : outputs_ & ~bit);
    return Code::Ok;
}

Code Machine::change_speed(uint16_t permil) {
    if (mode_ == Mode::Boot) return Code::NotReady;
    if (permil > 1000) return Code::BadArgument;
    speed_permil_ = permil;
    if (is_following_) bound_ramps();
    return Code::Ok;
}

// Index 0 sends it to a pulse, index 1 lets it stay where it is.
Code Machine::turn_servo(uint8_t index, uint16_t pulse_us) {
    if (mode_ == Mode::Boot) return Code::NotReady;
    if (!servo_.is_there() || index > 1 || (index == 1 && pulse_us != 0)) return Code::BadArgument;
    if (index == 1) {
        servo_.hold();
        return Code::Ok;
    }
    if (pulse_us < config_->servo.lower_us || pulse_us > config_->servo.upper_us) return Code::PositionLimit;
    if (mode_ == Mode::EStop) return Code::EstopPressed;
    servo_.go_to(pulse_us);
    servo_us_ = now_us_;
    return Code::Ok;
}

}  // namespace gemelo
