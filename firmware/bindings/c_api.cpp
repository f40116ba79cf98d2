// The virtual device as plain C functions, for ctypes.
#include <string.h>

#include "../platform/host/virtual_device.h"

using gemelo::DeviceConfig;
using gemelo::VirtualDevice;

struct FlatJoint {
    char name[gemelo::kNameSize];
    int32_t lower_q8, upper_q8, max_velocity_q8, max_acceleration_q8;
    uint32_t dir_setup_us, inverted;
};

struct FlatConfig {
    char name[gemelo::kNameSize];
    uint32_t tick_hz, queue_capacity, state_hz, hold_timeout_ms, joints;
    FlatJoint joint[gemelo::kMaxJoints];
};

static DeviceConfig unfold(const FlatConfig& flat) {
    DeviceConfig config{};
    memcpy(config.name, flat.name, sizeof config.name);
    config.tick_hz = flat.tick_hz;
    config.queue_capacity = flat.queue_capacity;
    config.state_hz = flat.state_hz;
    config.sensor_hz = 10;
    config.hold_timeout_ms = flat.hold_timeout_ms;
    config.is_armed_at_boot = 1;
    config.joints = static_cast<uint8_t>(flat.joints);
    for (uint8_t j = 0; j < gemelo::kMaxJoints; ++j) {
        const FlatJoint& from = flat.joint[j];
        gemelo::JointConfig& to = config.joint[j];
        memcpy(to.name, from.name, sizeof to.name);
        to.lower_q8 = from.lower_q8;
        to.upper_q8 = from.upper_q8;
        to.max_velocity_q8 = from.max_velocity_q8;
        to.max_acceleration_q8 = from.max_acceleration_q8;
        to.dir_setup_us = from.dir_setup_us;
        to.is_inverted = from.inverted != 0;
    }
    return config;
}

extern "C" {

// What a test or the virtual ESP32 reads of a device at once.
struct GemeloSnapshot {
    uint64_t now_us;
    uint64_t play_us;
    uint32_t mode;
    uint32_t referenced;
    uint32_t moving;
    uint32_t max_slot_error_q8;
    int32_t steps[gemelo::kMaxJoints];
    int32_t commanded_q8[gemelo::kMaxJoints];
    int64_t commanded_q20[gemelo::kMaxJoints];
    uint32_t scale_q30;
};

// A sentence, or nullptr; `joint` becomes the joint at fault, or 8.
const char* gemelo_find_fault(const FlatConfig* flat, uint8_t* joint) {
    const DeviceConfig config = unfold(*flat);
    const gemelo::ConfigFault fault = gemelo::find_fault(config);
    *joint = gemelo::kMaxJoints;
    for (uint8_t j = 0; j < config.joints && j < gemelo::kMaxJoints; ++j)
        if (fault.part == config.joint[j].name) *joint = j;
    return fault.sentence;
}

VirtualDevice* gemelo_create(const FlatConfig* flat, uint32_t boot_id, const char* reset_cause, uint64_t now_us,
                             const int32_t* steps, int referenced) {
    const DeviceConfig config = unfold(*flat);
    if (gemelo::find_fault(config).sentence != nullptr) return nullptr;
    VirtualDevice* device = new VirtualDevice(config, boot_id, reset_cause, now_us);
    device->start(steps, referenced != 0);
    return device;
}

void gemelo_destroy(VirtualDevice* device) { delete device; }

void gemelo_receive(VirtualDevice* device, const uint8_t* bytes, size_t size, int retained, uint64_t received_us) {
    device->receive(bytes, size, retained != 0, received_us);
}

void gemelo_advance(VirtualDevice* device, uint64_t until_us) { device->advance(until_us); }

void gemelo_halt(VirtualDevice* device) { device->machine().halt(); }

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
    snapshot->max_slot_error_q8 = machine.max_slot_error_q8();
    snapshot->scale_q30 = point.scale_q30;
    for (uint8_t j = 0; j < gemelo::kMaxJoints; ++j) {
        snapshot->steps[j] = machine.stepper().executed(j);
        snapshot->commanded_q20[j] = point.position_q20[j];
        snapshot->commanded_q8[j] = static_cast<int32_t>((point.position_q20[j] + 2048) >> 12);
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
