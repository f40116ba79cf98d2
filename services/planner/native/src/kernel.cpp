// The collision check of an arm with itself and its surroundings, for eight configurations at once. Compiled once for
// each processor.
//
// Spheres in trees: what is far from the sphere around a whole link is far from the link. `near` asks the same question
// with the path added that a part may move within the stretch that a lane stands for: a lane that is not near is free
// on its whole stretch.
#include "apart.h"
#include "gaps.h"

namespace gemelo {
namespace {

constexpr float kRounding = 1e-5f;  // of the most that a part can move: what floats lose in its velocity; chosen
constexpr int kBatch = 32;          // obstacles that go down a tree together; chosen: they stay in the first cache

class CollisionCheck {
  public:
    CollisionCheck(const WorldView& world, const CheckQuery& query, CheckResult& result)
        : world_(world), query_(query), result_(result) {
        result_ = {0, 0, -1, -1};
        half_ = load(query.half);
        place_frames(world_, query.joints, frames_);
    }

    void run() {
        if (query_.touching.first < 0 || !touch(query_.touching.first, query_.touching.second)) look_at_all();
        result_.hits &= query_.lanes;
        result_.near &= query_.lanes;
    }

  private:
    void look_at_all() {
        if (query_.steps != nullptr) {
            twist_frames(world_, query_.steps, frames_, twists_);
            slack_ = load(query_.slack) + half_ * kRounding;
        }
        for (int32_t part = 0; part < world_.part_count; ++part) {
            roots_[part] = centre_of(frames_[world_.parts[part].frame], world_.parts[part].nodes[0]);
        }
        // The more lanes are known to be near, the less there is to look at for all others.
        const int32_t first_part = query_.near.second >= kMaxParts ? query_.near.first : -1;
        const int32_t first_pair = first_part < 0 && query_.near.first >= 0 ? pair_of(query_.near) : -1;
        if (first_part >= 0) against_obstacles(first_part);
        if (first_pair >= 0) against_itself(first_pair);
        for (int32_t part = 0; part < world_.part_count && !is_over(); ++part) {
            // What stands fixed cannot come nearer to anything.
            if (part != first_part && world_.parts[part].frame != 0) against_obstacles(part);
        }
        for (int32_t pair = 0; pair < world_.pair_count && !is_over(); ++pair) {
            if (pair != first_pair) against_itself(pair);
        }
    }

    // The number of the pair of these two parts; -1 where there is none.
    int32_t pair_of(const ContactView& parts) const {
        for (int32_t pair = 0; pair < world_.pair_count; ++pair) {
            const PairView& both = world_.pairs[pair];
            if (both.first == parts.first && both.second == parts.second) return pair;
        }
        return -1;
    }

    // True if a part touches another one, or an obstacle, in a lane that matters; nothing is noted where it does not.
    bool touch(int32_t first, int32_t second) {
        const PartView& part = world_.parts[first];
        begin(0.0f);
        if (second >= kMaxParts) {
            const int32_t obstacle[] = {second - kMaxParts};
            const Descent down{part.nodes, &frames_[part.frame], world_.obstacles, first, -1};
            descend(down, 0, centre_of(frames_[part.frame], part.nodes[0]), obstacle, 1);
        } else {
            const int32_t pair = pair_of({first, second});
            if (pair >= 0) ask_table(world_.pairs[pair], query_.pair_motion[pair]);
            against_solids(first, second);
            known_ = {};
            // What is only near, as the table knows, is not noted: the whole question comes to it again.
            if (result_.hits == 0) result_ = {0, 0, -1, -1};
        }
        return result_.hits != 0;
    }

    bool is_over() const {
        if (query_.marks != nullptr) return false;
        const uint32_t hits = result_.hits & query_.lanes;
        return hits == query_.lanes || (query_.first_hit_is_all && hits != 0);
    }

