#include "provision.h"

#include <string.h>

#include "baud.h"
#include "phrase.h"
#include "record_reader.h"

namespace gemelo {
namespace {

constexpr size_t kLeastWifiPassword = 8;  // standard: WPA2

constexpr Field text(const char* key, size_t offset, size_t capacity) {
    return Field{key, Kind::Text, false, static_cast<uint16_t>(offset), static_cast<uint16_t>(capacity)};
}

constexpr Field kFields[] = {
    text("device", offsetof(Credentials, device), sizeof Credentials::device),
    text("wifi_ssid", offsetof(Credentials, wifi_ssid), sizeof Credentials::wifi_ssid),
    text("wifi_password", offsetof(Credentials, wifi_password), sizeof Credentials::wifi_password),
    text("mqtt_uri", offsetof(Credentials, mqtt_uri), sizeof Credentials::mqtt_uri),
    text("mqtt_user", offsetof(Credentials, mqtt_user), sizeof Credentials::mqtt_user),
    text("mqtt_password", offsetof(Credentials, mqtt_password), sizeof Credentials::mqtt_password),
    text("mqtt_ca", offsetof(Credentials, mqtt_ca), sizeof Credentials::mqtt_ca),
    text("mqtt_certificate", offsetof(Credentials, mqtt_certificate), sizeof Credentials::mqtt_certificate),
    text("mqtt_key", offsetof(Credentials, mqtt_key), sizeof Credentials::mqtt_key),
    text("update_key", offsetof(Credentials, update_key), sizeof Credentials::update_key),
    text("serial_baud", offsetof(Credentials, serial_baud), sizeof Credentials::serial_baud),
    Field{"factory_reset", Kind::Truth, false, offsetof(Credentials, is_factory_reset)},
};
constexpr Record kProvision{kFields, sizeof kFields / sizeof kFields[0], true};

bool begins_with(const char* text, const char* start) {
    for (; *start != 0; ++text, ++start)
        if (*text != *start) return false;
    return true;
}

bool is_uri(const char* text) { return begins_with(text, "mqtt://") || begins_with(text, "mqtts://"); }

// Empty texts are no fault: what they are for is not used.
const char* find_fault(const Credentials& credentials) {
    if (credentials.device[0] != 0 && !is_name(credentials.device))
        return "\"device\" is not 1 to 31 letters, digits, '_' or '-'";
    if (credentials.mqtt_uri[0] != 0 && !is_uri(credentials.mqtt_uri))
        return "\"mqtt_uri\" does not begin with mqtt:// or mqtts://";
    if (credentials.serial_baud[0] != 0 && read_baud(credentials.serial_baud) == 0)
        return "\"serial_baud\" is not a number of 9600 to 3000000";
    if ((credentials.mqtt_certificate[0] != 0) != (credentials.mqtt_key[0] != 0))
        return "\"mqtt_certificate\" and \"mqtt_key\" belong together: give both, or both empty";
    const bool has_password = credentials.wifi_password[0] != 0;
    if (has_password && memchr(credentials.wifi_password, 0, kLeastWifiPassword) != nullptr)
        return "\"wifi_password\" is shorter than the 8 bytes of WPA2";
    return nullptr;
}

}  // namespace

bool parse_provision(const char* text, size_t size, Credentials* credentials, Refusal* refusal) {
    credentials->is_factory_reset = false;
    if (!read_record(text, size, kProvision, credentials, refusal)) return false;
    const char* fault = find_fault(*credentials);
    if (fault == nullptr) return true;
    Phrase(refusal->reason, sizeof refusal->reason).add(fault);
    return false;
}

}  // namespace gemelo
