#include "rig.h"

#include <cstring>

#include "bytes.h"
#include "frame.h"

namespace rig {
namespace {

void add_u8(Bytes& bytes, uint8_t value) { bytes.push_back(value); }

void add_u16(Bytes& bytes, uint16_t value) {
    bytes.resize(bytes.size() + 2);
    gemelo::store_u16(&bytes[bytes.size() - 2], value);
}

void add_u32(Bytes& bytes, uint32_t value) {
    bytes.resize(bytes.size() + 4);
    gemelo::store_u32(&bytes[bytes.size() - 4], value);
}

void add_u64(Bytes& bytes, uint64_t value) {
    bytes.resize(bytes.size() + 8);
    gemelo::store_u64(&bytes[bytes.size() - 8], value);
}

Bytes header(gemelo::FrameType type, size_t joints, uint32_t boot_id) {
    Bytes bytes(gemelo::kHeaderSize);
    gemelo::write_header(bytes.data(), type, static_cast<uint8_t>(joints), boot_id);
    return bytes;
}

gemelo::JointConfig joint(const char* name, bool inverted) {
    gemelo::JointConfig config{};
    std::strncpy(config.name, name, sizeof config.name - 1);
    config.lower_q8 = -100000 * 256;
    config.upper_q8 = 100000 * 256;
    config.max_velocity_q8 = 4000 * 256;
    config.max_acceleration_q8 = 4000 * 256;
    config.dir_setup_us = 5;
    config.is_inverted = inverted;
    return config;
}

}  // namespace

gemelo::DeviceConfig two_joints() {
    gemelo::DeviceConfig config{};
    std::strncpy(config.name, "bench", sizeof config.name - 1);
    config.tick_hz = 50000;
    config.queue_capacity = 128;
    config.state_hz = 50;
    config.sensor_hz = 10;
    config.is_armed_at_boot = 1;
    config.hold_timeout_ms = 500;
    config.joints = 2;
    config.joint[0] = joint("q1", false);
    config.joint[1] = joint("q2", true);
    return config;
}

Bytes seal(Bytes bytes) {
    const size_t size = bytes.size();
    bytes.resize(size + gemelo::kCrcSize);
    gemelo::seal_frame(bytes.data(), size);
    return bytes;
}

Bytes build(const ChunkSpec& chunk) {
    Bytes bytes =
        header(gemelo::FrameType::Traj, chunk.rows.empty() ? 2 : chunk.rows[0].position.size(), chunk.boot_id);
    add_u32(bytes, chunk.stream);
    add_u32(bytes, chunk.seq);
    add_u64(bytes, chunk.expires_us);
    add_u32(bytes, chunk.dt_us);
    add_u16(bytes, static_cast<uint16_t>(chunk.rows.size()));
    add_u16(bytes, static_cast<uint16_t>((chunk.first ? 1 : 0) | (chunk.last ? 2 : 0)));
    for (const Row& row : chunk.rows) {
        for (int32_t value : row.position) add_u32(bytes, static_cast<uint32_t>(value));
        for (int32_t value : row.velocity) add_u32(bytes, static_cast<uint32_t>(value));
    }
    return seal(bytes);
}

Bytes build_command(gemelo::Command command, uint32_t id, const std::vector<int32_t>& position, uint64_t expires_us,
                    uint32_t boot_id) {
    Bytes bytes = header(gemelo::FrameType::Cmd, position.size(), boot_id);
    add_u32(bytes, id);
    add_u64(bytes, expires_us);
    add_u8(bytes, static_cast<uint8_t>(command));
    add_u8(bytes, 0);
    add_u16(bytes, 0);
    for (int32_t value : position) add_u32(bytes, static_cast<uint32_t>(value));
    return seal(bytes);
}

Bytes build_heartbeat(uint32_t session, uint32_t counter, uint32_t boot_id) {
    Bytes bytes = header(gemelo::FrameType::Heartbeat, 0, boot_id);
    add_u32(bytes, session);
    add_u32(bytes, counter);
    return seal(bytes);
}

Bytes build_sync(uint64_t t0) {
    Bytes bytes = header(gemelo::FrameType::Sync, 0, 0);
    add_u64(bytes, t0);
    return seal(bytes);
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
