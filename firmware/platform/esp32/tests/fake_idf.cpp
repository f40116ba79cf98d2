#include "fake_idf.h"

#include <sys/mman.h>

#include <condition_variable>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <thread>

#include "bootloader_random.h"
#include "driver/gpio.h"
#include "driver/gptimer.h"
#include "driver/ledc.h"
#include "driver/uart.h"
#include "esp_adc/adc_cali_scheme.h"
#include "esp_crt_bundle.h"
#include "esp_heap_caps.h"
#include "esp_netif.h"
#include "esp_ota_ops.h"
#include "esp_random.h"
#include "esp_rom_sys.h"
#include "esp_task_wdt.h"
#include "esp_timer.h"
#include "esp_transport_ssl.h"
#include "esp_transport_tcp.h"
#include "esp_wifi.h"
#include "freertos/task.h"
#include "nvs.h"
#include "nvs_flash.h"
#include "soc/gpio_reg.h"

namespace fake {

Chip chip;

namespace {

struct Timer {
    gptimer_alarm_cb_t on_alarm = nullptr;
    void* context = nullptr;
    uint64_t alarm_count = 0;
    bool is_running = false;
} timer;

constexpr uint64_t kCountsPerUs = 40;
constexpr size_t kPage = 4096;

std::mutex mutex;
std::condition_variable changed;
std::thread thread;
uint32_t granted = 0;
bool is_ending = false;
bool is_done = true;
bool is_notified = false;

volatile uint32_t& gpio(uintptr_t address) { return *reinterpret_cast<volatile uint32_t*>(address); }

void map_registers() {
    void* const at = reinterpret_cast<void*>(static_cast<uintptr_t>(DR_REG_GPIO_BASE));
    static void* const page =
        mmap(at, kPage, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_FIXED_NOREPLACE, -1, 0);
    if (page != at) std::abort();
}

void apply(uint32_t set, uint32_t clear, int first) {
    for (int i = 0; i < 32; ++i) {
        const uint64_t bit = 1ull << (first + i);
        if ((set >> i & 1) != 0 && (chip.outputs & bit) == 0) ++chip.ups[first + i];
        if ((set >> i & 1) != 0) chip.outputs |= bit;
        if ((clear >> i & 1) != 0) chip.outputs &= ~bit;
    }
}

// The registers hold the last write only: of the pins that change in a tick a test looks at one.
void take_writes() {
    apply(gpio(GPIO_OUT_W1TS_REG), gpio(GPIO_OUT_W1TC_REG), 0);
    apply(gpio(GPIO_OUT1_W1TS_REG), gpio(GPIO_OUT1_W1TC_REG), 32);
    for (const uintptr_t address : {GPIO_OUT_W1TS_REG, GPIO_OUT_W1TC_REG, GPIO_OUT1_W1TS_REG, GPIO_OUT1_W1TC_REG})
        gpio(address) = 0;
}

void tick() {
    take_writes();
    gpio(GPIO_IN_REG) = static_cast<uint32_t>(chip.inputs);
    gpio(GPIO_IN1_REG) = static_cast<uint32_t>(chip.inputs >> 32);
    const gptimer_alarm_event_data_t event{};
    timer.on_alarm(nullptr, &event, timer.context);
    take_writes();
}

// Until the interrupt has woken the task, or 2 ms have passed.
void pass_time() {
    is_notified = false;
    for (uint64_t passed_us = 0; passed_us < 2000 && !is_notified;) {
        const uint64_t step_us = timer.is_running ? timer.alarm_count / kCountsPerUs : 1000;
        chip.now_us += step_us;
        passed_us += step_us;
        if (timer.is_running) tick();
    }
    chip.now_us += chip.waking_us;
}

// As the boot loader with rollback: a new image is started once, and again only if it was marked valid meanwhile.
Flash started(Flash flash) {
    if (flash.state == ESP_OTA_IMG_PENDING_VERIFY || flash.state == ESP_OTA_IMG_INVALID) {
        flash.boot = 1 - flash.boot;
        flash.state = ESP_OTA_IMG_VALID;
    }
    if (flash.state == ESP_OTA_IMG_NEW) flash.state = ESP_OTA_IMG_PENDING_VERIFY;
    flash.running = flash.boot;
    flash.is_open = false;
    return flash;
}

}  // namespace

void reset() {
    map_registers();
    const auto nvs = chip.nvs;
    const Flash flash = started(chip.flash);
    const uint32_t writes = chip.flash_writes;
    const esp_reset_reason_t reason = chip.reset_reason;
    chip = Chip{};
    chip.nvs = nvs;
    chip.flash = flash;
    chip.flash_writes = writes;
    chip.reset_reason = reason;
    timer = Timer{};
    take_writes();
    chip.outputs = 0;
    chip.ups.clear();
}

Task::Task(std::function<void()> task) {
    granted = 0;
    is_ending = is_done = false;
    thread = std::thread([this, task] {
        try {
            task();
        } catch (const Restarted&) {
            has_restarted_ = true;
        } catch (const Ended&) {
        }
        const std::lock_guard<std::mutex> lock(mutex);
        is_done = true;
        changed.notify_all();
    });
}

Task::~Task() {
    {
        const std::lock_guard<std::mutex> lock(mutex);
        is_ending = true;
        changed.notify_all();
    }
    thread.join();
}

void Task::grant(uint32_t slots) {
    std::unique_lock<std::mutex> lock(mutex);
    granted += slots;
    changed.notify_all();
    changed.wait(lock, [] { return granted == 0 || is_done; });
}

}  // namespace fake

