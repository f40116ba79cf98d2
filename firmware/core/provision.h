// The credentials of a device, sent once over its serial line: the JSON of `provision` in PROTOCOL.md.
#pragma once

#include <stddef.h>

#include "config.h"
#include "refusal.h"

namespace gemelo {

// Texts with a 0 at their end; the bounds of SSID and password are those of IEEE 802.11.
struct Credentials {
    char device[kNameSize] = "";
    char wifi_ssid[33] = "";
    char wifi_password[64] = "";
    char mqtt_uri[128] = "";
    char mqtt_user[64] = "";
    char mqtt_password[64] = "";
    char mqtt_ca[2049] = "";           // PEM
    char mqtt_certificate[2049] = "";  // PEM, the device's own, by which a broker knows it
    char mqtt_key[2049] = "";          // PEM, of that certificate
    char update_key[257] = "";         // PEM, the public key that a new firmware is signed for; empty: takes none
    char serial_baud[8] = "";          // of the serial line; empty: 921600
    bool is_factory_reset = false;     // asked for; nothing to be kept
};

// Puts what is said into `credentials`; what is not said stays. False with a refusal that holds nothing of what was
// said, and `credentials` is not to be used then.
bool parse_provision(const char* text, size_t size, Credentials* credentials, Refusal* refusal);

}  // namespace gemelo
