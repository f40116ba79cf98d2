#include "oscilloscope.h"

using namespace gemelo;

namespace property {

Oscilloscope::Oscilloscope(const Bench& bench, const Pins& pins, Findings& findings)
    : findings_(findings), tick_ns_(1e9 / bench.config.tick_hz), before_(pins) {
    for (uint8_t j = 0; j < bench.config.joints; ++j)
        line_.push_back(Line{bench.drivers[j], bench.config.joint[j].is_inverted != 0, false, 0, 0, 0, 0, {}});
}

void Oscilloscope::forget() {
    for (Line& line : line_) {
        line.rises.clear();
        line.has_turned = false;
    }
}

bool Oscilloscope::is_past(uint64_t from, uint32_t ns) const {
    if (from == 0) return true;
    const uint64_t ago = tick_ - from;
    return ago >= 1 && static_cast<double>(ago) * tick_ns_ >= ns;
}

void Oscilloscope::change(const Pins& pins) {
    for (size_t j = 0; j < line_.size(); ++j) {
        Line& line = line_[j];
        const uint32_t bit = 1u << j;
        if (((pins.dir ^ before_.dir) & bit) != 0) {
            line.turned = tick_;
            line.has_turned = true;
        }
        if (((pins.step ^ before_.step) & bit) == 0) continue;
        if ((pins.step & bit) != 0) {
            rise(line, (pins.dir & bit) != 0);
        } else {
            if (!is_past(line.rose, line.driver.step_high_ns))
                findings_.add(Property::PulseTiming, "STEP of joint ", j, " is high for less than the ",
                              line.driver.name, " asks");
            line.fell = tick_;
        }
    }
    before_ = pins;
}

void Oscilloscope::rise(Line& line, bool dir) {
    if (!is_past(line.fell, line.driver.step_low_ns))
        findings_.add(Property::PulseTiming, "STEP is low for less than the ", line.driver.name, " asks");
    if (!is_past(line.turned, line.driver.dir_setup_ns))
        findings_.add(Property::PulseTiming, "DIR has been still for ", tick_ - line.turned, " ticks only, the ",
                      line.driver.name, " asks for ", line.driver.dir_setup_ns, " ns");
    line.rose = tick_;
    line.count += dir != line.is_inverted ? 1 : -1;
    line.rises.push_back(Rise{tick_, line.count});
    ++pulses_;
}

}  // namespace property
