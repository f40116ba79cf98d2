#pragma once

// Nothing, as with CONFIG_LOG_DEFAULT_LEVEL_NONE.
#define ESP_LOGI(tag, format, ...) ((void)(tag), (void)(format))
