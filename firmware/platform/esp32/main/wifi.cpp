#include "wifi.h"

#include <string.h>

#include "esp_err.h"
#include "esp_netif.h"
#include "esp_wifi.h"

namespace gemelo {
namespace {

// Fills a field of esp_wifi, which need not end with a 0 where it is full.
template <size_t kSize>
void fill(uint8_t (&field)[kSize], const char* text) {
    memcpy(field, text, strnlen(text, kSize));
}

}  // namespace

void Wifi::begin(const Credentials& credentials) {
    ESP_ERROR_CHECK(esp_netif_init());
    ESP_ERROR_CHECK(esp_event_loop_create_default());
    esp_netif_create_default_wifi_sta();
    wifi_init_config_t config = WIFI_INIT_CONFIG_DEFAULT();
    config.nvs_enable = 0;  // Wi-Fi must never write the flash by itself: the arm may be moving
    ESP_ERROR_CHECK(esp_wifi_init(&config));
    ESP_ERROR_CHECK(esp_wifi_set_storage(WIFI_STORAGE_RAM));
    ESP_ERROR_CHECK(esp_event_handler_register(WIFI_EVENT, ESP_EVENT_ANY_ID, on_event, this));
    ESP_ERROR_CHECK(esp_event_handler_register(IP_EVENT, IP_EVENT_STA_GOT_IP, on_event, this));
    set_up_station(credentials);
    ESP_ERROR_CHECK(esp_wifi_start());
    // With modem sleep the clock synchronisation is 5 to 7 ms off instead of 0.3 ms.
    ESP_ERROR_CHECK(esp_wifi_set_ps(WIFI_PS_NONE));
}

void Wifi::set_up_station(const Credentials& credentials) {
    wifi_config_t config = {};
    fill(config.sta.ssid, credentials.wifi_ssid);
    fill(config.sta.password, credentials.wifi_password);
    config.sta.threshold.authmode = credentials.wifi_password[0] == 0 ? WIFI_AUTH_OPEN : WIFI_AUTH_WPA2_PSK;
    ESP_ERROR_CHECK(esp_wifi_set_mode(WIFI_MODE_STA));
    ESP_ERROR_CHECK(esp_wifi_set_config(WIFI_IF_STA, &config));
}

void Wifi::turn(uint64_t now_us) {
    if (__atomic_exchange_n(&has_failed_, false, __ATOMIC_ACQ_REL)) back_off_.fail(now_us);
    if (is_up()) back_off_.succeed();
    if (back_off_.is_due(now_us) && esp_wifi_connect() != ESP_OK) back_off_.fail(now_us);
}

void Wifi::on_event(void* self, esp_event_base_t base, int32_t id, void*) {
    Wifi& wifi = *static_cast<Wifi*>(self);
    if (base == IP_EVENT) {
        __atomic_store_n(&wifi.is_up_, true, __ATOMIC_RELEASE);
    } else if (id == WIFI_EVENT_STA_START) {
        if (esp_wifi_connect() != ESP_OK) __atomic_store_n(&wifi.has_failed_, true, __ATOMIC_RELEASE);
    } else if (id == WIFI_EVENT_STA_DISCONNECTED) {
        __atomic_store_n(&wifi.is_up_, false, __ATOMIC_RELEASE);
        __atomic_store_n(&wifi.has_failed_, true, __ATOMIC_RELEASE);
    }
}

}  // namespace gemelo
