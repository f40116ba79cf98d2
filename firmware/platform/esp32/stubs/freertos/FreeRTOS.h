#pragma once

#include <stdint.h>

typedef int BaseType_t;
typedef unsigned int UBaseType_t;
typedef uint32_t TickType_t;

#define configMAX_PRIORITIES 25
#define configTICK_RATE_HZ 1000
#define pdFALSE 0
#define pdTRUE 1
#define pdPASS pdTRUE
#define pdMS_TO_TICKS(ms) (static_cast<TickType_t>((static_cast<uint64_t>(ms) * configTICK_RATE_HZ) / 1000))
#define portYIELD_FROM_ISR(is_woken) (static_cast<void>(is_woken))
