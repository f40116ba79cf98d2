// The memory that is left to the board, measured by one task and read by another.
#include "memory.h"

#include "esp_heap_caps.h"

namespace gemelo {
namespace {

constexpr uint32_t kTasks = 4;  // slot, wire, network, sensors

struct WatchedStack {
    TaskHandle_t task;
    const char* name;
};

WatchedStack stacks[kTasks];
uint32_t watched = 0;
// Each word by itself: two of them may be of two measurements, ten seconds apart.
uint32_t heap_free, heap_least, stack_least, stack_at;

void store(uint32_t* word, size_t value) { __atomic_store_n(word, static_cast<uint32_t>(value), __ATOMIC_RELAXED); }
uint32_t load(const uint32_t* word) { return __atomic_load_n(word, __ATOMIC_RELAXED); }

}  // namespace

void watch_stack(TaskHandle_t task, const char* name) {
    const uint32_t at = __atomic_load_n(&watched, __ATOMIC_RELAXED);
    if (at == kTasks) return;
    stacks[at] = WatchedStack{task, name};
    __atomic_store_n(&watched, at + 1, __ATOMIC_RELEASE);
}

void measure_memory() {
    store(&heap_free, heap_caps_get_free_size(MALLOC_CAP_8BIT | MALLOC_CAP_INTERNAL));
    store(&heap_least, heap_caps_get_minimum_free_size(MALLOC_CAP_8BIT | MALLOC_CAP_INTERNAL));
    const uint32_t count = __atomic_load_n(&watched, __ATOMIC_ACQUIRE);
    for (uint32_t i = 0; i < count; ++i) {
        const uint32_t least = uxTaskGetStackHighWaterMark(stacks[i].task);  // ESP-IDF counts bytes
        if (i != 0 && least >= load(&stack_least)) continue;
        store(&stack_least, least);
        store(&stack_at, i);
    }
}

MemoryReport measured_memory() {
    const char* name = __atomic_load_n(&watched, __ATOMIC_ACQUIRE) == 0 ? "" : stacks[load(&stack_at)].name;
    return MemoryReport{load(&heap_free), load(&heap_least), load(&stack_least), name};
}

}  // namespace gemelo
