#include "rig.h"

#include "bytes.h"
#include "plain_joints.h"

namespace rig {

gemelo::DeviceConfig two_joints() {
    gemelo::DeviceConfig config = plain_joints("bench", 4000);
    config.joint[1].is_inverted = true;
    return config;
}

Rig::Rig(const gemelo::DeviceConfig& config, bool referenced, uint64_t now_us, uint32_t boot_id)
    : device(config, boot_id, "power_on", now_us), joints_(config.joints), boot_id_(boot_id) {
    const int32_t steps[gemelo::kMaxJoints] = {};
    device.start(steps, referenced);
    next_beat_us_ = now_us;
    listen();
}

Ack Rig::send(const Bytes& frame, bool retained) {
    listen();
    ack.reset();
    device.receive(frame.data(), frame.size(), retained, device.now_us());
    listen();
    return ack.value_or(Ack{});
}

Ack Rig::send(const ChunkSpec& chunk, bool retained) { return send(build(chunk), retained); }

gemelo::Code Rig::send_command(const Bytes& frame, bool retained) {
    listen();
    command_code_.reset();
    device.receive(frame.data(), frame.size(), retained, device.now_us());
    listen();
    return command_code_.value();
}

gemelo::Code Rig::command(gemelo::Command command, const std::vector<int32_t>& position) {
    return send_command(build_command(command, next_command_++, position, kNever, boot_id_));
}

void Rig::beat() { device.receive(build_heartbeat(1, ++beats_)); }

void Rig::run_ms(uint32_t ms, bool silent) {
    for (uint32_t i = 0; i < ms; ++i) {
        if (!silent && device.now_us() >= next_beat_us_) {
            beat();
            next_beat_us_ = device.now_us() + 200000;
        }
        device.advance(device.now_us() + 1000);
    }
    listen();
}

void Rig::run_until_idle(uint32_t at_most_ms) {
    for (uint32_t i = 0; i < at_most_ms && mode() != gemelo::Mode::Idle; ++i) run_ms(1);
    run_ms(2);
}

void Rig::listen() {
    for (const gemelo::OutFrame& frame : device.outputs()) read(frame);
    device.outputs().clear();
}

void Rig::read(const gemelo::OutFrame& frame) {
    using namespace gemelo;
    const uint8_t* at = frame.payload.data();
    switch (frame.output) {
        case Output::TrajAck:
            ack = Ack{
                load_u32(at + 8),  load_u32(at + 12), load_u32(at + 16), static_cast<Code>(at[20]), at[21],
                load_u16(at + 22), load_i32(at + 24), load_i32(at + 28), load_u16(at + 32),         load_u16(at + 34)};
            break;
        case Output::CmdAck:
            command_code_ = static_cast<Code>(at[13]);
            break;
        case Output::Event:
            events.emplace_back(frame.payload.begin(), frame.payload.end());
            break;
        case Output::State:
            state_ = State{load_u64(at + 8),
                           static_cast<Mode>(at[16]),
                           load_u16(at + 20),
                           load_u64(at + 32),
                           load_u32(at + 40),
                           load_u32(at + 44),
                           load_u32(at + 48),
                           {},
                           {}};
            for (uint32_t j = 0; j < joints_; ++j) {
                state_.steps.push_back(load_i32(at + 60 + 4 * j));
                state_.velocity_q8.push_back(load_i32(at + 60 + 4 * (joints_ + j)));
            }
            break;
        default:
            break;
    }
}

int Rig::count_events(const std::string& name) const {
    int count = 0;
    for (const std::string& text : events) count += text.find("\"event\": \"" + name + "\"") != std::string::npos;
    return count;
}

std::string Rig::event(const std::string& name) const {
    for (auto text = events.rbegin(); text != events.rend(); ++text)
        if (text->find("\"event\": \"" + name + "\"") != std::string::npos) return *text;
    return "";
}

const State& Rig::state() {
    run_ms(20);
    return state_;
}

}  // namespace rig
