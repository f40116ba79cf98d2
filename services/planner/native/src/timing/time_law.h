// The movement along a smooth run: sections with bounds under which no joint exceeds its own, the steady speeds between
// them, and the phases of steady jerk one after the other.
//
// The operations stand in the order of services/planner/timing (bounds.py, sections.py, time_law.py), which do the same
// where this is not built: the timing of one path is shorter than the calls that would ask Python for its bounds.
// tests/planner/native/test_native_timing.py holds both together.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "jerk_limited.h"
#include "spline_run.h"

namespace gemelo {

// Tuning constants, chosen as in sections.py and time_law.py.
constexpr double kBending = 0.8;   // share of the acceleration's limit that bending may use
constexpr double kTwisting = 0.6;  // share of the jerk's limit that the bend's own change may use
constexpr double kCrossing = 0.2;  // share of the jerk's limit for accelerating in a bend
constexpr size_t kCuts = 2;        // sections of a piece, before the ones that are alike become one
constexpr double kSectionShares[5] = {1e-06, 0.25000049999999996, 0.49999999999999994, 0.7499995, 0.999999};
constexpr double kAlike = 1.08;         // sections whose speeds differ by less are one
constexpr double kNearly = 1.0 - 1e-9;  // of a change of speed, lest rounding leaves no profile for it
constexpr int kTimeNewton = 8;          // steps to when a length is reached
constexpr double kFewest = 1e-3;        // [s] times nearer than that are one

// A stretch of the run [s at full speed] with bounds of the movement along it.
struct Section {
    double length;
    Bounds bounds;
};

// What all samples of a part of a piece allow.
inline Bounds bounds_of(const SplineRun& run, size_t piece, size_t part, const LimitsView& limits) {
    const size_t dof = run.dof();
    PathPoint points[5];
    double straight = INFINITY, bent = INFINITY, twisted = INFINITY;
    for (int k = 0; k < 5; ++k) {
        PathPoint& point = points[k];
        run.inside(piece, (static_cast<double>(part) + kSectionShares[k]) / kCuts, point);
        for (size_t i = 0; i < dof; ++i) {
            const double a = limits.acceleration[i] / limits.velocity[i], j = limits.jerk[i] / limits.velocity[i];
            point.first[i] = std::abs(point.first[i]) + kTiny;
            point.second[i] = std::abs(point.second[i]) + kTiny;
            point.third[i] = std::abs(point.third[i]) + kTiny;
            straight = std::fmin(straight, 1.0 / point.first[i]);
            bent = std::fmin(bent, kBending * a / point.second[i]);
            twisted = std::fmin(twisted, kTwisting * j / point.third[i]);
        }
    }
    Bounds least{std::fmin(std::fmin(straight, std::sqrt(bent)), std::cbrt(twisted)), INFINITY, INFINITY};
    const double v = least.speed, squared = v * v, cubed = squared * v;
    for (const PathPoint& point : points) {
        for (size_t i = 0; i < dof; ++i) {
            const double a = limits.acceleration[i] / limits.velocity[i], j = limits.jerk[i] / limits.velocity[i];
            const double first = point.first[i], crossing = 3.0 * point.second[i] * v;
            const double crossed = std::fmin(kCrossing * j, crossing * (a / first));
            const double rise = std::fmin((a - point.second[i] * squared) / first, kCrossing * j / crossing);
            least.acceleration = std::fmin(least.acceleration, rise);
            least.jerk = std::fmin(least.jerk, (j - point.third[i] * cubed - crossed) / first);
        }
    }
    return least;
}

// Some for each piece; neighbours that are about as fast are one, under the bounds of the slower.
inline std::vector<Section> sections_of(const SplineRun& run, const LimitsView& limits) {
    std::vector<Section> sections;
    constexpr size_t parts = kPieceParts / kCuts;
    for (size_t index = 0; index < run.count() * kCuts; ++index) {
        const double length = run.length_after((index + 1) * parts) - run.length_after(index * parts);
        const Bounds bounds = bounds_of(run, index / kCuts, index % kCuts, limits);
        if (!sections.empty()) {
            Section& last = sections.back();
            const double one = last.bounds.speed, other = bounds.speed;
            if (std::max(one, other) <= kAlike * std::min(one, other)) {
                last.length += length;
                last.bounds = {std::min(one, other), std::min(last.bounds.acceleration, bounds.acceleration),
                               std::min(last.bounds.jerk, bounds.jerk)};
                continue;
            }
        }
        sections.push_back({length, bounds});
    }
    return sections;
}

// The fastest steady speed at the other end of the section.
inline double reachable(double speed, const Section& section) {
    const double change = largest_change(speed, section.length, section.bounds);
    return std::min(speed + kNearly * change, std::max(speed, section.bounds.speed));
}

// Steady speeds at the ends of the sections, one more than these: they can be reached from rest and brought to rest.
inline std::vector<double> boundary_speeds(const std::vector<Section>& sections) {
    std::vector<double> speeds(sections.size() + 1, 0.0);
    for (size_t i = 1; i < sections.size(); ++i) {
        speeds[i] = std::min(sections[i - 1].bounds.speed, sections[i].bounds.speed);
    }
    for (size_t i = 1; i < sections.size(); ++i) {
        speeds[i] = std::min(speeds[i], reachable(speeds[i - 1], sections[i - 1]));
    }
    for (size_t i = sections.size() - 1; i > 0; --i)
        speeds[i] = std::min(speeds[i], reachable(speeds[i + 1], sections[i]));
    return speeds;
}

// A run's length by time, from rest to rest.
class RunTimeLaw {
  public:
    // Throws `NoProfile`.
    explicit RunTimeLaw(const std::vector<Section>& sections) {
        const std::vector<double> speeds = boundary_speeds(sections);
        double travelled = 0.0;
        for (size_t i = 0; i < sections.size(); ++i) {
            const JerkLimited through(sections[i].length, speeds[i], speeds[i + 1], sections[i].bounds);
            for (size_t k = 0; k < through.count; ++k) {
                Phase phase = through.phases[k];
                phase.length += travelled;
                phases_.push_back(phase);
                stamps_.push_back(duration_);
                duration_ += phase.duration;
            }
            travelled += sections[i].length;
        }
        if (phases_.empty()) throw NoProfile("no jerk-limited profile for a path without length");
    }

