#pragma once

#include "esp_transport.h"

extern "C" esp_transport_handle_t esp_transport_tcp_init(void);
