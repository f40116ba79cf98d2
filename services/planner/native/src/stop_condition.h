// The end of a search: another thread's flag, or the clock.
#pragma once

#include <atomic>
#include <chrono>
#include <memory>

namespace gemelo {

// Set from any thread.
struct CancelFlag {
    std::atomic<bool> is_set{false};
};

class StopCondition {
  public:
    // `seconds` from now; infinity is for ever.
    StopCondition(double seconds, std::shared_ptr<const CancelFlag> cancel)
        : cancel_(std::move(cancel)), began_(Clock::now()), seconds_(seconds) {}

    bool is_cancelled() const { return cancel_ && cancel_->is_set.load(std::memory_order_relaxed); }
    // Asked before every check. The clock is read at every eighth question, for it takes a fiftieth of a small check.
    bool operator()() const {
        if (asked_++ % kEvery == 0 && elapsed() > seconds_) is_late_ = true;
        return is_late_ || is_cancelled();
    }
    double elapsed() const { return std::chrono::duration<double>(Clock::now() - began_).count(); }

  private:
    static constexpr uint64_t kEvery = 8;  // chosen: eight checks among a large mesh's triangles take about 1 ms

    using Clock = std::chrono::steady_clock;
    std::shared_ptr<const CancelFlag> cancel_;
    Clock::time_point began_;
    double seconds_;
    mutable uint64_t asked_ = 0;
    mutable bool is_late_ = false;
};

}  // namespace gemelo
