// Motion validation: true for a path that is free as a whole, nothing left out between the samples.
//
// A sample stands for the stretch around it. Eight stretches, taken from all over the path, make one question to the
// check. No part moves farther within a stretch than its bound, so a lane without anything that near is free on all of
// its stretch; one that touches ends everything; any other is cut in two. What cannot be told apart at `finest` is
// called not free.
#pragma once

#include "joint_path.h"
#include "stop_condition.h"
#include "world.h"

namespace gemelo {

struct Tolerances {
    double margin = 1e-3;   // [m] that stays free
    double finest = 2e-4;   // [m] of motion within a stretch that is not cut any further
    double coarsest = 0.2;  // [m] of motion within the first stretches, at most
};

enum class Verdict { kFree, kTouching, kTooNear, kStopped };

class MotionValidator {
  public:
    MotionValidator(const World& world, const Kernel& kernel, const Tolerances& tolerances)
        : world_(world), kernel_(kernel), tolerances_(tolerances), touching_(dof()) {}

    // From now on what was found last is looked for first. Verdicts are the same, but of several contacts another one
    // may be told of.
    void learn() { is_learning_ = true; }

    // How many configurations have been looked at.
    uint64_t checks() const { return checks_; }
    const CheckResult& result() const { return result_; }  // the last contact, where the verdict is not kFree
    // Where on the path it was, where the verdict is kTouching.
    const Joints& touching() const { return touching_; }

    bool is_free(const double* joints) { return are_free({joints}); }

    // True if all `configurations`, (dof,) each, are free: eight make one question.
    bool are_free(const std::vector<const double*>& configurations) {
        stretches_.clear();
        ends_.clear();
        for (const double* joints : configurations) {
            stretches_.push_back({stretches_.size(), 0.0, 0.0});
            ends_.insert(ends_.end(), joints, joints + dof());
        }
        ends_.insert(ends_.end(), configurations.back(), configurations.back() + dof());
        const Polyline points(ends_.data(), configurations.size() + 1, dof());
        const double still[kMaxDof] = {};
        world_.bound_motion(still, part_motion_, pair_motion_);
        slowness_.clear();
        for (size_t next = 0; next < stretches_.size(); next += kLanes) {
            const size_t count = std::min<size_t>(kLanes, stretches_.size() - next);
            if (check(points, next, count) != 0 || result_.near != 0) return false;
        }
        return true;
    }

    bool is_free_line(const double* from, const double* to, const StopCondition& stop) {
        ends_.assign(from, from + dof());
        ends_.insert(ends_.end(), to, to + dof());
        return look(Polyline(ends_.data(), 2, dof()), stop) == Verdict::kFree;
    }

    // By way of `at`: both lines together are hardly dearer than one.
    bool is_free_corner(const double* from, const double* at, const double* to, const StopCondition& stop) {
        ends_.assign(from, from + dof());
        ends_.insert(ends_.end(), at, at + dof());
        ends_.insert(ends_.end(), to, to + dof());
        return look(Polyline(ends_.data(), 3, dof()), stop) == Verdict::kFree;
    }

    template <class Path>
    Verdict look(const Path& path, const StopCondition& stop) {
        begin(path);
        for (size_t next = 0; next < stretches_.size();) {
            if (stop()) return Verdict::kStopped;
            const size_t count = std::min<size_t>(kLanes, stretches_.size() - next);
            if (check(path, next, count) != 0) {
                const Stretch& stretch = stretches_[next + first_lane(result_.hits)];
                path.at(stretch.span, stretch.middle, touching_.data());
                return Verdict::kTouching;
            }
            for (size_t lane = 0; lane < count; ++lane) {
                if ((result_.near >> lane & 1u) != 0 && !cut(stretches_[next + lane])) return Verdict::kTooNear;
            }
            next += count;
        }
        return Verdict::kFree;
    }

    // From where to where, in spans, the path is not known to be free, and of which pairs: parts, or a part and
    // kMaxParts + an obstacle.
    struct Unresolved {
        double begin, end;
        std::vector<std::array<int32_t, 2>> pairs;
    };

