#include "ota.h"

#include <string.h>

#include "bytes.h"
#include "esp_system.h"
#include "mbedtls/pk.h"
#include "phrase.h"
#include "this_chip.h"

namespace gemelo {
namespace {

constexpr uint64_t kTrialUs = 30000000;
constexpr uint64_t kUntilSaidUs = 300000;  // for the answer to leave the wire

bool refuse(Refusal* refusal, const char* reason) {
    Phrase(refusal->reason, sizeof refusal->reason).add(reason);
    return false;
}

bool is_signed(const char* key, const uint8_t* digest, const uint8_t* signature, size_t size) {
    mbedtls_pk_context context;
    mbedtls_pk_init(&context);
    // A PEM is told from DER by the 0 at its end, which counts.
    const int parsed = mbedtls_pk_parse_public_key(&context, reinterpret_cast<const uint8_t*>(key), strlen(key) + 1);
    const bool is_good = parsed == 0 && mbedtls_pk_can_do(&context, MBEDTLS_PK_ECDSA) != 0 &&
                         mbedtls_pk_verify(&context, MBEDTLS_MD_SHA256, digest, kDigestSize, signature, size) == 0;
    mbedtls_pk_free(&context);
    return is_good;
}

}  // namespace

void Ota::begin(const Credentials& credentials, uint64_t now_us) {
    credentials_ = &credentials;
    slot_ = {this, kThisChip.image_id, verify, open, write, finish, abort, permits_older};
    begun_us_ = now_us;
    esp_ota_img_states_t state = ESP_OTA_IMG_UNDEFINED;
    is_on_trial_ = esp_ota_get_state_partition(esp_ota_get_running_partition(), &state) == ESP_OK &&
                   state == ESP_OTA_IMG_PENDING_VERIFY;
}

void Ota::turn(const Machine& machine, uint64_t now_us) {
    // Whom nobody has heard, nobody has moved.
    if (is_on_trial_ && !is_said_ && now_us >= begun_us_ + kTrialUs) {
        is_on_trial_ = false;
        esp_ota_mark_app_invalid_rollback_and_reboot();  // returns where there is no other: then this one goes on
    }
    if (!machine.keeps_still()) return;
    if (is_on_trial_ && is_said_) {
        esp_ota_mark_app_valid_cancel_rollback();  // where it fails, the next start is of the firmware before
        is_on_trial_ = false;
    }
    if (!is_ready_ || machine.is_enabled()) return;
    if (restart_us_ == 0) restart_us_ = now_us + kUntilSaidUs;
    if (now_us >= restart_us_) esp_restart();
}

bool Ota::verify(void* self, const uint8_t* digest, const uint8_t* signature, size_t size, Refusal* refusal) {
    const char* key = static_cast<Ota*>(self)->credentials_->update_key;
    if (key[0] == 0) return refuse(refusal, "it has no key for updates: provision --update-key over its cable");
    if (is_signed(key, digest, signature, size)) return true;
    return refuse(refusal, "its signature is not by the key that this device was provisioned with");
}

bool Ota::permits_older(void* self, const uint8_t* digest, uint32_t boot_id, const uint8_t* signature, size_t size) {
    const char* key = static_cast<Ota*>(self)->credentials_->update_key;
    uint8_t boot[sizeof boot_id], leave[kDigestSize];
    store_u32(boot, boot_id);
    mbedtls_sha256_context hash;
    mbedtls_sha256_init(&hash);
    mbedtls_sha256_starts(&hash, 0);
    mbedtls_sha256_update(&hash, digest, kDigestSize);
    mbedtls_sha256_update(&hash, reinterpret_cast<const uint8_t*>("older"), 5);  // standard: PROTOCOL.md
    mbedtls_sha256_update(&hash, boot, sizeof boot);
    mbedtls_sha256_finish(&hash, leave);
    mbedtls_sha256_free(&hash);
    return key[0] != 0 && is_signed(key, leave, signature, size);
}

bool Ota::open(void* self, uint32_t size, Refusal* refusal) {
    Ota& ota = *static_cast<Ota*>(self);
    if (ota.is_on_trial_) return refuse(refusal, "the firmware that runs is on trial itself: wait for its status");
    ota.partition_ = esp_ota_get_next_update_partition(nullptr);
    if (ota.partition_ == nullptr) return refuse(refusal, "its flash has no second slot: flash it once over its cable");
    if (size > ota.partition_->size) {
        Phrase(refusal->reason, sizeof refusal->reason)
            .add("it has ")
            .add(size)
            .add(" bytes, the slot ")
            .add(ota.partition_->size);
        return false;
    }
    // Each sector is erased when it is written: the whole slot at once would stall the slot's task for seconds.
    if (esp_ota_begin(ota.partition_, OTA_WITH_SEQUENTIAL_WRITES, &ota.handle_) != ESP_OK)
        return refuse(refusal, "the flash memory cannot be written");
    mbedtls_sha256_init(&ota.hash_);
    mbedtls_sha256_starts(&ota.hash_, 0);
    return true;
}

bool Ota::write(void* self, const uint8_t* bytes, size_t size, Refusal* refusal) {
    Ota& ota = *static_cast<Ota*>(self);
    mbedtls_sha256_update(&ota.hash_, bytes, size);
    if (esp_ota_write(ota.handle_, bytes, size) == ESP_OK) return true;
    return refuse(refusal, "the flash memory cannot be written");
}

bool Ota::finish(void* self, const uint8_t* digest, Refusal* refusal) {
    Ota& ota = *static_cast<Ota*>(self);
    uint8_t found[kDigestSize];
    mbedtls_sha256_finish(&ota.hash_, found);
    mbedtls_sha256_free(&ota.hash_);
    if (memcmp(found, digest, kDigestSize) != 0) {
        esp_ota_abort(ota.handle_);
        return refuse(refusal, "its checksum is not that of what was signed: it was damaged on its way");
    }
    if (esp_ota_end(ota.handle_) != ESP_OK) return refuse(refusal, "it is damaged: ESP-IDF finds no image in it");
    if (esp_ota_set_boot_partition(ota.partition_) != ESP_OK)
        return refuse(refusal, "the flash memory cannot be written");
    ota.is_ready_ = true;
    return true;
}

void Ota::abort(void* self) {
    Ota& ota = *static_cast<Ota*>(self);
    mbedtls_sha256_free(&ota.hash_);
    esp_ota_abort(ota.handle_);
}

}  // namespace gemelo
