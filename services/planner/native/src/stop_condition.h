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
    bool is_late() const { return elapsed() > seconds_; }
    bool operator()() const { return is_cancelled() || is_late(); }
    double elapsed() const { return std::chrono::duration<double>(Clock::now() - began_).count(); }

  private:
    using Clock = std::chrono::steady_clock;
    std::shared_ptr<const CancelFlag> cancel_;
    Clock::time_point began_;
    double seconds_;
};

}  // namespace gemelo
