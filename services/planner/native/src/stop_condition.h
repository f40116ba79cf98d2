// The end of a search: another thread's flag, or time: that of the clock, or one that is counted.
#pragma once

#include <atomic>
#include <chrono>
#include <memory>

namespace gemelo {

// Set from any thread. Where a question counts as some seconds, it has a time of its own, which goes on with every
// question alone: the same work takes the same time, however busy the machine is.
struct CancelFlag {
    explicit CancelFlag(double seconds_per_question = 0.0) : per_question(seconds_per_question) {}

    bool is_counted() const { return per_question > 0.0; }
    // [s] after so many more questions.
    double ask(uint64_t more = 1) { return static_cast<double>(questions += more) * per_question; }

    std::atomic<bool> is_set{false};
    const double per_question;  // [s]; 0 where the clock's time counts
    std::atomic<uint64_t> questions{0};
};

class StopCondition {
  public:
    // `seconds` from now; infinity is for ever.
    StopCondition(double seconds, std::shared_ptr<CancelFlag> cancel)
        : cancel_(std::move(cancel)), began_(Clock::now()), seconds_(seconds) {
        counted_ = cancel_ && cancel_->is_counted() ? cancel_.get() : nullptr;
        if (counted_) counted_before_ = counted_->ask();
    }

    bool is_cancelled() const { return cancel_ && cancel_->is_set.load(std::memory_order_relaxed); }
    // Asked before every check. The clock is read at every eighth question, for it takes a fiftieth of a small check.
    bool operator()() const {
        if ((counted_ || asked_++ % kEvery == 0) && elapsed() > seconds_) is_late_ = true;
        return is_late_ || is_cancelled();
    }
    double elapsed() const {
        if (counted_) return counted_->ask() - counted_before_;
        return std::chrono::duration<double>(Clock::now() - began_).count();
    }

  private:
    static constexpr uint64_t kEvery = 8;  // chosen: eight checks among a large mesh's triangles take about 1 ms

    using Clock = std::chrono::steady_clock;
    std::shared_ptr<CancelFlag> cancel_;
    CancelFlag* counted_ = nullptr;
    double counted_before_ = 0.0;
    Clock::time_point began_;
    double seconds_;
    mutable uint64_t asked_ = 0;
    mutable bool is_late_ = false;
};

}  // namespace gemelo
