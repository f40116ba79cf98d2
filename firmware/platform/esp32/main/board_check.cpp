#include "board_check.h"

#include "pin_uses.h"

namespace gemelo {
namespace {

const char* find_pin_fault(const PinUse& use, const Chip& chip) {
    const uint64_t bit = pin(use.pin);
    if ((chip.pins & bit) == 0) return "this chip has no such pin";
    if ((chip.flash & bit) != 0) return "its pin belongs to the flash memory";
    if (use.pin == chip.wire_tx || use.pin == chip.wire_rx) return "its pin belongs to the serial wire";
    const bool is_input_only = (chip.input_only & bit) != 0;
    if (use.use == Use::Output && is_input_only) return "its pin can only be an input";
    if (use.pull != Pull::None && is_input_only) return "its pin has no pull resistor: fit one and say pull none";
    if (use.use == Use::Analog && (chip.analog & bit) == 0) return "its pin is not one of ADC1";
    return nullptr;
}

const char* find_pin_warning(const PinUse& use, const Chip& chip) {
    const uint64_t bit = pin(use.pin);
    if ((chip.strapping & bit) != 0)
        return "its pin is read at reset: what is wired to it may keep the chip from starting";
    if ((chip.psram & bit) != 0) return "its pin belongs to the PSRAM of some modules";
    return nullptr;
}

bool is_wireable(const JointConfig& joint) { return joint.step_pin != kNone && joint.dir_pin != kNone; }

}  // namespace

ConfigFault find_board_fault(const DeviceConfig& config, const Chip& chip) {
    if (config.tick_hz == 0 || kTimerHz % config.tick_hz != 0) return {"tick_hz does not divide the timer's 40 MHz"};
    for (uint8_t j = 0; j < config.joints; ++j)
        if (!is_wireable(config.joint[j])) return {"it has no step_pin or no dir_pin", config.joint[j].name};
    const PinUses uses(config);
    for (const PinUse& use : uses) {
        const char* sentence = find_pin_fault(use, chip);
        if (sentence != nullptr) return {sentence, use.part};
    }
    return {};
}

ConfigFault next_board_warning(const DeviceConfig& config, const Chip& chip, uint8_t* from) {
    const PinUses uses(config);
    for (const PinUse* use = uses.begin() + *from; use < uses.end(); ++use) {
        const char* sentence = find_pin_warning(*use, chip);
        *from = static_cast<uint8_t>(use - uses.begin() + 1);
        if (sentence != nullptr) return {sentence, use->part};
    }
    return {};
}

}  // namespace gemelo
