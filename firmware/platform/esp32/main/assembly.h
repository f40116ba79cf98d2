// A message that arrives in pieces, put together; one that is too long or has a hole is nothing.
#pragma once

#include <stddef.h>
#include <stdint.h>
#include <string.h>

namespace gemelo {

template <size_t kCapacity>
class Assembly {
  public:
    // True with the last piece. `offset` is this piece's place in a message of `total` bytes.
    bool add(const void* bytes, size_t size, size_t offset, size_t total) {
        if (offset == 0) received_ = 0, is_whole_ = total <= kCapacity;
        is_whole_ = is_whole_ && offset == received_ && size <= total - offset && total <= kCapacity;
        if (is_whole_ && size != 0) memcpy(bytes_ + offset, bytes, size);
        received_ = offset + size;
        return received_ >= total;
    }
    const uint8_t* bytes() const { return bytes_; }
    size_t size() const { return is_whole_ ? received_ : 0; }

  private:
    uint8_t bytes_[kCapacity];
    size_t received_ = 0;
    bool is_whole_ = false;
};

}  // namespace gemelo
