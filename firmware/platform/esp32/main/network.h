// The network's task: Wi-Fi, then MQTT, and what the device says to the broker.
#pragma once

#include <stdint.h>

#include "freertos/FreeRTOS.h"
#include "freertos/task.h"
#include "provision.h"

namespace gemelo {

// nullptr where nothing is provisioned: then there is the serial wire only. `credentials` must stay.
TaskHandle_t start_network(const Credentials& credentials, uint32_t boot_id);

}  // namespace gemelo