    // In order; empty where all of the path is free.
    template <class Path>
    std::vector<Unresolved> unresolved(const Path& path, const StopCondition& stop) {
        begin(path);
        std::vector<Stretch> found;
        for (size_t next = 0, count = 0; next < stretches_.size(); next += count) {
            count = std::min<size_t>(kLanes, stretches_.size() - next);
            const uint32_t hits = check(path, next, count, false);
            for (size_t lane = 0; lane < count; ++lane) {
                const Stretch stretch = stretches_[next + lane];
                if (((hits | result_.near) >> lane & 1u) == 0 || (!stop() && cut(stretch))) continue;
                found.push_back(stretch);
            }
        }
        return joined(path, std::move(found));
    }

  private:
    struct Stretch {
        size_t span;
        double middle, half;
    };

    static double middle_of(const Stretch& stretch) { return static_cast<double>(stretch.span) + stretch.middle; }

    // In order, and those that meet as one, with the pairs of all of them.
    template <class Path>
    std::vector<Unresolved> joined(const Path& path, std::vector<Stretch> found) {
        std::sort(found.begin(), found.end(),
                  [](const Stretch& a, const Stretch& b) { return middle_of(a) < middle_of(b); });
        stretches_ = std::move(found);
        std::vector<Unresolved> result;
        for (size_t first = 0, next = 0; first < stretches_.size(); first = next) {
            Unresolved interval{middle_of(stretches_[first]) - stretches_[first].half, 0.0, {}};
            for (next = first; next < stretches_.size(); ++next) {
                const double begins = middle_of(stretches_[next]) - stretches_[next].half;
                if (next > first && begins > interval.end + 1e-9) break;
                interval.end = middle_of(stretches_[next]) + stretches_[next].half;
            }
            interval.pairs = near_pairs(path, first, next);
            result.push_back(std::move(interval));
        }
        return result;
    }

    // All that are near in any of the stretches from one up to another.
    template <class Path>
    std::vector<std::array<int32_t, 2>> near_pairs(const Path& path, size_t first, size_t last) {
        const size_t parts = static_cast<size_t>(world_.view().part_count);
        const size_t columns = kMaxParts + static_cast<size_t>(world_.view().obstacle_count);
        std::vector<uint8_t> marks(parts * columns, 0);
        for (size_t next = first; next < last; next += kLanes) {
            check(path, next, std::min<size_t>(kLanes, last - next), false, marks.data());
        }
        std::vector<std::array<int32_t, 2>> pairs;
        for (size_t i = 0; i < marks.size(); ++i) {
            if (marks[i] != 0) pairs.push_back({static_cast<int32_t>(i / columns), static_cast<int32_t>(i % columns)});
        }
        return pairs;
    }

    static size_t first_lane(uint32_t lanes) {
        size_t lane = 0;
        while (!(lanes >> lane & 1u)) ++lane;
        return lane;
    }

    size_t dof() const { return static_cast<size_t>(world_.dof()); }
    double* speed(size_t span) { return speeds_.data() + span * dof(); }

    // The bounds for the fastest span, how much of them each span needs, and the first stretches.
    template <class Path>
    void begin(const Path& path) {
        const size_t spans = path.span_count();
        double fastest[kMaxDof] = {};
        speeds_.resize(spans * dof());
        for (size_t span = 0; span < spans; ++span) {
            path.speed(span, speed(span));
            for (size_t i = 0; i < dof(); ++i) fastest[i] = std::max(fastest[i], speed(span)[i]);
        }
        world_.bound_motion(fastest, part_motion_, pair_motion_);
        motion_ = 0.0;
        for (const auto* each : {&part_motion_, &pair_motion_}) {
            for (const MotionView& most : *each) motion_ = std::max(motion_, static_cast<double>(most.travel));
        }
        slowness_.assign(spans, 0.0);
        for (size_t span = 0; span < spans; ++span) {
            for (size_t i = 0; i < dof(); ++i) {
                if (fastest[i] > 0.0) slowness_[span] = std::max(slowness_[span], speed(span)[i] / fastest[i]);
            }
        }
        first_stretches(spans);
    }

