// A virtual hobby servo: its horn follows the pulse at a speed of its own, and an object between the jaws stops it.
#pragma once

#include <stdint.h>

namespace gemelo {

// Places are pulse lengths in us: where the horn stands under that pulse.
struct HornConfig {
    double speed_us_s;
    double open_us;     // where the jaws are open, and where the horn is at first
    double closed_us;   // where they touch
    double open_value;  // that the sensor reads there, in its unit
    double closed_value;
    uint8_t sensor;  // kNone: nothing reads the jaws
};

class Horn {
  public:
    void begin(const HornConfig& config);
    bool is_there() const { return config_.speed_us_s > 0; }
    // Lets `seconds` pass under this pulse; 0 us: the horn is free and stays.
    void advance(uint32_t pulse_us, double seconds);
    // From now on the jaws close as far as `stop_us` only.
    void put_object(double stop_us);
    void take_object() { has_object_ = false; }

    double place_us() const { return place_us_; }
    uint8_t sensor() const { return config_.sensor; }
    double value() const;

  private:
    HornConfig config_{};
    double place_us_ = 0;
    double stop_us_ = 0;
    bool has_object_ = false;
};

}  // namespace gemelo
