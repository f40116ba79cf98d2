// Every pin that a configuration names, with what it wants of it.
#pragma once

#include <stdint.h>

#include "config.h"

namespace gemelo {

enum class Use : uint8_t { Output, Input, Analog };

struct PinUse {
    uint8_t pin;
    Use use;
    Pull pull;
    const char* part;  // of the configuration, empty for the device
};

class PinUses {
  public:
    explicit PinUses(const DeviceConfig& config);
    const PinUse* begin() const { return use_; }
    const PinUse* end() const { return use_ + size_; }

  private:
    void add(uint8_t pin, Use use, Pull pull, const char* part);

    static constexpr uint8_t kMost = 2 * kMaxJoints + kMaxInputs + kMaxOutputs + 2 * kMaxSensors + 2;
    PinUse use_[kMost];
    uint8_t size_ = 0;
};

}  // namespace gemelo
