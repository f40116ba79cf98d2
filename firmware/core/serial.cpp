#include "serial.h"

#include "bytes.h"
#include "crc32.h"

namespace gemelo {
namespace {

constexpr uint64_t kStrangerUs = 2000000;  // standard: PROTOCOL.md
constexpr uint64_t kPauseUs = 1000000;     // chosen: ten heartbeats; what was begun before is no frame any more

bool is_sign_of_life(FrameType type) {
    return type == FrameType::Traj || type == FrameType::Cmd || type == FrameType::Heartbeat;
}

bool is_answer(Output output) {
    return output == Output::TrajAck || output == Output::CmdAck || output == Output::SyncReply ||
           output == Output::ConfigAck || output == Output::Text || output == Output::UpdateAck;
}

bool is_for_both(Output output) { return output == Output::Status || output == Output::Event; }

FrameType type_of(Output output) {
    switch (output) {
        case Output::ConfigAck:
            return FrameType::ConfigAck;
        case Output::UpdateAck:
            return FrameType::UpdateAck;
        case Output::Sensors:
            return FrameType::Sensors;
        case Output::Status:
            return FrameType::Status;
        default:
            return FrameType::Event;
    }
}

}  // namespace

void SerialPort::begin(Machine& machine, uint32_t boot_id, Other other, void* context) {
    machine_ = &machine;
    boot_id_ = boot_id;
    other_ = other;
    context_ = context;
    text_mode_.begin(machine);
}

void SerialPort::receive(const uint8_t* bytes, size_t size, uint64_t received_us, uint64_t now_us) {
    is_answering_ = true;
    if (received_us > byte_us_ + kPauseUs) take(packets_.pause(), received_us, now_us);
    byte_us_ = received_us;
    for (size_t i = 0; i < size; ++i) take(packets_.put(bytes[i]), received_us, now_us);
    is_answering_ = false;
}

void SerialPort::take(Packets::Found found, uint64_t received_us, uint64_t now_us) {
    switch (found) {
        case Packets::Found::None:
            return;
        case Packets::Found::Frame:
            return take_frame(received_us, now_us);
        case Packets::Found::Line:
            return take_line(received_us, now_us);
        case Packets::Found::Bad:
            return machine_->count_bad_frame();
    }
}

void SerialPort::take_frame(uint64_t received_us, uint64_t now_us) {
    const Frame frame = open_frame(packets_.bytes(), packets_.size());
    if (!frame.is_valid()) return machine_->count_bad_frame();
    greet(received_us);
    const uint8_t* text = frame.bytes + kHeaderSize;
    const size_t text_size = frame.size - kHeaderSize;
    switch (frame.type()) {
        case FrameType::Config:
            return machine_->receive_config(Arrival{text, text_size, false, received_us}, now_us);
        case FrameType::Provision:
        case FrameType::Inject:
            return other_ == nullptr ? machine_->count_bad_frame() : other_(context_, frame.type(), text, text_size);
        default:
            if (is_sign_of_life(frame.type())) wire_ = Wire::Serial;
            return machine_->receive(frame, Arrival{packets_.bytes(), packets_.size(), false, received_us}, now_us);
    }
}

void SerialPort::take_line(uint64_t received_us, uint64_t now_us) {
    const char* bytes = reinterpret_cast<const char*>(packets_.bytes());
    const TextLine line = read_text_line(bytes, packets_.size(), machine_->config());
    if (!line.is_line) return machine_->count_bad_frame();
    greet(received_us);
    wire_ = Wire::Serial;
    text_mode_.receive(line, now_us);
}

// Whoever is there has not been for a while.
void SerialPort::greet(uint64_t received_us) {
    const bool is_stranger = !was_heard_ || received_us > heard_us_ + kStrangerUs;
    was_heard_ = true;
    ++understood_;
    heard_us_ = received_us;
    if (!is_stranger) return;
    is_greeting_ = true;
    machine_->report_status();
    is_greeting_ = false;
}

void SerialPort::yield_to_mqtt(const Arrival& arrival) {
    const bool is_frame = arrival.size >= kHeaderSize && arrival.bytes[0] == kMagic && !arrival.is_retained;
    if (is_frame && is_sign_of_life(static_cast<FrameType>(arrival.bytes[2]))) wire_ = Wire::Mqtt;
}

bool SerialPort::carries(Output output) const {
    if (is_for_both(output)) return true;
    return is_answer(output) ? is_answering_ : wire_ != Wire::Mqtt;
}

bool SerialPort::leaves_to_mqtt(Output output) const {
    if (is_for_both(output)) return !is_greeting_;
    return is_answer(output) ? !is_answering_ : wire_ != Wire::Serial;
}

size_t SerialPort::wrap(Output output, const uint8_t* payload, size_t size, uint8_t* out, size_t capacity) const {
    switch (output) {
        case Output::Text:
            if (size > capacity) return 0;
            for (size_t i = 0; i < size; ++i) out[i] = payload[i];
            return size;
        case Output::ConfigAck:
        case Output::UpdateAck:
        case Output::Sensors:
        case Output::Status:
        case Output::Event:
            return wrap_json(type_of(output), payload, size, out, capacity);
        default: {
            if (cobs_bound(size) > capacity) return 0;
            CobsWriter packet(out);
            packet.put(payload, size);
            return packet.finish();
        }
    }
}

size_t SerialPort::wrap_json(FrameType type, const uint8_t* text, size_t size, uint8_t* out, size_t capacity) const {
    if (cobs_bound(kHeaderSize + size + kCrcSize) > capacity) return 0;
    uint8_t header[kHeaderSize];
    uint8_t crc[kCrcSize];
    write_header(header, type, 0, boot_id_);
    store_u32(crc, crc32(text, size, crc32(header, kHeaderSize)));
    CobsWriter packet(out);
    packet.put(header, kHeaderSize);
    packet.put(text, size);
    packet.put(crc, kCrcSize);
    return packet.finish();
}

}  // namespace gemelo
