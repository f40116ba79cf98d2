#pragma once

#include <stdlib.h>

typedef int esp_err_t;

#define ESP_OK 0
#define ESP_ERR_NO_MEM 0x101
#define ESP_ERROR_CHECK(x)                \
    do {                                  \
        const esp_err_t result_ = (x);    \
        if (result_ != ESP_OK) ::abort(); \
    } while (0)
