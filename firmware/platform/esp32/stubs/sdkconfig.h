// The settings of sdkconfig.defaults, as far as the layer reads them. The compiler is told the chip:
// -DCONFIG_IDF_TARGET_...
#pragma once

#define CONFIG_GPTIMER_ISR_IRAM_SAFE 1
#if CONFIG_IDF_TARGET_ESP32C3
#define CONFIG_FREERTOS_UNICORE 1
#endif
