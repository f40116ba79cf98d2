// The core with a clock that is moved by hand, and a world around it: tests run it as fast as they like, the virtual
// ESP32 in real time.
#pragma once

#include <deque>
#include <string>
#include <vector>

#include "machine.h"
#include "serial.h"
#include "world.h"

namespace gemelo {

struct OutFrame {
    Output output;
    std::vector<uint8_t> payload;
};

// PROVISION or INJECT, as JSON, as it came over the line.
struct Request {
    FrameType type;
    std::string text;
};

// Pin levels after a tick in which they changed.
struct PinChange {
    uint64_t tick;  // since the device started
    Pins pins;
};

// What a platform in another language does for a FirmwareSlot: 1, or 0 with the reason in `reason` (128 bytes).
struct FirmwareCalls {
    int (*verify)(const uint8_t* digest, const uint8_t* signature, size_t size, char* reason);
    int (*begin)(uint32_t size, char* reason);
    int (*write)(const uint8_t* bytes, size_t size, char* reason);
    int (*finish)(const uint8_t* digest, char* reason);
    void (*abort)();
    int (*permits_older)(const uint8_t* digest, uint32_t boot_id, const uint8_t* signature, size_t size);
};

class VirtualDevice {
  public:
    // `slot`: that its firmware runs from, where it has any.
    VirtualDevice(const DeviceConfig& config, uint32_t boot_id, const std::string& reset_cause, uint64_t now_us,
                  const std::string& slot = "");
    VirtualDevice(const VirtualDevice&) = delete;
    VirtualDevice& operator=(const VirtualDevice&) = delete;

    // The counters begin at `steps`; the shafts stand there too, unless the kMaxJoints of `shaft` say where they are.
    void start(const int32_t* steps, bool referenced, const int32_t* shaft = nullptr);
    void receive(const uint8_t* bytes, size_t size, bool is_retained, uint64_t received_us);
    void receive(const std::vector<uint8_t>& bytes) { receive(bytes.data(), bytes.size(), false, now_us_); }
    void receive_config(const uint8_t* text, size_t size, bool is_retained, uint64_t received_us);
    void receive_serial(const uint8_t* bytes, size_t size, uint64_t received_us);
    // Takes a new firmware; its functions may all be null.
    FirmwareSlot& firmware() { return firmware_; }
    FirmwareCalls& firmware_calls() { return firmware_calls_; }
    // It has said `status` over the line to somebody who had spoken there.
    bool has_told_status() const { return has_told_status_; }
    // From now on somebody takes what goes over the serial line.
    void attach_line() { has_line_ = true; }
    // JSON of the platform's own: EVENT, SHAFT or PROVISION_ACK; true if it is to be said over MQTT too, by the caller.
    bool say(FrameType type, const uint8_t* text, size_t size);

    // Runs every tick whose time is before `until_us`; at a multiple of a slot since the start, a slot has just ended.
    void advance(uint64_t until_us);
    // Everything stands still until then, pins and shafts too; the slot that is under way ends before.
    void stand_still(uint64_t until_us);
    // The slot's task hangs for so long; only the interrupt runs, and what arrives waits.
    void freeze(uint64_t duration_us) { frozen_until_us_ = now_us_ + duration_us; }
    void advance_without_slots(uint32_t slots);
    void set_sensor(uint8_t index, double value);

    uint64_t now_us() const { return now_us_; }
    Machine& machine() { return machine_; }
    World& world() { return world_; }
    const World& world() const { return world_; }
    const DeviceConfig& config() const { return config_; }
    // What goes over MQTT.
    std::deque<OutFrame>& outputs() { return outputs_; }
    // What goes over the serial line, as bytes.
    std::string& line() { return line_; }
    std::deque<Request>& requests() { return requests_; }
    // The text of the configuration that was taken last; empty if none was.
    const std::string& kept() const { return kept_; }
    void set_tracing(bool on) { is_tracing_ = on; }
    std::deque<PinChange>& trace() { return trace_; }

  private:
    enum class Way : uint8_t { Frame, Config, Serial };
    struct Arrived {
        Way way;
        std::vector<uint8_t> bytes;
        bool is_retained;
        uint64_t received_us;
    };

    static void put(void* self, Output output, const uint8_t* bytes, size_t size);
    static void keep(void* self, const uint8_t* text, size_t size);
    static void take_request(void* self, FrameType type, const uint8_t* text, size_t size);
    void arrive(Arrived&& arrived);
    void hand_over(const Arrived& arrived);
    void hand_over_waiting();
    void run_until_tick(uint32_t due);
    void tick();
    void run_slot_task();
    void drive_pins();
    void wire();
    bool is_frozen() const { return slot_start_us_ < frozen_until_us_; }

    DeviceConfig config_;
    std::string reset_cause_;
    std::string slot_;
    FirmwareSlot firmware_;
    FirmwareCalls firmware_calls_{};
    Machine machine_;
    SerialPort serial_;
    World world_;
    uint32_t wired_crc32_ = 0;
    uint32_t ticks_per_slot_ = 0;
    uint64_t now_us_;
    uint64_t slot_start_us_;
    uint64_t frozen_until_us_ = 0;
    uint32_t tick_in_slot_ = 0;
    uint64_t tick_ = 0;
    std::deque<Arrived> waiting_;
    std::deque<OutFrame> outputs_;
    std::string line_;
    std::deque<Request> requests_;
    std::string kept_;
    bool has_line_ = false;
    bool has_told_status_ = false;
    std::deque<PinChange> trace_;
    Pins traced_;
    bool is_tracing_ = false;
};

}  // namespace gemelo
