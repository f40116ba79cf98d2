// A new firmware over the wire: UPDATE in PROTOCOL.md. Its pieces are taken in their order; the platform checks its
// signature, writes it into the slot that does not run, and has it started next.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "frame.h"
#include "refusal.h"

namespace gemelo {

constexpr size_t kDigestSize = 32;        // [bytes] standard: SHA-256
constexpr size_t kMaxSignature = 72;      // [bytes] standard: ECDSA with P-256, DER
constexpr size_t kMaxUpdatePiece = 4096;  // [bytes] standard: one sector of the flash
constexpr size_t kImageHeaderSize = 24;   // [bytes] standard: esp_image_header_t of ESP-IDF
constexpr uint8_t kImageMagic = 0xE9;     // standard: its first byte
constexpr size_t kImageChipOffset = 12;   // standard: of the chip's id, u16
// Standard: of esp_app_desc_t's version, behind that header, the first segment's (8 bytes) and 16 bytes of its own.
constexpr size_t kImageVersionOffset = 48;
constexpr size_t kImageVersionSize = 32;   // standard: the same
constexpr uint16_t kVirtualChip = 0xFFFE;  // chosen: of a virtual device; ESP-IDF's invalid id is 0xFFFF

enum class UpdateStep : uint8_t { Begin = 1, Data, End, Abort };

// What the platform does, while nothing moves and the drivers are off; false with a reason.
struct FirmwareSlot {
    void* context = nullptr;
    uint16_t chip_id = 0;  // of images for this chip
    bool (*verify)(void* context, const uint8_t* digest, const uint8_t* signature, size_t size,
                   Refusal* refusal) = nullptr;
    bool (*begin)(void* context, uint32_t size, Refusal* refusal) = nullptr;
    bool (*write)(void* context, const uint8_t* bytes, size_t size, Refusal* refusal) = nullptr;
    // Compares all that was written with `digest`, and starts it a little later.
    bool (*finish)(void* context, const uint8_t* digest, Refusal* refusal) = nullptr;
    void (*abort)(void* context) = nullptr;
    // True if the signature lets this boot take an image with this digest though its version is older than what runs.
    bool (*permits_older)(void* context, const uint8_t* digest, uint32_t boot_id, const uint8_t* signature,
                          size_t size) = nullptr;
};

struct UpdateAnswer {
    uint32_t session = 0;
    uint32_t next = 0;  // the first byte that is wanted
    bool is_accepted = false;
    bool is_receiving = false;  // a transfer of this session goes on
    Refusal refusal;
};

class UpdateReceiver {
  public:
    // `slot` must stay; nullptr: nothing can be updated.
    void begin(const FirmwareSlot* slot) { slot_ = slot; }
    // False for a frame that is none. `is_free`: nothing moves and the drivers are off.
    bool receive(const Frame& frame, uint32_t boot_id, bool is_retained, bool is_free, UpdateAnswer* answer);

  private:
    enum class State : uint8_t { Idle, Receiving, Ready };

    bool carry_out(const Frame& frame, Refusal* refusal);
    bool begin_transfer(const Frame& frame, const uint8_t* content, size_t size, Refusal* refusal);
    bool is_permitted(const Frame& frame, const uint8_t* digest, const uint8_t* signature, size_t size,
                      Refusal* refusal);
    bool take(uint32_t session, uint32_t offset, const uint8_t* bytes, size_t size, Refusal* refusal);
    bool fits(uint32_t offset, size_t size, Refusal* refusal) const;
    bool is_for_this_chip(const uint8_t* bytes, size_t size, Refusal* refusal) const;
    bool is_new_enough(const uint8_t* bytes, Refusal* refusal) const;
    bool end_transfer(uint32_t session, Refusal* refusal);
    bool is_current(uint32_t session, Refusal* refusal) const;
    void give_up();

    const FirmwareSlot* slot_ = nullptr;
    State state_ = State::Idle;
    uint32_t session_ = 0;
    uint32_t size_ = 0;
    uint32_t received_ = 0;
    bool may_be_older_ = false;  // than what runs
    uint8_t digest_[kDigestSize];
};

}  // namespace gemelo
