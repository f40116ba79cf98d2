#include "play.h"

#include <algorithm>
#include <cstdlib>

using namespace gemelo;

namespace property {
namespace {

constexpr uint32_t kBoot = 0xB0070001;
constexpr uint32_t kPatienceMs = 400000;  // a path of long time steps, slowly

Bench bench_of(uint64_t seed) {
    Dice dice(seed);
    return random_bench(dice);
}

}  // namespace

Play::Play(const PlaySpec& spec, Findings& findings)
    : spec_(spec),
      dice_(spec.seed ^ 0x5EED),
      findings_(findings),
      stand_(bench_of(spec.seed), findings, spec.begin_us, kBoot, true, spec.seed),
      gateway_(stand_, kBoot, spec.seed, spec.repeats) {}

void Play::run() {
    while (ms_ < spec_.seconds * 1000) step();
    settle();
}

void Play::step() {
    findings_.context = "seed " + std::to_string(spec_.seed) + " at " + std::to_string(ms_) + " ms";
    stand_.run_to_a_tick();
    disturb();
    look_after_place();
    look_after_streams();
    gateway_.work();
    stand_.run_to_slot_end();
    ++ms_;
}

void Play::disturb() {
    steer();
    if (dice_.chance(0.0003)) beats_again_ms_ = ms_ + static_cast<uint32_t>(dice_.between(300, 900));
    if (dice_.chance(0.0004)) fed_again_ms_ = ms_ + static_cast<uint32_t>(dice_.between(100, 2500));
    if (dice_.chance(0.0004) && gateway_.has_stream()) gateway_.end_stream();
    if (dice_.chance(0.00003)) hang();
    if (dice_.chance(0.00006)) press_estop();
    if (dice_.chance(0.00003)) run_into_a_switch();
    gateway_.is_beating = ms_ >= beats_again_ms_;
    gateway_.is_feeding = ms_ >= fed_again_ms_;
}

// What people do.
void Play::steer() {
    if (stand_.mode() == Mode::Homing && !dice_.chance(0.1)) return;
    if (dice_.chance(0.0008)) gateway_.command(Command::Hold);
    if (stand_.mode() == Mode::Hold && !is_stopping_ && dice_.chance(0.004)) gateway_.command(Command::Resume);
    if (dice_.chance(0.0005)) gateway_.command(Command::Speed, static_cast<uint16_t>(dice_.between(1, 3) * 333));
    if (dice_.chance(0.0001)) gateway_.command(Command::Speed, static_cast<uint16_t>(dice_.between(0, 1000)));
    if (!dice_.chance(0.0002)) return;
    gateway_.command(Command::Stop);
    is_stopping_ = gateway_.has_stream();
    gateway_.forget_stream();
}

void Play::hang() {
    stand_.hang(6);
    stop_dead();
}

// From the next tick on the input is active; at most in that tick a pulse may still begin.
void Play::press_estop() {
    stand_.press(0, true);
    stand_.run_a_tick();
    const uint64_t pulses = stand_.scope->pulses();
    stop_dead();
    if (stand_.scope->pulses() != pulses)
        findings_.add(Property::EStop, stand_.scope->pulses() - pulses, " pulses later than a tick after the e-stop");
    if (stand_.mode() != Mode::EStop || stand_.machine.is_enabled() || stand_.machine.is_referenced())
        findings_.add(Property::EStop, "the device is in mode ", static_cast<int>(stand_.mode()),
                      ", its drivers on or its place believed, after the e-stop");
    if (gateway_.command(Command::Reset) != Code::EstopPressed)
        findings_.add(Property::EStop, "RESET does not say ESTOP_PRESSED while it is");
    if (dice_.chance(0.5)) stand_.run_uninspected(static_cast<uint32_t>(dice_.between(1, 200)));
    stand_.press(0, false);
}

// Three readings, and no pulse after them.
void Play::run_into_a_switch() {
    stand_.press(1, true);
    for (int i = 0; i < 3; ++i) stand_.run_a_tick();
    const uint64_t pulses = stand_.scope->pulses();
    stop_dead();
    const bool is_stopped = stand_.mode() == Mode::Fault || stand_.mode() == Mode::EStop;
    if (!is_stopped || stand_.scope->pulses() != pulses)
        findings_.add(Property::EStop, "a limit switch does not stop the arm");
    stand_.press(1, false);
}

void Play::stop_dead() {
    stand_.run_uninspected(6);
    if (stand_.mode() != Mode::Fault && stand_.mode() != Mode::EStop) return;
    stand_.inspector->start_anew(*stand_.scope);
    gateway_.forget_stream();
    is_stopping_ = is_homing_ = false;
}

// A person who comes by: resets, arms, and homes the arm, or tells it where it truly is.
void Play::look_after_place() {
    expect_true_place();
    if (!dice_.chance(0.01)) return;
    if (stand_.mode() == Mode::Fault || stand_.mode() == Mode::EStop) gateway_.command(Command::Reset);
    if (stand_.mode() != Mode::Unreferenced) return;
    gateway_.command(Command::Arm);
    if (dice_.chance(0.7) && gateway_.command(Command::Home) == Code::Ok) {
        is_homing_ = true;
        return;
    }
    std::vector<int32_t> place;
    for (uint8_t j = 0; j < stand_.bench.config.joints; ++j) {
        const JointConfig& joint = stand_.bench.config.joint[j];
        const int64_t lowest = joint.lower_q8 / 256, highest = joint.upper_q8 / 256;  // whole steps within
        place.push_back(static_cast<int32_t>(std::clamp(stand_.shaft(j), lowest, highest) * 256));
    }
    if (gateway_.command(Command::Reference, 0, place) == Code::Ok) stand_.inspector->start_anew(*stand_.scope);
}

// The switch closes at a whole step, and counts three ticks later: not a step away at the slow speed.
void Play::expect_true_place() {
    if (!is_homing_ || stand_.mode() == Mode::Homing) return;
    is_homing_ = false;
    for (uint8_t j = 0; j < stand_.bench.config.joints; ++j) {
        const int64_t away = stand_.machine.stepper().executed(j) - stand_.shaft(j);
        if (((stand_.homed >> j) & 1) != 0 && std::abs(away) > 1)
            findings_.add(Property::EmittedSteps, "joint ", int{j}, " is ", away, " steps off after homing");
    }
    stand_.homed = 0;
}

void Play::look_after_streams() {
    if (stand_.mode() != Mode::Idle) return;
    is_stopping_ = false;
    if (gateway_.is_done()) {
        expect_target();
        gateway_.forget_stream();
    }
    if (!gateway_.has_stream() && ms_ < spec_.seconds * 1000 && dice_.chance(0.01)) gateway_.open_stream();
}

void Play::expect_target() {
    for (uint8_t j = 0; j < stand_.bench.config.joints; ++j) {
        const int32_t wanted = (gateway_.target()[j] + 128) >> 8, made = stand_.machine.stepper().executed(j);
        if (made != wanted)
            findings_.add(Property::EmittedSteps, "joint ", int{j}, " ends at ", made, " instead of ", wanted);
    }
}

void Play::settle() {
    beats_again_ms_ = fed_again_ms_ = 0;
    gateway_.is_beating = gateway_.is_feeding = true;
    gateway_.command(Command::Speed, 1000);
    for (uint32_t i = 0; i < kPatienceMs; ++i) {
        if (gateway_.has_stream()) gateway_.end_stream();
        if (stand_.mode() == Mode::Hold && !is_stopping_) gateway_.command(Command::Resume);
        look_after_place();
        look_after_streams();
        if (stand_.mode() == Mode::Idle && !gateway_.has_stream()) return;
        gateway_.work();
        stand_.run_slot();
        ++ms_;
    }
    findings_.add(Property::Answers, "the last stream has not ended");
}

}  // namespace property
