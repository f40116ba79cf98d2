// Trajectories for Python: timed along a path, and sampled when they are finished; arrays in, arrays out.
#include "trajectories.h"

#include <array>

#include "arrays.h"
#include "step_stream.h"
#include "timing/timed_path.h"

namespace gemelo {
namespace {

// A trajectory of at least two points (m,), (m, n).
TrajectoryView trajectory_of(const Row& stamps, const Rows& p, const Rows& v, const Rows& a) {
    const size_t points = stamps.size(), dof = p.shape(1);
    require(points > 1, "a trajectory has two points at least");
    for (const Rows* rows : {&p, &v, &a}) {
        require(rows->shape(0) == points && rows->shape(1) == dof, "points must be as many as stamps, and alike");
    }
    return {stamps.data(), p.data(), v.data(), a.data(), dof};
}

// Positions, velocities, accelerations and jerks, (m, n) each, of the quintics through a trajectory's points at `times`
// (m,), each in the segment `index` (m,).
nb::tuple quintics(const Row& stamps, const Rows& p, const Rows& v, const Rows& a, const Row& times,
                   const Segments& index) {
    const TrajectoryView trajectory = trajectory_of(stamps, p, v, a);
    const size_t points = stamps.size(), dof = trajectory.dof, count = times.size();
    require(index.size() == count, "each time needs its segment");
    for (size_t i = 0; i < count; ++i) {
        require(index(i) >= 0 && static_cast<size_t>(index(i)) + 1 < points, "a segment must exist");
    }
    std::array<std::vector<double>, 4> columns;
    for (auto& column : columns) column.resize(count * dof);
    {
        nb::gil_scoped_release release;
        Segment segment;
        for (size_t i = 0; i < count; ++i) {
            if (i == 0 || index(i) != index(i - 1)) segment.begin(trajectory, static_cast<size_t>(index(i)));
            segment.sample(times(i),
                           {&columns[0][i * dof], &columns[1][i * dof], &columns[2][i * dof], &columns[3][i * dof]});
        }
    }
    const auto taken = [&](size_t k) { return array_of(std::move(columns[k]), {count, dof}); };
    return nb::make_tuple(taken(0), taken(1), taken(2), taken(3));
}

// Positions (k, n) of samples at `shares` of each segment, and (5, n) the least and the largest of them, and the
// largest sizes of velocities, accelerations and jerks.
nb::tuple sampled(const Row& stamps, const Rows& p, const Rows& v, const Rows& a, const Row& shares) {
    const TrajectoryView trajectory = trajectory_of(stamps, p, v, a);
    const size_t dof = trajectory.dof, segments = stamps.size() - 1, rows = segments * shares.size();
    std::vector<double> positions(rows * dof);
    std::vector<double> reached(5 * dof);
    const auto row = [&](size_t k) { return reached.data() + k * dof; };
    {
        nb::gil_scoped_release release;
        sample_all(trajectory, segments, shares.data(), shares.size(), positions.data(),
                   {row(0), row(1), row(2), row(3), row(4)});
    }
    return nb::make_tuple(array_of(std::move(positions), {rows, dof}), array_of(std::move(reached), {size_t{5}, dof}));
}

// A tuple of floats for each of `rows` (m, n).
nb::list tuples(const Rows& rows) {
    const auto count = static_cast<Py_ssize_t>(rows.shape(0)), columns = static_cast<Py_ssize_t>(rows.shape(1));
    nb::list result = nb::steal<nb::list>(PyList_New(count));
    if (!result.is_valid()) throw nb::python_error();
    const double* values = rows.data();
    for (Py_ssize_t i = 0; i < count; ++i) {
        PyObject* row = PyTuple_New(columns);
        if (row == nullptr) throw nb::python_error();
        PyList_SET_ITEM(result.ptr(), i, row);
        for (Py_ssize_t k = 0; k < columns; ++k) {
            PyObject* number = PyFloat_FromDouble(*values++);
            if (number == nullptr) throw nb::python_error();
            PyTuple_SET_ITEM(row, k, number);
        }
    }
    return result;
}

// How far any of `rows` (m, n) is at most from the line between two rows (2, n), in any joint.
double most_aside(const Rows& line, const Rows& rows) {
    require(line.shape(0) == 2, "a line has two ends");
    require_columns(rows.shape(1), line.shape(1), "joint values");
    return aside(line.data(), rows.data(), rows.shape(0), rows.shape(1));
}

// By joints; `loads` (n, 3): inertia, friction, and the turn of a step, 0 where nothing is known of the motor; `curves`
// (k, 3): joint, rate and pull-out torque.
std::vector<MotorView> motors_of(const Rows& loads, const Rows& curves, size_t dof) {
    require(loads.shape(0) == dof, "each joint needs its load");
    require_columns(loads.shape(1), 3, "loads");
    require_columns(curves.shape(1), 3, "curves");
    std::vector<MotorView> motors;
    for (size_t i = 0; i < dof; ++i) motors.push_back({loads(i, 0), loads(i, 1), loads(i, 2), {}, {}});
    for (size_t row = 0; row < curves.shape(0); ++row) {
        require(curves(row, 0) >= 0.0 && curves(row, 0) < static_cast<double>(dof), "a curve's joint must exist");
        MotorView& motor = motors[static_cast<size_t>(curves(row, 0))];
        motor.speed.push_back(curves(row, 1));
        motor.torque.push_back(curves(row, 2));
    }
    return motors;
}

// The largest rate of the step stream of a trajectory from the knot `begin` to the knot `end`, at `shares` of its
// knots, and the largest share of the pull-out torque, (2, n); `scale` (n,) is in parts of a step, of which there are
// `subdivision`, the motors are as of `motors_of`.
nb::ndarray<nb::numpy, double> stream_demands(const Row& stamps, const Rows& p, const Rows& v, const Rows& a,
                                              const Row& scale, const Rows& loads, const Rows& curves,
                                              const Row& shares, size_t begin, size_t end, size_t last, double knot,
                                              double subdivision) {
    const TrajectoryView trajectory = trajectory_of(stamps, p, v, a);
    const size_t dof = trajectory.dof;
    require_columns(scale.size(), dof, "scales");
    require(begin < end, "a stream has two knots at least");
    const std::vector<MotorView> motors = motors_of(loads, curves, dof);
    std::vector<double> demands(2 * dof);
    {
        nb::gil_scoped_release release;
        const Stream made = stream_of(trajectory, {scale.data(), stamps.size(), begin, end, last, knot, subdivision});
        const StreamView stream{made.start.data(), made.square.data(), made.cube.data(), end - begin, dof,
                                shares.size(),     knot * subdivision};
        peak_rates(stream, shares.data(), demands.data());
        for (size_t i = 0; i < dof; ++i) {
            if (motors[i].speed.empty()) continue;
            demands[dof + i] = torque_share(stream, shares.data(), i, motors[i], knot, subdivision);
        }
    }
    return array_of(std::move(demands), {size_t{2}, dof});
}

// How long [s] braking from the largest of `velocities` (m, n) takes the joint that takes longest, with
// `accelerations` (n,).
double longest_braking(const Rows& velocities, const Row& accelerations) {
    const size_t dof = velocities.shape(1);
    require_columns(accelerations.size(), dof, "accelerations");
    double longest = 0.0;
    for (size_t i = 0; i < dof; ++i) {
        double most = 0.0;
        for (size_t row = 0; row < velocities.shape(0); ++row) grow(std::abs(velocities(row, i)), most);
        grow(most / accelerations(i), longest);
    }
    return longest;
}

// True if what has been `reached` (5, n), as of `sampled`, is within `most` (5, n), the first row of it from below.
bool is_within(const Rows& reached, const Rows& most) {
    const size_t dof = reached.shape(1);
    require(reached.shape(0) == 5 && most.shape(0) == 5 && most.shape(1) == dof, "five rows each, of the same joints");
    for (size_t i = 0; i < dof; ++i) {
        if (!(reached(0, i) >= most(0, i))) return false;
        for (size_t row = 1; row < 5; ++row) {
            if (!(reached(row, i) <= most(row, i))) return false;
        }
    }
    return true;
}

// The largest rate (n,) of a step stream, whose coefficients (k, n) are in 1/256 steps, at `shares` of its knots.
nb::ndarray<nb::numpy, double> rates_of(const Rows& start, const Rows& square, const Rows& cube, const Row& shares,
                                        double knot) {
    const size_t knots = start.shape(0), dof = start.shape(1);
    for (const Rows* rows : {&square, &cube}) {
        require(rows->shape(0) == knots && rows->shape(1) == dof, "coefficients must be alike");
    }
    std::vector<double> peaks(dof);
    peak_rates({start.data(), square.data(), cube.data(), knots, dof, shares.size(), knot}, shares.data(),
               peaks.data());
    return array_of(std::move(peaks), {dof});
}

// Times (m,), and positions, velocities and accelerations (m, n).
nb::tuple taken(States states, size_t dof) {
    const size_t rows = states.times.size();
    return nb::make_tuple(array_of(std::move(states.times), {rows}), array_of(std::move(states.positions), {rows, dof}),
                          array_of(std::move(states.velocities), {rows, dof}),
                          array_of(std::move(states.accelerations), {rows, dof}));
}

// The limits of all joints that have columns in `rows`, of which there must be at least `least`.
LimitsView limits_for(const Rows& rows, size_t least, const Row& velocity, const Row& acceleration, const Row& jerk) {
    const size_t dof = rows.shape(1);
    require(dof >= 1 && dof <= static_cast<size_t>(kMaxDof), "an arm has 1 to 16 joint values");
    require(rows.shape(0) >= least, "a line has 2 corners at least, a curve 4 control points");
    for (const Row* limit : {&velocity, &acceleration, &jerk}) require_columns(limit->size(), dof, "limits");
    return {velocity.data(), acceleration.data(), jerk.data(), dof};
}

// The states along the uniform cubic B-spline of `control` (k, n).
nb::tuple timed_curve(const Rows& control, const Row& velocity, const Row& acceleration, const Row& jerk) {
    const LimitsView limits = limits_for(control, 4, velocity, acceleration, jerk);
    States states;
    {
        nb::gil_scoped_release release;
        states = timed_path(control.data(), control.shape(0), limits);
    }
    return taken(std::move(states), limits.dof);
}

// The states from corner to corner of the polyline (m, n), at rest at all of them.
nb::tuple timed_lines(const Rows& corners, const Row& velocity, const Row& acceleration, const Row& jerk) {
    const LimitsView limits = limits_for(corners, 2, velocity, acceleration, jerk);
    States states;
    {
        nb::gil_scoped_release release;
        states = stop_and_go(corners.data(), corners.shape(0), limits);
    }
    return taken(std::move(states), limits.dof);
}

}  // namespace

void add_trajectories(nb::module_& module) {
    using namespace nb::literals;
    nb::exception<NoProfile>(module, "NoProfile", PyExc_ValueError);
    nb::exception<TurnsOnTheSpot>(module, "TurnsOnTheSpot", PyExc_ValueError);
    module.def("quintics", &quintics, "stamps"_a, "positions"_a, "velocities"_a, "accelerations"_a, "times"_a,
               "index"_a);
    module.def("peak_rates", &rates_of, "start"_a, "square"_a, "cube"_a, "shares"_a, "knot"_a);
    module.def("sampled", &sampled, "stamps"_a, "positions"_a, "velocities"_a, "accelerations"_a, "shares"_a);
    module.def("tuples", &tuples, "rows"_a);
    module.def("most_aside", &most_aside, "line"_a, "rows"_a);
    module.def("stream_demands", &stream_demands, "stamps"_a, "positions"_a, "velocities"_a, "accelerations"_a,
               "scale"_a, "loads"_a, "curves"_a, "shares"_a, "begin"_a, "end"_a, "last"_a, "knot"_a, "subdivision"_a);
    module.def("longest_braking", &longest_braking, "velocities"_a, "accelerations"_a);
    module.def("is_within", &is_within, "reached"_a, "most"_a);
    module.def("timed_curve", &timed_curve, "control"_a, "velocity"_a, "acceleration"_a, "jerk"_a);
    module.def("timed_lines", &timed_lines, "corners"_a, "velocity"_a, "acceleration"_a, "jerk"_a);
}

}  // namespace gemelo
