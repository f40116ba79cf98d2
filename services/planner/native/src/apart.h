// Readings of a table of distances: what it knows of eight configurations, and of the stretches that they stand for.
#pragma once

#include <initializer_list>

#include "lanes.h"

namespace gemelo {
namespace {

// Lanes in which two parts are known to be far enough apart: at the configuration, and on all of the stretch.
struct Apart {
    uint32_t here = 0, throughout = 0;
};

constexpr float kCellSlack = 1e-3f;  // of a cell: what floats lose; chosen

// The cells from one to another, of which the last may be beyond the end of a turn.
struct CellRange {
    int32_t first, last;
    bool is_known;
};

inline CellRange cells_of(const TableAxisView& axis, float value, float way) {
    float at = (value - axis.low) * axis.scale;
    const float off = way * axis.scale + kCellSlack, count = static_cast<float>(axis.count);
    if (!(off < count)) return {0, 0, false};
    if (axis.is_turn) {
        at -= count * __builtin_floorf((at - off) / count);
    } else if (!(at - off >= -2.0f * kCellSlack && at + off <= count + 2.0f * kCellSlack)) {
        return {0, 0, false};
    }
    const int32_t first = static_cast<int32_t>(__builtin_floorf(at - off));
    const int32_t last = static_cast<int32_t>(__builtin_floorf(at + off));
    if (axis.is_turn) return {first, last, last - first < axis.count};
    return {first < 0 ? 0 : first, last < axis.count ? last : axis.count - 1, true};
}

// The least of all cells that are reached: at a level where these are two by two at most.
inline float least_of(const TableView& table, const CellRange& rows, const CellRange& columns) {
    int level = 0;
    const auto is_wide = [&](const CellRange& range) { return (range.last >> level) - (range.first >> level) > 1; };
    while (is_wide(rows) || is_wide(columns)) ++level;
    if (level >= table.level_count) return table.least;
    const auto count_at = [&](int axis) {
        const int32_t count = table.axes[axis].count >> level;
        return count > 1 ? count : 1;
    };
    const int32_t row_count = count_at(0), column_count = count_at(1);
    float least = table.cells[table.offsets[level] + ((rows.first >> level) % row_count) * column_count +
                              (columns.first >> level) % column_count];
    for (const int32_t row : {rows.first, rows.last}) {
        for (const int32_t column : {columns.first, columns.last}) {
            const float cell = table.cells[table.offsets[level] + ((row >> level) % row_count) * column_count +
                                           (column >> level) % column_count];
            least = cell < least ? cell : least;
        }
    }
    return least;
}

// Of the lanes `lanes` those that keep `limits` [m].
inline Apart apart(const TableView& table, const float* joints, const float* ways, const float* limits,
                   uint32_t lanes) {
    Apart known;
    for (int lane = 0; lane < kLanes; ++lane) {
        if ((lanes >> lane & 1u) == 0) continue;
        CellRange here[2], around[2];
        for (int i = 0; i < 2; ++i) {
            const TableAxisView& axis = table.axes[i];
            const float value = joints[axis.drive * kLanes + lane];
            here[i] = cells_of(axis, value, 0.0f);
            around[i] = ways != nullptr ? cells_of(axis, value, ways[axis.drive * kLanes + lane]) : here[i];
        }
        const auto keeps = [&](const CellRange(&both)[2]) {
            return both[0].is_known && both[1].is_known && least_of(table, both[0], both[1]) > limits[lane];
        };
        if (keeps(here)) known.here |= 1u << lane;
        if (keeps(around)) known.throughout |= 1u << lane;
    }
    return known;
}

}  // namespace
}  // namespace gemelo
