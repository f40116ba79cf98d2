// The module's functions for trajectories: their timing, their samples and their step rates.
#pragma once

#include <nanobind/nanobind.h>

namespace gemelo {

void add_trajectories(nanobind::module_& module);

}  // namespace gemelo