    // The lanes that could still learn something from a squared distance of which `limit` is the least that is free.
    uint32_t within(const Lanes& gap, float limit) const {
        const Lanes wide = open_ + limit;
        return not_beyond(gap, wide * wide) & query_.lanes & ~known_.throughout &
               (query_.marks != nullptr ? kAllLanes : ~result_.hits);
    }

    void note(const Lanes& gap, float limit, uint32_t near, int32_t first, int32_t second) {
        const Lanes narrow(limit * limit);
        const uint32_t hits = not_beyond(gap, narrow) & near & ~known_.here;
        result_.hits |= hits;
        if ((near & ~result_.near) != 0 || hits != 0) {
            result_.first = first;
            result_.second = second;
        }
        result_.near |= near;
        if (query_.marks != nullptr) query_.marks[first * (kMaxParts + world_.obstacle_count) + second] = 1;
        close();
    }

    // Lanes that are already known to be near only want to know of hits.
    void close() { open_ = query_.marks != nullptr ? motion_ : select(spread(result_.near), 0.0f, motion_); }

    void begin(const Lanes& motion) {
        motion_ = motion;
        close();
    }

    // What a part or a pair moves at most within a lane's stretch [m]: by its velocity in the middle of it, if that is
    // known to be less.
    Lanes bounded(const MotionView& most, const Lanes& straight) const {
        return smaller(half_ * most.travel, straight + slack_ * most.travel + half_ * half_ * most.bend);
    }

    Lanes moved(int32_t part) const {
        const Lanes most = half_ * query_.part_motion[part].travel;
        if (query_.steps == nullptr) return most;
        const PartView& view = world_.parts[part];
        return bounded(query_.part_motion[part], travel(twists_[view.frame], roots_[part], view.nodes[0].radius));
    }

    Lanes moved(int32_t part, int32_t relative_to) const {
        const PartView& view = world_.parts[part];
        if (view.frame == relative_to) return 0.0f;
        return travel(twists_[view.frame] - twists_[relative_to], roots_[part], view.nodes[0].radius);
    }

    void against_obstacles(int32_t part) {
        begin(moved(part));
        const Descent down{world_.parts[part].nodes, &frames_[world_.parts[part].frame], world_.obstacles, part, -1};
        const NodeView& root = down.nodes[0];
        int32_t batch[kBatch];
        int count = 0;
        const auto push = [&](int32_t item) {
            if (world_.obstacles[item].touching >> part & 1u) return;
            batch[count++] = item;
            if (count < kBatch) return;
            descend(down, 0, roots_[part], batch, count);
            count = 0;
        };
        for (int32_t i = 0; i < world_.unbounded_count; ++i) push(world_.unbounded[i]);
        for (int32_t i = 0; i < world_.tree_count && !is_over();) {
            const NodeView& node = world_.tree[i];
            const Lanes gap = squared(roots_[part] - Point{node.x, node.y, node.z});
            const bool is_near = within(gap, root.radius + node.radius + query_.margin) != 0;
            if (is_near && node.skip == i + 1) push(node.item);
            i = is_near ? i + 1 : node.skip;
        }
        if (count > 0 && !is_over()) descend(down, 0, roots_[part], batch, count);
    }

    void against_itself(int32_t pair) {
        const PairView& both = world_.pairs[pair];
        if (both.table != nullptr && query_.ways != nullptr && both.table->least > query_.margin) return;
        const PartView &first = world_.parts[both.first], &second = world_.parts[both.second];
        begin(half_ * query_.pair_motion[pair].travel);
        const float limit = first.nodes[0].radius + second.nodes[0].radius + query_.margin;
        const Lanes gap = squared(roots_[both.first] - roots_[both.second]);
        if (within(gap, limit) == 0) return;
        if (query_.steps != nullptr) {
            const Lanes straight = moved(both.first, both.common) + moved(both.second, both.common);
            begin(bounded(query_.pair_motion[pair], straight));
            if (within(gap, limit) == 0) return;
        }
        ask_table(both, query_.pair_motion[pair]);
        if (within(gap, limit) != 0) against_solids(both.first, both.second);
        known_ = {};
    }

