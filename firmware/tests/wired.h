// A device wired to switches that its own shafts close, and to an e-stop button; tick by tick, with no other simulator.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstring>
#include <deque>
#include <string>
#include <vector>

#include "bytes.h"
#include "frames.h"
#include "machine.h"
#include "plain_joints.h"

namespace rig {

constexpr uint8_t kButton = 0, kHome1 = 1, kEnd2 = 2, kUpper1 = 3;  // the inputs of wired_joints()

inline gemelo::HomingConfig wired_homing(uint8_t input, int direction, int32_t position) {
    gemelo::HomingConfig homing{};
    homing.input = input;
    homing.direction = static_cast<int8_t>(direction);
    homing.fast_q8 = 2000 * 256;
    homing.slow_q8 = 150 * 256;
    homing.back_off_q8 = 60 * 256;
    homing.position_q8 = position * 256;
    homing.max_travel_q8 = 12000 * 256;
    homing.timeout_ms = 30000;
    return homing;
}

inline gemelo::InputConfig wired_input(const char* name, uint8_t pin, gemelo::InputRole role, uint8_t joint,
                                       bool is_inverted) {
    gemelo::InputConfig input{};
    std::strncpy(input.name, name, sizeof input.name - 1);
    input.pin = pin;
    input.role = role;
    input.joint = joint;
    input.is_inverted = is_inverted;
    return input;
}

// q1 finds home_1 downwards at -5000; q2 finds its upper end upwards at 3000, with an inverted switch on a high pin.
inline gemelo::DeviceConfig wired_joints() {
    using namespace gemelo;
    DeviceConfig config = plain_joints("wired", 8000);
    config.joint[0].homing = wired_homing(kHome1, -1, -5000);
    config.joint[1].homing = wired_homing(kEnd2, 1, 3000);
    config.inputs = 4;
    config.input[kButton] = wired_input("stop_button", 0, InputRole::EStop, kNone, true);
    config.input[kHome1] = wired_input("home_1", 4, InputRole::Home, 0, false);
    config.input[kEnd2] = wired_input("end_2", 34, InputRole::LimitUpper, 1, true);
    config.input[kUpper1] = wired_input("upper_1", 35, InputRole::LimitUpper, 0, false);
    config.outputs = 2;
    std::strncpy(config.output[0].name, "avanzar", gemelo::kNameSize - 1);
    std::strncpy(config.output[1].name, "laser", gemelo::kNameSize - 1);
    config.output[1].at_boot = config.output[1].is_off_at_estop = 1;
    return config;
}

// The same with the places of its switches far away, so that nothing closes by itself.
inline gemelo::DeviceConfig open_field() {
    gemelo::DeviceConfig config = wired_joints();
    config.joint[0].homing.position_q8 = -90000 * 256;
    config.joint[1].homing.position_q8 = 90000 * 256;
    return config;
}

// What a person does to a switch.
enum class Finger { Off, Pressed, HeldOpen };

class Wired {
  public:
    explicit Wired(const gemelo::DeviceConfig& config = wired_joints(), std::vector<int32_t> begin = {0, 0},
                   bool referenced = false, uint64_t begin_us = 0)
        : now_us(begin_us),
          shaft(begin),
          config_(config),
          finger_(gemelo::kMaxInputs, Finger::Off),
          tops_(2),
          before_(2) {
        next_beat_us_ = begin_us;
        machine.begin(config_, gemelo::Identity{kBoot, "power_on"}, gemelo::Sink{this, put});
        pins_ = machine.stepper().pins();
        // The device counts from zero wherever its shafts stand.
        const int32_t steps[gemelo::kMaxJoints] = {};
        machine.start(now_us, steps, referenced);
    }

    void press(uint8_t input, Finger finger = Finger::Pressed) { finger_[input] = finger; }
    // Where the switch of an input closes, and towards which side; the configuration's place for a switch that homes.
    bool is_closed(uint8_t input) const {
        if (finger_[input] != Finger::Off) return finger_[input] == Finger::Pressed;
        for (uint8_t j = 0; j < config_.joints; ++j) {
            const gemelo::HomingConfig& homing = config_.joint[j].homing;
            if (homing.input == input) return homing.direction * (shaft[j] - homing.position_q8 / 256) >= 0;
        }
        return false;
    }

