// The golden trace as text: every pin change and every word of the device, hashed, every 20 ms; its events in full.
#include "script.h"
#include "text.h"

using namespace gemelo;

namespace {

// FNV-1a.
struct Hash {
    uint32_t value = 2166136261u;

    void add(uint32_t byte) { value = (value ^ (byte & 0xFF)) * 16777619u; }
    void add_u32(uint32_t word) {
        for (int shift = 0; shift < 32; shift += 8) add(word >> shift);
    }
};

class Tracer final : public Watch {
  public:
    explicit Tracer(uint8_t joints) : joints_(joints) {}

    void tick(Machine& machine, const Levels& levels) override {
        machine.stepper().tick(levels);
        const Pins& pins = machine.stepper().pins();
        ++tick_;
        if (pins.step == pins_.step && pins.dir == pins_.dir) return;
        pins_ = pins;
        ++changes_;
        hash_.add_u32(tick_);
        hash_.add_u32(pins.step);
        hash_.add_u32(pins.dir);
    }
    void hear(Output output, const uint8_t* bytes, size_t size) override {
        hash_.add(static_cast<uint32_t>(output));
        for (size_t i = 0; i < size; ++i) hash_.add(bytes[i]);
        if (output != Output::Event) return;
        put_bytes(bytes, size);
        put('\n');
    }
    void look(Machine& machine, uint32_t ms) override {
        if (ms % 20 != 19) return;
        put_number(ms + 1);
        put_text(" ms mode ");
        put_number(static_cast<int64_t>(machine.mode()));
        put_text(" steps");
        for (uint8_t j = 0; j < joints_; ++j) {
            put(' ');
            put_number(machine.stepper().executed(j));
        }
        put_text(" changes ");
        put_number(changes_);
        put_text(" hash ");
        put_number(hash_.value);
        put('\n');
    }

  private:
    uint8_t joints_;
    Pins pins_;
    Hash hash_;
    uint32_t tick_ = 0;
    uint32_t changes_ = 0;
};

void trace(uint8_t joints) {
    Tracer tracer(joints);
    Player player(joints, tracer);
    player.play(Move{1, joints, kZero, kThere}, kEventful);
    player.play(Move{2, joints, kThere, kBack}, kPlain);
    play_safety(player, joints);
}

}  // namespace

int main() {
    trace(3);
    trace(6);
    return 0;
}
