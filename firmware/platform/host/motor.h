// A stepper and its load: which of the pulses the shaft really follows.
//
// The pulses turn the magnetic field; the rotor hangs on it as on a spring of torque T sin(load angle), 360 degrees of
// which are four full steps (Acarnley, "Stepping Motors: a guide to theory and practice", IET 2002: static torque and
// pull-out). T is the pull-out torque at the field's speed, so a rotor whose load asks for more falls back by whole
// cycles of four full steps: steps are lost, and nobody tells the counter. The motion is the synchronous machine's
// swing equation (Kundur, "Power System Stability and Control"):
//     J dw/dt = T(speed) (sin(load angle) + 2 zeta x / (1 + x^2)) - friction
// with x = slip speed / natural frequency; the second term is the damping of small oscillations, bounded for large
// ones as an induction machine's torque is (Kloss). Integrated tick by tick, semi-implicitly, which is stable while the
// natural frequency is well below the tick's; a lighter rotor is taken as heavy as the tick can follow.
#pragma once

#include <stdint.h>

namespace gemelo {

constexpr uint8_t kMaxCurve = 16;

struct MotorConfig {
    int32_t pulses_per_turn = 400;
    int32_t full_steps_per_turn = 200;
    uint8_t points = 0;        // of the curve; 0: an ideal motor, which follows every pulse at once
    double speed[kMaxCurve];   // [pulses/s] rising
    double torque[kMaxCurve];  // [N m] at these speeds; 0 beyond the last
    double inertia;            // [kg m^2] of rotor and load, at the motor shaft
    double friction;           // [N m] at the motor shaft, dry
};

class Motor {
  public:
    // The shaft stands at `shaft` [pulses].
    void begin(const MotorConfig& config, double tick_s, int32_t shaft);

    void pulse(int direction);
    // After every tick; nothing happens in it once is_settled().
    void tick() {
        if (!is_settled_) move();
    }
    bool is_settled() const { return is_settled_; }

    // Held fast, or without current: pulses do not turn it. Let go, it falls to the field's nearest cycle.
    void hold(bool is_held);
    // The coupling gives way by so many pulses.
    void slip(int32_t pulses) { slipped_ += pulses; }

    // True position [pulses], to the nearest one.
    int32_t shaft() const;

  private:
    void move();
    void settle();
    double torque_at(double speed) const;
    bool is_ideal() const { return config_.points == 0; }

    MotorConfig config_;
    double tick_s_ = 0;
    double cycle_ = 8;         // [pulses] of four full steps
    double acceleration_ = 0;  // [pulses/s^2] per N m
    double natural_ = 1;       // [rad/s] electrical, of small oscillations
    double field_ = 0;         // [pulses]
    double rotor_ = 0;         // [pulses]
    double velocity_ = 0;      // [pulses/s] of the rotor
    double rate_ = 0;          // [pulses/s] of the field, smoothed
    int32_t slipped_ = 0;
    bool is_held_ = false;
    bool is_settled_ = true;
};

}  // namespace gemelo
