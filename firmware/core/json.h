// Writes one flat JSON object into a buffer of fixed size; keys need no escaping.
#pragma once

#include <stddef.h>
#include <stdint.h>

namespace gemelo {

class JsonWriter {
  public:
    static constexpr size_t kSize = 512;  // chosen
    JsonWriter() { put('{'); }
    void field(const char* key, const char* text);
    void field(const char* key, uint64_t number);
    void field(const char* key, bool truth);
    // A decimal: `milli` / 1000.
    void field_milli(const char* key, int32_t milli);
    // A pair of numbers as an array.
    void field(const char* key, uint32_t first, uint32_t second);
    // Closes the object; nothing may be added after.
    size_t close();
    const uint8_t* bytes() const { return reinterpret_cast<const uint8_t*>(text_); }

  private:
    void key(const char* name);
    void put(char c);
    void put(const char* text);
    void put_escaped(char c);
    void put_number(uint64_t number);

    char text_[kSize];
    size_t size_ = 0;
};

}  // namespace gemelo
