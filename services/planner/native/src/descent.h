// Descents towards a tool target within the joint limits: damped least squares after Levenberg and Marquardt, with the
// joints that press against a limit left out of the step. In doubles, unlike the check.
#pragma once

#include <array>

#include "robot.h"

namespace gemelo {

struct ToolTarget {
    std::array<double, 3> position;  // [m]
    std::array<double, 9> rotation;  // by rows
    bool has_rotation;
    double metres_per_radian;
    double position_tolerance;  // [m]
    double rotation_tolerance;  // [rad]
};

// A frame as in FrameView, and the tool's in the last of them.
struct ToolFrame {
    int32_t parent, drive, slides;
    double multiplier, offset;
    std::array<double, 12> fixed;
};

struct ToolDescent {
    std::vector<ToolFrame> frames;  // from the base to the tool, without branches
    std::array<double, 12> tool;    // in the last frame
    std::vector<double> lower, upper;
};

// Where a descent ended.
struct DescentEnd {
    double error;  // [m], turns weighted in
    bool is_there;
};

class DescentRun {
  public:
    DescentRun(const ToolDescent& arm, const ToolTarget& target) : arm_(arm), target_(target), dof_(arm.lower.size()) {}

    // From `joints` (dof,) to the nearest local optimum, in place.
    DescentEnd run(double* joints) {
        clip(joints);
        Residual now = residual(joints);
        double damping = 1e-6;
        for (int step = 0; step < kIterations && !is_there(now); ++step) {
            double next[kMaxDof];
            if (!find_free(joints, now)) break;
            const bool is_solved = step_from(joints, now, damping, next);
            const Residual then = is_solved ? residual(next) : now;
            if (is_solved && then.cost < now.cost) {
                const bool has_stalled = then.cost > now.cost * (1.0 - kStall);
                std::copy(next, next + dof_, joints);
                now = then;
                damping = std::max(damping * 0.1, 1e-12);
                if (has_stalled) break;
            } else {
                damping *= 10.0;
                if (damping > 1e4) break;
            }
        }
        return {std::sqrt(now.cost), is_there(now)};
    }

    // Where the tool is [m] at `joints` (dof,).
    static std::array<double, 3> tool_position(const ToolDescent& arm, const double* joints) {
        Matrix at[kMaxFrames];
        const Matrix tool = place(arm, joints, at);
        return {tool[9], tool[10], tool[11]};
    }

    // The product (dof, dof) of the weighted Jacobian at `joints` with itself.
    void squared_jacobian(const double* joints, double (*squared)[kMaxDof]) const {
        const Residual at = residual(joints);
        for (size_t i = 0; i < dof_; ++i) {
            for (size_t j = 0; j < dof_; ++j) {
                squared[i][j] = 0.0;
                for (size_t row = 0; row < rows(); ++row) squared[i][j] += at.jacobian[row][i] * at.jacobian[row][j];
            }
        }
    }

  private:
    // Chosen as in descent.py.
    static constexpr int kIterations = 40;
    static constexpr double kStall = 1e-5;       // share of the squared error by which a step must improve
    static constexpr double kLargestStep = 0.8;  // [rad] or [m] a joint may move in one step
    static constexpr double kFlat = 1e-10;       // of the error's slope, below which it is a minimum; chosen: rounding
    using Matrix = std::array<double, 12>;       // a rotation by rows, then a translation

    struct Residual {
        double error[6];
        double jacobian[6][kMaxDof];
        double cost;
    };

    size_t rows() const { return target_.has_rotation ? 6 : 3; }

    void clip(double* joints) const {
        for (size_t i = 0; i < dof_; ++i) joints[i] = std::min(std::max(joints[i], arm_.lower[i]), arm_.upper[i]);
    }

