// The joints' positions in memory that survives a warm reset: no flash is written for them.
#pragma once

#include <stdint.h>

#include "config.h"

namespace gemelo {

struct Pose {
    int32_t steps[kMaxJoints];
    uint32_t config_crc32;  // the steps mean nothing under another configuration
    // No bools: after power-on the memory is anything.
    uint8_t is_referenced;
    uint8_t is_moving;  // the steps are as of the motion's begin

    bool operator==(const Pose& other) const;
};

// Lies in RTC memory, uninitialised; only seal() makes it valid.
class PoseMemory {
  public:
    void keep(const Pose& pose);
    bool is_valid() const { return crc_ == seal(); }
    const Pose& pose() const { return pose_; }

  private:
    uint32_t seal() const;

    Pose pose_;
    uint32_t crc_;
};

// How the device starts.
struct Awakening {
    int32_t steps[kMaxJoints];
    bool is_referenced;
    bool was_moving;
};

// `is_warm`: the chip was not without power, and its supply did not fail.
Awakening wake(const PoseMemory& memory, bool is_warm, uint32_t config_crc32);

}  // namespace gemelo
