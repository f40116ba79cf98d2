// The readings: a task of low priority that measures and puts raw values into its ring.
#pragma once

#include "config.h"

namespace gemelo {

void start_sensors();

// From the slot's task, after the pins are set up: measure what `config` says from now on. Without joints nothing is
// measured.
void set_sensors(const DeviceConfig& config);

}  // namespace gemelo
