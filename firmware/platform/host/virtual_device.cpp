#include "virtual_device.h"

namespace gemelo {

VirtualDevice::VirtualDevice(const DeviceConfig& config, uint32_t boot_id, const std::string& reset_cause,
                             uint64_t now_us, const std::string& slot)
    : config_(config), reset_cause_(reset_cause), slot_(slot), now_us_(now_us), slot_start_us_(now_us) {
    const Identity identity{boot_id, reset_cause_.c_str(), true, "", slot_.c_str()};
    machine_.begin(config_, identity, Sink{this, put, keep, nullptr, &firmware_});
    serial_.begin(machine_, boot_id, take_request, this);
}

void VirtualDevice::put(void* context, Output output, const uint8_t* bytes, size_t size) {
    VirtualDevice& self = *static_cast<VirtualDevice*>(context);
    if (self.serial_.leaves_to_mqtt(output)) self.outputs_.push_back(OutFrame{output, {bytes, bytes + size}});
    if (!self.has_line_ || !self.serial_.carries(output)) return;
    if (output == Output::Status && self.serial_.understood() != 0) self.has_told_status_ = true;
    uint8_t wrapped[SerialPort::kLargestReport];
    const size_t length = self.serial_.wrap(output, bytes, size, wrapped, sizeof wrapped);
    self.line_.append(reinterpret_cast<const char*>(wrapped), length);
}

bool VirtualDevice::say(FrameType type, const uint8_t* text, size_t size) {
    if (type == FrameType::Event) {
        machine_.say(Output::Event, text, size);
        return false;
    }
    const bool is_answer = type == FrameType::ProvisionAck;
    if (has_line_ && (is_answer || serial_.carries(Output::State))) {
        uint8_t wrapped[SerialPort::kLargestReport];
        const size_t length = serial_.wrap_json(type, text, size, wrapped, sizeof wrapped);
        line_.append(reinterpret_cast<const char*>(wrapped), length);
    }
    return !is_answer && serial_.leaves_to_mqtt(Output::State);
}

void VirtualDevice::take_request(void* self, FrameType type, const uint8_t* text, size_t size) {
    static_cast<VirtualDevice*>(self)->requests_.push_back(Request{type, {text, text + size}});
}

void VirtualDevice::keep(void* self, const uint8_t* text, size_t size) {
    static_cast<VirtualDevice*>(self)->kept_.assign(reinterpret_cast<const char*>(text), size);
}

void VirtualDevice::start(const int32_t* steps, bool referenced, const int32_t* shaft) {
    const uint8_t count = shaft == nullptr ? config_.joints : kMaxJoints;
    for (uint8_t j = 0; j < count; ++j) world_.set_shaft(j, shaft == nullptr ? steps[j] : shaft[j]);
    wire();
    machine_.start(now_us_, steps, referenced);
    drive_pins();
}

void VirtualDevice::wire() {
    wired_crc32_ = machine_.config_crc32();
    ticks_per_slot_ = ticks_per_slot(config_);
    tick_in_slot_ = 0;
    slot_start_us_ = now_us_;
    traced_ = machine_.stepper().pins();
    world_.wire(config_, traced_);
}

void VirtualDevice::receive(const uint8_t* bytes, size_t size, bool is_retained, uint64_t received_us) {
    arrive(Arrived{Way::Frame, {bytes, bytes + size}, is_retained, received_us});
}

void VirtualDevice::receive_config(const uint8_t* text, size_t size, bool is_retained, uint64_t received_us) {
    arrive(Arrived{Way::Config, {text, text + size}, is_retained, received_us});
}

void VirtualDevice::receive_serial(const uint8_t* bytes, size_t size, uint64_t received_us) {
    arrive(Arrived{Way::Serial, {bytes, bytes + size}, false, received_us});
}

void VirtualDevice::arrive(Arrived&& arrived) {
    if (is_frozen() || !waiting_.empty()) return waiting_.push_back(std::move(arrived));
    hand_over(arrived);
}

void VirtualDevice::hand_over(const Arrived& arrived) {
    const Arrival arrival{arrived.bytes.data(), arrived.bytes.size(), arrived.is_retained, arrived.received_us};
    switch (arrived.way) {
        case Way::Frame:
            serial_.yield_to_mqtt(arrival);
            machine_.receive(arrival, now_us_);
            break;
        case Way::Config:
            machine_.receive_config(arrival, now_us_);
            break;
        case Way::Serial:
            serial_.receive(arrival.bytes, arrival.size, arrival.received_us, now_us_);
            break;
    }
    if (machine_.config_crc32() != wired_crc32_) wire();
    drive_pins();
}

void VirtualDevice::advance(uint64_t until_us) {
    while (until_us > slot_start_us_) {
        if (tick_in_slot_ == 0 && !is_frozen()) hand_over_waiting();
        const uint64_t span_us = until_us - slot_start_us_;
        const bool is_whole = span_us >= kSlotUs;
        const uint64_t due = is_whole ? ticks_per_slot_ : (span_us * ticks_per_slot_ + kSlotUs - 1) / kSlotUs;
        run_until_tick(static_cast<uint32_t>(due));
        if (!is_whole) break;
        slot_start_us_ += kSlotUs;
        now_us_ = slot_start_us_;
        tick_in_slot_ = 0;
        world_.turn_horn(machine_.servo().pulse_us());
    }
    if (until_us > now_us_) now_us_ = until_us;
}

void VirtualDevice::stand_still(uint64_t until_us) {
    if (tick_in_slot_ != 0) advance(slot_start_us_ + kSlotUs);
    if (until_us <= slot_start_us_) return;
    const uint64_t slots = (until_us - slot_start_us_) / kSlotUs;
    slot_start_us_ += slots * kSlotUs;
    tick_ += slots * ticks_per_slot_;
    if (slot_start_us_ > now_us_) now_us_ = slot_start_us_;
}

void VirtualDevice::run_until_tick(uint32_t due) {
    if (ticks_per_slot_ == 0) return run_slot_task();  // without a configuration there is no tick
    if (tick_in_slot_ == 0 && due > 0) {
        tick();
        if (!is_frozen()) run_slot_task();
    }
    if (tick_in_slot_ < due && machine_.stepper().is_quiet() && world_.is_settled()) {
        const uint32_t count = due - tick_in_slot_;
        machine_.stepper().skip(count);
        tick_in_slot_ += count;
        tick_ += count;
    }
    while (tick_in_slot_ < due) tick();
}

void VirtualDevice::run_slot_task() {
    machine_.slot(slot_start_us_);
    drive_pins();
}

void VirtualDevice::hand_over_waiting() {
    for (; !waiting_.empty(); waiting_.pop_front()) hand_over(waiting_.front());
}

void VirtualDevice::drive_pins() {
    world_.enable(machine_.is_enabled());
    for (uint8_t i = 0; i < config_.sensors; ++i) machine_.set_sensor(i, world_.sensor_raw(i));
}

void VirtualDevice::advance_without_slots(uint32_t slots) {
    const uint64_t duration_us = static_cast<uint64_t>(slots) * kSlotUs;
    freeze(duration_us);
    advance(now_us_ + duration_us);
}

void VirtualDevice::set_sensor(uint8_t index, double value) { world_.set_sensor(index, value); }

void VirtualDevice::tick() {
    Stepper& stepper = machine_.stepper();
    stepper.tick(world_.levels());
    const Pins& pins = stepper.pins();
    world_.tick(pins);
    if (is_tracing_ && (pins.step != traced_.step || pins.dir != traced_.dir)) trace_.push_back(PinChange{tick_, pins});
    traced_ = pins;
    ++tick_;
    ++tick_in_slot_;
}

}  // namespace gemelo
