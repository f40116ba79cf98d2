#include "text_line.h"

namespace gemelo {
namespace {

constexpr uint8_t kDecimals = 9;      // a number is counted in 1e-9 rad or m; chosen
constexpr uint8_t kRestDecimals = 2;  // follows from the 1e-7 rad or m of text_scale_q32

bool is_digit(char c) { return c >= '0' && c <= '9'; }

class Cursor {
  public:
    Cursor(const char* at, const char* end) : at_(at), end_(end) {}
    bool is_at_end() const { return at_ == end_; }
    bool eat(char c) {
        if (at_ == end_ || *at_ != c) return false;
        ++at_;
        return true;
    }
    bool digit(uint64_t* out) {
        if (at_ == end_ || !is_digit(*at_)) return false;
        *out = static_cast<uint64_t>(*at_++ - '0');
        return true;
    }

  private:
    const char* at_;
    const char* end_;
};

bool read_seq(Cursor& cursor, uint32_t* seq) {
    uint64_t digit = 0, value = 0;
    if (!cursor.digit(&value)) return false;
    while (cursor.digit(&digit)) {
        value = value * 10 + digit;
        if (value > UINT32_MAX) return false;
    }
    *seq = static_cast<uint32_t>(value);
    return true;
}

// |value| of a decimal number in units of 1e-7, and the two decimals beyond.
struct Decimal {
    uint64_t units = 0;
    uint32_t rest = 0;
    bool is_negative = false;
};

// What it says of a number that is none: BadArgument; of one that no joint could reach: PositionLimit.
Code read_decimal(Cursor& cursor, Decimal* out) {
    constexpr uint64_t kFar = 1000000000000000;  // 1e8 rad
    uint64_t digit = 0;
    bool has_digits = false;
    bool is_far = false;
    out->is_negative = cursor.eat('-');
    if (!out->is_negative) cursor.eat('+');
    const auto append = [&](uint64_t next) {
        is_far = is_far || out->units > kFar;
        if (!is_far) out->units = out->units * 10 + next;
        has_digits = true;
    };
    while (cursor.digit(&digit)) append(digit);
    uint8_t decimals = 0;
    if (cursor.eat('.')) {
        for (; cursor.digit(&digit); ++decimals) {
            if (decimals == kDecimals) return Code::BadArgument;
            if (decimals < kDecimals - kRestDecimals) {
                append(digit);
            } else {
                out->rest += static_cast<uint32_t>(decimals == kDecimals - 1 ? digit : digit * 10);
            }
        }
    }
    if (!has_digits) return Code::BadArgument;
    for (; decimals < kDecimals - kRestDecimals; ++decimals) append(0);
    return is_far ? Code::PositionLimit : Code::Ok;
}

// To the nearest 1/256 step.
Code scale(const Decimal& decimal, uint64_t scale_q32, int32_t* q8) {
    uint64_t product_q32 = 0;
    if (__builtin_mul_overflow(decimal.units, scale_q32, &product_q32) || product_q32 > INT64_MAX)
        return Code::PositionLimit;
    product_q32 += scale_q32 / 100 * decimal.rest + (1u << 31);
    const uint64_t magnitude = product_q32 >> 32;
    if (magnitude > INT32_MAX) return Code::PositionLimit;
    *q8 = decimal.is_negative ? -static_cast<int32_t>(magnitude) : static_cast<int32_t>(magnitude);
    return Code::Ok;
}

// The first thing that is wrong with the numbers, wherever it stands; a wrong count is worse than a wrong number.
Code read_targets(Cursor& cursor, const DeviceConfig& config, int32_t* target_q8) {
    Code code = Code::Ok;
    uint8_t count = 0;
    for (; cursor.eat(','); ++count) {
        if (count == config.joints) return Code::BadCount;
        Decimal decimal;
        Code found = read_decimal(cursor, &decimal);
        const uint64_t scale_q32 = config.joint[count].text_scale_q32;
        if (found == Code::Ok) found = scale_q32 == 0 ? Code::BadJoints : scale(decimal, scale_q32, &target_q8[count]);
        if (found == Code::BadArgument) return found;
        if (code == Code::Ok) code = found;
    }
    if (!cursor.is_at_end()) return Code::BadArgument;
    return count == config.joints ? code : Code::BadCount;
}

}  // namespace

TextLine read_text_line(const char* line, size_t size, const DeviceConfig& config) {
    TextLine read;
    if (size < 2 || line[0] != '<' || line[size - 1] != '>') return read;
    for (size_t i = 1; i + 1 < size; ++i)
        if (line[i] == '<' || line[i] == '>') return read;
    read.is_line = true;
    Cursor cursor(line + 1, line + size - 1);
    if (!read_seq(cursor, &read.seq)) {
        read.code = Code::BadCount;
        return read;
    }
    read.code = config.joints == 0 ? Code::NotReady : read_targets(cursor, config, read.target_q8);
    return read;
}

}  // namespace gemelo
