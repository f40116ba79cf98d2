// The fastest movement of one variable from one steady speed to another within bounds of speed, acceleration and jerk.
//
// Up to a peak of the speed, on at it, down from it (Biagiotti and Melchiorri 2008, section 3.4). ruckig gives the same
// for such ends; the tests compare the two.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "states.h"

namespace gemelo {

struct Bounds {
    double speed, acceleration, jerk;
};

// Of steady jerk; the length and its derivatives are those at its begin.
struct Phase {
    double duration, length, speed, acceleration, jerk;

    double length_at(double t) const { return length + t * (speed + t * (acceleration / 2.0 + t * jerk / 6.0)); }
    double speed_at(double t) const { return speed + t * (acceleration + t * jerk / 2.0); }
    double acceleration_at(double t) const { return acceleration + t * jerk; }
};

// Chosen: what rounding leaves.
constexpr double kTiny = 1e-12;
constexpr double kNoTime = 1e-12;  // [s] a phase that is shorter is none

// The largest change of a steady speed within a length.
//
// A change c of the speed v takes the length (2 v + c) (c / j)^0.5, or (2 v + c) (c / a + a / j) / 2 where it is so
// large that the acceleration's bound is reached: a cubic in c^0.5 (Cardano's formula), and a quadratic in c.
inline double largest_change(double speed, double length, const Bounds& bounds) {
    const double a = bounds.acceleration, j = bounds.jerk;
    const double third = 2.0 * speed / 3.0, half = 0.5 * length * std::sqrt(j), size = std::cbrt(half);
    const double root = third > kTiny * size * size
                            ? 2.0 * std::sqrt(third) * std::sinh(std::asinh(half / (third * std::sqrt(third))) / 3.0)
                            : std::cbrt(2.0 * half);
    const double change = root * root;
    if (!(change * j > a * a)) return change;
    const double b = a / j + 2.0 * speed / a, c = 2.0 * (length - speed * a / j);
    return 2.0 * c / (b + std::sqrt(b * b + 4.0 * c / a));
}

// How a change of the speed is made: jerk, steady acceleration, jerk.
struct Ramp {
    double jerking, steady;

    Ramp(double change, const Bounds& bounds) {
        const double a = bounds.acceleration, j = bounds.jerk;
        const bool is_limited = change * j > a * a;
        jerking = is_limited ? a / j : std::sqrt(std::max(change, 0.0) / j);
        steady = is_limited ? change / a - jerking : 0.0;
    }
    double duration() const { return 2.0 * jerking + steady; }
};

class JerkLimited {
  public:
    // Over a `length` > 0, from `before` to `after`; throws `NoProfile`.
    JerkLimited(double length, double before, double after, const Bounds& bounds) {
        const double peak = peak_speed(length, before, after, bounds);
        const double ramps = travelled(before, peak, bounds) + travelled(after, peak, bounds);
        const double steady = peak < bounds.speed ? 0.0 : std::max(length - ramps, 0.0) / peak;
        const Ramp up(peak - before, bounds), down(peak - after, bounds);
        const double j = bounds.jerk, top = up.jerking * j, low = down.jerking * j;
        const double halfway = before + 0.5 * top * up.jerking, ending = peak - 0.5 * low * down.jerking;
        const auto add = [&](double lasts, double speed, double acceleration, double jerk) {
            duration += lasts;
            if (!(lasts > kNoTime)) return;
            if (count && phases[count - 1].jerk == jerk) {
                phases[count - 1].duration += lasts;
                return;
            }
            const double at = count ? phases[count - 1].length_at(phases[count - 1].duration) : 0.0;
            phases[count++] = {lasts, at, speed, acceleration, jerk};
        };
        add(up.jerking, before, 0.0, j);
        add(up.steady, halfway, top, 0.0);
        add(up.jerking, halfway + top * up.steady, top, -j);
        add(steady, peak, 0.0, 0.0);
        add(down.jerking, peak, 0.0, -j);
        add(down.steady, ending, -low, 0.0);
        add(down.jerking, ending - low * down.steady, -low, j);
        if (!std::isfinite(duration) || count == 0) fail(length);
    }

    // Length, speed and acceleration at `t` [s] within the duration.
    std::array<double, 3> at(double t) const {
        size_t index = 0;
        while (index + 1 < count && t > phases[index].duration) t -= phases[index++].duration;
        const Phase& phase = phases[index];
        return {phase.length_at(t), phase.speed_at(t), phase.acceleration_at(t)};
    }

    std::array<Phase, 7> phases{};  // from one change of the jerk to the next
    size_t count = 0;
    double duration = 0.0;

  private:
    static double travelled(double low, double high, const Bounds& bounds) {
        return 0.5 * (low + high) * Ramp(high - low, bounds).duration();
    }

    [[noreturn]] static void fail(double length) {
        char text[80];
        std::snprintf(text, sizeof text, "no jerk-limited profile for a stretch of %.3g s", length);
        throw NoProfile(text);
    }

    // The highest speed on the way: the bound, or what leaves room to come up to it and down from it.
    static double peak_speed(double length, double before, double after, const Bounds& bounds) {
        const auto missing = [&](double peak) {
            return length - travelled(before, peak, bounds) - travelled(after, peak, bounds);
        };
        if (missing(bounds.speed) >= 0.0) return bounds.speed;
        if (before == after) return std::min(bounds.speed, before + largest_change(before, 0.5 * length, bounds));
        double low = std::max(before, after), high = bounds.speed;
        const double least = missing(low);
        if (!(least >= -1e-9 * length)) fail(length);
        if (least <= 0.0) return low;
        double guess = 0.5 * (low + high);
        for (int step = 0; step < kSteps && low < high; ++step) {
            const double left = missing(guess);
            (left > 0.0 ? low : high) = guess;
            const double newton = guess + left / (slope(before, guess, bounds) + slope(after, guess, bounds));
            const double next = newton > low && newton < high ? newton : 0.5 * (low + high);
            if (next == guess) break;
            guess = next;
        }
        return guess;
    }

    // The derivative of `travelled` by the higher speed.
    static double slope(double low, double high, const Bounds& bounds) {
        const Ramp ramp(high - low, bounds);
        const double rate = ramp.steady > 0.0 ? bounds.acceleration : bounds.jerk * std::max(ramp.jerking, kTiny);
        return 0.5 * ramp.duration() + 0.5 * (low + high) / rate;
    }

    static constexpr int kSteps = 100;  // of Newton, and halvings; chosen: more than a double has bits
};

}  // namespace gemelo