    // As many in every span, in an order that jumps about the path, so that a contact is found early.
    void first_stretches(size_t spans) {
        const double wanted = std::max(motion_ / tolerances_.coarsest, 1.0 * kLanes / static_cast<double>(spans));
        const size_t each = static_cast<size_t>(std::ceil(std::min(wanted, 1e4)));
        const size_t total = each * spans, strides = (total + kLanes - 1) / kLanes;
        stretches_.clear();
        for (size_t stride = 0; stride < strides; ++stride) {
            for (size_t i = stride; i < total; i += strides) {
                const double width = 1.0 / static_cast<double>(each);
                stretches_.push_back({i / each, (static_cast<double>(i % each) + 0.5) * width, 0.5 * width});
            }
        }
    }

    // The lanes that touch; the others are not looked at where one does and `is_one_enough`.
    template <class Path>
    uint32_t check(const Path& path, size_t next, size_t count, bool is_one_enough = true, uint8_t* marks = nullptr) {
        float joints[kMaxDof * kLanes], half[kLanes], steps[kMaxDof * kLanes], slack[kLanes];
        float ways[kMaxDof * kLanes];
        double row[kMaxDof], rates[kMaxDof];
        const size_t dof = this->dof();
        const bool is_moving = !slowness_.empty();
        for (size_t lane = 0; lane < kLanes; ++lane) {
            const Stretch& stretch = stretches_[next + std::min(lane, count - 1)];
            path.at(stretch.span, stretch.middle, row);
            for (size_t i = 0; i < dof; ++i) joints[i * kLanes + lane] = static_cast<float>(row[i]);
            half[lane] = raised(stretch.half * (is_moving ? slowness_[stretch.span] : 0.0));
            if (!is_moving) continue;
            const double off = path.rate(stretch.span, stretch.middle, stretch.half, speed(stretch.span), rates);
            const double* most = speed(stretch.span);
            for (size_t i = 0; i < dof; ++i) {
                steps[i * kLanes + lane] = static_cast<float>(stretch.half * rates[i]);
                ways[i * kLanes + lane] = raised(stretch.half * most[i]);
            }
            slack[lane] = raised(off * static_cast<double>(half[lane]));
        }
        const uint32_t lanes = (1u << count) - 1;
        const float margin = static_cast<float>(tolerances_.margin);
        kernel_.check(world_.view(),
                      {joints, half, is_moving ? steps : nullptr, slack, part_motion_.data(), pair_motion_.data(),
                       margin, lanes, is_one_enough, marks, is_one_enough ? touching_pair_ : ContactView{}, near_pair_,
                       is_moving ? ways : nullptr},
                      result_);
        checks_ += count;
        if (is_learning_ && result_.first >= 0) {
            (result_.hits != 0 ? touching_pair_ : near_pair_) = {result_.first, result_.second};
        }
        return result_.hits;
    }

    // Two halves at the end of the queue; false where that would be too fine.
    bool cut(const Stretch whole) {
        if (whole.half * slowness_[whole.span] * motion_ < tolerances_.finest) return false;
        const double half = 0.5 * whole.half;
        stretches_.push_back({whole.span, whole.middle - half, half});
        stretches_.push_back({whole.span, whole.middle + half, half});
        return true;
    }

    const World& world_;
    const Kernel& kernel_;
    Tolerances tolerances_;
    Joints touching_;
    CheckResult result_{};
    bool is_learning_ = false;
    ContactView touching_pair_, near_pair_;  // the newest ones
    uint64_t checks_ = 0;
    double motion_ = 0.0;
    Joints ends_;
    std::vector<Stretch> stretches_;
    std::vector<double> slowness_;
    Joints speeds_;  // by spans
    std::vector<MotionView> part_motion_, pair_motion_;
};

}  // namespace gemelo
