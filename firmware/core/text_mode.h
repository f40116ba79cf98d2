// Text mode: lines in, each at most once, and an answer to each.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "machine.h"
#include "text_line.h"

namespace gemelo {

class TextMode {
  public:
    void begin(Machine& machine) { machine_ = &machine; }
    void receive(const TextLine& line, uint64_t now_us);

    // Since begin().
    uint32_t lost() const { return lost_; }
    uint32_t late() const { return late_; }

  private:
    void place(uint32_t seq, bool was_followed, uint64_t now_us);
    void acknowledge(uint32_t seq, uint64_t t_us);
    void refuse(uint32_t seq, Code code);
    void say(const char* text, size_t size);

    Machine* machine_ = nullptr;
    bool has_seq_ = false;
    bool was_followed_ = false;  // the newest line
    uint32_t seq_ = 0;           // of it
    uint64_t placed_us_ = 0;     // when it came
    uint64_t heard_us_ = 0;      // when it came last
    uint32_t lost_ = 0;
    uint32_t late_ = 0;
};

}  // namespace gemelo