    static Matrix product(const Matrix& a, const Matrix& b) {
        Matrix c;
        for (size_t row = 0; row < 3; ++row) {
            for (size_t column = 0; column < 3; ++column) {
                c[3 * row + column] =
                    a[3 * row] * b[column] + a[3 * row + 1] * b[3 + column] + a[3 * row + 2] * b[6 + column];
            }
            c[9 + row] = a[3 * row] * b[9] + a[3 * row + 1] * b[10] + a[3 * row + 2] * b[11] + a[9 + row];
        }
        return c;
    }

    static Matrix moved(Matrix at, const ToolFrame& frame, double value) {
        if (frame.slides != 0) {
            for (size_t row = 0; row < 3; ++row) at[9 + row] += at[3 * row + 2] * value;
            return at;
        }
        const double sine = std::sin(value), cosine = std::cos(value);
        for (size_t row = 0; row < 9; row += 3) {
            const double x = at[row], y = at[row + 1];
            at[row] = x * cosine + y * sine;
            at[row + 1] = y * cosine - x * sine;
        }
        return at;
    }

    // The tool's pose at `joints` (dof,), and those of the frames into `at`.
    static Matrix place(const ToolDescent& arm, const double* joints, Matrix* at) {
        Matrix here{1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0};
        for (size_t i = 0; i < arm.frames.size(); ++i) {
            const ToolFrame& frame = arm.frames[i];
            const double value = joints[frame.drive] * frame.multiplier + frame.offset;
            at[i] = here = moved(product(here, frame.fixed), frame, value);
        }
        return product(here, arm.tool);
    }

    // What is missing [m], turns weighted, and how the joints change that.
    Residual residual(const double* joints) const {
        Matrix at[kMaxFrames];
        const Matrix tool = place(arm_, joints, at);
        Residual result{};
        for (size_t i = 0; i < arm_.frames.size(); ++i) add_column(result, arm_.frames[i], at[i], tool);
        for (size_t row = 0; row < 3; ++row) result.error[row] = target_.position[row] - tool[9 + row];
        if (target_.has_rotation) turn(tool, result.error + 3);
        for (size_t row = 0; row < rows(); ++row) result.cost += result.error[row] * result.error[row];
        return result;
    }

    void add_column(Residual& result, const ToolFrame& frame, const Matrix& at, const Matrix& tool) const {
        const double z[3] = {at[2], at[5], at[8]};
        const double arm[3] = {tool[9] - at[9], tool[10] - at[10], tool[11] - at[11]};
        const size_t column = static_cast<size_t>(frame.drive);
        for (size_t row = 0; row < 3; ++row) {
            const size_t next = (row + 1) % 3, last = (row + 2) % 3;
            const double turning = z[next] * arm[last] - z[last] * arm[next];
            result.jacobian[row][column] += frame.multiplier * (frame.slides != 0 ? z[row] : turning);
            if (frame.slides == 0) {
                result.jacobian[3 + row][column] += target_.metres_per_radian * frame.multiplier * z[row];
            }
        }
    }

    // The rotation vector from the tool's rotation to the target's, weighted.
    void turn(const Matrix& tool, double* vector) const {
        double r[9];
        for (size_t row = 0; row < 3; ++row) {
            for (size_t column = 0; column < 3; ++column) {
                r[3 * row + column] = target_.rotation[3 * row] * tool[3 * column] +
                                      target_.rotation[3 * row + 1] * tool[3 * column + 1] +
                                      target_.rotation[3 * row + 2] * tool[3 * column + 2];
            }
        }
        const double skew[3] = {0.5 * (r[7] - r[5]), 0.5 * (r[2] - r[6]), 0.5 * (r[3] - r[1])};
        const double sine = std::hypot(skew[0], skew[1], skew[2]), cosine = 0.5 * (r[0] + r[4] + r[8] - 1.0);
        const double angle = std::atan2(sine, cosine);
        double scale = sine > 1e-8 ? angle / sine : 1.0;
        for (size_t i = 0; i < 3; ++i) vector[i] = scale * skew[i];
        if (cosine < -0.99) half_turn(r, skew, angle, vector);
        for (size_t i = 0; i < 3; ++i) vector[i] *= target_.metres_per_radian;
    }

