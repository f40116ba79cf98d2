// The error of a model that cannot be built; becomes a ValueError.
#pragma once

#include <stdexcept>

namespace gemelo {

struct BadModel : std::invalid_argument {
    using std::invalid_argument::invalid_argument;
};

}  // namespace gemelo
