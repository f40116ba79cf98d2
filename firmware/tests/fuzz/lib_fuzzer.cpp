// The same as a target of libFuzzer.
#include <string.h>

#include "play.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    fuzz::play(fuzz::read_items(data, size));
    return 0;
}

extern "C" size_t LLVMFuzzerCustomMutator(uint8_t* data, size_t size, size_t most, unsigned seed) {
    static const std::vector<std::vector<fuzz::Item>> others = fuzz::seeds();
    std::vector<fuzz::Item> items = fuzz::read_items(data, size);
    fuzz::mutate(items, others[seed % others.size()], seed);
    const fuzz::Bytes bytes = fuzz::write_items(items);
    const size_t length = bytes.size() < most ? bytes.size() : most;
    if (length != 0) memcpy(data, bytes.data(), length);
    return length;
}
