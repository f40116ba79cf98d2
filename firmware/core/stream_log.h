// The log of streams: the one that is played, the chunk that it wants next, and those that are over.
#pragma once

#include <stdint.h>

namespace gemelo {

class StreamLog {
  public:
    uint32_t stream() const { return stream_; }  // the present one, else the last one, 0 for none since boot
    uint32_t next_seq() const { return next_seq_; }

    void open(uint32_t stream) {
        past_[next_past_] = stream_;
        next_past_ = static_cast<uint8_t>((next_past_ + 1) % kPast);
        stream_ = stream;
        next_seq_ = 0;
    }
    void take(uint32_t seq) { next_seq_ = seq + 1; }
    bool is_past(uint32_t stream) const {
        for (uint32_t past : past_)
            if (past == stream) return true;
        return false;
    }

  private:
    static constexpr uint8_t kPast = 8;  // chosen: a late chunk is of a stream that has just ended
    uint32_t past_[kPast] = {};
    uint8_t next_past_ = 0;
    uint32_t stream_ = 0;
    uint32_t next_seq_ = 0;
};

}  // namespace gemelo
