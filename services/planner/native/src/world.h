// An arm among obstacles, ready for the check. Never changed once built: whoever plans in it keeps it.
#pragma once

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
        }
        for (const auto& part : parts_) {
            part_views_.push_back(
                {part->nodes.data(), part->solid_views.data(), count(part->solid_views), part->frame});
            reaches_.push_back(reaches(*chain_, *part));
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

    // How far at most every part and pair moves [m] while each joint value goes its way of `speed` (dof,).
    void bound_motion(const double* speed, std::vector<float>& part_motion, std::vector<float>& pair_motion) const {
        part_motion.clear();
        pair_motion.clear();
        for (const auto& reach : reaches_) part_motion.push_back(rounded_up(1.0001 * motion(reach, speed)));
        for (const PairView& pair : pairs_) {
            const double both =
                motion(between(pair.first, pair.second), speed) + motion(between(pair.second, pair.first), speed);
            pair_motion.push_back(rounded_up(1.0001 * both));
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

    double motion(const std::vector<double>& reach, const double* speed) const {
        double sum = 0.0;
        for (size_t i = 1; i < reach.size(); ++i) sum += reach[i] * std::abs(speed[chain_->frames[i].drive]);
        return sum;
    }

    // The reaches of `part` over the joints that do not carry `other` as well.
    std::vector<double> between(int32_t part, int32_t other) const {
        std::vector<double> reach = reaches_[static_cast<size_t>(part)];
        for (int32_t i = parts_[static_cast<size_t>(other)]->frame; i > 0; i = chain_->frame(i).parent) {
            reach[static_cast<size_t>(i)] = 0.0;
        }
        return reach;
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
    std::vector<std::vector<double>> reaches_;
    std::vector<ObstacleView> obstacles_;
    std::vector<NodeView> tree_;
    std::vector<int32_t> unbounded_;
    WorldView view_;
};

}  // namespace gemelo
