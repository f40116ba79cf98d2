// Checks that this chip supports a configuration, before it is applied.
#pragma once

#include "chip.h"
#include "config.h"

namespace gemelo {

constexpr uint32_t kTimerHz = 40000000;  // of the tick's timer: half the APB clock of every chip

ConfigFault find_board_fault(const DeviceConfig& config, const Chip& chip);

// What works but may surprise. Gives the first one at or after place `from` and moves `from` behind it; none at the
// end.
ConfigFault next_board_warning(const DeviceConfig& config, const Chip& chip, uint8_t* from);

}  // namespace gemelo
