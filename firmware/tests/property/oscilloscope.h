// STEP and DIR as the drivers see them, tick by tick: counts pulses and checks their timing against the data sheets.
#pragma once

#include <vector>

#include "bench.h"
#include "findings.h"
#include "stepper.h"

namespace property {

struct Rise {
    uint64_t tick;
    int64_t count;  // after it
};

class Oscilloscope {
  public:
    Oscilloscope(const Bench& bench, const gemelo::Pins& pins, Findings& findings);

    // The levels after a tick.
    void see(const gemelo::Pins& pins) {
        if (pins.step != before_.step || pins.dir != before_.dir) change(pins);
        ++tick_;
    }
    uint64_t tick() const { return tick_; }
    // Pulses forwards less pulses backwards.
    int64_t count(uint8_t joint) const { return line_[joint].count; }
    uint64_t pulses() const { return pulses_; }
    // Since forget(): when STEP rose, and whether DIR turned.
    const std::vector<Rise>& rises(uint8_t joint) const { return line_[joint].rises; }
    bool has_turned(uint8_t joint) const { return line_[joint].has_turned; }
    void forget();

  private:
    struct Line {
        Driver driver;
        bool is_inverted;
        bool has_turned = false;
        int64_t count = 0;
        uint64_t rose = 0, fell = 0, turned = 0;  // ticks, as of 1; 0 for never
        std::vector<Rise> rises;
    };
    void change(const gemelo::Pins& pins);
    void rise(Line& line, bool dir);
    // Whether `from` was at least so long ago; any time at least one tick.
    bool is_past(uint64_t from, uint32_t ns) const;

    Findings& findings_;
    double tick_ns_;
    uint64_t tick_ = 1;
    uint64_t pulses_ = 0;
    gemelo::Pins before_;
    std::vector<Line> line_;
};

}  // namespace property
