// Output of machine and wire to the board: messages to their rings, a configuration to be kept or checked.
#include <string.h>

#include "board.h"
#include "board_check.h"
#include "device.h"
#include "esp_timer.h"
#include "phrase.h"
#include "this_chip.h"

namespace gemelo {

void Device::put(void* self, Output output, const uint8_t* bytes, size_t size) {
    Device& device = *static_cast<Device*>(self);
    const uint8_t kind = static_cast<uint8_t>(output);
    const bool is_heard = device.is_connected_ || device.serial_.understood() != 0;
    if (output == Output::Status && is_heard) device.ota_.status_said();
    if (device.serial_.carries(output)) {
        uint8_t framed[SerialPort::kLargestReport];
        const size_t length = device.serial_.wrap(output, bytes, size, framed, sizeof framed);
        if (length != 0) board.to_wire.push(kind, 0, 0, framed, length);
    }
    if (device.serial_.leaves_to_mqtt(output) && device.network_ != nullptr) {
        board.to_mqtt.push(kind, 0, 0, bytes, size);
        xTaskNotifyGive(device.network_);
    }
}

void Device::keep(void* self, const uint8_t* text, size_t size) {
    Device& device = *static_cast<Device*>(self);
    if (size > sizeof device.scratch_.text) return;
    memcpy(device.scratch_.text, text, size);
    device.text_size_ = size;
}

ConfigFault Device::check(void*, const DeviceConfig& config) { return find_board_fault(config, kThisChip); }

void Device::other(void* self, FrameType type, const uint8_t* text, size_t size) {
    Device& device = *static_cast<Device*>(self);
    if (type != FrameType::Provision) return;
    Credentials* room = device.text_size_ == 0 ? &device.scratch_.proposed : nullptr;
    device.provisioning_.receive(text, size, device.machine_, room, static_cast<uint64_t>(esp_timer_get_time()));
}

void Device::warn() {
    uint8_t from = 0;
    for (;;) {
        const ConfigFault warning = next_board_warning(config_, kThisChip, &from);
        if (warning.sentence == nullptr) return;
        char detail[120];
        Phrase(detail, sizeof detail).add(warning.part).add(": ").add(warning.sentence);
        machine_.event("pin_warning", detail);
    }
}

}  // namespace gemelo
