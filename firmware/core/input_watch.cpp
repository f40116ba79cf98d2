#include "input_watch.h"

namespace gemelo {
namespace {

uint32_t* word_of(Levels* levels, uint8_t pin) { return pin < 32 ? &levels->low : &levels->high; }

}  // namespace

void InputWatch::begin(const DeviceConfig& config) {
    blind();
    inputs_ = config.inputs < kMaxInputs ? config.inputs : kMaxInputs;
    active_ = estops_ = once_ = twice_ = last_tick_ = 0;
    expected_ = Levels{};
    Levels mask;
    for (uint8_t i = 0; i < inputs_; ++i) {
        const InputConfig& input = config.input[i];
        pin_[i] = Pin{input.pin, input.is_inverted};
        const uint32_t bit = 1u << (input.pin % 32);
        if (input.role == InputRole::EStop) estops_ |= 1u << i;
        if (input.is_inverted != 0) *word_of(&expected_, input.pin) |= bit;
        *word_of(&mask, input.pin) |= bit;
    }
    // From here on the interrupt sees the inputs, and must find the rest done.
    __atomic_signal_fence(__ATOMIC_SEQ_CST);
    mask_ = mask;
}

uint32_t InputWatch::read(const Levels& levels, uint32_t tick) {
    if (tick - last_tick_ != 1) once_ = twice_ = 0;
    last_tick_ = tick;
    const uint32_t readings = active_in(levels), different = readings ^ active_;
    const uint32_t changed = different & (twice_ | (readings & estops_));
    twice_ = different & once_ & ~changed;
    once_ = different & ~changed;
    active_ ^= changed;
    if (changed != 0) expect(levels, changed);
    return changed & active_;
}

uint32_t InputWatch::active_in(const Levels& levels) const {
    uint32_t active = 0;
    for (uint8_t i = 0; i < inputs_ && i < kMaxInputs; ++i) {
        const Pin& pin = pin_[i];
        const uint32_t word = pin.number < 32 ? levels.low : levels.high;
        active |= (((word >> (pin.number & 31)) & 1) ^ pin.is_inverted) << i;
    }
    return active;
}

void InputWatch::expect(const Levels& levels, uint32_t changed) {
    Levels pins;
    for (uint8_t i = 0; i < kMaxInputs; ++i)
        if ((changed >> i) & 1) *word_of(&pins, pin_[i].number) |= 1u << (pin_[i].number & 31);
    expected_.low = (expected_.low & ~pins.low) | (levels.low & pins.low);
    expected_.high = (expected_.high & ~pins.high) | (levels.high & pins.high);
}

}  // namespace gemelo
