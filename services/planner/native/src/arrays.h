// Arrays of numpy as the module's functions take and return them, and the errors of those that do not fit.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "bad_model.h"

namespace gemelo {

namespace nb = nanobind;

using Rows = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Row = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Integers = nb::ndarray<const int32_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Segments = nb::ndarray<const int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

template <class T>
inline nb::ndarray<nb::numpy, T> array_of(std::vector<T> values, std::initializer_list<size_t> shape) {
    auto* owned = new std::vector<T>(std::move(values));
    nb::capsule owner(owned, [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
    return nb::ndarray<nb::numpy, T>(owned->data(), shape, owner);
}

inline void require(bool is_so, const char* otherwise) {
    if (!is_so) throw BadModel(otherwise);
}

inline void require_columns(size_t is, size_t wanted, const char* what) {
    if (is == wanted) return;
    throw BadModel(std::string(what) + " must have " + std::to_string(wanted) + " columns, not " + std::to_string(is));
}

}  // namespace gemelo
