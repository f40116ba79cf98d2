// The core with a clock that is moved by hand: tests run it as fast as they like, the virtual ESP32 in real time.
#pragma once

#include <deque>
#include <string>
#include <vector>

#include "machine.h"

namespace gemelo {

struct OutFrame {
    Output output;
    std::vector<uint8_t> payload;
};

// Pin levels after a tick in which they changed.
struct PinChange {
    uint64_t tick;  // since the device started
    Pins pins;
};

class VirtualDevice {
  public:
    VirtualDevice(const DeviceConfig& config, uint32_t boot_id, const std::string& reset_cause, uint64_t now_us);
    VirtualDevice(const VirtualDevice&) = delete;
    VirtualDevice& operator=(const VirtualDevice&) = delete;

    void start(const int32_t* steps, bool referenced) { machine_.start(now_us_, steps, referenced); }
    void receive(const uint8_t* bytes, size_t size, bool is_retained, uint64_t received_us);
    void receive(const std::vector<uint8_t>& bytes) { receive(bytes.data(), bytes.size(), false, now_us_); }

    // Runs every tick whose time is before `until_us`; at a multiple of a slot since the start, a slot has just ended.
    void advance(uint64_t until_us);
    // Only the interrupt runs: the slot task hangs.
    void advance_without_slots(uint32_t slots);

    uint64_t now_us() const { return now_us_; }
    Machine& machine() { return machine_; }
    std::deque<OutFrame>& outputs() { return outputs_; }
    void set_tracing(bool on) { is_tracing_ = on; }
    std::deque<PinChange>& trace() { return trace_; }

  private:
    static void put(void* self, Output output, const uint8_t* bytes, size_t size);
    void run_until_tick(uint32_t due);
    void tick();

    DeviceConfig config_;
    std::string reset_cause_;
    Machine machine_;
    uint32_t ticks_per_slot_;
    uint64_t now_us_;
    uint64_t slot_start_us_;
    uint32_t tick_in_slot_ = 0;
    uint64_t tick_ = 0;
    std::deque<OutFrame> outputs_;
    std::deque<PinChange> trace_;
    Pins traced_;
    bool is_tracing_ = false;
};

}  // namespace gemelo
