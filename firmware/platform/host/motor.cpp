#include "motor.h"

#include <math.h>

namespace gemelo {
namespace {

constexpr double kTau = 6.283185307179586;
constexpr double kDamping = 0.3;  // of critical, for small oscillations: the upper end of what drivers and loads give
constexpr double kSmoothing = 0.002;  // [s] over which pulses count as a speed
constexpr double kStiffest = 0.5;     // [rad] of the natural oscillation in one tick
constexpr double kWeakest = 1e-9;     // [N m] a motor without torque does not divide by zero
constexpr double kStill = 0.01;       // [pulses/s], and share of the torque: no motion that anyone could see

}  // namespace

void Motor::begin(const MotorConfig& config, double tick_s, int32_t shaft) {
    config_ = config;
    tick_s_ = tick_s;
    cycle_ = 4.0 * config.pulses_per_turn / config.full_steps_per_turn;
    field_ = rotor_ = shaft;
    velocity_ = rate_ = 0;
    slipped_ = 0;
    is_held_ = false;
    is_settled_ = true;
    if (is_ideal()) return;
    acceleration_ = config.pulses_per_turn / kTau / config.inertia;
    natural_ = sqrt(fmax(torque_at(0), kWeakest) * acceleration_ * kTau / cycle_);
    const double fastest = kStiffest / tick_s;
    if (natural_ > fastest) {
        acceleration_ *= (fastest / natural_) * (fastest / natural_);
        natural_ = fastest;
    }
}

void Motor::pulse(int direction) {
    field_ += direction;
    if (is_ideal()) {
        if (!is_held_) rotor_ += direction;
        return;
    }
    rate_ += direction / kSmoothing;
    is_settled_ = is_held_;
}

void Motor::hold(bool is_held) {
    if (is_held_ == is_held) return;
    is_held_ = is_held;
    velocity_ = rate_ = 0;
    is_settled_ = is_held || is_ideal();
    if (!is_held && is_ideal()) rotor_ = field_ - cycle_ * round((field_ - rotor_) / cycle_);
}

void Motor::move() {
    rate_ -= rate_ * (tick_s_ / kSmoothing);
    const double torque = torque_at(fabs(rate_));
    const double pull = sin((field_ - rotor_) * kTau / cycle_);
    const double slip = (rate_ - velocity_) * kTau / cycle_ / natural_;
    const double drive = torque * (pull + 2 * kDamping * slip / (1 + slip * slip));
    const double free = velocity_ + drive * acceleration_ * tick_s_;
    // Dry friction brakes, but never turns the motion round.
    const double drag = config_.friction * acceleration_ * tick_s_;
    velocity_ = fabs(free) <= drag ? 0 : free - copysign(drag, free);
    rotor_ += velocity_ * tick_s_;
    if (fabs(velocity_) < kStill && fabs(rate_) < kStill) settle();
}

// What friction holds stays where it is, but not on top of the hill between two cycles; what nothing holds ends where
// the field pulls no more.
void Motor::settle() {
    const double behind = field_ - rotor_;
    const double angle = behind * kTau / cycle_;
    const double torque = torque_at(0);
    const double pull = torque * fabs(sin(angle));
    if (pull > config_.friction + kStill * torque) return;
    const bool falls = cos(angle) < 0 && torque > config_.friction;
    if (falls || pull > config_.friction) rotor_ = field_ - cycle_ * round(behind / cycle_);
    velocity_ = rate_ = 0;
    is_settled_ = true;
}

double Motor::torque_at(double speed) const {
    const double* speeds = config_.speed;
    if (speed <= speeds[0]) return config_.torque[0];
    for (uint8_t i = 1; i < config_.points; ++i) {
        if (speed > speeds[i]) continue;
        const double share = (speed - speeds[i - 1]) / (speeds[i] - speeds[i - 1]);
        return config_.torque[i - 1] + share * (config_.torque[i] - config_.torque[i - 1]);
    }
    return 0;
}

int32_t Motor::shaft() const { return static_cast<int32_t>(lround(rotor_)) + slipped_; }

}  // namespace gemelo
