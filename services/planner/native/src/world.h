// An arm among obstacles, ready for the check, put together from what is known of either.
#pragma once

#include <array>

#include "pair_table.h"
#include "robot.h"

namespace gemelo {

using Parts = std::vector<std::shared_ptr<const Part>>;
using Tables = std::vector<std::shared_ptr<const PairTable>>;

// What stands around an arm: the obstacles, and spheres around them in a tree. Never changed once built.
struct Surroundings {
    std::vector<ObstacleView> obstacles;
    std::vector<NodeView> tree;      // its leaves' items are obstacles
    std::vector<int32_t> unbounded;  // obstacles that are in no sphere
    std::vector<Obstacle> owned;

    explicit Surroundings(std::vector<Obstacle> things) : owned(std::move(things)) {
        std::vector<Sphere> spheres;
        std::vector<int32_t> items;
        for (const Obstacle& obstacle : owned) {
            const int32_t item = static_cast<int32_t>(obstacles.size());
            obstacles.push_back(view_of(obstacle));
            if (obstacle.shape == ShapeKind::kHalfSpace) {
                unbounded.push_back(item);
            } else {
                spheres.push_back(around(obstacle, obstacles.back().rounding));
                items.push_back(item);
            }
        }
        tree = SphereTree(spheres, kSteps).take();
        for (NodeView& node : tree) node.item = node.item < 0 ? -1 : items[static_cast<size_t>(node.item)];
    }
    Surroundings(const Surroundings&) = delete;
    Surroundings& operator=(const Surroundings&) = delete;

  private:
    static constexpr int kSteps = 8;  // chosen: the tree is built while a scene is taken in, of links but once
};

// An arm and what it holds, without what stands around it. Never changed once built.
class Body {
  public:
    Body(std::shared_ptr<const Chain> chain, Parts parts, std::vector<PairView> pairs, Tables tables)
        : chain_(std::move(chain)), parts_(std::move(parts)), pairs_(std::move(pairs)), tables_(std::move(tables)) {
        require_sound();
        for (PairView& pair : pairs_) {
            if (cost(pair.second, pair.first) < cost(pair.first, pair.second)) std::swap(pair.first, pair.second);
            pair.common = common_frame(pair);
            for (const auto& table : tables_) {
                if (table->is_of(pair.first, pair.second)) pair.table = &table->view();
            }
        }
        for (const auto& part : parts_) {
            part_views_.push_back(
                {part->nodes.data(), part->solid_views.data(), count(part->solid_views), part->frame});
        }
        for (const auto& part : parts_) reaches_.push_back(reaches(*chain_, *part));
        for (int32_t part = 0; part < count(parts_); ++part) carriers_.push_back(carriers(part, 0));
        for (const PairView& pair : pairs_) {
            pair_carriers_.push_back({carriers(pair.first, pair.common), carriers(pair.second, pair.common)});
        }
    }
    Body(const Body&) = delete;
    Body& operator=(const Body&) = delete;

    int32_t dof() const { return chain_->dof; }
    size_t sphere_count() const {
        size_t sum = 0;
        for (const auto& part : parts_) sum += part->spheres.size();
        return sum;
    }

    // How far each joint value moves a pair of parts at most against one another, (dof,) [m/rad] or [m/m]; 0 where it
    // does not.
    std::vector<double> reaches_between(size_t pair) const {
        std::vector<double> sums(static_cast<size_t>(dof()), 0.0);
        for (const Carriers& each : pair_carriers_.at(pair)) {
            for (const Carrier& carrier : each) sums[static_cast<size_t>(carrier.drive)] += carrier.reach;
        }
        return sums;
    }
    const std::vector<PairView>& pairs() const { return pairs_; }

    WorldView among(const Surroundings& around) const {
        return {chain_->frames.data(), part_views_.data(),      pairs_.data(),           around.obstacles.data(),
                around.tree.data(),    around.unbounded.data(), count(chain_->frames),   count(part_views_),
                count(pairs_),         count(around.tree),      count(around.unbounded), count(around.obstacles)};
    }

    // How far at most every part and pair moves while each joint value goes its way of `speed` (dof,).
    void bound_motion(const double* speed, std::vector<MotionView>& parts, std::vector<MotionView>& pairs) const {
        parts.clear();
        pairs.clear();
        for (const Carriers& each : carriers_) parts.push_back(rounded(motion(each, speed)));
        for (const auto& both : pair_carriers_) {
            const Motion first = motion(both[0], speed), second = motion(both[1], speed);
            pairs.push_back(rounded({first.travel + second.travel, first.bend + second.bend}));
        }
    }

