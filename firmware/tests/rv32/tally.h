// The distribution of a count, by one bin per value.
#pragma once

#include <stdint.h>

class Tally {
  public:
    bool is_open = false;  // to the distribution; the maximum is over everything

    void clear() {
        is_open = false;
        sum_ = count_ = most_ = 0;
        for (uint32_t& bin : bins_) bin = 0;
    }
    void add(uint32_t value) {
        if (value > most_) most_ = value;
        if (!is_open) return;
        sum_ += value;
        ++count_;
        ++bins_[value < kBins ? value : kBins - 1];
    }
    uint64_t sum() const { return sum_; }
    uint32_t count() const { return count_; }
    uint32_t most() const { return most_; }
    // The smallest value that at least this share of all do not exceed.
    uint32_t quantile(uint32_t percent) const {
        uint64_t seen = 0;
        for (uint32_t value = 0; value < kBins; ++value) {
            seen += bins_[value];
            if (seen * 100 >= static_cast<uint64_t>(count_) * percent) return value;
        }
        return kBins;
    }

  private:
    static constexpr uint32_t kBins = 1 << 15;

    uint64_t sum_ = 0;
    uint32_t count_ = 0;
    uint32_t most_ = 0;
    uint32_t bins_[kBins] = {};
};
