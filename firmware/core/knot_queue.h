// The knots that have not been reached yet: a ring of fixed size.
#pragma once

#include <stdint.h>

#include "config.h"

namespace gemelo {

// A point of the path: where the joints are and how fast, `dt_us` after the knot before it.
struct Knot {
    int32_t position[kMaxJoints];  // Q24.8 steps
    int32_t velocity[kMaxJoints];  // Q24.8 steps/s
    uint32_t dt_us;
    uint32_t ceiling_q26;  // the square of the time scale that this knot may be passed with
};

class KnotQueue {
  public:
    void begin(uint16_t capacity) {
        capacity_ = capacity;
        clear();
    }
    void clear() { first_ = size_ = 0; }
    uint16_t size() const { return size_; }
    uint16_t space() const { return static_cast<uint16_t>(capacity_ - size_); }
    bool is_empty() const { return size_ == 0; }

    // The i-th knot, the oldest being 0.
    Knot& operator[](uint16_t i) { return ring_[(first_ + i) % kMaxKnots]; }
    const Knot& operator[](uint16_t i) const { return ring_[(first_ + i) % kMaxKnots]; }
    const Knot& newest() const { return (*this)[static_cast<uint16_t>(size_ - 1)]; }

    // Keeps the oldest ones.
    void truncate(uint16_t size) { size_ = size; }
    // Whose fields are what they were.
    Knot& push() { return ring_[(first_ + size_++) % kMaxKnots]; }
    void pop() {
        first_ = static_cast<uint16_t>((first_ + 1) % kMaxKnots);
        --size_;
    }

  private:
    Knot ring_[kMaxKnots];
    uint16_t capacity_ = 0;
    uint16_t first_ = 0;
    uint16_t size_ = 0;
};

}  // namespace gemelo
