// The last commands and their answers, so that a repeated one is answered again and not done again. Another command
// under the same id is none of them: nobody can take a STOP's answer away from it.
#pragma once

#include <stdint.h>

#include "protocol.h"

namespace gemelo {

class CommandLog {
  public:
    // The answer that was given to this command, or nullptr.
    const Code* find(uint32_t id, uint8_t command) const {
        for (uint8_t i = 0; i < size_; ++i)
            if (entry_[i].id == id && entry_[i].command == command) return &entry_[i].code;
        return nullptr;
    }
    void add(uint32_t id, uint8_t command, Code code) {
        entry_[next_] = Entry{id, command, code};
        next_ = static_cast<uint8_t>((next_ + 1) % kEntries);
        if (size_ < kEntries) ++size_;
    }

  private:
    struct Entry {
        uint32_t id;
        uint8_t command;
        Code code;
    };
    static constexpr uint8_t kEntries = 16;  // chosen
    Entry entry_[kEntries];
    uint8_t size_ = 0;
    uint8_t next_ = 0;
};

}  // namespace gemelo
