// The transport to the broker: TCP, or TLS that proves whom it speaks to.
#pragma once

#include "esp_transport.h"
#include "provision.h"

// In ESP-IDF's library and used across its components, but declared in a private header only up to 5.4.
extern "C" int esp_transport_get_socket(esp_transport_handle_t t);

namespace gemelo {

// By the scheme of `mqtt_uri`. With mqtts:// the broker must show a certificate of `mqtt_ca`, or of a public authority
// where that is empty, and is shown `mqtt_certificate` if there is one. `credentials` must stay.
esp_transport_handle_t make_transport(const Credentials& credentials);

}  // namespace gemelo