    void tick() {
        gemelo::Stepper& stepper = machine.stepper();
        stepper.tick(levels());
        const gemelo::Pins& pins = stepper.pins();
        for (uint8_t j = 0; j < config_.joints; ++j) {
            const uint32_t bit = 1u << j;
            if ((pins.step & ~pins_.step & bit) == 0) continue;
            shaft[j] += ((pins.dir & bit) != 0) != (config_.joint[j].is_inverted != 0) ? 1 : -1;
            ++pulses;
        }
        pins_ = pins;
        if (++tick_in_slot_ == 1) machine.slot(now_us);
        if (tick_in_slot_ < gemelo::ticks_per_slot(config_)) return;
        tick_in_slot_ = 0;
        now_us += 1000;
        watch();
    }
    void run_ms(uint32_t ms, bool silent = false) {
        for (uint32_t i = 0; i < ms; ++i) {
            if (!silent && now_us >= next_beat_us_) {
                give(build_heartbeat(1, ++beats_));
                next_beat_us_ = now_us + 200000;
            }
            for (uint32_t n = gemelo::ticks_per_slot(config_); n != 0; --n) tick();
        }
    }
    // Until the device has come to this mode; false if it has not within the time.
    bool run_until(gemelo::Mode mode, uint32_t at_most_ms = 60000) {
        for (uint32_t i = 0; i < at_most_ms; ++i) {
            if (machine.mode() == mode) return true;
            run_ms(1);
        }
        return false;
    }

    gemelo::Code command(gemelo::Command command, uint16_t argument = 0, uint8_t index = 0,
                         const std::vector<int32_t>& position = {}) {
        give(build_command(command, ++commands_, position, kNever, kBoot, index, argument));
        return code_;
    }
    gemelo::Code send(const ChunkSpec& chunk) {
        give(build(chunk));
        return chunk_code_;
    }
    gemelo::Code follow(double first, double second) {
        const int32_t target[] = {static_cast<int32_t>(first * 256), static_cast<int32_t>(second * 256)};
        return machine.follow(target, now_us);
    }
    void give(const Bytes& frame) {
        machine.receive(gemelo::Arrival{frame.data(), frame.size(), false, now_us}, now_us);
    }

    double path(uint8_t joint) const { return machine.present().position_q20[joint] / 1048576.0; }
    int32_t steps(uint8_t joint) const { return machine.stepper().executed(joint); }
    int count_events(const std::string& text) const {
        return static_cast<int>(std::count_if(events.begin(), events.end(), [&text](const std::string& event) {
            return event.find(text) != std::string::npos;
        }));
    }
    // The fastest and hardest that a joint's path was since the start; over 4 ms, so that a slot's rounding is nothing.
    double fastest(size_t joint) const { return tops_[joint].speed; }
    double hardest(size_t joint) const { return tops_[joint].acceleration; }

    uint64_t now_us;
    std::vector<int32_t> shaft;  // where the motors truly are, from their pulses
    uint64_t pulses = 0;
    gemelo::Machine machine;
    std::vector<std::string> events, statuses, sensors;
    Bytes state;

  private:
    struct Top {
        double speed = 0, acceleration = 0;
        int homed = 0;
        std::deque<double> v = std::deque<double>(4);
    };

    static void put(void* self, gemelo::Output output, const uint8_t* bytes, size_t size) {
        Wired& wired = *static_cast<Wired*>(self);
        const std::string text(bytes, bytes + size);
        switch (output) {
            case gemelo::Output::Event:
                wired.events.push_back(text);
                break;
            case gemelo::Output::Status:
                wired.statuses.push_back(text);
                break;
            case gemelo::Output::Sensors:
                wired.sensors.push_back(text);
                break;
            case gemelo::Output::State:
                wired.state.assign(bytes, bytes + size);
                break;
            case gemelo::Output::CmdAck:
                wired.code_ = static_cast<gemelo::Code>(bytes[13]);
                break;
            case gemelo::Output::TrajAck:
                wired.chunk_code_ = static_cast<gemelo::Code>(bytes[20]);
                break;
            default:
                break;
        }
    }
    gemelo::Levels levels() const {
        gemelo::Levels levels;
        for (uint8_t i = 0; i < config_.inputs; ++i) {
            const gemelo::InputConfig& input = config_.input[i];
            const uint32_t level = is_closed(i) != (input.is_inverted != 0) ? 1u : 0u;
            (input.pin < 32 ? levels.low : levels.high) |= level << (input.pin % 32);
        }
        return levels;
    }
    void watch() {
        for (uint8_t j = 0; j < config_.joints && j < 2; ++j) {
            Top& top = tops_[j];
            // A joint that has got a new count has not moved there.
            const int homed = count_events(std::string("\"detail\": \"") + config_.joint[j].name);
            const double position = path(j);
            const double velocity = homed == top.homed ? (position - before_[j]) * 1000.0 : 0.0;
            top.homed = homed;
            before_[j] = position;
            top.speed = std::max(top.speed, std::fabs(velocity));
            top.acceleration = std::max(top.acceleration, std::fabs(velocity - top.v.front()) * 1000.0 / 4);
            top.v.pop_front();
            top.v.push_back(velocity);
        }
    }

    gemelo::DeviceConfig config_;
    gemelo::Pins pins_;
    std::vector<Finger> finger_;
    std::vector<Top> tops_;
    std::vector<double> before_;
    uint32_t tick_in_slot_ = 0;
    uint32_t beats_ = 0, commands_ = 0;
    uint64_t next_beat_us_ = 0;
    gemelo::Code code_ = gemelo::Code::Ok, chunk_code_ = gemelo::Code::Ok;
};

}  // namespace rig
