// A random play: streams, and all that people, links and failing parts do to them.
#pragma once

#include "gateway.h"

namespace property {

struct PlaySpec {
    uint64_t seed;
    uint32_t seconds = 20;
    bool repeats = false;  // everything is said twice
    uint64_t begin_us = 0;
};

class Play {
  public:
    Play(const PlaySpec& spec, Findings& findings);

    // Until its time is over and the last stream has come to its end.
    void run();
    uint64_t pulses() const { return stand_.scope->pulses(); }
    Stand& stand() { return stand_; }

  private:
    void step();
    void disturb();
    void steer();
    void hang();
    void press_estop();
    void run_into_a_switch();
    void stop_dead();
    void look_after_streams();
    void look_after_place();
    void expect_true_place();
    void settle();
    void expect_target();

    PlaySpec spec_;
    Dice dice_;
    Findings& findings_;
    Stand stand_;
    Gateway gateway_;
    uint32_t fed_again_ms_ = 0, beats_again_ms_ = 0;
    uint32_t ms_ = 0;
    bool is_stopping_ = false;
    bool is_homing_ = false;
};

}  // namespace property