using fake::chip;

extern "C" {

uint32_t ulTaskNotifyTake(BaseType_t, TickType_t) {
    {
        std::unique_lock<std::mutex> lock(fake::mutex);
        if (fake::granted > 0 && --fake::granted == 0) fake::changed.notify_all();
        fake::changed.wait(lock, [] { return fake::granted > 0 || fake::is_ending; });
        if (fake::is_ending) throw fake::Ended{};
    }
    fake::pass_time();
    return 1;
}
void vTaskNotifyGiveFromISR(TaskHandle_t, BaseType_t* is_woken) {
    fake::is_notified = true;
    *is_woken = pdTRUE;
}
BaseType_t xTaskNotifyGive(TaskHandle_t) { return pdTRUE; }
BaseType_t xTaskCreatePinnedToCore(TaskFunction_t, const char*, uint32_t, void*, UBaseType_t, TaskHandle_t*,
                                   BaseType_t) {
    return pdPASS;
}
TaskHandle_t xTaskGetCurrentTaskHandle(void) { return nullptr; }
void vTaskDelay(TickType_t) {}
UBaseType_t uxTaskGetStackHighWaterMark(TaskHandle_t task) { return fake::chip.stack_left[task]; }
size_t heap_caps_get_free_size(uint32_t) { return fake::chip.heap_free; }
size_t heap_caps_get_minimum_free_size(uint32_t) { return fake::chip.heap_least; }

esp_err_t gptimer_new_timer(const gptimer_config_t*, gptimer_handle_t*) { return ESP_OK; }
esp_err_t gptimer_register_event_callbacks(gptimer_handle_t, const gptimer_event_callbacks_t* callbacks,
                                           void* context) {
    fake::timer.on_alarm = callbacks->on_alarm;
    fake::timer.context = context;
    return ESP_OK;
}
esp_err_t gptimer_set_raw_count(gptimer_handle_t, uint64_t) { return ESP_OK; }
esp_err_t gptimer_set_alarm_action(gptimer_handle_t, const gptimer_alarm_config_t* alarm) {
    fake::timer.alarm_count = alarm->alarm_count;
    return ESP_OK;
}
esp_err_t gptimer_enable(gptimer_handle_t) { return ESP_OK; }
// As the real ones, both refuse what is not so.
esp_err_t gptimer_start(gptimer_handle_t) {
    if (fake::timer.is_running) return ESP_ERR_NO_MEM;
    fake::timer.is_running = true;
    return ESP_OK;
}
esp_err_t gptimer_stop(gptimer_handle_t) {
    if (!fake::timer.is_running) return ESP_ERR_NO_MEM;
    fake::timer.is_running = false;
    return ESP_OK;
}

static void gpio_reset_all(uint64_t pins) {
    chip.is_output &= ~pins;
    chip.is_input &= ~pins;
    chip.is_analog &= ~pins;
}
esp_err_t gpio_config(const gpio_config_t* config) {
    gpio_reset_all(config->pin_bit_mask);
    if (config->mode == GPIO_MODE_OUTPUT) chip.is_output |= config->pin_bit_mask;
    if (config->mode == GPIO_MODE_INPUT) chip.is_input |= config->pin_bit_mask;
    return ESP_OK;
}
// As ESP-IDF's: no input, no output, a pull-up, and no longer at the ADC.
esp_err_t gpio_reset_pin(gpio_num_t pin) {
    gpio_reset_all(1ull << pin);
    return ESP_OK;
}
esp_err_t gpio_set_level(gpio_num_t pin, uint32_t level) {
    chip.outputs = (chip.outputs & ~(1ull << pin)) | static_cast<uint64_t>(level) << pin;
    return ESP_OK;
}
int gpio_get_level(gpio_num_t pin) { return static_cast<int>((chip.inputs & chip.is_input) >> pin & 1); }
esp_err_t gpio_set_intr_type(gpio_num_t, gpio_int_type_t) { return ESP_OK; }
esp_err_t gpio_install_isr_service(int) { return ESP_OK; }
esp_err_t gpio_isr_handler_add(gpio_num_t, gpio_isr_t, void*) { return ESP_OK; }
esp_err_t gpio_isr_handler_remove(gpio_num_t) { return ESP_OK; }

esp_err_t ledc_timer_config(const ledc_timer_config_t* timer) {
    chip.servo_hz = timer->duty_resolution == LEDC_TIMER_14_BIT ? timer->freq_hz : 0;
    return ESP_OK;
}
esp_err_t ledc_channel_config(const ledc_channel_config_t* channel) {
    chip.servo_pin = channel->gpio_num;
    chip.servo_duty = chip.servo_next_duty = channel->duty;
    return ESP_OK;
}
esp_err_t ledc_set_duty(ledc_mode_t, ledc_channel_t, uint32_t duty) {
    chip.servo_next_duty = duty;
    return ESP_OK;
}
esp_err_t ledc_update_duty(ledc_mode_t, ledc_channel_t) {
    chip.servo_duty = chip.servo_next_duty;
    return ESP_OK;
}

int64_t esp_timer_get_time(void) { return static_cast<int64_t>(chip.now_us); }
void esp_rom_delay_us(uint32_t us) { chip.now_us += us; }
esp_reset_reason_t esp_reset_reason(void) { return chip.reset_reason; }
void esp_restart(void) { throw fake::Restarted{}; }
uint32_t esp_random(void) { return 4; }
void bootloader_random_enable(void) {}
void bootloader_random_disable(void) {}
esp_err_t esp_task_wdt_reconfigure(const esp_task_wdt_config_t*) { return ESP_OK; }
esp_err_t esp_task_wdt_add(TaskHandle_t) { return ESP_OK; }
esp_err_t esp_task_wdt_reset(void) { return ESP_OK; }

esp_err_t nvs_flash_init(void) { return ESP_OK; }
esp_err_t nvs_flash_erase(void) { return ESP_OK; }
esp_err_t nvs_open(const char*, nvs_open_mode_t, nvs_handle_t*) { return ESP_OK; }
esp_err_t nvs_set_blob(nvs_handle_t, const char* key, const void* value, size_t size) {
    chip.nvs[key] = std::string(static_cast<const char*>(value), size);
    return ESP_OK;
}
esp_err_t nvs_get_blob(nvs_handle_t, const char* key, void* out, size_t* size) {
    const auto found = chip.nvs.find(key);
    if (found == chip.nvs.end() || found->second.size() > *size) return ESP_ERR_NO_MEM;
    memcpy(out, found->second.data(), *size = found->second.size());
    return ESP_OK;
}
esp_err_t nvs_set_str(nvs_handle_t handle, const char* key, const char* value) {
    return nvs_set_blob(handle, key, value, strlen(value) + 1);
}
esp_err_t nvs_get_str(nvs_handle_t handle, const char* key, char* out, size_t* size) {
    return nvs_get_blob(handle, key, out, size);
}
esp_err_t nvs_erase_all(nvs_handle_t) {
    chip.nvs.clear();
    return ESP_OK;
}
esp_err_t nvs_commit(nvs_handle_t) {
    ++chip.flash_writes;
    return ESP_OK;
}

static const esp_partition_t kSlots[] = {{0x20000, 0x1e0000, "ota_0"}, {0x200000, 0x1e0000, "ota_1"}};
static int slot_of(const esp_partition_t* partition) { return static_cast<int>(partition - kSlots); }
const esp_partition_t* esp_ota_get_running_partition(void) { return &kSlots[chip.flash.running]; }
const esp_partition_t* esp_ota_get_next_update_partition(const esp_partition_t*) {
    return &kSlots[1 - chip.flash.running];
}
esp_err_t esp_ota_begin(const esp_partition_t* partition, size_t, esp_ota_handle_t* handle) {
    if (chip.flash.is_open || slot_of(partition) == chip.flash.running) return ESP_ERR_NO_MEM;
    chip.flash.is_open = true;
    chip.flash.slot[slot_of(partition)].clear();
    *handle = static_cast<esp_ota_handle_t>(slot_of(partition));
    return ESP_OK;
}
esp_err_t esp_ota_write(esp_ota_handle_t handle, const void* data, size_t size) {
    if (!chip.flash.is_open) return ESP_ERR_NO_MEM;
    chip.flash.slot[handle].append(static_cast<const char*>(data), size);
    return ESP_OK;
}
esp_err_t esp_ota_abort(esp_ota_handle_t) {
    if (!chip.flash.is_open) return ESP_ERR_NO_MEM;
    chip.flash.is_open = false;
    return ESP_OK;
}
esp_err_t esp_ota_end(esp_ota_handle_t handle) {
    return esp_ota_abort(handle) == ESP_OK && chip.flash.is_valid ? ESP_OK : ESP_ERR_NO_MEM;
}
esp_err_t esp_ota_set_boot_partition(const esp_partition_t* partition) {
    chip.flash.boot = slot_of(partition);
    chip.flash.state = ESP_OTA_IMG_NEW;
    return ESP_OK;
}
esp_err_t esp_ota_get_state_partition(const esp_partition_t*, esp_ota_img_states_t* state) {
    *state = chip.flash.state;
    return ESP_OK;
}
esp_err_t esp_ota_mark_app_valid_cancel_rollback(void) {
    chip.flash.state = ESP_OTA_IMG_VALID;
    return ESP_OK;
}
esp_err_t esp_ota_mark_app_invalid_rollback_and_reboot(void) {
    chip.flash.state = ESP_OTA_IMG_INVALID;
    throw fake::Restarted{};
}

esp_mqtt_client_handle_t esp_mqtt_client_init(const esp_mqtt_client_config_t* config) {
    chip.mqtt = *config;
    chip.will.assign(config->session.last_will.msg, static_cast<size_t>(config->session.last_will.msg_len));
    chip.will = std::string(config->session.last_will.topic) + " " + chip.will;
    return reinterpret_cast<esp_mqtt_client_handle_t>(&chip);
}
esp_err_t esp_mqtt_client_register_event(esp_mqtt_client_handle_t, esp_mqtt_event_id_t, esp_event_handler_t handler,
                                         void* context) {
    chip.mqtt_handler = handler;
    chip.mqtt_context = context;
    return ESP_OK;
}
esp_err_t esp_mqtt_client_start(esp_mqtt_client_handle_t) { return ESP_OK; }
int esp_mqtt_client_subscribe_single(esp_mqtt_client_handle_t, const char* topic, int qos) {
    chip.subscriptions.push_back(std::string(topic) + " " + std::to_string(qos));
    return 1;
}
int esp_mqtt_client_publish(esp_mqtt_client_handle_t, const char* topic, const char*, int, int qos, int retain) {
    chip.published.push_back(std::string(topic) + " " + std::to_string(qos) + (retain != 0 ? " retained" : ""));
    return 1;
}
esp_transport_handle_t esp_transport_tcp_init(void) { return nullptr; }
esp_transport_handle_t esp_transport_ssl_init(void) { return nullptr; }
esp_err_t esp_transport_set_default_port(esp_transport_handle_t, int) { return ESP_OK; }
int esp_transport_get_socket(esp_transport_handle_t) { return -1; }
void esp_transport_ssl_set_cert_data(esp_transport_handle_t, const char* data, int length) {
    chip.tls_authority.assign(data, static_cast<size_t>(length));
}
void esp_transport_ssl_set_client_cert_data(esp_transport_handle_t, const char* data, int length) {
    chip.tls_certificate.assign(data, static_cast<size_t>(length));
}
void esp_transport_ssl_set_client_key_data(esp_transport_handle_t, const char* data, int length) {
    chip.tls_key.assign(data, static_cast<size_t>(length));
}
void esp_transport_ssl_crt_bundle_attach(esp_transport_handle_t, esp_err_t (*)(void*)) {
    chip.tls_authority = "public authorities";
}
esp_err_t esp_crt_bundle_attach(void*) { return ESP_OK; }

esp_err_t adc_oneshot_new_unit(const adc_oneshot_unit_init_cfg_t*, adc_oneshot_unit_handle_t*) { return ESP_OK; }
// ADC1 of the ESP32: GPIO 36 to 39 are its channels 0 to 3, 32 to 35 the channels 4 to 7.
static int adc_pin(adc_channel_t channel) { return channel < 4 ? 36 + channel : 28 + channel; }
esp_err_t adc_oneshot_config_channel(adc_oneshot_unit_handle_t, adc_channel_t channel, const adc_oneshot_chan_cfg_t*) {
    gpio_reset_all(1ull << adc_pin(channel));
    chip.is_analog |= 1ull << adc_pin(channel);
    return ESP_OK;
}
esp_err_t adc_oneshot_read(adc_oneshot_unit_handle_t, adc_channel_t channel, int* raw) {
    *raw = (chip.is_analog >> adc_pin(channel) & 1) != 0 ? fake::kAnalogMv : fake::kPulledUpMv;
    return ESP_OK;
}
esp_err_t adc_oneshot_io_to_channel(int pin, adc_unit_t* const unit, adc_channel_t* const channel) {
    if (pin < 32 || pin > 39) return ESP_ERR_NO_MEM;
    *unit = ADC_UNIT_1;
    *channel = static_cast<adc_channel_t>(pin < 36 ? pin - 28 : pin - 36);
    return ESP_OK;
}
esp_err_t adc_cali_raw_to_voltage(adc_cali_handle_t, int raw, int* voltage) {
    *voltage = raw;
    return ESP_OK;
}
esp_err_t adc_cali_create_scheme_line_fitting(const adc_cali_line_fitting_config_t*, adc_cali_handle_t* handle) {
    static int scheme;
    *handle = reinterpret_cast<adc_cali_handle_t>(&scheme);
    return ESP_OK;
}

}  // extern "C"