    // What is known of this pair from here on, until it is done with.
    void ask_table(const PairView& pair, const MotionView& most) {
        if (pair.table == nullptr) return;
        float limits[kLanes];
        store(query_.ways != nullptr ? Lanes(query_.margin) : half_ * most.travel + query_.margin, limits);
        known_ = apart(*pair.table, query_.joints, query_.ways, limits, query_.lanes);
    }

    // The spheres of the one part against the solids of the other.
    void against_solids(int32_t spheres, int32_t solids) {
        const PartView &first = world_.parts[spheres], &second = world_.parts[solids];
        const Placement seen = relative(frames_[second.frame], frames_[first.frame]);
        const Descent down{first.nodes, &seen, second.solids, spheres, solids};
        for (int32_t done = 0; done < second.solid_count && !is_over(); done += kBatch) {
            int32_t batch[kBatch];
            int count = 0;
            while (count < kBatch && done + count < second.solid_count) {
                batch[count] = done + count;
                ++count;
            }
            descend(down, 0, centre_of(seen, first.nodes[0]), batch, count);
        }
    }

    // A tree of spheres, where its frame is as seen from the obstacles, and who they are.
    struct Descent {
        const NodeView* nodes;
        const Placement* at;
        const ObstacleView* obstacles;
        int32_t first;
        int32_t second;  // -1: the obstacle's own number
    };

    void descend(const Descent& down, int32_t index, const Point& centre, const int32_t* obstacles, int count) {
        const NodeView& node = down.nodes[index];
        const bool is_leaf = node.skip == index + 1;
        int32_t kept[kBatch];
        int keep = 0;
        for (int i = 0; i < count; ++i) {
            const ObstacleView& obstacle = down.obstacles[obstacles[i]];
            const float limit = node.radius + query_.margin + obstacle.rounding;
            const Lanes gap = squared_gap(obstacle, centre, open_ + limit);
            const uint32_t near = within(gap, limit);
            if (near == 0) continue;
            kept[keep++] = obstacles[i];
            if (is_leaf) note(gap, limit, near, down.first, down.second < 0 ? kMaxParts + obstacles[i] : down.second);
        }
        if (is_leaf || keep == 0) return;
        for (int32_t child = index + 1; child < node.skip && !is_over(); child = down.nodes[child].skip) {
            descend(down, child, centre_of(*down.at, down.nodes[child]), kept, keep);
        }
    }

    const WorldView& world_;
    const CheckQuery& query_;
    CheckResult& result_;
    Lanes half_;
    Lanes motion_;  // [m] the present part or pair may move within a lane's stretch
    Lanes open_;    // the same, and 0 in lanes that are known to be near
    Lanes slack_;
    Apart known_;  // of the present pair, by its table
    Placement frames_[kMaxFrames];
    Twist twists_[kMaxFrames];
    Point roots_[kMaxParts];
};

void check(const WorldView& world, const CheckQuery& query, CheckResult& result) {
    CollisionCheck(world, query, result).run();
}

void place(const WorldView& world, const float* joints, float* centres) {
    Placement frames[kMaxFrames];
    place_frames(world, joints, frames);
    for (int32_t part = 0; part < world.part_count; ++part) {
        const NodeView* nodes = world.parts[part].nodes;
        for (int32_t i = 0; i < nodes[0].skip; ++i) {
            if (nodes[i].skip != i + 1) continue;
            const Point p = centre_of(frames[world.parts[part].frame], nodes[i]);
            store(p.x, centres);
            store(p.y, centres + kLanes);
            store(p.z, centres + 2 * kLanes);
            centres += 3 * kLanes;
        }
    }
}

}  // namespace

#if defined(GEMELO_PLAIN_LANES)
const Kernel kPlainKernel = {"plain", check, place};
#elif defined(__AVX2__)
const Kernel kAvx2Kernel = {"avx2", check, place};
#else
const Kernel kVectorKernel = {"vector", check, place};
#endif

}  // namespace gemelo
