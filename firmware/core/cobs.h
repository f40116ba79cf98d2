// Consistent overhead byte stuffing (Cheshire and Baker, IEEE/ACM Transactions on Networking 7(2), 1999): packets
// between two 0x00 that hold none.
#pragma once

#include <stddef.h>
#include <stdint.h>

namespace gemelo {

// The most that a packet of `size` bytes takes, its two 0x00 included.
constexpr size_t cobs_bound(size_t size) { return size + size / 254 + 3; }

// Writes one packet, byte by byte, into a place of at least cobs_bound().
class CobsWriter {
  public:
    explicit CobsWriter(uint8_t* out) : out_(out) {}
    void put(const uint8_t* bytes, size_t size);
    // Returns the packet's length.
    size_t finish();

  private:
    void close();

    uint8_t* out_;
    size_t size_ = 2;  // a 0x00, and the first block's code
    size_t code_at_ = 1;
};

// Reads one packet, byte by byte.
class CobsReader {
  public:
    void begin() { *this = CobsReader{}; }
    // The next byte of a packet, which is not 0x00; true if it stands for a byte, which then is in `out`.
    bool put(uint8_t byte, uint8_t* out);
    // The packet may end here: no block is cut off.
    bool is_whole() const { return left_ == 0; }

  private:
    uint8_t left_ = 0;  // bytes until the next code
    bool owes_zero_ = false;
};

}  // namespace gemelo
