#include "record_reader.h"

#include <string.h>

#include "phrase.h"

namespace gemelo {
namespace {

constexpr size_t kKeySize = 32;  // chosen

struct Range {
    int64_t lowest;
    uint64_t highest;
};

Range range_of(Kind kind) {
    switch (kind) {
        case Kind::Index:
            return {0, kNone - 1};
        case Kind::I8:
            return {INT8_MIN, INT8_MAX};
        case Kind::U8:
            return {0, UINT8_MAX};
        case Kind::I32:
            return {INT32_MIN, INT32_MAX};
        case Kind::U32:
            return {0, UINT32_MAX};
        default:
            return {0, UINT64_MAX};
    }
}

// The lowest bytes of a little-endian two's complement; every processor this runs on is one.
size_t size_of(Kind kind) {
    switch (kind) {
        case Kind::I32:
        case Kind::U32:
            return 4;
        case Kind::U64:
            return 8;
        default:
            return 1;
    }
}

bool is_same(const char* a, const char* b) {
    for (; *a == *b; ++a, ++b)
        if (*a == 0) return true;
    return false;
}

class RecordReader {
  public:
    RecordReader(const char* text, size_t size, Refusal* refusal) : json_(text, size), refusal_(refusal) {}

    bool read_whole(const Record& record, uint8_t* out) {
        return read(record, out) && (json_.end() || refuse_json(""));
    }

  private:
    bool read(const Record& record, uint8_t* out);
    bool read_member(const Record& record, uint8_t* out, uint32_t* seen);
    bool read_value(const Field& field, uint8_t* out);
    bool read_integer(const Field& field, uint8_t* out);
    bool read_word(const Field& field, uint8_t* out);
    bool read_list(const Field& field, uint8_t* out);
    bool refuse_json(const char* key);
    bool refuse(const char* key, const char* predicate);
    void name_part(const Field& list, size_t index, const uint8_t* entry);
    Phrase reason() { return Phrase(refusal_->reason, sizeof refusal_->reason); }

    JsonReader json_;
    Refusal* refusal_;
};

bool RecordReader::refuse(const char* key, const char* predicate) {
    reason().quote(key).add(" ").add(predicate);
    return false;
}

bool RecordReader::refuse_json(const char* key) {
    Phrase sentence = reason();
    if (*key != 0) sentence.quote(key).add(": ");
    sentence.add(json_.error()).add(" (byte ").add(json_.position()).add(")");
    return false;
}

bool RecordReader::read(const Record& record, uint8_t* out) {
    if (!json_.open('{')) return refuse_json("");
    uint32_t seen = 0;
    while (json_.next('}'))
        if (!read_member(record, out, &seen)) return false;
    if (json_.error() != nullptr) return refuse_json("");
    for (uint8_t i = 0; i < record.size; ++i)
        if (record.fields[i].is_required && (seen >> i & 1) == 0) return refuse(record.fields[i].key, "is missing");
    return true;
}

bool RecordReader::read_member(const Record& record, uint8_t* out, uint32_t* seen) {
    char key[kKeySize];
    if (!json_.key(key, sizeof key)) return refuse_json("");
    for (uint8_t i = 0; i < record.size; ++i) {
        const Field& field = record.fields[i];
        if (!is_same(field.key, key)) continue;
        if ((*seen >> i & 1) != 0) return refuse(key, "is there twice");
        *seen |= 1u << i;
        return read_value(field, out + field.offset);
    }
    if (!record.is_secret) return refuse(key, "is not a key that is known here");
    reason().add("it has a key that is not known here");
    return false;
}

bool RecordReader::read_value(const Field& field, uint8_t* out) {
    switch (field.kind) {
        case Kind::Text:
            if (json_.text(reinterpret_cast<char*>(out), field.capacity)) return true;
            if (!json_.is_too_long()) return refuse_json(field.key);
            reason().quote(field.key).add(" is longer than ").add(field.capacity - 1u).add(" bytes");
            return false;
        case Kind::Truth: {
            bool is_true = false;
            if (!json_.truth(&is_true)) return refuse_json(field.key);
            *out = is_true;
            return true;
        }
        case Kind::Word:
            return read_word(field, out);
        case Kind::Record:
            return json_.null() || read(*field.record, out);
        case Kind::List:
            return read_list(field, out);
        default:
            return read_integer(field, out);
    }
}

bool RecordReader::read_integer(const Field& field, uint8_t* out) {
    JsonInteger integer;
    if (!json_.integer(&integer)) return refuse_json(field.key);
    const Range range = range_of(field.kind);
    if (!integer.is_within(range.lowest, range.highest)) {
        reason().quote(field.key).add(" is not ").add_signed(range.lowest).add(" to ").add(range.highest);
        return false;
    }
    const uint64_t value = integer.is_negative ? 0 - integer.magnitude : integer.magnitude;
    memcpy(out, &value, size_of(field.kind));
    return true;
}

bool RecordReader::read_word(const Field& field, uint8_t* out) {
    char word[kKeySize];
    if (!json_.text(word, sizeof word) && !json_.is_too_long()) return refuse_json(field.key);
    for (uint8_t i = 0; field.words[i] != nullptr && !json_.is_too_long(); ++i) {
        if (!is_same(field.words[i], word)) continue;
        *out = i;
        return true;
    }
    Phrase sentence = reason();
    sentence.quote(field.key).add(" is none of ").add(field.words[0]);
    for (uint8_t i = 1; field.words[i] != nullptr; ++i) sentence.add(", ").add(field.words[i]);
    return false;
}

bool RecordReader::read_list(const Field& field, uint8_t* out) {
    if (!json_.open('[')) return refuse_json(field.key);
    uint8_t count = 0;
    while (json_.next(']')) {
        if (count == field.capacity) {
            reason().quote(field.key).add(" has more than ").add(field.capacity).add(" entries");
            return false;
        }
        uint8_t* entry = out + field.stride * count;
        if (!read(*field.record, entry)) {
            name_part(field, count, entry);
            return false;
        }
        ++count;
    }
    if (json_.error() != nullptr) return refuse_json(field.key);
    out[field.count_offset - field.offset] = count;
    return true;
}

// By its name if that has been read, else by its place.
void RecordReader::name_part(const Field& list, size_t index, const uint8_t* entry) {
    Phrase part(refusal_->part, sizeof refusal_->part);
    const char* name = reinterpret_cast<const char*>(entry) + list.record->fields[0].offset;
    if (*name != 0) {
        part.add(name);
    } else {
        part.add(list.key).add("[").add(index).add("]");
    }
}

}  // namespace

bool read_record(const char* text, size_t size, const Record& record, void* out, Refusal* refusal) {
    *refusal = Refusal{};
    return RecordReader(text, size, refusal).read_whole(record, static_cast<uint8_t*>(out));
}

}  // namespace gemelo