    double duration() const { return duration_; }

    // Length, speed and acceleration at `time` [s].
    std::array<double, 3> at(double time) const {
        const auto after = std::upper_bound(stamps_.begin(), stamps_.end(), time);
        const size_t row = static_cast<size_t>(after - stamps_.begin()) - 1;
        const double t = time - stamps_[row];
        return {phases_[row].length_at(t), phases_[row].speed_at(t), phases_[row].acceleration_at(t)};
    }

    // [s] when the path is so long, by Newton from where the speed is highest.
    double reached(double length) const {
        const auto is_before = [](double wanted, const Phase& phase) { return wanted < phase.length; };
        const auto after = std::upper_bound(phases_.begin(), phases_.end(), length, is_before);
        const size_t row = static_cast<size_t>(std::max<std::ptrdiff_t>(after - phases_.begin(), 1)) - 1;
        const Phase& phase = phases_[row];
        double t = 2.0 * phase.acceleration + phase.duration * phase.jerk > 0.0 ? phase.duration : 0.0;
        for (int step = 0; step < kTimeNewton; ++step) {
            const double missing = phase.length_at(t) - length;
            t = std::min(std::max(t - missing / std::max(phase.speed_at(t), 1e-12), 0.0), phase.duration);
        }
        return stamps_[row] + t;
    }

    // Times [s] from 0 to the end: where the jerk changes, where a piece of the run begins, and evenly between them.
    std::vector<double> times(const SplineRun& run) const {
        std::vector<double> marks(stamps_);
        for (size_t piece = 1; piece < run.count(); ++piece) {
            marks.push_back(reached(run.length_after(piece * kPieceParts)));
        }
        marks.push_back(duration_);
        std::sort(marks.begin(), marks.end());
        std::vector<double> kept{marks[0]};
        for (size_t i = 1; i < marks.size(); ++i) {
            if (marks[i] - marks[i - 1] > kFewest) kept.push_back(marks[i]);
        }
        kept.back() = duration_;
        const double spacing = std::max(kSpacing, duration_ / kMostPoints);
        std::vector<double> times;
        for (size_t i = 0; i + 1 < kept.size(); ++i) {
            const double gap = kept[i + 1] - kept[i], parts = std::max(1.0, std::ceil(gap / spacing));
            for (double part = 0.0; part < parts; part += 1.0) times.push_back(kept[i] + part / parts * gap);
        }
        times.push_back(duration_);
        return times;
    }

  private:
    std::vector<Phase> phases_;
    std::vector<double> stamps_;  // [s] when each phase begins
    double duration_ = 0.0;
};

}  // namespace gemelo
