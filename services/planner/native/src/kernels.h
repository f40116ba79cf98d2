// The choice of the check's build that this processor runs best.
#pragma once

#include <string>
#include <vector>

#include "bad_model.h"
#include "views.h"

namespace gemelo {

// The best one first; the plain one is always there.
inline std::vector<const Kernel*> kernels() {
    std::vector<const Kernel*> known;
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx2")) known.push_back(&kAvx2Kernel);
#endif
    known.push_back(&kVectorKernel);
    known.push_back(&kPlainKernel);
    return known;
}

inline const Kernel& kernel_named(const std::string& name) {
    std::string names;
    for (const Kernel* kernel : kernels()) {
        if (name == kernel->name || name.empty()) return *kernel;
        names += std::string(names.empty() ? "" : ", ") + kernel->name;
    }
    throw BadModel("there is no kernel \"" + name + "\" on this processor, only " + names);
}

}  // namespace gemelo
