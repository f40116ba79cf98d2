#include "transport.h"

#include <string.h>

#include "esp_crt_bundle.h"
#include "esp_transport_ssl.h"
#include "esp_transport_tcp.h"

namespace gemelo {
namespace {

constexpr int kPlainPort = 1883;
constexpr int kTlsPort = 8883;

int length(const char* pem) { return static_cast<int>(strlen(pem)); }

}  // namespace

esp_transport_handle_t make_transport(const Credentials& credentials) {
    const bool is_tls = strncmp(credentials.mqtt_uri, "mqtts://", 8) == 0;
    const esp_transport_handle_t transport = is_tls ? esp_transport_ssl_init() : esp_transport_tcp_init();
    esp_transport_set_default_port(transport, is_tls ? kTlsPort : kPlainPort);
    if (!is_tls) return transport;
    if (credentials.mqtt_ca[0] != 0)
        esp_transport_ssl_set_cert_data(transport, credentials.mqtt_ca, length(credentials.mqtt_ca));
    else
        esp_transport_ssl_crt_bundle_attach(transport, esp_crt_bundle_attach);
    // On the transport itself: esp-mqtt gives a transport of its caller's own none of its settings.
    if (credentials.mqtt_certificate[0] == 0) return transport;
    esp_transport_ssl_set_client_cert_data(transport, credentials.mqtt_certificate,
                                           length(credentials.mqtt_certificate));
    esp_transport_ssl_set_client_key_data(transport, credentials.mqtt_key, length(credentials.mqtt_key));
    return transport;
}

}  // namespace gemelo
