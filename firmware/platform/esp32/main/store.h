// The flash: credentials and the configuration's text, in the NVS namespace `gemelo`. Written at rest only.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "provision.h"

namespace gemelo {

// Once, before all others.
void open_store();

void load_credentials(Credentials* credentials);
bool save_credentials(Credentials& credentials);

// The text's size, 0 for none.
size_t load_config(char* text, size_t capacity);
bool save_config(const char* text, size_t size);

bool forget_all();

}  // namespace gemelo
