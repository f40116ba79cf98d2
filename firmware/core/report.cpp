#include "report.h"

#include "bytes.h"
#include "frame.h"
#include "json.h"

namespace gemelo {
namespace {

constexpr size_t kStateHeadSize = 60;  // [bytes] standard: PROTOCOL.md
constexpr size_t kStateServoSize = 4;  // [bytes] standard: PROTOCOL.md

void add(JsonWriter* json, const MemoryReport& memory) {
    json->field("heap_free", static_cast<uint64_t>(memory.heap_free));
    json->field("heap_least", static_cast<uint64_t>(memory.heap_least));
    json->field("stack_least", static_cast<uint64_t>(memory.stack_least));
    json->field("stack_task", memory.task);
}

}  // namespace

void Reporter::send(Output output, uint8_t* bytes, size_t size) const {
    sink_.put(sink_.context, output, bytes, seal_frame(bytes, size));
}

void Reporter::acknowledge(const Acknowledgement& ack) const {
    uint8_t bytes[44 + kCrcSize];
    write_header(bytes, FrameType::Ack, 0, boot_id_);
    store_u32(bytes + 8, ack.stream);
    store_u32(bytes + 12, ack.seq);
    store_u32(bytes + 16, ack.next_seq);
    bytes[20] = static_cast<uint8_t>(ack.verdict.code);
    bytes[21] = ack.verdict.joint;
    store_u16(bytes + 22, ack.verdict.knot);
    store_i32(bytes + 24, ack.verdict.value);
    store_i32(bytes + 28, ack.verdict.limit);
    store_u16(bytes + 32, ack.credits);
    store_u16(bytes + 34, ack.buffered_ms);
    store_u64(bytes + 36, ack.t_us);
    send(Output::TrajAck, bytes, 44);
}

void Reporter::acknowledge_command(uint32_t id, uint8_t command, Code code, Mode mode, uint64_t t_us) const {
    uint8_t bytes[24 + kCrcSize];
    write_header(bytes, FrameType::CmdAck, 0, boot_id_);
    store_u32(bytes + 8, id);
    bytes[12] = command;
    bytes[13] = static_cast<uint8_t>(code);
    bytes[14] = static_cast<uint8_t>(mode);
    bytes[15] = 0;
    store_u64(bytes + 16, t_us);
    send(Output::CmdAck, bytes, 24);
}

void Reporter::answer_sync(uint64_t t0, uint64_t t1, uint64_t t2) const {
    uint8_t bytes[32 + kCrcSize];
    write_header(bytes, FrameType::SyncReply, 0, boot_id_);
    store_u64(bytes + 8, t0);
    store_u64(bytes + 16, t1);
    store_u64(bytes + 24, t2);
    send(Output::SyncReply, bytes, 32);
}

void Reporter::state(const StateReport& report) const {
    uint8_t bytes[kStateHeadSize + 8 * kMaxJoints + kStateServoSize + kCrcSize];
    write_header(bytes, FrameType::State, joints_, boot_id_);
    store_u64(bytes + 8, report.t_us);
    bytes[16] = static_cast<uint8_t>(report.mode);
    bytes[17] = static_cast<uint8_t>(report.fault);
    store_u16(bytes + 18, report.inputs);
    store_u16(bytes + 20, static_cast<uint16_t>(report.scale_q30 >> 15));
    store_u16(bytes + 22, report.buffered_ms);
    store_u32(bytes + 24, report.stream);
    store_u32(bytes + 28, report.next_seq);
    store_u64(bytes + 32, report.play_us);
    store_u32(bytes + 40, report.underruns);
    store_u32(bytes + 44, report.refused);
    store_u32(bytes + 48, report.bad_frames);
    bytes[52] = report.flags;
    bytes[53] = report.fault_joint;
    store_u16(bytes + 54, report.outputs);
    store_u16(bytes + 56, report.referenced);
    store_u16(bytes + 58, report.speed_permil);
    for (uint8_t j = 0; j < joints_; ++j) {
        store_i32(bytes + kStateHeadSize + 4 * j, report.steps[j]);
        store_i32(bytes + kStateHeadSize + 4 * (joints_ + j), report.velocity_q8[j]);
    }
    size_t size = kStateHeadSize + 8 * static_cast<size_t>(joints_);
    if (report.has_servo) {
        store_u16(bytes + size, report.servo_us);
        store_u16(bytes + size + 2, report.servo_target_us);
        size += kStateServoSize;
    }
    send(Output::State, bytes, size);
}

void Reporter::event(const char* name, uint64_t t_us, uint32_t stream, const char* detail) const {
    JsonWriter json;
    json.field("event", name);
    json.field("t_us", t_us);
    json.field("boot_id", static_cast<uint64_t>(boot_id_));
    json.field("stream", static_cast<uint64_t>(stream));
    json.field("detail", detail);
    const size_t size = json.close();
    sink_.put(sink_.context, Output::Event, json.bytes(), size);
}

void Reporter::status(const StatusReport& report) const {
    JsonWriter json;
    json.field("online", true);
    json.field("device", report.device);
    json.field("firmware", kFirmwareVersion);
    json.field("protocol", kProtocolVersion, kNewestProtocol);
    json.field("boot_id", static_cast<uint64_t>(report.boot_id));
    json.field("reset_cause", report.reset_cause);
    json.field("joints", static_cast<uint64_t>(report.config->joints));
    json.field("tick_hz", static_cast<uint64_t>(report.config->tick_hz));
    json.field("queue_capacity", static_cast<uint64_t>(report.config->queue_capacity));
    json.field("referenced", report.is_referenced);
    json.field("armed", report.is_armed);
    json.field("config_crc32", static_cast<uint64_t>(report.config->crc32));
    json.field("virtual", report.is_virtual);
    if (report.slot[0] != 0) json.field("slot", report.slot);
    if (sink_.memory != nullptr) add(&json, sink_.memory());
    const size_t size = json.close();
    sink_.put(sink_.context, Output::Status, json.bytes(), size);
}

void Reporter::sensors(const SensorReport& report) const {
    JsonWriter json;
    json.field("t_us", report.t_us);
    json.field("boot_id", static_cast<uint64_t>(boot_id_));
    for (uint8_t i = 0; i < report.config->sensors; ++i)
        if ((report.heard >> i) & 1) json.field_milli(report.config->sensor[i].name, report.milli[i]);
    const size_t size = json.close();
    say(Output::Sensors, json.bytes(), size);
}

void Reporter::acknowledge_config(uint32_t crc32, bool accepted, const char* part, const char* reason) const {
    JsonWriter json;
    json.field("crc32", static_cast<uint64_t>(crc32));
    json.field("accepted", accepted);
    json.field("part", part);
    json.field("reason", reason);
    const size_t size = json.close();
    say(Output::ConfigAck, json.bytes(), size);
}

void Reporter::acknowledge_update(const UpdateAnswer& answer) const {
    JsonWriter json;
    json.field("session", static_cast<uint64_t>(answer.session));
    json.field("next", static_cast<uint64_t>(answer.next));
    json.field("accepted", answer.is_accepted);
    json.field("receiving", answer.is_receiving);
    json.field("reason", answer.refusal.reason);
    const size_t size = json.close();
    say(Output::UpdateAck, json.bytes(), size);
}

}  // namespace gemelo
