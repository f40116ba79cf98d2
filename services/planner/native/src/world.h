// An arm among obstacles, ready for the check. Never changed once built: whoever plans in it keeps it.
#pragma once

#include <array>

#include "robot.h"

namespace gemelo {

using Parts = std::vector<std::shared_ptr<const Part>>;

class World {
  public:
    World(std::shared_ptr<const Chain> chain, Parts parts, std::vector<PairView> pairs, std::vector<Obstacle> obstacles)
        : chain_(std::move(chain)), parts_(std::move(parts)), pairs_(std::move(pairs)), owned_(std::move(obstacles)) {
        require_sound();
        for (PairView& pair : pairs_) {
            if (cost(pair.second, pair.first) < cost(pair.first, pair.second)) std::swap(pair.first, pair.second);
            pair.common = common_frame(pair);
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
        add_obstacles();
        view_ = {chain_->frames.data(), part_views_.data(), pairs_.data(),         obstacles_.data(),
                 tree_.data(),          unbounded_.data(),  count(chain_->frames), count(part_views_),
                 count(pairs_),         count(tree_),       count(unbounded_),     count(obstacles_)};
    }
    World(const World&) = delete;
    World& operator=(const World&) = delete;

    const WorldView& view() const { return view_; }
    int32_t dof() const { return chain_->dof; }
    size_t sphere_count() const {
        size_t sum = 0;
        for (const auto& part : parts_) sum += part->spheres.size();
        return sum;
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

    void add_obstacles() {
        std::vector<Sphere> spheres;
        std::vector<int32_t> items;
        for (const Obstacle& obstacle : owned_) {
            const int32_t item = count(obstacles_);
            obstacles_.push_back(view_of(obstacle));
            if (obstacle.shape == ShapeKind::kHalfSpace) {
                unbounded_.push_back(item);
            } else {
                spheres.push_back(around(obstacle, obstacles_.back().rounding));
                items.push_back(item);
            }
        }
        tree_ = SphereTree(spheres).take();
        for (NodeView& node : tree_) node.item = node.item < 0 ? -1 : items[static_cast<size_t>(node.item)];
    }

    std::shared_ptr<const Chain> chain_;
    Parts parts_;
    std::vector<PairView> pairs_;
    std::vector<Obstacle> owned_;
    std::vector<PartView> part_views_;
    std::vector<std::vector<double>> reaches_;  // of every part by frame: [m/rad] or [m/m]
    std::vector<Carriers> carriers_;
    std::vector<std::array<Carriers, 2>> pair_carriers_;
    std::vector<ObstacleView> obstacles_;
    std::vector<NodeView> tree_;
    std::vector<int32_t> unbounded_;
    WorldView view_;
};

}  // namespace gemelo
