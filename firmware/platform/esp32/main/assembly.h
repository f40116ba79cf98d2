// A message that arrives in pieces, put together where it is to lie; one without room, or with a hole, is nothing.
#pragma once

#include <stddef.h>
#include <stdint.h>
#include <string.h>

namespace gemelo {

class Assembly {
  public:
    // A message of `total` bytes begins, for which there is room at `place`; nullptr: there is none.
    void begin(uint8_t* place, size_t total) {
        place_ = place;
        total_ = total;
        received_ = 0;
    }
    // What has arrived is no part of any message.
    void forget() { place_ = nullptr; }
    // True with the last piece, which lies at `offset` in the message.
    bool add(const void* bytes, size_t size, size_t offset) {
        if (offset != received_ || offset > total_ || size > total_ - offset) forget();
        if (place_ != nullptr && size != 0) memcpy(place_ + offset, bytes, size);
        received_ = offset + size;
        return received_ >= total_;
    }
    bool is_whole() const { return place_ != nullptr && received_ == total_; }
    const uint8_t* bytes() const { return place_; }
    size_t size() const { return is_whole() ? total_ : 0; }

  private:
    uint8_t* place_ = nullptr;
    size_t total_ = 0;
    size_t received_ = 0;
};

}  // namespace gemelo
