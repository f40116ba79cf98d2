#include "store.h"

#include "esp_err.h"
#include "nvs.h"
#include "nvs_flash.h"

namespace gemelo {
namespace {

constexpr const char* kNamespace = "gemelo";
constexpr const char* kConfigKey = "config";

nvs_handle_t handle;

// One key of NVS for each of the credentials.
struct Entry {
    const char* key;
    char* text;
    size_t capacity;
};

struct Entries {
    explicit Entries(Credentials& c)
        : entry{{"device", c.device, sizeof c.device},
                {"wifi_ssid", c.wifi_ssid, sizeof c.wifi_ssid},
                {"wifi_password", c.wifi_password, sizeof c.wifi_password},
                {"mqtt_uri", c.mqtt_uri, sizeof c.mqtt_uri},
                {"mqtt_user", c.mqtt_user, sizeof c.mqtt_user},
                {"mqtt_password", c.mqtt_password, sizeof c.mqtt_password},
                {"mqtt_ca", c.mqtt_ca, sizeof c.mqtt_ca},
                {"mqtt_cert", c.mqtt_certificate, sizeof c.mqtt_certificate},  // NVS takes 15 bytes of a key
                {"mqtt_key", c.mqtt_key, sizeof c.mqtt_key},
                {"update_key", c.update_key, sizeof c.update_key},
                {"serial_baud", c.serial_baud, sizeof c.serial_baud}} {}
    Entry entry[11];
};

}  // namespace

void open_store() {
    esp_err_t result = nvs_flash_init();
    if (result == ESP_ERR_NVS_NO_FREE_PAGES || result == ESP_ERR_NVS_NEW_VERSION_FOUND) {
        ESP_ERROR_CHECK(nvs_flash_erase());
        result = nvs_flash_init();
    }
    ESP_ERROR_CHECK(result);
    ESP_ERROR_CHECK(nvs_open(kNamespace, NVS_READWRITE, &handle));
}

void load_credentials(Credentials* credentials) {
    for (const Entry& entry : Entries(*credentials).entry) {
        size_t size = entry.capacity;
        if (nvs_get_str(handle, entry.key, entry.text, &size) != ESP_OK) entry.text[0] = 0;
    }
}

bool save_credentials(Credentials& credentials) {
    for (const Entry& entry : Entries(credentials).entry)
        if (nvs_set_str(handle, entry.key, entry.text) != ESP_OK) return false;
    return nvs_commit(handle) == ESP_OK;
}

size_t load_config(char* text, size_t capacity) {
    size_t size = capacity;
    return nvs_get_blob(handle, kConfigKey, text, &size) == ESP_OK ? size : 0;
}

bool save_config(const char* text, size_t size) {
    return nvs_set_blob(handle, kConfigKey, text, size) == ESP_OK && nvs_commit(handle) == ESP_OK;
}

bool forget_all() { return nvs_erase_all(handle) == ESP_OK && nvs_commit(handle) == ESP_OK; }

}  // namespace gemelo
