// Instructions of Stepper::tick() and Machine::slot(): their distribution in a plain move, and the most in any play; of
// Machine::receive() those of any play.
// The clock is QEMU's -icount shift=0, in which minstret counts exactly what was executed.
#include "script.h"
#include "tally.h"
#include "text.h"

using namespace gemelo;

namespace {

uint32_t instructions() {
    uint32_t count;
    asm volatile(".option push\n.option arch, +zicsr\ncsrr %0, minstret\n.option pop" : "=r"(count)::"memory");
    return count;
}

// The clock is worth something only if a hundred instructions count as a hundred.
bool is_exact() {
    const uint32_t before = instructions();
    const uint32_t between = instructions();
    asm volatile(".rept 100\nnop\n.endr");
    return instructions() - between == between - before + 100;
}

Tally ticks, slots, receives;

class Counter final : public Watch {
  public:
    Counter() {
        const uint32_t before = instructions();
        overhead_ = instructions() - before;
    }
    void tick(Machine& machine, const Levels& levels) override {
        Stepper& stepper = machine.stepper();
        const uint32_t before = instructions();
        stepper.tick(levels);
        ticks.add(instructions() - before - overhead_);
    }
    void slot(Machine& machine, uint64_t now_us) override {
        const uint32_t before = instructions();
        machine.slot(now_us);
        slots.add(instructions() - before - overhead_);
        // Counted from the slot after: standing still would flatter.
        ticks.is_open = slots.is_open = is_plain && machine.is_moving();
    }

    void receive(Machine& machine, const Arrival& arrival, uint64_t now_us) override {
        const uint32_t before = instructions();
        machine.receive(arrival, now_us);
        receives.add(instructions() - before - overhead_);
    }

    bool is_plain = false;

  private:
    uint32_t overhead_;
};

void print(const char* name, uint8_t joints, const Tally& tally) {
    put_text(name);
    const uint64_t numbers[] = {joints,      tally.sum(), tally.count(), tally.quantile(50), tally.quantile(99),
                                tally.most()};
    for (uint64_t number : numbers) {
        put(' ');
        put_number(static_cast<int64_t>(number));
    }
    put('\n');
}

void count(uint8_t joints) {
    ticks.clear();
    slots.clear();
    receives.clear();
    receives.is_open = true;
    Counter counter;
    Player player(joints, counter);
    player.play(Move{1, joints, kZero, kThere}, kEventful);
    counter.is_plain = true;
    player.play(Move{2, joints, kThere, kBack}, kPlain);
    counter.is_plain = false;
    play_safety(player, joints);
    print("tick", joints, ticks);
    print("slot", joints, slots);
    print("receive", joints, receives);
}

}  // namespace

int main() {
    if (!is_exact()) return 1;
    count(3);
    count(6);
    return 0;
}
