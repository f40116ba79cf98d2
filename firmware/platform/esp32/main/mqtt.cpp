#include "mqtt.h"

#include <string.h>

#include "board.h"
#include "esp_err.h"
#include "esp_random.h"
#include "esp_timer.h"
#include "json.h"
#include "lwip/sockets.h"
#include "tasks.h"
#include "transport.h"

namespace gemelo {
namespace {

constexpr int kKeepAliveS = 5;
constexpr int kTimeoutMs = 2000;
constexpr int kReconnectMs = 1000;

size_t write_will(const Credentials& credentials, uint32_t boot_id, JsonWriter* json) {
    json->field("online", false);
    json->field("device", credentials.device);
    json->field("boot_id", static_cast<uint64_t>(boot_id));
    return json->close();
}

// gemelo-device-<name>-<digits>
void write_client_id(const char* device, char* text) {
    strcpy(text, kClientIdPrefix);
    strcat(text, device);
    char* end = text + strlen(text);
    *end++ = '-';
    uint64_t random = (static_cast<uint64_t>(esp_random()) << 32) | esp_random();
    for (size_t digit = 0; digit < Mqtt::kRandomDigits; ++digit, random >>= 4)
        *end++ = "0123456789abcdef"[random & 0xF];
    *end = 0;
}

// Without it Nagle's algorithm and delayed acknowledgements cost 20 to 40 ms a frame.
void send_at_once(esp_transport_handle_t transport) {
    const int on = 1;
    const int connection = esp_transport_get_socket(transport);
    if (connection >= 0) setsockopt(connection, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
}

}  // namespace

void Mqtt::begin(const Credentials& credentials, uint32_t boot_id) {
    said_.begin(credentials.device);
    heard_.begin(credentials.device);
    transport_ = make_transport(credentials);
    JsonWriter will;
    esp_mqtt_client_config_t config = {};
    config.broker.address.uri = credentials.mqtt_uri;
    // Random, so that two devices of one name do not end each other's connections; one for all of a boot, so that a
    // connection ends the one before, whose last will then does not come late.
    write_client_id(credentials.device, client_id_);
    config.credentials.client_id = client_id_;
    if (credentials.mqtt_user[0] != 0) config.credentials.username = credentials.mqtt_user;
    if (credentials.mqtt_password[0] != 0) config.credentials.authentication.password = credentials.mqtt_password;
    config.session.last_will.topic = said_.full("status");
    config.session.last_will.msg_len = static_cast<int>(write_will(credentials, boot_id, &will));
    config.session.last_will.msg = reinterpret_cast<const char*>(will.bytes());
    config.session.last_will.qos = 1;
    config.session.last_will.retain = 1;
    config.session.keepalive = kKeepAliveS;
    config.session.protocol_ver = MQTT_PROTOCOL_V_3_1_1;
    config.network.timeout_ms = kTimeoutMs;
    config.network.reconnect_timeout_ms = kReconnectMs;
    config.network.transport = transport_;
    config.task.priority = static_cast<int>(kNetworkPriority) + 1;
    config.task.stack_size = 6144;
    config.buffer.size = 4096;
    config.buffer.out_size = 1024;
    config.outbox.limit = 16384;
    client_ = esp_mqtt_client_init(&config);
    ESP_ERROR_CHECK(client_ == nullptr ? ESP_ERR_NO_MEM : ESP_OK);
    ESP_ERROR_CHECK(esp_mqtt_client_register_event(client_, MQTT_EVENT_ANY, on_event, this));
    ESP_ERROR_CHECK(esp_mqtt_client_start(client_));
}

void Mqtt::publish(Output output, const uint8_t* bytes, size_t size) {
    const Said topic = said(output);
    if (topic.name == nullptr || size == 0 || !is_connected()) return;
    const char* data = reinterpret_cast<const char*>(bytes);
    esp_mqtt_client_publish(client_, said_.full(topic.name), data, static_cast<int>(size), topic.qos,
                            topic.is_retained ? 1 : 0);
}

void Mqtt::on_event(void* self, esp_event_base_t, int32_t id, void* data) {
    Mqtt& mqtt = *static_cast<Mqtt*>(self);
    if (id == MQTT_EVENT_CONNECTED) mqtt.connected();
    if (id == MQTT_EVENT_DISCONNECTED) __atomic_store_n(&mqtt.is_connected_, false, __ATOMIC_RELEASE);
    if (id == MQTT_EVENT_DATA) mqtt.receive(*static_cast<const esp_mqtt_event_t*>(data));
}

void Mqtt::connected() {
    send_at_once(transport_);
    __atomic_store_n(&is_connected_, true, __ATOMIC_RELEASE);
    subscribe_by(heard_);
    message_.forget();  // the rest of it was lost with the connection, and its place is taken now
    board.from_mqtt.push(static_cast<uint8_t>(Inbound::Connected), 0, 0, nullptr, 0);
}

void Mqtt::subscribe() {
    if (is_connected()) subscribe_by(said_);
}

void Mqtt::subscribe_by(Topics& topics) {
    for (const Heard& heard : kHeard) esp_mqtt_client_subscribe_single(client_, topics.full(heard.name), heard.qos);
}

// Only the first piece of a message tells its topic.
void Mqtt::receive(const esp_mqtt_event_t& event) {
    if (event.current_data_offset == 0) {
        topic_ = heard_.find(event.topic, static_cast<size_t>(event.topic_len));
        is_retained_ = event.retain;
        received_us_ = static_cast<uint64_t>(esp_timer_get_time());
        const size_t total = static_cast<size_t>(event.total_data_len);
        message_.begin(board.from_mqtt.reserve(total), total);
    }
    const bool is_last =
        message_.add(event.data, static_cast<size_t>(event.data_len), static_cast<size_t>(event.current_data_offset));
    if (is_last && topic_ != nullptr) deliver();
}

// A frame on a topic that its type does not belong to is delivered as no bytes: the machine counts it.
void Mqtt::deliver() {
    const bool is_config = topic_->type == FrameType::Config;
    const bool fits = is_config || (message_.size() > 2 && message_.bytes()[2] == static_cast<uint8_t>(topic_->type));
    const Inbound kind = is_config ? Inbound::Config : Inbound::Frame;
    const uint8_t flags = is_retained_ ? kRetained : 0;
    if (fits && message_.is_whole())
        board.from_mqtt.commit(static_cast<uint8_t>(kind), flags, received_us_, message_.size());
    else
        board.from_mqtt.push(static_cast<uint8_t>(kind), flags, received_us_, nullptr, 0);
    message_.forget();
}

}  // namespace gemelo