  private:
    template <class Thing>
    static int32_t count(const std::vector<Thing>& things) {
        return static_cast<int32_t>(things.size());
    }

    void require_sound() const {
        chain_->require_sound();
        if (parts_.empty() || parts_.size() > kMaxParts) {
            throw BadModel("an arm has 1 to " + std::to_string(kMaxParts) + " parts, links and attached objects, not " +
                           std::to_string(parts_.size()));
        }
        for (const auto& part : parts_) {
            if (part->frame < 0 || part->frame >= count(chain_->frames)) throw BadModel("a part's frame must exist");
        }
        for (const auto& table : tables_) {
            for (const TableAxisView& axis : table->view().axes) {
                if (axis.drive < 0 || axis.drive >= chain_->dof) throw BadModel("a table's joint value must exist");
            }
        }
        for (const PairView& pair : pairs_) {
            const bool is_sound = pair.first >= 0 && pair.first < count(parts_) && pair.second >= 0 &&
                                  pair.second < count(parts_) && pair.first != pair.second;
            if (!is_sound) throw BadModel("a pair must be of two parts that exist");
        }
    }

    // Of the spheres of one part against the solids of another.
    size_t cost(int32_t spheres, int32_t solids) const {
        return parts_[static_cast<size_t>(spheres)]->spheres.size() *
               parts_[static_cast<size_t>(solids)]->solids.size();
    }

    // A joint that carries a part, and how far it moves and turns it at most for each unit of its joint value.
    struct Carrier {
        int32_t drive;
        double reach;  // [m/rad] or [m/m]
        double turn;   // [rad/rad]; 0 of a slide
    };
    using Carriers = std::vector<Carrier>;  // the nearest to the base first

    struct Motion {
        double travel, bend;  // [m]
    };

    static MotionView rounded(const Motion& most) { return {raised(1.0001 * most.travel), raised(1.0001 * most.bend)}; }

    // With p a point of the part: d2p / dqi dqj is zi x (zj x (p - oj)) for a joint i before j or j itself, so at most
    // what j moves it by where i turns, and nothing where i slides.
    static Motion motion(const Carriers& carriers, const double* speed) {
        Motion sum{0.0, 0.0};
        double turn = 0.0;
        for (const Carrier& each : carriers) {
            const double fast = std::abs(speed[each.drive]), travel = each.reach * fast;
            sum.travel += travel;
            sum.bend += travel * (turn + 0.5 * each.turn * fast);
            turn += each.turn * fast;
        }
        return sum;
    }

    // The joints of `part` beyond the frame `from`.
    Carriers carriers(int32_t part, int32_t from) const {
        const std::vector<double>& reach = reaches_[static_cast<size_t>(part)];
        Carriers found;
        for (int32_t i = parts_[static_cast<size_t>(part)]->frame; i != from; i = chain_->frame(i).parent) {
            const FrameView& frame = chain_->frame(i);
            found.push_back(
                {frame.drive, reach[static_cast<size_t>(i)], frame.slides ? 0.0 : std::abs(double{frame.multiplier})});
        }
        std::reverse(found.begin(), found.end());
        return found;
    }

    int32_t common_frame(const PairView& pair) const {
        int32_t first = parts_[static_cast<size_t>(pair.first)]->frame;
        int32_t second = parts_[static_cast<size_t>(pair.second)]->frame;
        while (first != second) {  // parents have lower numbers
            int32_t& later = first > second ? first : second;
            later = chain_->frame(later).parent;
        }
        return first;
    }

    std::shared_ptr<const Chain> chain_;
    Parts parts_;
    std::vector<PairView> pairs_;
    Tables tables_;
    std::vector<PartView> part_views_;
    std::vector<std::vector<double>> reaches_;  // of every part by frame: [m/rad] or [m/m]
    std::vector<Carriers> carriers_;
    std::vector<std::array<Carriers, 2>> pair_carriers_;
};

// An arm among obstacles, ready for the check. Never changed once built: whoever plans in it keeps it.
class World {
  public:
    World(std::shared_ptr<const Body> body, std::shared_ptr<const Surroundings> around)
        : body_(std::move(body)), around_(std::move(around)), view_(body_->among(*around_)) {}

    const WorldView& view() const { return view_; }
    int32_t dof() const { return body_->dof(); }
    size_t sphere_count() const { return body_->sphere_count(); }
    void bound_motion(const double* speed, std::vector<MotionView>& parts, std::vector<MotionView>& pairs) const {
        body_->bound_motion(speed, parts, pairs);
    }

  private:
    std::shared_ptr<const Body> body_;
    std::shared_ptr<const Surroundings> around_;
    WorldView view_;
};

}  // namespace gemelo
