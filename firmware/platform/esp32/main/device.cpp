#include "device.h"

#include <string.h>

#include "board.h"
#include "board_check.h"
#include "esp_attr.h"
#include "esp_err.h"
#include "esp_system.h"
#include "esp_task_wdt.h"
#include "esp_timer.h"
#include "memory.h"
#include "phrase.h"
#include "reset_cause.h"
#include "sensors.h"
#include "store.h"
#include "this_chip.h"

namespace gemelo {
namespace {

constexpr uint32_t kLongestWaitMs = 2;    // where no tick runs, for want of a configuration
constexpr uint64_t kInboxBudgetUs = 400;  // of a slot, so that a flood of frames cannot starve the steps

RTC_NOINIT_ATTR PoseMemory pose_memory;

uint64_t clock_us() { return static_cast<uint64_t>(esp_timer_get_time()); }

}  // namespace

void Device::begin(const Credentials& credentials, uint32_t boot_id) {
    device_ = credentials.device;
    boot_id_ = boot_id;
    provisioning_.begin(credentials, serial_);
    ota_.begin(credentials, clock_us());
}

// What is in the flash was taken once; with another firmware or on another board it may not be good any more.
void Device::load_config() {
    Refusal refusal;
    const size_t size = gemelo::load_config(scratch_.text, sizeof scratch_.text);
    const bool is_good = size != 0 && parse_config(scratch_.text, size, &config_, &refusal) &&
                         find_board_fault(config_, kThisChip).sentence == nullptr;
    if (!is_good) config_ = DeviceConfig{};
}

void Device::run() {
    ESP_ERROR_CHECK(esp_task_wdt_add(nullptr));
    wake_up();
    for (;;) {
        ulTaskNotifyTake(pdTRUE, pdMS_TO_TICKS(kLongestWaitMs));
        machine_.slot(tick_.slot_start_us());
        pins_.drive(machine_);
        remember();
        serve();
        keep_config();
        if (machine_.subscribes_anew(clock_us())) __atomic_add_fetch(&board.silences, 1, __ATOMIC_RELAXED);
        provisioning_.restart_if_due(machine_, clock_us());
        ota_.turn(machine_, clock_us());
        is_awake_ = true;
        if (feeding_.is_due(clock_us())) esp_task_wdt_reset();
    }
}

void Device::wake_up() {
    load_config();
    const ResetCause cause = reset_cause();
    const Awakening awakening = wake(pose_memory, cause.is_warm, config_.crc32);
    Phrase(reset_cause_, sizeof reset_cause_).add(cause.text).add(awakening.was_moving ? " while moving" : "");
    machine_.begin(config_, Identity{boot_id_, reset_cause_, false, device_, ota_.label()},
                   Sink{this, put, keep, check, ota_.slot(), measured_memory});
    serial_.begin(machine_, boot_id_, other, this);
    tick_.begin(machine_.stepper(), xTaskGetCurrentTaskHandle());
    machine_.start(clock_us(), awakening.steps, awakening.is_referenced);
    set_up();
}

void Device::serve() {
    const uint64_t until_us = clock_us() + kInboxBudgetUs;
    bool has_more = true;
    while (has_more && clock_us() < until_us) {
        has_more = take_from(board.from_mqtt);
        has_more = take_from(board.from_wire) || has_more;
        has_more = take_from(board.from_sensors) || has_more;
    }
}

template <uint32_t kCapacity>
bool Device::take_from(Ring<kCapacity>& ring) {
    Record record;
    if (!ring.front(&record)) return false;
    take(record);
    ring.pop();
    return true;
}

// A configuration changes the stepper, the rate and the pins: the tick stands still then. It comes over the wire too.
void Device::take(const Record& record) {
    const Inbound kind = static_cast<Inbound>(record.kind);
    const bool may_change = machine_.takes_config() && (kind == Inbound::Config || kind == Inbound::Bytes);
    if (!may_change) return dispatch(record);
    const uint32_t before = machine_.config_crc32();
    tick_.stop();
    dispatch(record);
    if (machine_.config_crc32() != before) return set_up();
    tick_.resume();
}

void Device::dispatch(const Record& record) {
    const Arrival arrival{record.bytes, record.size, (record.flags & kRetained) != 0, record.time_us};
    const uint64_t now_us = clock_us();  // not the slot's start: a record may be younger
    switch (static_cast<Inbound>(record.kind)) {
        case Inbound::Frame:
            serial_.yield_to_mqtt(arrival);
            return machine_.receive(arrival, now_us);
        case Inbound::Config:
            return machine_.receive_config(arrival, now_us);
        case Inbound::Connected:
            is_connected_ = true;
            return machine_.report_status();
        case Inbound::Bytes:
            serial_.receive(record.bytes, record.size, record.time_us, now_us);
            return __atomic_store_n(&board.understood, serial_.understood(), __ATOMIC_RELAXED);
        case Inbound::Sensor: {
            int32_t raw = 0;
            memcpy(&raw, record.bytes, sizeof raw);
            return machine_.set_sensor(record.flags, raw);
        }
        case Inbound::FactoryReset:
            return provisioning_.ask_for_factory_reset();
    }
}

void Device::set_up() {
    pins_.set_up(config_);
    set_sensors(config_);
    if (config_.joints == 0) return;
    warn();
    tick_.start(config_);
}

// Twice a motion only: where it begins, and where it has ended.
void Device::remember() {
    Pose pose = kept_;
    pose.config_crc32 = machine_.config_crc32();
    pose.is_referenced = machine_.is_referenced();
    pose.is_moving = machine_.is_moving();
    for (uint8_t j = 0; !pose.is_moving && j < config_.joints; ++j) pose.steps[j] = machine_.stepper().executed(j);
    if (pose == kept_ && is_awake_) return;
    kept_ = pose;
    pose_memory.keep(pose);
}

// The flash stalls both cores for as long as it is written, so only this task, which alone can begin a motion, writes.
void Device::keep_config() {
    if (text_size_ == 0 || !machine_.keeps_still()) return;
    save_config(scratch_.text, text_size_);  // where it fails the gateway sends it again after the next start
    text_size_ = 0;
}

}  // namespace gemelo
