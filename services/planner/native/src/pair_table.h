// Tables of how far two parts of an arm are apart at least, by the one or two joint values between them: cells of exact
// distances less what may change within a cell, and the least of ever larger blocks of them.
#pragma once

#include <algorithm>
#include <limits>
#include <vector>

#include "bad_model.h"
#include "sphere_tree.h"
#include "views.h"

namespace gemelo {

// The values of one joint that a table knows, `count` cells of them; with `is_turn` one whole turn, after which they
// are the same again.
struct TableAxis {
    int32_t drive;
    double low, high;  // [rad] or [m]
    bool is_turn;
};

class PairTable {
  public:
    // `bounds` (rows, columns) [m] by the first joint's cell and the second's; a power of two of rows, and as many
    // columns or one.
    PairTable(int32_t first, int32_t second, const TableAxis& rows, const TableAxis& columns, int32_t row_count,
              int32_t column_count, const double* bounds)
        : first_(first), second_(second) {
        const bool is_square = column_count == row_count || column_count == 1;
        if (row_count < 1 || (row_count & (row_count - 1)) != 0 || !is_square) {
            throw BadModel("a table has a power of two of rows, and as many columns or one");
        }
        for (const TableAxis* axis : {&rows, &columns}) {
            if (!(axis->low < axis->high)) throw BadModel("a table's joint values must have a low and a high end");
        }
        view_ = {nullptr, {axis_of(rows, row_count), axis_of(columns, column_count)}, {}, 0, 0.0f};
        const size_t count = static_cast<size_t>(row_count) * static_cast<size_t>(column_count);
        for (size_t i = 0; i < count; ++i) cells_.push_back(-rounded_up(-bounds[i]));
        add_levels(row_count, column_count);
        view_.cells = cells_.data();
        view_.least = cells_.back();
    }
    PairTable(const PairTable&) = delete;
    PairTable& operator=(const PairTable&) = delete;

    bool is_of(int32_t one, int32_t other) const {
        return (one == first_ && other == second_) || (one == second_ && other == first_);
    }
    const TableView& view() const { return view_; }

  private:
    static TableAxisView axis_of(const TableAxis& axis, int32_t count) {
        const double scale = count / (axis.high - axis.low);
        return {axis.drive, count, axis.is_turn ? 1 : 0, static_cast<float>(axis.low), static_cast<float>(scale)};
    }

    // Every level has the least of two by two cells of the level before; the last is one cell.
    void add_levels(int32_t rows, int32_t columns) {
        size_t before = 0;
        view_.offsets[view_.level_count++] = 0;
        while (rows > 1 || columns > 1) {
            const int32_t more_rows = std::max(1, rows / 2), more_columns = std::max(1, columns / 2);
            const size_t begin = cells_.size();
            if (view_.level_count == kMostLevels) throw BadModel("a table has too many cells");
            view_.offsets[view_.level_count++] = static_cast<int32_t>(begin);
            cells_.resize(begin + static_cast<size_t>(more_rows * more_columns),
                          std::numeric_limits<float>::infinity());
            for (int32_t row = 0; row < rows; ++row) {
                for (int32_t column = 0; column < columns; ++column) {
                    const int32_t into =
                        std::min(row / 2, more_rows - 1) * more_columns + std::min(column / 2, more_columns - 1);
                    float& least = cells_[begin + static_cast<size_t>(into)];
                    least = std::min(least, cells_[before + static_cast<size_t>(row * columns + column)]);
                }
            }
            before = begin;
            rows = more_rows;
            columns = more_columns;
        }
    }

    int32_t first_, second_;
    std::vector<float> cells_;
    TableView view_;
};

}  // namespace gemelo
