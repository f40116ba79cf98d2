// Few spheres that hold all of many balls: greedily the one that holds the most of what is left (Chvatal 1979).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <vector>

#include "bad_model.h"
#include "sphere_tree.h"

namespace gemelo {

// `cells` have to be held; `candidates` are centres with the largest radius that each may have. The chosen ones are
// shrunk to what they were chosen for. A cell that no candidate holds gets a sphere around its own centre, for which
// `least` [m] must do.
class GreedyCover {
  public:
    GreedyCover(const std::vector<Sphere>& cells, std::vector<Sphere> candidates, double least)
        : cells_(cells), candidates_(std::move(candidates)), order_(cells.size()), holders_(cells.size()) {
        std::iota(order_.begin(), order_.end(), 0);
        std::stable_sort(order_.begin(), order_.end(),
                         [&](uint32_t a, uint32_t b) { return cells_[a].x < cells_[b].x; });
        for (size_t k = 0; k < candidates_.size(); ++k) list(k);
        for (size_t i = 0; i < cells_.size(); ++i) {
            if (!holders_[i].empty()) continue;
            candidates_.push_back({cells_[i].x, cells_[i].y, cells_[i].z, least});
            list(candidates_.size() - 1);
            if (holders_[i].empty()) throw BadModel("the cells are too large for the bulge: no sphere may hold one");
        }
    }

    std::vector<Sphere> choose() {
        std::vector<Sphere> chosen;
        std::vector<bool> left(cells_.size(), true);
        for (size_t count = cells_.size(); count > 0;) {
            const auto most = std::max_element(held_.begin(), held_.end(),
                                               [](const auto& a, const auto& b) { return a.gain < b.gain; });
            const size_t best = static_cast<size_t>(most - held_.begin());
            chosen.push_back({candidates_[best].x, candidates_[best].y, candidates_[best].z, 0.0});
            for (uint32_t cell : held_[best].cells) {
                if (!left[cell]) continue;
                left[cell] = false;
                --count;
                chosen.back().radius = std::max(chosen.back().radius, away(candidates_[best], cells_[cell]));
                for (uint32_t holder : holders_[cell]) --held_[holder].gain;
            }
        }
        return chosen;
    }

  private:
    struct Held {
        std::vector<uint32_t> cells;
        int64_t gain;  // how many of them are left
    };

    static double away(const Sphere& from, const Sphere& to) {
        return std::sqrt(square(from.x - to.x) + square(from.y - to.y) + square(from.z - to.z)) + to.radius;
    }

    static double square(double value) { return value * value; }

    // Only the cells whose x is in the candidate's reach are looked at.
    void list(size_t candidate) {
        const Sphere& sphere = candidates_[candidate];
        Held held{{}, 0};
        const auto first = std::lower_bound(order_.begin(), order_.end(), sphere.x - sphere.radius,
                                            [&](uint32_t i, double low) { return cells_[i].x < low; });
        for (auto next = first; next != order_.end() && cells_[*next].x <= sphere.x + sphere.radius; ++next) {
            const uint32_t i = *next;
            const double room = sphere.radius - cells_[i].radius;
            const double apart =
                square(sphere.x - cells_[i].x) + square(sphere.y - cells_[i].y) + square(sphere.z - cells_[i].z);
            if (room < 0.0 || apart > room * room) continue;
            held.cells.push_back(i);
            holders_[i].push_back(static_cast<uint32_t>(candidate));
        }
        held.gain = static_cast<int64_t>(held.cells.size());
        held_.push_back(std::move(held));
    }

    const std::vector<Sphere>& cells_;
    std::vector<Sphere> candidates_;
    std::vector<uint32_t> order_;                 // of the cells, by x
    std::vector<std::vector<uint32_t>> holders_;  // of each cell
    std::vector<Held> held_;                      // by each candidate
};

}  // namespace gemelo
