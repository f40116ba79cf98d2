// Reads a JSON object into a struct by a table of its fields.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "json_reader.h"
#include "refusal.h"

namespace gemelo {

// Index: a U8 that is not kNone.
enum class Kind : uint8_t { Text, Truth, Index, I8, U8, I32, U32, U64, Word, Record, List };

struct Record;

// One member of an object, and where its value goes.
struct Field {
    const char* key;
    Kind kind;
    bool is_required;
    uint16_t offset;
    uint16_t capacity = 0;               // Text: bytes with the 0 at its end; List: entries
    const char* const* words = nullptr;  // Word: the value is an index into them, stored as u8; ends with nullptr
    const Record* record = nullptr;      // Record: or null; List: each entry, beginning with its name
    uint16_t stride = 0;                 // List: from one entry to the next
    uint16_t count_offset = 0;           // List: of the number of entries, a u8
};

struct Record {
    const Field* fields;
    uint8_t size;            // at most 32
    bool is_secret = false;  // no refusal may hold what was sent
};

// The object that `text` is, to `out`; false with a refusal where it is not as the table says. Members that are
// missing leave `out` as it is.
bool read_record(const char* text, size_t size, const Record& record, void* out, Refusal* refusal);

}  // namespace gemelo
