// Chance that every standard library draws alike.
#pragma once

#include <cmath>
#include <cstdint>
#include <random>

namespace property {

class Dice {
  public:
    explicit Dice(uint64_t seed) : random_(seed * 0x9E3779B97F4A7C15ull + 1) {}
    bool chance(double probability) { return fraction() < probability; }
    int64_t between(int64_t low, int64_t high) {
        return low + static_cast<int64_t>(random_() % static_cast<uint64_t>(high - low + 1));
    }
    double fraction() { return static_cast<double>(random_() >> 11) * 0x1p-53; }
    // As likely between 1 and 2 as between 100 and 200.
    double logarithmic(double low, double high) { return low * std::exp(fraction() * std::log(high / low)); }

  private:
    std::mt19937_64 random_;
};

}  // namespace property
