// What sdkconfig.defaults asks for, as far as the layer reads it. The compiler is told the chip:
// -DCONFIG_IDF_TARGET_...
#pragma once

#define CONFIG_GPTIMER_ISR_IRAM_SAFE 1
#if CONFIG_IDF_TARGET_ESP32C3
#define CONFIG_FREERTOS_UNICORE 1
#endif
