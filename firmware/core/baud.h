// The baud rate of whoever speaks on the line: the one that was set, unless only another one can be understood.
#pragma once

#include <stddef.h>
#include <stdint.h>

namespace gemelo {

constexpr uint32_t kDefaultBaud = 921600;  // standard: PROTOCOL.md
constexpr uint32_t kLeastBaud = 9600;      // chosen: the slowest that terminals still have
constexpr uint32_t kMostBaud = 3000000;    // standard: the fastest of common USB bridges (FT232R, CP2102N)

// A decimal number of bauds; 0 for a text that is none, or out of bounds.
uint32_t read_baud(const char* text);

class BaudSearch {
  public:
    // The rate that was set, or 0 for none.
    explicit BaudSearch(uint32_t set_rate = 0);

    uint32_t rate() const { return rates_[at_]; }
    // `bytes` have come; `understood` frames and lines were made of what came since the start. True: the rate is
    // another one from now on.
    bool hear(size_t bytes, uint32_t understood, uint64_t now_us);

  private:
    static constexpr uint8_t kMostRates = 5;  // follows from kUsual: those, and the one that was set

    uint32_t rates_[kMostRates] = {};
    uint8_t count_ = 0;
    uint8_t at_ = 0;
    uint32_t understood_ = 0;
    size_t strange_ = 0;        // bytes since something was understood
    uint64_t settled_us_ = 0;   // when the rate was changed, or something was understood
    bool is_believed_ = false;  // something was understood at this rate
};

}  // namespace gemelo
