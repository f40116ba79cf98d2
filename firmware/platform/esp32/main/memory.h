// The memory that is left to the board: its heap, and the stacks of our tasks.
#pragma once

#include "freertos/FreeRTOS.h"
#include "freertos/task.h"
#include "report.h"

namespace gemelo {

// From now on the stack of this task counts; before the tasks of memory.cpp's readers run. `name` must stay.
void watch_stack(TaskHandle_t task, const char* name);
// For a task of low priority: a stack is looked through byte by byte.
void measure_memory();
// As it was measured last, or at the start; for any task.
MemoryReport measured_memory();

}  // namespace gemelo
