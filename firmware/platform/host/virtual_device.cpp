#include "virtual_device.h"

namespace gemelo {

VirtualDevice::VirtualDevice(const DeviceConfig& config, uint32_t boot_id, const std::string& reset_cause,
                             uint64_t now_us)
    : config_(config),
      reset_cause_(reset_cause),
      ticks_per_slot_(ticks_per_slot(config)),
      now_us_(now_us),
      slot_start_us_(now_us) {
    machine_.begin(config_, Identity{boot_id, reset_cause_.c_str()}, Sink{this, put});
    traced_ = machine_.stepper().pins();
}

void VirtualDevice::put(void* self, Output output, const uint8_t* bytes, size_t size) {
    static_cast<VirtualDevice*>(self)->outputs_.push_back(OutFrame{output, {bytes, bytes + size}});
}

void VirtualDevice::receive(const uint8_t* bytes, size_t size, bool is_retained, uint64_t received_us) {
    machine_.receive(Arrival{bytes, size, is_retained, received_us}, now_us_);
}

void VirtualDevice::advance(uint64_t until_us) {
    while (until_us > slot_start_us_) {
        const uint64_t span_us = until_us - slot_start_us_;
        const bool is_whole = span_us >= kSlotUs;
        const uint64_t due = is_whole ? ticks_per_slot_ : (span_us * ticks_per_slot_ + kSlotUs - 1) / kSlotUs;
        run_until_tick(static_cast<uint32_t>(due));
        if (!is_whole) break;
        slot_start_us_ += kSlotUs;
        tick_in_slot_ = 0;
    }
    if (until_us > now_us_) now_us_ = until_us;
}

void VirtualDevice::run_until_tick(uint32_t due) {
    if (tick_in_slot_ == 0 && due > 0) {
        tick();
        machine_.slot(slot_start_us_);
    }
    if (tick_in_slot_ < due && machine_.stepper().is_quiet()) {
        const uint32_t count = due - tick_in_slot_;
        machine_.stepper().skip(count);
        tick_in_slot_ += count;
        tick_ += count;
    }
    while (tick_in_slot_ < due) tick();
}

void VirtualDevice::advance_without_slots(uint32_t slots) {
    for (uint32_t i = 0; i < slots * ticks_per_slot_; ++i) tick();
    tick_in_slot_ = 0;
    slot_start_us_ += static_cast<uint64_t>(slots) * kSlotUs;
    now_us_ = slot_start_us_;
}

void VirtualDevice::tick() {
    Stepper& stepper = machine_.stepper();
    stepper.tick();
    const Pins& pins = stepper.pins();
    if (is_tracing_ && (pins.step != traced_.step || pins.dir != traced_.dir)) trace_.push_back(PinChange{tick_, pins});
    traced_ = pins;
    ++tick_;
    ++tick_in_slot_;
}

}  // namespace gemelo
