// Reads JSON from front to back, as RFC 8259 has it, into the caller's memory: no floats, no allocation. The first
// error ends it.
#pragma once

#include <stddef.h>
#include <stdint.h>

namespace gemelo {

struct JsonInteger {
    uint64_t magnitude = 0;
    bool is_negative = false;

    bool is_within(int64_t lowest, uint64_t highest) const;
};

class JsonReader {
  public:
    JsonReader(const char* text, size_t size) : begin_(text), at_(text), end_(text + size) {}

    // `bracket` is '{' or '['.
    bool open(char bracket);
    // True if another member or entry follows; consumes the comma, or the closing bracket.
    bool next(char closing_bracket);
    // A member's name and the colon.
    bool key(char* out, size_t capacity);
    // Into `out`, with a 0 at its end.
    bool text(char* out, size_t capacity);
    bool integer(JsonInteger* out);
    bool truth(bool* out);
    // Eats a `null` if one stands here.
    bool null();
    // Nothing but white space follows.
    bool end();

    const char* error() const { return error_; }
    bool is_too_long() const { return is_too_long_; }  // the error is a text that does not fit its place
    size_t position() const { return static_cast<size_t>(at_ - begin_); }

  private:
    bool fail(const char* error);
    void skip_space();
    bool eat(const char* word);
    bool code_point(uint32_t* out);
    bool escape(uint32_t* out);
    bool hex(uint32_t* out);
    bool utf8(uint32_t* out);

    const char* begin_;
    const char* at_;
    const char* end_;
    const char* error_ = nullptr;
    bool is_first_ = false;  // the bracket has just been opened
    bool is_too_long_ = false;
};

}  // namespace gemelo
