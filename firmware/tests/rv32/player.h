// A device and a gateway of few words: streams a move ahead of the device's clock, and does what the script says.
#pragma once

#include "machine.h"
#include "stream.h"

// What is done at a time of the play.
enum class Deed : uint8_t {
    Hold,
    Resume,
    StopFeeding,
    Feed,
    RepeatChunk,
    SkipChunk,
    Replace,
    Home,
    Reset,
    Arm,
    Slow,
    Full,
    PressButton,
    ReleaseButton,
    CloseLimit,
    OpenLimit,
    End,
};

struct Cue {
    uint32_t at_ms;
    Deed deed;
};

// Stands around the device: runs its ticks and slots, and hears what it says.
class Watch {
  public:
    virtual void tick(gemelo::Machine& machine, const gemelo::Levels& levels) { machine.stepper().tick(levels); }
    virtual void slot(gemelo::Machine& machine, uint64_t now_us) { machine.slot(now_us); }
    virtual void receive(gemelo::Machine& machine, const gemelo::Arrival& arrival, uint64_t now_us) {
        machine.receive(arrival, now_us);
    }
    virtual void hear(gemelo::Output, const uint8_t*, size_t) {}
    // A millisecond is over.
    virtual void look(gemelo::Machine&, uint32_t) {}

  protected:
    ~Watch() = default;
};

class Player {
  public:
    // The device stands at zero, referenced.
    Player(uint8_t joints, Watch& watch);

    // Plays one move, from a start in steps, until the script's End; without a move for a stream of 0.
    void play(const Move& move, const Cue* script);

  private:
    static void said(void* self, gemelo::Output output, const uint8_t* bytes, size_t size);
    void act(const Move& move, Deed deed);
    void feed(const Move& move);
    void replace(const Move& move);
    uint64_t played_us(const Move& move) const;
    void run_ms();
    void turn_shafts();
    gemelo::Levels read_pins() const;
    void send(const Wire& wire);

    Watch& watch_;
    gemelo::DeviceConfig config_;
    gemelo::Machine machine_;
    uint64_t now_us_ = 0;
    uint32_t beats_ = 0;
    uint32_t commands_ = 0;
    uint32_t seq_ = 0;
    uint16_t next_knot_ = 0;
    bool is_feeding_ = true;
    bool is_button_pressed_ = false;
    bool is_limit_closed_ = false;
    uint32_t step_ = 0;
    int32_t shaft_[kMostJoints] = {};
};
