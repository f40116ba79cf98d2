// Outgoing messages of the device: every frame and JSON text as bytes.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "config.h"
#include "protocol.h"
#include "update.h"

namespace gemelo {

constexpr const char* kFirmwareVersion = "1.0.0";

// Where an output goes; in the order of the topics in PROTOCOL.md.
enum class Output : uint8_t { TrajAck, CmdAck, SyncReply, State, Event, Status, ConfigAck, Sensors, Text, UpdateAck };

constexpr uint8_t kFlagArmed = 1;

// What is left of a board's memory, and what was left of it at the least since its start [bytes].
struct MemoryReport {
    uint32_t heap_free, heap_least;
    uint32_t stack_least;  // of the task that has come closest to its end
    const char* task;      // the name of that one
};

// Takes every output at once; the bytes are valid during the call only.
struct Sink {
    void* context = nullptr;
    void (*put)(void* context, Output output, const uint8_t* bytes, size_t size) = nullptr;
    // The text of a configuration that was taken, to be kept over a restart; may be null.
    void (*keep)(void* context, const uint8_t* text, size_t size) = nullptr;
    // What keeps this board from serving a configuration that is without a fault; may be null.
    ConfigFault (*check)(void* context, const DeviceConfig& config) = nullptr;
    // Takes a new firmware; may be null.
    const FirmwareSlot* firmware = nullptr;
    // How much memory is left; may be null.
    MemoryReport (*memory)() = nullptr;
};

struct Acknowledgement {
    uint32_t stream, seq, next_seq;
    Verdict verdict;
    uint16_t credits, buffered_ms;
    uint64_t t_us;
};

struct StateReport {
    uint64_t t_us;
    Mode mode;
    FaultCode fault;
    uint32_t scale_q30;
    uint16_t buffered_ms;
    uint32_t stream, next_seq;
    uint64_t play_us;
    uint32_t underruns, refused, bad_frames;
    uint16_t inputs;        // bit i: input i is active
    uint8_t flags;          // bit 0: armed
    uint8_t fault_joint;    // or kNoJoint
    uint16_t outputs;       // bit i: output i is on
    uint16_t referenced;    // bit j: the place of joint j is known
    uint16_t speed_permil;  // the time scale that was asked for
    int32_t steps[kMaxJoints];
    int32_t velocity_q8[kMaxJoints];
    bool has_servo;
    uint16_t servo_us, servo_target_us;  // 0: no pulses
};

struct StatusReport {
    const DeviceConfig* config;
    const char* device;
    const char* reset_cause;
    uint32_t boot_id;
    const char* slot;  // that the firmware runs from; empty: not known
    bool is_referenced, is_armed, is_virtual;
};

// Bit i of `heard`: sensor i has a reading, `milli` thousandths.
struct SensorReport {
    const DeviceConfig* config;
    uint64_t t_us;
    uint16_t heard;
    const int32_t* milli;
};

class Reporter {
  public:
    void begin(const Sink& sink, uint32_t boot_id, uint8_t joints) {
        sink_ = sink;
        boot_id_ = boot_id;
        joints_ = joints;
    }
    void acknowledge(const Acknowledgement& ack) const;
    void acknowledge_command(uint32_t id, uint8_t command, Code code, Mode mode, uint64_t t_us) const;
    void answer_sync(uint64_t t0, uint64_t t1, uint64_t t2) const;
    void state(const StateReport& report) const;
    void event(const char* name, uint64_t t_us, uint32_t stream, const char* detail) const;
    void status(const StatusReport& report) const;
    void sensors(const SensorReport& report) const;
    void acknowledge_config(uint32_t crc32, bool accepted, const char* part, const char* reason) const;
    void acknowledge_update(const UpdateAnswer& answer) const;
    // Bytes as they are.
    void say(Output output, const uint8_t* bytes, size_t size) const { sink_.put(sink_.context, output, bytes, size); }
    const Sink& sink() const { return sink_; }

  private:
    void send(Output output, uint8_t* bytes, size_t size) const;

    Sink sink_;
    uint32_t boot_id_ = 0;
    uint8_t joints_ = 0;
};

}  // namespace gemelo
