// The motion core for Python: arrays in, arrays out, the interpreter's lock released while it works.
//
// Shapes and finiteness are checked here and in core.py; the headers trust what they are given.
#include <nanobind/nanobind.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "arrays.h"
#include "centring.h"
#include "cover.h"
#include "descent.h"
#include "kernels.h"
#include "plan.h"
#include "polytope.h"
#include "trajectories.h"
#include "turns.h"

namespace gemelo {
namespace {

using Flag = std::shared_ptr<CancelFlag>;

// Finite, and of a size that a float still knows to the needed digits.
void require_usable(const double* values, size_t count) {
    for (size_t i = 0; i < count; ++i) {
        if (std::abs(values[i]) <= static_cast<double>(kMostTurn)) continue;
        throw BadModel("joint value " + std::to_string(values[i]) +
                       " is not within 100 rad or m of 0: wrap it into one turn");
    }
}

Joints joints_of(const Row& row, const World& world) {
    require_columns(row.size(), static_cast<size_t>(world.dof()), "joint values");
    require_usable(row.data(), row.size());
    return {row.data(), row.data() + row.size()};
}

std::shared_ptr<const Chain> make_chain(const Integers& links, const Rows& numbers, int dof) {
    require_columns(links.shape(1), 3, "links (parent, drive, slides)");
    require_columns(numbers.shape(1), 15, "numbers (12 of the transform, multiplier, offset, travel)");
    require(links.shape(0) == numbers.shape(0), "links and numbers must have the same number of rows");
    auto chain = std::make_shared<Chain>();
    chain->dof = dof;
    for (size_t i = 0; i < links.shape(0); ++i) {
        const double* row = numbers.data() + 15 * i;
        FrameView frame{links(i, 0), links(i, 1), links(i, 2), static_cast<float>(row[12]), static_cast<float>(row[13]),
                        {}};
        std::transform(row, row + 12, frame.fixed, [](double value) { return static_cast<float>(value); });
        chain->frames.push_back(frame);
        chain->travel.push_back(row[14]);
    }
    chain->require_sound();
    return chain;
}

// The frames between the base and the tool, of rows as of `make_chain`; `pose` is the tool's in the frame `number`.
std::shared_ptr<const ToolDescent> make_tool_descent(const Integers& links, const Rows& numbers, int number,
                                                     const Row& pose, const Rows& bounds) {
    require_columns(links.shape(1), 3, "links (parent, drive, slides)");
    require_columns(numbers.shape(1), 15, "numbers (12 of the transform, multiplier, offset, travel)");
    require_columns(pose.size(), 12, "a pose");
    require(links.shape(0) == numbers.shape(0) && bounds.shape(0) == 2, "bounds are two rows: lower, upper");
    const size_t dof = bounds.shape(1);
    require(dof >= 1 && dof <= static_cast<size_t>(kMaxDof), "an arm has 1 to 16 joint values");
    auto arm = std::make_shared<ToolDescent>();
    std::copy(pose.data(), pose.data() + 12, arm->tool.begin());
    arm->lower.assign(bounds.data(), bounds.data() + dof);
    arm->upper.assign(bounds.data() + dof, bounds.data() + 2 * dof);
    for (int i = number; i > 0; i = links(static_cast<size_t>(i), 0)) {
        const size_t row = static_cast<size_t>(i);
        require(row < links.shape(0) && links(row, 0) < i && links(row, 0) >= 0,
                "a frame's parent must come before it");
        require(links(row, 1) >= 0 && static_cast<size_t>(links(row, 1)) < dof, "a frame's joint value must exist");
        ToolFrame frame{links(row, 0), links(row, 1), links(row, 2), numbers(row, 12), numbers(row, 13), {}};
        std::copy(&numbers(row, 0), &numbers(row, 0) + 12, frame.fixed.begin());
        arm->frames.insert(arm->frames.begin(), frame);
        require(arm->frames.size() <= static_cast<size_t>(kMaxFrames), "an arm has at most 32 frames");
    }
    return arm;
}

ToolTarget target_of(const Row& position, const Row& rotation, double metres_per_radian, double position_tolerance,
                     double rotation_tolerance) {
    require_columns(position.size(), 3, "a position");
    require(rotation.size() == 9 || rotation.size() == 0, "a rotation has 9 numbers, or none");
    ToolTarget target{{}, {}, rotation.size() == 9, metres_per_radian, position_tolerance, rotation_tolerance};
    std::copy(position.data(), position.data() + 3, target.position.begin());
    std::copy(rotation.data(), rotation.data() + rotation.size(), target.rotation.begin());
    return target;
}

// Where self-motion takes the solution `joints` (n,), towards `middle` (n,) by `weight` (n,); empty where there is
// none.
nb::ndarray<nb::numpy, double> centre(const ToolDescent& arm, const Row& joints, const Row& middle, const Row& weight,
                                      const Row& position, const Row& rotation, double metres_per_radian,
                                      double position_tolerance, double rotation_tolerance) {
    const size_t dof = arm.lower.size();
    for (const Row* row : {&joints, &middle, &weight}) require_columns(row->size(), dof, "joint values");
    const ToolTarget target = target_of(position, rotation, metres_per_radian, position_tolerance, rotation_tolerance);
    std::vector<double> moved(joints.data(), joints.data() + dof);
    Centring centring(arm, target, middle.data(), weight.data());
    if (centring.run(moved.data()) == Centred::kNoFreedom) moved.clear();
    const size_t count = moved.size();
    return array_of(std::move(moved), {count});
}

// Where the descents from `starts` (m, n) end: rows (m, n + 2) of joint values, error [m], and 1 for what is there.
nb::ndarray<nb::numpy, double> descend(const ToolDescent& arm, const Rows& starts, const Row& position,
                                       const Row& rotation, double metres_per_radian, double position_tolerance,
                                       double rotation_tolerance) {
    const size_t dof = arm.lower.size(), count = starts.shape(0);
    require_columns(starts.shape(1), dof, "joint values");
    const ToolTarget target = target_of(position, rotation, metres_per_radian, position_tolerance, rotation_tolerance);
    std::vector<double> rows(count * (dof + 2));
    {
        nb::gil_scoped_release release;
        DescentRun run(arm, target);
        for (size_t i = 0; i < count; ++i) {
            double* row = rows.data() + i * (dof + 2);
            std::copy(&starts(i, 0), &starts(i, 0) + dof, row);
            const DescentEnd end = run.run(row);
            row[dof] = end.error;
            row[dof + 1] = end.is_there ? 1.0 : 0.0;
        }
    }
    return array_of(std::move(rows), {count, dof + 2});
}

nb::tuple tool_position(const ToolDescent& arm, const Joints& joints) {
    require_columns(joints.size(), arm.lower.size(), "joint values");
    const auto position = DescentRun::tool_position(arm, joints.data());
    return nb::make_tuple(position[0], position[1], position[2]);
}

// `branches` (m, n) with every choice of full turns [rad] within the limits, (k, n), `most` choices of each at most.
nb::ndarray<nb::numpy, double> turned(const Rows& branches, const Row& lower, const Row& upper, const Row& period,
                                      double turn, double most) {
    const size_t dof = branches.shape(1);
    for (const Row* row : {&lower, &upper, &period}) require_columns(row->size(), dof, "ranges");
    require(dof >= 1 && most >= 1.0, "one choice of a joint at least");
    std::vector<double> rows;
    for (size_t i = 0; i < branches.shape(0); ++i) {
        append_turns({lower.data(), upper.data(), period.data(), dof}, &branches(i, 0), turn, most, rows);
    }
    const size_t count = rows.size() / dof;
    return array_of(std::move(rows), {count, dof});
}

// `rows` (m, n), those first that the slowest joint reaches soonest from `near` (n,) at `speed` (n,).
nb::ndarray<nb::numpy, double> nearest_first(const Rows& rows, const Row& near, const Row& speed) {
    const size_t dof = rows.shape(1), count = rows.shape(0);
    for (const Row* row : {&near, &speed}) require_columns(row->size(), dof, "joint values");
    std::vector<double> sorted;
    sorted.reserve(rows.size());
    for (const size_t at : by_travel(rows.data(), count, near.data(), speed.data(), dof)) {
        sorted.insert(sorted.end(), rows.data() + at * dof, rows.data() + (at + 1) * dof);
    }
    return array_of(std::move(sorted), {count, dof});
}

std::vector<Sphere> spheres_of(const Rows& rows) {
    require_columns(rows.shape(1), 4, "spheres (x, y, z, radius)");
    std::vector<Sphere> spheres;
    for (size_t i = 0; i < rows.shape(0); ++i) spheres.push_back({rows(i, 0), rows(i, 1), rows(i, 2), rows(i, 3)});
    return spheres;
}

std::shared_ptr<const Part> make_part(int frame, const Rows& spheres, std::vector<Obstacle> solids) {
    return std::make_shared<Part>(frame, spheres_of(spheres), std::move(solids));
}

nb::ndarray<nb::numpy, double> cover(const Rows& cells, const Rows& candidates, double least) {
    const std::vector<Sphere> held = spheres_of(cells);
    std::vector<double> rows;
    for (const Sphere& sphere : GreedyCover(held, spheres_of(candidates), least).choose()) {
        rows.insert(rows.end(), {sphere.x, sphere.y, sphere.z, sphere.radius});
    }
    const size_t count = rows.size() / 4;
    return array_of(std::move(rows), {count, size_t{4}});
}

PolytopeView polytope_of(const Rows& sides, const Rows& points) {
    require_columns(sides.shape(1), 4, "sides");
    require_columns(points.shape(1), 3, "points");
    return {sides.data(), sides.shape(0)};
}

// (n,) of points (n, 3) in the solid with these sides (k, 4).
nb::ndarray<nb::numpy, double> depths(const Rows& sides, const Rows& points) {
    const PolytopeView solid = polytope_of(sides, points);
    const size_t count = points.shape(0);
    std::vector<double> found(count);
    {
        nb::gil_scoped_release release;
        depths_in(solid, points.data(), count, found.data());
    }
    return array_of(std::move(found), {count});
}

// (n, 3) the points (n, 3), those outside after at most so many projections onto the sides (k, 4).
nb::ndarray<nb::numpy, double> projected(const Rows& sides, const Rows& points, int times) {
    const PolytopeView solid = polytope_of(sides, points);
    const size_t count = points.shape(0);
    std::vector<double> moved(points.data(), points.data() + 3 * count);
    {
        nb::gil_scoped_release release;
        project_onto(solid, moved.data(), count, times);
    }
    return array_of(std::move(moved), {count, size_t{3}});
}

std::vector<Triangle> triangles_of(const Rows& vertices, const Integers& faces) {
    require_columns(vertices.shape(1), 3, "vertices");
    require_columns(faces.shape(1), 3, "faces");
    std::vector<Triangle> triangles(faces.shape(0));
    for (size_t i = 0; i < faces.shape(0); ++i) {
        for (size_t k = 0; k < 3; ++k) {
            const int32_t index = faces(i, k);
            require(index >= 0 && static_cast<size_t>(index) < vertices.shape(0), "a face's vertex must exist");
            for (size_t axis = 0; axis < 3; ++axis) triangles[i][k][axis] = vertices(static_cast<size_t>(index), axis);
        }
    }
    return triangles;
}

std::shared_ptr<const TriangleMesh> make_mesh(const Rows& vertices, const Integers& faces) {
    auto triangles = triangles_of(vertices, faces);
    nb::gil_scoped_release release;
    return std::make_shared<const TriangleMesh>(std::move(triangles));
}

// The cells that hold any of the solid, for the fit of spheres: centres [m] and at least how deep, -1 at the surface.
nb::ndarray<nb::numpy, double> solid_cells(const Rows& vertices, const Integers& faces, double cell) {
    require(cell > 0.0, "a cell's edge must be above 0 m");
    const auto triangles = triangles_of(vertices, faces);
    require(!triangles.empty(), "a mesh needs at least one triangle");
    const DistanceGrid grid(triangles, cell);
    std::vector<double> rows;
    for (size_t i = 0; i < grid.cells.size(); ++i) {
        if (grid.kinds[i] == CellKind::kEmpty) continue;
        const Vector centre = grid.centre(i);
        const double depth = grid.kinds[i] == CellKind::kSolid ? static_cast<double>(grid.cells[i]) : -1.0;
        rows.insert(rows.end(), {centre[0], centre[1], centre[2], depth});
    }
    const size_t count = rows.size() / 4;
    return array_of(std::move(rows), {count, size_t{4}});
}

Obstacle make_obstacle(int shape, const Row& pose, const Row& size, double rounding, uint64_t touching,
                       std::shared_ptr<const TriangleMesh> mesh) {
    require(shape >= 0 && shape <= 3, "a shape is 0 to 3");
    require_columns(pose.size(), 12, "a pose");
    require_columns(size.size(), 3, "a size");
    require((shape == 3) == (mesh != nullptr), "a mesh, and only a mesh, comes with its triangles");
    Obstacle obstacle{static_cast<ShapeKind>(shape), {}, {}, rounding, touching, std::move(mesh)};
    std::copy(pose.data(), pose.data() + 12, obstacle.pose);
    std::copy(size.data(), size.data() + 3, obstacle.size);
    return obstacle;
}

// As `make_obstacle`, at a place [m] and turned by a quaternion (x, y, z, w) of any length but 0.
Obstacle make_placed_obstacle(int shape, const Vector& place, const std::array<double, 4>& quaternion,
                              const Vector& size, double rounding, uint64_t touching,
                              std::shared_ptr<const TriangleMesh> mesh) {
    require(shape >= 0 && shape <= 3, "a shape is 0 to 3");
    require((shape == 3) == (mesh != nullptr), "a mesh, and only a mesh, comes with its triangles");
    Obstacle obstacle{static_cast<ShapeKind>(shape), {}, {}, rounding, touching, std::move(mesh)};
    double length = 0.0;
    for (const double each : quaternion) length += each * each;
    length = std::sqrt(length);
    const double x = quaternion[0] / length, y = quaternion[1] / length, z = quaternion[2] / length,
                 w = quaternion[3] / length;
    const double pose[12] = {1 - 2 * (y * y + z * z),
                             2 * (x * y - z * w),
                             2 * (x * z + y * w),
                             2 * (x * y + z * w),
                             1 - 2 * (x * x + z * z),
                             2 * (y * z - x * w),
                             2 * (x * z - y * w),
                             2 * (y * z + x * w),
                             1 - 2 * (x * x + y * y),
                             place[0],
                             place[1],
                             place[2]};
    std::copy(pose, pose + 12, obstacle.pose);
    std::copy(size.begin(), size.end(), obstacle.size);
    return obstacle;
}

// `axes` are two rows: the joint value, its low and high end, 1 for a whole turn; `bounds` (rows, columns) [m].
std::shared_ptr<const PairTable> make_pair_table(int first, int second, const Rows& axes, const Rows& bounds) {
    require(axes.shape(0) == 2 && axes.shape(1) == 4, "a table has two axes of four numbers");
    const auto axis = [&](size_t i) {
        return TableAxis{static_cast<int32_t>(axes(i, 0)), axes(i, 1), axes(i, 2), axes(i, 3) != 0.0};
    };
    return std::make_shared<const PairTable>(first, second, axis(0), axis(1), static_cast<int32_t>(bounds.shape(0)),
                                             static_cast<int32_t>(bounds.shape(1)), bounds.data());
}

// Of every pair its parts, and how far each joint value moves these at most against one another.
nb::list reaches_between(const Body& body) {
    nb::list found;
    for (size_t pair = 0; pair < body.pairs().size(); ++pair) {
        const PairView& both = body.pairs()[pair];
        found.append(nb::make_tuple(both.first, both.second, body.reaches_between(pair)));
    }
    return found;
}

std::shared_ptr<const Body> make_body(std::shared_ptr<const Chain> chain, Parts parts, const Integers& pairs,
                                      Tables tables) {
    require_columns(pairs.shape(1), 2, "pairs");
    std::vector<PairView> both;
    for (size_t i = 0; i < pairs.shape(0); ++i) both.push_back({pairs(i, 0), pairs(i, 1), 0, nullptr});
    return std::make_shared<const Body>(std::move(chain), std::move(parts), std::move(both), std::move(tables));
}

std::shared_ptr<const Surroundings> make_surroundings(std::vector<Obstacle> obstacles) {
    return std::make_shared<const Surroundings>(std::move(obstacles));
}

std::shared_ptr<const World> make_world(std::shared_ptr<const Body> body,
                                        std::shared_ptr<const Surroundings> surroundings) {
    return std::make_shared<const World>(std::move(body), std::move(surroundings));
}

// As many as there are parts or pairs, or more.
size_t most_things(const World& world) {
    return std::max<size_t>(kMaxParts, static_cast<size_t>(world.view().pair_count));
}

// Which rows are free; eight at a time.
nb::ndarray<nb::numpy, bool> are_free(const World& world, const Kernel& kernel, const Rows& rows, double margin) {
    require_columns(rows.shape(1), static_cast<size_t>(world.dof()), "joint values");
    require_usable(rows.data(), rows.size());
    const size_t count = rows.shape(0), dof = rows.shape(1);
    auto* verdicts = new bool[count + 1];
    nb::capsule owner(verdicts, [](void* p) noexcept { delete[] static_cast<bool*>(p); });
    {
        nb::gil_scoped_release release;
        const std::vector<MotionView> still(most_things(world), MotionView{0.0f, 0.0f});
        float joints[kMaxDof * kLanes];
        const float half[kLanes] = {};
        for (size_t first = 0; first < count; first += kLanes) {
            const size_t lanes = std::min<size_t>(kLanes, count - first);
            for (size_t lane = 0; lane < kLanes; ++lane) {
                const double* row = rows.data() + (first + std::min(lane, lanes - 1)) * dof;
                for (size_t i = 0; i < dof; ++i) joints[i * kLanes + lane] = static_cast<float>(row[i]);
            }
            CheckResult checked;
            kernel.check(world.view(),
                         {joints, half, nullptr, nullptr, still.data(), still.data(), static_cast<float>(margin),
                          (1u << lanes) - 1, false, nullptr},
                         checked);
            for (size_t lane = 0; lane < lanes; ++lane) verdicts[first + lane] = !(checked.hits >> lane & 1u);
        }
    }
    return nb::ndarray<nb::numpy, bool>(verdicts, {count}, owner);
}

// The same of one configuration, with the interpreter's lock held: it takes as long as to release it.
bool is_free(const World& world, const Kernel& kernel, const Joints& joints, double margin) {
    require_columns(joints.size(), static_cast<size_t>(world.dof()), "joint values");
    require_usable(joints.data(), joints.size());
    return MotionValidator(world, kernel, {margin, 0.0, 0.0}).is_free(joints.data());
}

// Eight paddings at once: the largest in [low, high] with which nothing is near, narrowed eightfold each time.
nb::tuple clearance(const World& world, const Kernel& kernel, const Row& row, double most) {
    const Joints at = joints_of(row, world);
    const std::vector<MotionView> unit(most_things(world), MotionView{1.0f, 0.0f});
    float joints[kMaxDof * kLanes], half[kLanes];
    for (size_t i = 0; i < at.size(); ++i) std::fill_n(joints + i * kLanes, kLanes, static_cast<float>(at[i]));
    double low = 0.0, high = most;
    CheckResult checked{}, nearest{0, 0, -1, -1};
    while (high - low > 1e-6) {
        for (int lane = 0; lane < kLanes; ++lane)
            half[lane] = static_cast<float>(low + (high - low) * (lane + 1) / kLanes);
        kernel.check(world.view(),
                     {joints, half, nullptr, nullptr, unit.data(), unit.data(), 0.0f, kAllLanes, true, nullptr},
                     checked);
        if (checked.hits != 0) return nb::make_tuple(0.0, checked.first, checked.second);
        if (checked.near == 0 && low == 0.0 && high == most) return nb::make_tuple(most, -1, -1);
        int free = 0;
        while (free < kLanes && !(checked.near >> free & 1u)) ++free;
        if (checked.near != 0) nearest = checked;
        const double step = (high - low) / kLanes;
        high = free == kLanes ? high : low + step * (free + 1);
        low = low + step * free;
        if (free == kLanes) break;
    }
    return nb::make_tuple(low, nearest.first, nearest.second);
}

nb::tuple first_contact(const World& world, const Kernel& kernel, const Row& row, double margin) {
    const Joints at = joints_of(row, world);
    MotionValidator validator(world, kernel, {margin, 0.0, 0.0});
    const bool is_free = validator.is_free(at.data());
    return nb::make_tuple(!is_free, validator.result().first, validator.result().second);
}

// Measured: a sampled trajectory is looked at in fewer stretches where they begin as long as so many of its lines. Few
// lines are looked at one by one.
constexpr size_t kManyRows = 64, kLinesTogether = 8;

size_t stride_for(size_t rows) { return rows < kManyRows ? 1 : kLinesTogether; }

// Verdict of a polyline (degree 1) or of a B-spline by its control points (degree 3), and where on it, if it touches.
nb::tuple look(const World& world, const Kernel& kernel, const Rows& rows, int degree, double margin, double finest,
               double seconds, Flag cancel) {
    require_columns(rows.shape(1), static_cast<size_t>(world.dof()), "joint values");
    require_usable(rows.data(), rows.size());
    require(degree == 1 || degree == 3, "a course is of degree 1 or 3");
    require(rows.shape(0) > static_cast<size_t>(degree), "a course needs more rows than its degree");
    nb::gil_scoped_release release;
    Tolerances tolerances;
    tolerances.margin = margin;
    tolerances.finest = finest;
    MotionValidator validator(world, kernel, tolerances);
    const StopCondition stop(seconds, cancel);
    const size_t count = rows.shape(0), dof = rows.shape(1);
    const Verdict verdict = degree == 1 ? validator.look(Polyline(rows.data(), count, dof, stride_for(count)), stop)
                                        : validator.look(Spline(rows.data(), count, dof), stop);
    nb::gil_scoped_acquire acquire;
    return nb::make_tuple(static_cast<int>(verdict),
                          array_of(Joints(validator.touching()), {validator.touching().size()}));
}

// Of a polyline that is not known to be free: for each range, in rows, begin and end, and the unresolved pairs (k, 2).
nb::list unresolved(const World& world, const Kernel& kernel, const Rows& rows, double margin, double finest) {
    require_columns(rows.shape(1), static_cast<size_t>(world.dof()), "joint values");
    require_usable(rows.data(), rows.size());
    require(rows.shape(0) > 1, "a polyline needs two rows");
    Tolerances tolerances;
    tolerances.margin = margin;
    tolerances.finest = finest;
    std::vector<MotionValidator::Unresolved> found;
    {
        nb::gil_scoped_release release;
        MotionValidator validator(world, kernel, tolerances);
        const Polyline path(rows.data(), rows.shape(0), rows.shape(1));
        found = validator.unresolved(path, StopCondition(std::numeric_limits<double>::infinity(), nullptr));
    }
    nb::list result;
    for (const auto& interval : found) {
        std::vector<int32_t> pairs;
        for (const auto& pair : interval.pairs) pairs.insert(pairs.end(), pair.begin(), pair.end());
        const size_t count = interval.pairs.size();
        result.append(nb::make_tuple(interval.begin, interval.end, array_of(std::move(pairs), {count, size_t{2}})));
    }
    return result;
}

std::vector<Joints> each_row(const Rows& rows, const World& world, const char* what) {
    require_columns(rows.shape(1), static_cast<size_t>(world.dof()), what);
    require_usable(rows.data(), rows.size());
    std::vector<Joints> each;
    for (size_t i = 0; i < rows.shape(0); ++i) each.emplace_back(&rows(i, 0), &rows(i, 0) + rows.shape(1));
    return each;
}

Plan find(const World& world, const Kernel& kernel, const Rows& bounds, const Row& start, const Rows& goals,
          uint64_t seed, double margin, double seconds, Flag cancel, uint64_t enough, bool are_lines_blocked) {
    const auto limits = each_row(bounds, world, "bounds (lower, upper, weights)");
    require(limits.size() == 3, "bounds are three rows: lower, upper, weights");
    const Space space{limits[0], limits[1], limits[2]};
    PlanQuery query{joints_of(start, world), each_row(goals, world, "goals"), seed, enough, are_lines_blocked};
    require(!query.goals.empty(), "a plan needs at least one goal");
    nb::gil_scoped_release release;
    Tolerances tolerances;
    tolerances.margin = margin;
    return plan(world, kernel, space, tolerances, query, StopCondition(seconds, cancel));
}

nb::ndarray<nb::numpy, double> path_of(const Plan& plan, size_t dof) {
    std::vector<double> rows;
    for (const Joints& joints : plan.path) rows.insert(rows.end(), joints.begin(), joints.end());
    return array_of(std::move(rows), {plan.path.size(), dof});
}

// The leaves' centres (n, leaves, 3), for the tests of the kinematics.
nb::ndarray<nb::numpy, float> centres(const World& world, const Kernel& kernel, const Rows& rows) {
    require_columns(rows.shape(1), static_cast<size_t>(world.dof()), "joint values");
    require_usable(rows.data(), rows.size());
    const size_t dof = rows.shape(1), spheres = world.sphere_count();
    std::vector<float> result(rows.shape(0) * spheres * 3), joints(dof * kLanes), placed(spheres * 3 * kLanes);
    for (size_t row = 0; row < rows.shape(0); ++row) {
        for (size_t i = 0; i < dof * kLanes; ++i) joints[i] = static_cast<float>(rows(row, i / kLanes));
        kernel.place(world.view(), joints.data(), placed.data());
        for (size_t i = 0; i < spheres * 3; ++i) result[row * spheres * 3 + i] = placed[i * kLanes + row % kLanes];
    }
    return array_of(std::move(result), {rows.shape(0), spheres, size_t{3}});
}

// The number of the first of the nearest of the rows (n, dof) to each of the points (m, dof), for the tests of trees.
nb::ndarray<nb::numpy, int64_t> nearest_rows(const Rows& rows, const Row& weights, const Rows& points) {
    const size_t dof = weights.size();
    require(dof >= 1 && dof <= kMaxDof && rows.shape(0) > 0, "there must be rows of 1 to 16 joint values");
    require_columns(rows.shape(1), dof, "rows");
    require_columns(points.shape(1), dof, "points");
    const Space space{Joints(dof), Joints(dof), {weights.data(), weights.data() + dof}};
    SearchTree tree(space);
    for (size_t row = 0; row < rows.shape(0); ++row) tree.add(rows.data() + row * dof, 0);
    std::vector<int64_t> found;
    for (size_t point = 0; point < points.shape(0); ++point) {
        found.push_back(static_cast<int64_t>(tree.nearest(points.data() + point * dof).index));
    }
    return array_of(std::move(found), {points.shape(0)});
}

}  // namespace
}  // namespace gemelo

