// Random numbers that are the same on every machine, unlike the standard library's distributions.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>

namespace gemelo {

// SplitMix64 (Steele, Lea and Flood 2014).
class Random {
  public:
    explicit Random(uint64_t seed) : state_(seed) {}

    uint64_t next() {
        uint64_t z = state_ += 0x9e3779b97f4a7c15u;
        z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
        z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
        return z ^ (z >> 31);
    }

    // In [0, 1).
    double share() { return static_cast<double>(next() >> 11) * 0x1p-53; }

    // Normally distributed about 0 with deviation 1 (Box and Muller 1958).
    double normal() { return std::sqrt(-2.0 * std::log(1.0 - share())) * std::cos(kTurn * share()); }

    // In [0, count).
    size_t below(size_t count) { return static_cast<size_t>(next() % count); }

  private:
    static constexpr double kTurn = 6.283185307179586;
    uint64_t state_;
};

}  // namespace gemelo