    // Near half a turn the skew part says little: the axis is the longest column of the symmetric part's rest.
    static void half_turn(const double* r, const double* skew, double angle, double* vector) {
        const double cosine = std::cos(angle);
        size_t longest = 0;
        for (size_t i = 1; i < 3; ++i) {
            if (r[4 * i] > r[4 * longest]) longest = i;
        }
        double axis[3];
        for (size_t i = 0; i < 3; ++i) {
            axis[i] = 0.5 * (r[3 * i + longest] + r[3 * longest + i]) - (i == longest ? cosine : 0.0);
        }
        const double length = std::hypot(axis[0], axis[1], axis[2]);
        const double along = axis[0] * skew[0] + axis[1] * skew[1] + axis[2] * skew[2];
        for (size_t i = 0; i < 3; ++i) vector[i] = (along < 0.0 ? -angle : angle) * axis[i] / length;
    }

    bool is_there(const Residual& at) const {
        const double* e = at.error;
        if (std::hypot(e[0], e[1], e[2]) > target_.position_tolerance) return false;
        return !target_.has_rotation ||
               std::hypot(e[3], e[4], e[5]) <= target_.rotation_tolerance * target_.metres_per_radian;
    }

    // Which joints no limit holds back; false where none of them gets anywhere.
    bool find_free(const double* joints, const Residual& at) {
        double most = 0.0;
        for (size_t i = 0; i < dof_; ++i) {
            pull_[i] = 0.0;
            for (size_t row = 0; row < rows(); ++row) pull_[i] += at.error[row] * at.jacobian[row][i];
            is_free_[i] =
                (joints[i] > arm_.lower[i] || pull_[i] > 0.0) && (joints[i] < arm_.upper[i] || pull_[i] < 0.0);
            if (is_free_[i]) most = std::max(most, std::abs(pull_[i]));
        }
        return most >= kFlat;
    }

    // By Cholesky; false where rounding leaves no positive pivot.
    bool step_from(const double* joints, const Residual& at, double damping, double* next) const {
        double lower[kMaxDof][kMaxDof], step[kMaxDof];
        for (size_t i = 0; i < dof_; ++i) {
            for (size_t j = 0; j <= i; ++j) {
                double sum = i == j ? damping : 0.0;
                if (is_free_[i] && is_free_[j]) {
                    for (size_t row = 0; row < rows(); ++row) sum += at.jacobian[row][i] * at.jacobian[row][j];
                }
                for (size_t k = 0; k < j; ++k) sum -= lower[i][k] * lower[j][k];
                if (i == j && !(sum > 0.0)) return false;
                lower[i][j] = i == j ? std::sqrt(sum) : sum / lower[j][j];
            }
        }
        for (size_t i = 0; i < dof_; ++i) {
            step[i] = is_free_[i] ? pull_[i] : 0.0;
            for (size_t k = 0; k < i; ++k) step[i] -= lower[i][k] * step[k];
            step[i] /= lower[i][i];
        }
        double longest = 0.0;
        for (size_t i = dof_; i-- > 0;) {
            for (size_t k = i + 1; k < dof_; ++k) step[i] -= lower[k][i] * step[k];
            step[i] /= lower[i][i];
            longest = std::max(longest, std::abs(step[i]));
        }
        const double share = longest > kLargestStep ? kLargestStep / longest : 1.0;
        for (size_t i = 0; i < dof_; ++i) next[i] = joints[i] + share * step[i];
        clip(next);
        return true;
    }

    const ToolDescent& arm_;
    const ToolTarget& target_;
    size_t dof_;
    double pull_[kMaxDof];
    bool is_free_[kMaxDof];
};

}  // namespace gemelo
