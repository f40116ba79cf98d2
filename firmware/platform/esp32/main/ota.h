// A new firmware in the other OTA slot: its signature, the flash, the restart into it, and its trial after that.
//
// The boot loader starts a new image once. Unless it is marked valid before the next reset, whatever the cause of that,
// the one before is started again.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "esp_ota_ops.h"
#include "machine.h"
#include "mbedtls/sha256.h"
#include "provision.h"
#include "update.h"

namespace gemelo {

class Ota {
  public:
    // `credentials` must stay.
    void begin(const Credentials& credentials, uint64_t now_us);
    const FirmwareSlot* slot() const { return &slot_; }
    // The name of the partition that runs.
    const char* label() const { return esp_ota_get_running_partition()->label; }
    // Somebody has heard `status`.
    void status_said() { is_said_ = true; }
    // At rest and disarmed: ends the trial, one way or the other, or restarts into a new image.
    void turn(const Machine& machine, uint64_t now_us);

  private:
    static bool verify(void* self, const uint8_t* digest, const uint8_t* signature, size_t size, Refusal* refusal);
    static bool open(void* self, uint32_t size, Refusal* refusal);
    static bool write(void* self, const uint8_t* bytes, size_t size, Refusal* refusal);
    static bool finish(void* self, const uint8_t* digest, Refusal* refusal);
    static void abort(void* self);
    static bool permits_older(void* self, const uint8_t* digest, uint32_t boot_id, const uint8_t* signature,
                              size_t size);

    const Credentials* credentials_ = nullptr;
    FirmwareSlot slot_;
    const esp_partition_t* partition_ = nullptr;  // that is written
    esp_ota_handle_t handle_ = 0;
    mbedtls_sha256_context hash_;
    uint64_t begun_us_ = 0;  // of this boot
    bool is_on_trial_ = false;
    bool is_said_ = false;
    bool is_ready_ = false;  // for the restart
    uint64_t restart_us_ = 0;
};

}  // namespace gemelo
