#pragma once

#include "sdkconfig.h"

#if CONFIG_IDF_TARGET_ESP32
#define SOC_GPIO_PIN_COUNT 40
#elif CONFIG_IDF_TARGET_ESP32S3
#define SOC_GPIO_PIN_COUNT 49
#else
#define SOC_GPIO_PIN_COUNT 22
#endif