NB_MODULE(_motion, module) {
    using namespace gemelo;
    nb::set_leak_warnings(false);  // what Python keeps until the process ends is no leak
    using namespace nb::literals;
    nb::class_<Chain>(module, "Chain");
    nb::class_<ToolDescent>(module, "ToolDescent");
    nb::class_<Part>(module, "Part");
    nb::class_<TriangleMesh>(module, "TriangleMesh");
    nb::class_<Obstacle>(module, "Obstacle");
    nb::class_<PairTable>(module, "PairTable");
    nb::class_<Body>(module, "Body");
    nb::class_<Surroundings>(module, "Surroundings");
    nb::class_<World>(module, "World");
    nb::class_<Kernel>(module, "Kernel").def_ro("name", &Kernel::name);
    nb::class_<CancelFlag>(module, "CancelFlag")
        .def(nb::init<double>(), "seconds_per_question"_a = 0.0)
        .def("time", &CancelFlag::ask, "questions"_a = 1)
        .def("set", [](CancelFlag& flag) { flag.is_set.store(true); })
        .def("is_set", [](const CancelFlag& flag) { return flag.is_set.load(); });
    nb::class_<Plan>(module, "Plan")
        .def_prop_ro("outcome", [](const Plan& plan) { return static_cast<int>(plan.outcome); })
        .def("path", &path_of, "dof"_a)
        .def(
            "control",
            [](const Plan& plan, size_t dof) {
                return array_of(std::vector<double>(plan.control), {plan.control.size() / dof, dof});
            },
            "dof"_a)
        .def("shares",
             [](const Plan& plan) { return array_of(std::vector<double>(plan.shares), {plan.shares.size()}); })
        .def_ro("search_s", &Plan::search_s)
        .def_ro("shorten_s", &Plan::shorten_s)
        .def_ro("smooth_s", &Plan::smooth_s)
        .def_ro("iterations", &Plan::iterations)
        .def_ro("checks", &Plan::checks);
    module.def("kernel_names", [] {
        std::vector<std::string> names;
        for (const Kernel* kernel : kernels()) names.emplace_back(kernel->name);
        return names;
    });
    module.def(
        "kernel", [](const std::string& name) { return &kernel_named(name); }, "name"_a, nb::rv_policy::reference);
    module.def("chain", &make_chain, "links"_a, "numbers"_a, "dof"_a);
    module.def("tool_descent", &make_tool_descent, "links"_a, "numbers"_a, "frame"_a, "pose"_a, "bounds"_a);
    module.def("tool_position", &tool_position, "arm"_a, "joints"_a);
    module.def("descend", &descend, "arm"_a, "starts"_a, "position"_a, "rotation"_a, "metres_per_radian"_a,
               "position_tolerance"_a, "rotation_tolerance"_a);
    module.def("centre", &centre, "arm"_a, "joints"_a, "middle"_a, "weight"_a, "position"_a, "rotation"_a,
               "metres_per_radian"_a, "position_tolerance"_a, "rotation_tolerance"_a);
    module.def("turned", &turned, "branches"_a, "lower"_a, "upper"_a, "period"_a, "turn"_a, "most"_a);
    module.def("nearest_first", &nearest_first, "rows"_a, "near"_a, "speed"_a);
    module.def("part", &make_part, "frame"_a, "spheres"_a, "solids"_a);
    module.def("cover", &cover, "cells"_a, "candidates"_a, "least"_a);
    module.def("depths", &depths, "sides"_a, "points"_a);
    module.def("projected", &projected, "sides"_a, "points"_a, "times"_a);
    module.def("mesh", &make_mesh, "vertices"_a, "faces"_a);
    module.def("solid_cells", &solid_cells, "vertices"_a, "faces"_a, "cell"_a);
    module.def("obstacle", &make_obstacle, "shape"_a, "pose"_a, "size"_a, "rounding"_a, "touching"_a, "mesh"_a.none());
    module.def("placed_obstacle", &make_placed_obstacle, "shape"_a, "place"_a, "quaternion"_a, "size"_a, "rounding"_a,
               "touching"_a, "mesh"_a.none());
    module.def("body", &make_body, "chain"_a, "parts"_a, "pairs"_a, "tables"_a);
    module.def("pair_table", &make_pair_table, "first"_a, "second"_a, "axes"_a, "bounds"_a);
    module.def("reaches_between", &reaches_between, "body"_a);
    module.def("surroundings", &make_surroundings, "obstacles"_a);
    module.def("world", &make_world, "body"_a, "surroundings"_a);
    module.def("are_free", &are_free, "world"_a, "kernel"_a, "rows"_a, "margin"_a);
    module.def("is_free", &is_free, "world"_a, "kernel"_a, "joints"_a, "margin"_a);
    module.def("clearance", &clearance, "world"_a, "kernel"_a, "row"_a, "most"_a);
    module.def("first_contact", &first_contact, "world"_a, "kernel"_a, "row"_a, "margin"_a);
    module.def("look", &look, "world"_a, "kernel"_a, "rows"_a, "degree"_a, "margin"_a, "finest"_a, "seconds"_a,
               "cancel"_a.none());
    module.def("unresolved", &unresolved, "world"_a, "kernel"_a, "rows"_a, "margin"_a, "finest"_a);
    module.def("plan", &find, "world"_a, "kernel"_a, "bounds"_a, "start"_a, "goals"_a, "seed"_a, "margin"_a,
               "seconds"_a, "cancel"_a.none(), "enough"_a, "are_lines_blocked"_a);
    add_trajectories(module);
    module.def("centres", &centres, "world"_a, "kernel"_a, "rows"_a);
    module.def("nearest_rows", &nearest_rows, "rows"_a, "weights"_a, "points"_a);
}
