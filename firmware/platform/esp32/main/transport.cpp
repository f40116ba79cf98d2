#include "transport.h"

#include <string.h>

#include "esp_crt_bundle.h"
#include "esp_transport_ssl.h"
#include "esp_transport_tcp.h"

namespace gemelo {
namespace {

constexpr int kPlainPort = 1883;
constexpr int kTlsPort = 8883;

}  // namespace

esp_transport_handle_t make_transport(const Credentials& credentials) {
    const bool is_tls = strncmp(credentials.mqtt_uri, "mqtts://", 8) == 0;
    const esp_transport_handle_t transport = is_tls ? esp_transport_ssl_init() : esp_transport_tcp_init();
    esp_transport_set_default_port(transport, is_tls ? kTlsPort : kPlainPort);
    if (!is_tls) return transport;
    const size_t size = strlen(credentials.mqtt_ca);
    if (size != 0)
        esp_transport_ssl_set_cert_data(transport, credentials.mqtt_ca, static_cast<int>(size));
    else
        esp_transport_ssl_crt_bundle_attach(transport, esp_crt_bundle_attach);
    return transport;
}

}  // namespace gemelo
