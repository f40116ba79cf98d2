#include "reset_cause.h"

#include "esp_system.h"

namespace gemelo {

ResetCause reset_cause() {
    switch (esp_reset_reason()) {
        case ESP_RST_POWERON:
            return {"power_on", false};
        case ESP_RST_BROWNOUT:
            return {"brownout", false};
        case ESP_RST_SW:
            return {"restart", true};
        case ESP_RST_PANIC:
            return {"panic", true};
        case ESP_RST_INT_WDT:
            return {"interrupt_watchdog", true};
        case ESP_RST_TASK_WDT:
            return {"task_watchdog", true};
        case ESP_RST_WDT:
            return {"watchdog", true};
        default:
            return {"unknown", false};
    }
}

}  // namespace gemelo
