#include "stand.h"

#include "bytes.h"

using namespace gemelo;

namespace property {

Stand::Stand(const Bench& bench_, Findings& findings_, uint64_t now_us, uint32_t boot_id, bool referenced,
             uint64_t seed)
    : bench(bench_),
      findings(findings_),
      dice_(seed),
      ticks_per_slot_(ticks_per_slot(bench.config)),
      slot_us_(now_us),
      beats_(static_cast<uint32_t>(-dice_.between(1, 50))) {
    machine.begin(bench.config, Identity{boot_id, "power_on"}, Sink{this, said});
    const int32_t steps[kMaxJoints] = {};
    machine.start(now_us, steps, referenced);
    pins_ = machine.stepper().pins();
    scope.emplace(bench, pins_, findings);
    inspector.emplace(bench, machine, findings);
    inspector->start_anew(*scope);
}

uint64_t Stand::now_us() const { return slot_us_ + static_cast<uint64_t>(tick_) * kSlotUs / ticks_per_slot_; }

void Stand::deliver(const rig::Bytes& frame, bool retained) {
    chunk_answer.reset();
    command_answer.reset();
    machine.receive(Arrival{frame.data(), frame.size(), retained, now_us()}, now_us());
}

void Stand::beat() { deliver(rig::build_heartbeat(9, ++beats_)); }

void Stand::tick() {
    machine.stepper().tick(levels());
    const Pins& pins = machine.stepper().pins();
    scope->see(pins);
    if (pins.step != pins_.step || pins.dir != pins_.dir) {
        mix(pins_hash_, scope->tick());
        mix(pins_hash_, (static_cast<uint64_t>(pins.step) << 32) | pins.dir);
        pins_ = pins;
    }
    if (!first_pulse_us_ && scope->pulses() != pulses_before_) first_pulse_us_ = now_us();
    if (tick_++ == slot_task_tick_) machine.slot(slot_us_);
}

bool Stand::is_active(uint8_t input) const {
    if (is_pressed_[input]) return true;
    const uint8_t joint = bench.config.input[input].joint;
    if (joint == kNone || bench.config.joint[joint].homing.input != input) return false;
    const HomingConfig& homing = bench.config.joint[joint].homing;
    return homing.direction * (shaft(joint) - homing.position_q8 / 256) >= 0;
}

Levels Stand::levels() const {
    Levels levels;
    for (uint8_t i = 0; i < bench.config.inputs; ++i) {
        const InputConfig& input = bench.config.input[i];
        const uint32_t level = is_active(i) != (input.is_inverted != 0) ? 1 : 0;
        (input.pin < 32 ? levels.low : levels.high) |= level << (input.pin % 32);
    }
    return levels;
}

// Frames come between ticks, and in a slot before or after its task has run; the task itself may be late.
void Stand::run_to_a_tick() {
    slot_task_tick_ = dice_.chance(0.7) ? 0 : static_cast<uint32_t>(dice_.between(0, ticks_per_slot_ - 1));
    const uint32_t until = static_cast<uint32_t>(dice_.between(0, ticks_per_slot_ - 1));
    while (tick_ < until) tick();
}

void Stand::run_a_tick() {
    if (tick_ == ticks_per_slot_) run_to_slot_end();
    tick();
}

void Stand::run_to_slot_end() {
    while (tick_ < ticks_per_slot_) tick();
    tick_ = 0;
    slot_us_ += kSlotUs;
    if (is_inspected_) inspector->look(*scope);
}

void Stand::hang(uint32_t slots) {
    slot_task_tick_ = ticks_per_slot_;
    is_inspected_ = false;
    for (uint32_t i = 0; i < slots; ++i) run_to_slot_end();
    is_inspected_ = true;
}

void Stand::run_uninspected(uint32_t slots) {
    is_inspected_ = false;
    for (uint32_t i = 0; i < slots; ++i) run_slot();
    is_inspected_ = true;
}

void Stand::count_ticks(uint64_t ticks) {
    for (uint64_t count = 0; count < ticks; count += ticks_per_slot_) {
        machine.stepper().tick(levels());
        machine.stepper().skip(ticks_per_slot_ - 1);
    }
}

void Stand::said(void* self, Output output, const uint8_t* bytes, size_t size) {
    static_cast<Stand*>(self)->hear(output, bytes, size);
}

// To a tick, and to the us that both times are cut to.
void Stand::check_start(const std::string& event) {
    const uint64_t told_us = std::stoull(event.substr(event.find("\"t_us\": ") + 8));
    const int64_t away = static_cast<int64_t>(told_us - first_pulse_us_.value_or(0));
    const int64_t tick_us = static_cast<int64_t>(kSlotUs / ticks_per_slot_) + 1;
    if (!first_pulse_us_ || away > tick_us || away < -tick_us)
        findings.add(Property::Answers, "the first pulse is told ", away, " us late");
}

void Stand::hear(Output output, const uint8_t* bytes, size_t size) {
    if (output == Output::TrajAck) {
        chunk_answer =
            ChunkAnswer{load_u32(bytes + 8), load_u32(bytes + 12), load_u32(bytes + 16), static_cast<Code>(bytes[20])};
    } else if (output == Output::CmdAck) {
        command_answer = static_cast<Code>(bytes[13]);
    } else if (output == Output::Event) {
        const std::string text(reinterpret_cast<const char*>(bytes), size);
        const size_t begin = text.find(": \"") + 3;
        const std::string name = text.substr(begin, text.find('"', begin) - begin);
        ++events_[name];
        if (name == "started") check_start(text);
        if (name == "homed") {
            const uint8_t joint = static_cast<uint8_t>(text[text.find("\"detail\": \"q") + 12] - '1');
            inspector->recount(joint, *scope);
            homed = static_cast<uint16_t>(homed | 1u << joint);
        }
        for (size_t i = 0; i < size; ++i) mix(words_hash_, bytes[i]);
    } else if (output == Output::State) {
        for (size_t i = kHeaderSize; i < size - kCrcSize; ++i)
            if (i < 44 || i >= 48) mix(words_hash_, bytes[i]);
    }
}

}  // namespace property
