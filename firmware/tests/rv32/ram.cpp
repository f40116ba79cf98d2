// All the memory that the core asks a platform for, besides the stack; only measured.
#include "machine.h"

gemelo::DeviceConfig config;
gemelo::Machine machine;
