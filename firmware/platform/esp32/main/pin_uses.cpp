#include "pin_uses.h"

namespace gemelo {

PinUses::PinUses(const DeviceConfig& config) {
    for (uint8_t j = 0; j < config.joints; ++j) {
        add(config.joint[j].step_pin, Use::Output, Pull::None, config.joint[j].name);
        add(config.joint[j].dir_pin, Use::Output, Pull::None, config.joint[j].name);
    }
    add(config.enable_pin, Use::Output, Pull::None, "");
    for (uint8_t i = 0; i < config.outputs; ++i)
        add(config.output[i].pin, Use::Output, Pull::None, config.output[i].name);
    for (uint8_t i = 0; i < config.inputs; ++i)
        add(config.input[i].pin, Use::Input, config.input[i].pull, config.input[i].name);
    for (uint8_t i = 0; i < config.sensors; ++i) {
        const SensorConfig& sensor = config.sensor[i];
        const bool is_analog = sensor.kind == SensorKind::Analog;
        add(sensor.pin, is_analog ? Use::Analog : Use::Input, Pull::None, sensor.name);
        if (!is_analog) add(sensor.trigger_pin, Use::Output, Pull::None, sensor.name);
    }
    add(config.servo.pin, Use::Output, Pull::None, config.servo.name);
}

void PinUses::add(uint8_t pin, Use use, Pull pull, const char* part) {
    if (pin != kNone) use_[size_++] = PinUse{pin, use, pull, part};
}

}  // namespace gemelo
