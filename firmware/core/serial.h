// The device on a serial line: frames, JSON in frames and text mode, and who speaks where.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "frame.h"
#include "json.h"
#include "machine.h"
#include "packets.h"
#include "text_mode.h"

namespace gemelo {

class SerialPort {
  public:
    // Frames that the platform handles: PROVISION and INJECT, as JSON.
    using Other = void (*)(void* context, FrameType type, const uint8_t* text, size_t size);
    // The most that wrap() makes.
    static constexpr size_t kLargestReport = cobs_bound(kHeaderSize + JsonWriter::kSize + kCrcSize);

    // `other` may be nullptr: nothing else is understood.
    void begin(Machine& machine, uint32_t boot_id, Other other, void* context);
    void receive(const uint8_t* bytes, size_t size, uint64_t received_us, uint64_t now_us);
    // A frame has come over MQTT: a sign of life there moves what is said there.
    void yield_to_mqtt(const Arrival& arrival);

    // True if this output goes over this line now; true if it goes over MQTT.
    bool carries(Output output) const;
    bool leaves_to_mqtt(Output output) const;

    // An output as it goes over the wire; returns its length, or 0 where `capacity` does not suffice.
    size_t wrap(Output output, const uint8_t* payload, size_t size, uint8_t* out, size_t capacity) const;
    // The same for the JSON of a platform's own: PROVISION_ACK, SHAFT.
    size_t wrap_json(FrameType type, const uint8_t* text, size_t size, uint8_t* out, size_t capacity) const;

    // Frames and lines that were understood since begin().
    uint32_t understood() const { return understood_; }
    const TextMode& text_mode() const { return text_mode_; }

  private:
    enum class Wire : uint8_t { Both, Serial, Mqtt };

    void take(Packets::Found found, uint64_t received_us, uint64_t now_us);
    void take_frame(uint64_t received_us, uint64_t now_us);
    void take_line(uint64_t received_us, uint64_t now_us);
    void greet(uint64_t received_us);

    Machine* machine_ = nullptr;
    Other other_ = nullptr;
    void* context_ = nullptr;
    uint32_t boot_id_ = 0;
    Packets packets_;
    TextMode text_mode_;
    Wire wire_ = Wire::Both;     // that carried a sign of life last
    bool is_answering_ = false;  // what is said now answers what came over this line
    bool is_greeting_ = false;
    bool was_heard_ = false;
    uint32_t understood_ = 0;
    uint64_t heard_us_ = 0;  // the last frame or line
    uint64_t byte_us_ = 0;   // the last bytes
};

}  // namespace gemelo
