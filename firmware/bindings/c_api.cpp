// The virtual device as plain C functions, for ctypes.
#include <string.h>

#include "../core/config_text.h"
#include "../core/provision.h"
#include "../platform/host/virtual_device.h"

using gemelo::DeviceConfig;
using gemelo::VirtualDevice;

extern "C" {

// What a test or the virtual ESP32 reads of a device at once.
struct GemeloSnapshot {
    uint64_t now_us;
    uint64_t play_us;
    uint32_t mode;
    uint32_t referenced;
    uint32_t moving;
    uint32_t still;
    uint32_t armed;
    uint32_t outputs;
    uint32_t config_crc32;
    uint32_t max_slot_error_q8;
    int32_t steps[gemelo::kMaxJoints];
    int32_t shaft[gemelo::kMaxJoints];
    int32_t commanded_q8[gemelo::kMaxJoints];
    int64_t commanded_q20[gemelo::kMaxJoints];
    uint32_t level_low;
    uint32_t level_high;
    uint32_t scale_q30;
    uint32_t servo_us;  // 0: no pulses
    uint32_t servo_target_us;
    double horn_us;  // where the horn truly is
    uint32_t told_status;
};

// The device of a configuration, or nullptr and why not; `part` has room for 32 bytes, `reason` for 128. An empty text
// makes a device that has no configuration yet. `slot` is what its firmware runs from, where it has any.
VirtualDevice* gemelo_create(const char* text, size_t size, char* part, char* reason, uint32_t boot_id,
                             const char* reset_cause, uint64_t now_us, const char* slot) {
    DeviceConfig config{};
    gemelo::Refusal refusal;
    const bool is_taken = size == 0 || gemelo::parse_config(text, size, &config, &refusal);
    memcpy(part, refusal.part, sizeof refusal.part);
    memcpy(reason, refusal.reason, sizeof refusal.reason);
    return is_taken ? new VirtualDevice(config, boot_id, reset_cause, now_us, slot) : nullptr;
}

void gemelo_start(VirtualDevice* device, const int32_t* steps, const int32_t* shaft, int referenced) {
    device->start(steps, referenced != 0, shaft);
}

void gemelo_destroy(VirtualDevice* device) { delete device; }

void gemelo_receive(VirtualDevice* device, const uint8_t* bytes, size_t size, int retained, uint64_t received_us) {
    device->receive(bytes, size, retained != 0, received_us);
}

void gemelo_receive_config(VirtualDevice* device, const uint8_t* text, size_t size, int retained,
                           uint64_t received_us) {
    device->receive_config(text, size, retained != 0, received_us);
}

void gemelo_attach_line(VirtualDevice* device) { device->attach_line(); }

void gemelo_receive_serial(VirtualDevice* device, const uint8_t* bytes, size_t size, uint64_t received_us) {
    device->receive_serial(bytes, size, received_us);
}

// Up to `capacity` bytes of what goes over the serial line; they are gone then. Returns how many.
size_t gemelo_take_serial(VirtualDevice* device, uint8_t* bytes, size_t capacity) {
    std::string& line = device->line();
    const size_t size = line.size() < capacity ? line.size() : capacity;
    memcpy(bytes, line.data(), size);
    line.erase(0, size);
    return size;
}

// The oldest request's size, or -1 for none; taken out of the queue only if `capacity` suffices.
int64_t gemelo_take_request(VirtualDevice* device, uint8_t* type, uint8_t* text, size_t capacity) {
    auto& requests = device->requests();
    if (requests.empty()) return -1;
    const gemelo::Request& request = requests.front();
    const size_t size = request.text.size();
    if (size > capacity) return static_cast<int64_t>(size);
    *type = static_cast<uint8_t>(request.type);
    memcpy(text, request.text.data(), size);
    requests.pop_front();
    return static_cast<int64_t>(size);
}

int gemelo_say(VirtualDevice* device, uint8_t type, const uint8_t* text, size_t size) {
    return device->say(static_cast<gemelo::FrameType>(type), text, size);
}

// True if the text is valid; if not, `reason` (128 bytes) says why. `is_factory_reset` if it asks for that.
int gemelo_check_provision(const char* text, size_t size, int* is_factory_reset, char* reason) {
    gemelo::Credentials credentials;
    gemelo::Refusal refusal;
    const bool is_taken = gemelo::parse_provision(text, size, &credentials, &refusal);
    *is_factory_reset = credentials.is_factory_reset;
    memcpy(reason, refusal.reason, sizeof refusal.reason);
    return is_taken;
}

// The text of the configuration that was taken last; up to `capacity` bytes of it, returns its size.
size_t gemelo_kept(VirtualDevice* device, uint8_t* text, size_t capacity) {
    const std::string& kept = device->kept();
    memcpy(text, kept.data(), kept.size() < capacity ? kept.size() : capacity);
    return kept.size();
}

void gemelo_advance(VirtualDevice* device, uint64_t until_us) { device->advance(until_us); }

void gemelo_stand_still(VirtualDevice* device, uint64_t until_us) { device->stand_still(until_us); }

void gemelo_halt(VirtualDevice* device) { device->machine().halt(); }

int gemelo_subscribes_anew(VirtualDevice* device, uint64_t now_us) { return device->machine().subscribes_anew(now_us); }

void gemelo_report_status(VirtualDevice* device) { device->machine().report_status(); }

// The oldest output's size, or -1 for none; taken out of the queue only if `capacity` suffices.
int64_t gemelo_take(VirtualDevice* device, uint8_t* output, uint8_t* bytes, size_t capacity) {
    auto& outputs = device->outputs();
    if (outputs.empty()) return -1;
    const gemelo::OutFrame& frame = outputs.front();
    const size_t size = frame.payload.size();
    if (size > capacity) return static_cast<int64_t>(size);
    *output = static_cast<uint8_t>(frame.output);
    memcpy(bytes, frame.payload.data(), size);
    outputs.pop_front();
    return static_cast<int64_t>(size);
}

void gemelo_snapshot(VirtualDevice* device, GemeloSnapshot* snapshot) {
    const gemelo::Machine& machine = device->machine();
    const gemelo::Point& point = machine.present();
    *snapshot = GemeloSnapshot{};
    snapshot->now_us = device->now_us();
    snapshot->play_us = point.play_us;
    snapshot->mode = static_cast<uint32_t>(machine.mode());
    snapshot->referenced = machine.is_referenced();
    snapshot->moving = machine.is_moving();
    snapshot->still = machine.keeps_still();
    snapshot->armed = machine.is_enabled();
    snapshot->outputs = machine.outputs();
    snapshot->config_crc32 = machine.config_crc32();
    snapshot->level_low = device->world().levels().low;
    snapshot->level_high = device->world().levels().high;
    snapshot->max_slot_error_q8 = machine.max_slot_error_q8();
    snapshot->scale_q30 = point.scale_q30;
    snapshot->servo_us = machine.servo().pulse_us();
    snapshot->servo_target_us = machine.servo().target_us();
    snapshot->horn_us = device->world().horn().place_us();
    snapshot->told_status = device->has_told_status();
    for (uint8_t j = 0; j < gemelo::kMaxJoints; ++j) {
        snapshot->steps[j] = machine.stepper().executed(j);
        snapshot->shaft[j] = device->world().shaft(j);
        snapshot->commanded_q20[j] = point.position_q20[j];
        snapshot->commanded_q8[j] = gemelo::as_q8(point.position_q20[j]);
    }
}

void gemelo_trace(VirtualDevice* device, int on) { device->set_tracing(on != 0); }

// Up to `capacity` pin changes, oldest first; returns how many.
size_t gemelo_take_trace(VirtualDevice* device, uint64_t* tick, uint32_t* step, uint32_t* dir, size_t capacity) {
    auto& trace = device->trace();
    size_t count = 0;
    for (; count < capacity && !trace.empty(); ++count) {
        tick[count] = trace.front().tick;
        step[count] = trace.front().pins.step;
        dir[count] = trace.front().pins.dir;
        trace.pop_front();
    }
    return count;
}

}  // extern "C"
