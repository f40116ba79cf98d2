#include "inspector.h"

#include <algorithm>
#include <cmath>

using namespace gemelo;

namespace property {
namespace {

constexpr double kFine = 1.0 / static_cast<double>(kFineStep);
constexpr double kHeadroom = 1.1;
constexpr size_t kSpans[] = {1, 4, 16};  // slots

int64_t floor_of(int64_t a, int64_t b) { return a >= 0 ? a / b : -((b - 1 - a) / b); }

}  // namespace

Inspector::Inspector(const Bench& bench, const Machine& machine, Findings& findings)
    : bench_(bench), machine_(machine), findings_(findings), jump_(bench.config.joints) {
    for (uint8_t j = 0; j < bench.config.joints; ++j) {
        Axis axis;
        axis.fastest = velocity_limit_q8(bench.config, j) / 256.0;
        axis.harshest = bench.config.joint[j].max_acceleration_q8 / 256.0;
        axis_.push_back(axis);
    }
    dt_.fill(1);
}

void Inspector::recount(uint8_t joint, const Oscilloscope& scope) {
    axis_[joint].p_q20 = machine_.present().position_q20[joint];
    axis_[joint].offset = machine_.stepper().latched(joint) - scope.count(joint);
}

void Inspector::start_anew(Oscilloscope& scope) {
    for (uint8_t j = 0; j < axis_.size(); ++j) {
        recount(j, scope);
        axis_[j].v.fill(0);
    }
    next_ = Expected{};
    stream_ = 0;
    scope.forget();
    slot_begin_ = scope.tick();
}

void Inspector::expect_stream(uint32_t stream, const PlayedPath& path) { next_ = Expected{stream, path}; }

void Inspector::look(Oscilloscope& scope) {
    const Point& point = machine_.present();
    dt_[++slots_ % dt_.size()] = 1;
    switch_stream(point);
    check_path(point);
    check_steps(scope);
    for (uint8_t j = 0; j < axis_.size(); ++j) {
        check_spread(scope, j, point.position_q20[j]);
        const double way = static_cast<double>(point.position_q20[j] - axis_[j].p_q20) * kFine - jump_[j];
        axis_[j].p_q20 = point.position_q20[j];
        check_limits(j, way);
        jump_[j] = 0;
    }
    scope.forget();
    slot_begin_ = scope.tick();
}

// A path may begin up to one step from where the arm stands; the steps between are made in its first slot. A stream
// that was stopped before has none: the arm stays where it is.
void Inspector::switch_stream(const Point& point) {
    if (next_.stream == 0 || point.stream != next_.stream) return;
    if (machine_.mode() == Mode::Idle && stands(point)) {
        next_ = Expected{};
        stream_ = 0;
        return;
    }
    stream_ = next_.stream;
    path_ = next_.path;
    next_ = Expected{};
    play_us_ = 0;
    path_.seek(0);
    for (uint8_t j = 0; j < axis_.size(); ++j)
        jump_[j] = path_.position(j) - static_cast<double>(axis_[j].p_q20) * kFine;
}

bool Inspector::stands(const Point& point) const {
    for (uint8_t j = 0; j < axis_.size(); ++j)
        if (point.position_q20[j] != axis_[j].p_q20) return false;
    return true;
}

void Inspector::check_path(const Point& point) {
    if (stream_ == 0 || point.stream != stream_ || next_.stream != 0) return;
    if (point.play_us < play_us_ || point.play_us > play_us_ + kSlotUs)
        findings_.add(Property::OnThePath, "stream time goes from ", play_us_, " to ", point.play_us);
    play_us_ = point.play_us;
    if (!path_.seek(play_us_)) findings_.add(Property::OnThePath, "stream time ", play_us_, " is beyond the path");
    dt_[slots_ % dt_.size()] = path_.shortest_dt();
    for (uint8_t j = 0; j < axis_.size(); ++j) {
        const double away = static_cast<double>(point.position_q20[j]) * kFine - path_.position(j);
        // Stream time is told in whole us; the parameter has 24 bits, the coefficients 20.
        const double resolution = 1.1e-6 + path_.shortest_dt() * 0x1p-22;
        if (std::fabs(away) > std::fabs(path_.velocity(j)) * resolution + 1e-4)
            findings_.add(Property::OnThePath, "joint ", int{j}, " is ", away, " steps off the path at ", play_us_,
                          " us");
    }
}

void Inspector::check_steps(const Oscilloscope& scope) {
    for (uint8_t j = 0; j < axis_.size(); ++j) {
        const int64_t wanted = (machine_.present().position_q20[j] + kFineStep / 2) >> kFineBits;
        const int64_t made = scope.count(j) + axis_[j].offset;
        if (made != wanted || machine_.stepper().latched(j) != made)
            findings_.add(Property::EmittedSteps, "joint ", int{j}, " made ", made, " steps, counted ",
                          machine_.stepper().latched(j), ", should have ", wanted);
    }
}

// Each pulse comes in the tick in which the straight line through the slot passes its half step, or one later where
// the pulse before is in the way. DIR's set-up and a path that begins beside the arm put them off further.
void Inspector::check_spread(const Oscilloscope& scope, uint8_t joint, int64_t p_q20) {
    if (scope.has_turned(joint) || jump_[joint] != 0) return;
    const int64_t slot = static_cast<int64_t>(ticks_per_slot(bench_.config)) * kFineStep;
    const int64_t start = (axis_[joint].p_q20 + kFineStep / 2) * (slot / kFineStep), way = p_q20 - axis_[joint].p_q20;
    for (const Rise& rise : scope.rises(joint)) {
        const int64_t tick = static_cast<int64_t>(rise.tick - slot_begin_) + 1;
        const int64_t count = rise.count + axis_[joint].offset;
        const int64_t due = floor_of(start + way * tick, slot), overdue = floor_of(start + way * (tick - 2), slot);
        const bool is_early = way > 0 ? due < count : due > count;
        const bool is_late = tick > 2 && (way > 0 ? overdue >= count : overdue <= count);
        if (is_early || is_late)
            findings_.add(Property::PulseTiming, "joint ", int{joint}, " makes step ", count, " in tick ", tick,
                          is_early ? " of its slot, too early" : " of its slot, too late");
    }
}

void Inspector::check_limits(uint8_t joint, double way) {
    Axis& axis = axis_[joint];
    const double v = way * kSlotHz;
    axis.v[slots_ % axis.v.size()] = v;
    const double dt = shortest_dt();
    const double rounding = 1.5 / 256 / dt + 1.0 / 512;
    const double grain = (16 * kFine + axis.fastest * 0.25 * 0x1p-23) * kSlotHz;
    if (std::fabs(v) > axis.fastest * kHeadroom)
        findings_.add(Property::Limits, "joint ", int{joint}, " does ", v, " steps/s, its limit is ", axis.fastest);
    for (size_t span : kSpans) {
        const double change = std::fabs(v - axis.v[(slots_ + axis.v.size() - span) % axis.v.size()]);
        const double slots = static_cast<double>(span == kWindow ? span : span + 1);
        const double allowed = kHeadroom * axis.harshest * slots / kSlotHz;
        if (change > allowed + 2 * rounding + grain)
            findings_.add(Property::Limits, "joint ", int{joint}, " changes by ", change, " steps/s in ", span,
                          " ms, its acceleration limit is ", axis.harshest, ", its velocity ", v, ", dt ", dt);
    }
}

double Inspector::shortest_dt() const { return *std::min_element(dt_.begin(), dt_.end()); }

}  // namespace property
