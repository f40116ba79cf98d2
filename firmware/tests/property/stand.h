// A device on a test stand: its clock, its ticks, its slot task, and everything that watches it.
#pragma once

#include <map>
#include <optional>
#include <string>

#include "dice.h"
#include "frames.h"
#include "inspector.h"

namespace property {

struct ChunkAnswer {
    uint32_t stream, seq, next_seq;
    gemelo::Code code;
};

class Stand {
  public:
    // The device starts at step 0. What of `bench` is for good is copied.
    Stand(const Bench& bench, Findings& findings, uint64_t now_us, uint32_t boot_id, bool referenced, uint64_t seed);
    Stand(const Stand&) = delete;
    Stand& operator=(const Stand&) = delete;

    // Hands a frame over at the present tick; afterwards `chunk_answer` or `command_answer` is what came back.
    void deliver(const rig::Bytes& frame, bool retained = false);
    // The next ticks until one within the coming slot, at which frames may be delivered; then the rest of the slot.
    void run_to_a_tick();
    void run_to_slot_end();
    void run_a_tick();
    void run_slot() {
        run_to_a_tick();
        run_to_slot_end();
    }
    // The slot task hangs for so many slots.
    void hang(uint32_t slots);
    // Somebody presses an input, or lets go of it; otherwise a switch is closed by the shaft.
    void press(uint8_t input, bool is_pressed) { is_pressed_[input] = is_pressed; }
    // A stream was opened: its first pulse is to be told by `started`.
    void watch_first_pulse() { first_pulse_us_.reset(), pulses_before_ = scope->pulses(); }
    // A few slots that nobody inspects, for what stops the pulses dead.
    void run_uninspected(uint32_t slots);
    // Where the motor truly is, in whole steps; it was at 0 when the device started at 0.
    int64_t shaft(uint8_t joint) const { return scope->count(joint); }
    void beat();

    uint64_t now_us() const;
    gemelo::Mode mode() const { return machine.mode(); }
    int events(const std::string& name) const { return events_.count(name) ? events_.at(name) : 0; }
    // Of all changes of pins so far; and of all words, but for the counter of refused frames.
    uint64_t pins_hash() const { return pins_hash_; }
    uint64_t words_hash() const { return words_hash_; }
    // Lets the interrupt alone run, before anything moves, until it has counted so many ticks.
    void count_ticks(uint64_t ticks);

    Bench bench;
    Findings& findings;
    gemelo::Machine machine;
    std::optional<Oscilloscope> scope;
    std::optional<Inspector> inspector;
    std::optional<ChunkAnswer> chunk_answer;
    std::optional<gemelo::Code> command_answer;
    uint16_t homed = 0;  // bit j: joint j has found its switch

  private:
    static void said(void* self, gemelo::Output output, const uint8_t* bytes, size_t size);
    void hear(gemelo::Output output, const uint8_t* bytes, size_t size);
    gemelo::Levels levels() const;
    bool is_active(uint8_t input) const;
    static void mix(uint64_t& hash, uint64_t value) { hash = (hash ^ value) * 1099511628211ull; }
    void tick();

    Dice dice_;
    uint32_t ticks_per_slot_;
    uint32_t tick_ = 0;  // of the slot
    uint32_t slot_task_tick_ = 0;
    uint64_t slot_us_;
    uint32_t beats_;
    uint64_t pins_hash_ = 14695981039346656037ull, words_hash_ = pins_hash_;
    gemelo::Pins pins_;
    bool is_pressed_[gemelo::kMaxInputs] = {};
    void check_start(const std::string& event);
    uint64_t pulses_before_ = 0;
    std::optional<uint64_t> first_pulse_us_;
    bool is_inspected_ = true;
    std::map<std::string, int> events_;
};

}  // namespace property
