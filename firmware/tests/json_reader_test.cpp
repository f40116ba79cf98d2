// The JSON that a device can read, and what it says of the rest.
#include "json_reader.h"

#include <gtest/gtest.h>

#include <string>

#include "json.h"

using namespace gemelo;

namespace {

struct TextRead {
    bool is_read;
    std::string text, error;
};

TextRead read_text(const std::string& json, size_t capacity = 64) {
    std::string out(capacity, '#');
    JsonReader reader(json.data(), json.size());
    const bool is_read = reader.text(out.data(), capacity) && reader.end();
    return {is_read, is_read ? out.c_str() : "", reader.error() == nullptr ? "" : reader.error()};
}

std::string error_of_integer(const std::string& json) {
    JsonReader reader(json.data(), json.size());
    JsonInteger integer;
    if (reader.integer(&integer)) reader.end();
    return reader.error() == nullptr ? "" : reader.error();
}

}  // namespace

TEST(JsonReader, ReadsEscapesAndSurrogatePairsAsUtf8) {
    EXPECT_EQ(read_text(R"("a\"\\\/\b\f\n\r\t")").text, "a\"\\/\b\f\n\r\t");
    EXPECT_EQ(read_text(R"("\u0041\u00e9\u20ac\ud83d\uDE00")").text, "A\xc3\xa9\xe2\x82\xac\xf0\x9f\x98\x80");
    EXPECT_EQ(read_text("\"\xc3\xa9\xe2\x82\xac\xf0\x9f\x98\x80\"").text, "\xc3\xa9\xe2\x82\xac\xf0\x9f\x98\x80");
}

TEST(JsonReader, RefusesTextsThatAreNone) {
    EXPECT_EQ(read_text("\"abc").error, "a text has no end");
    EXPECT_EQ(read_text("\"abc\\").error, "a text has no end");
    EXPECT_EQ(read_text("\"\\u12").error, "a text has no end");
    EXPECT_EQ(read_text("\"\\u12g4\"").error, "an escape has four hexadecimal digits");
    EXPECT_EQ(read_text("\"\\x41\"").error, "an unknown escape stands in a text");
    EXPECT_EQ(read_text("\"\\u0000\"").error, "a zero stands in a text");
    EXPECT_EQ(read_text("\"\\ud83d\"").error, "half of a surrogate pair stands in a text");
    EXPECT_EQ(read_text("\"\\ud83d\\u0041\"").error, "half of a surrogate pair stands in a text");
    EXPECT_EQ(read_text("\"\\ude00\"").error, "half of a surrogate pair stands in a text");
    EXPECT_EQ(read_text("\"a\nb\"").error, "a control character stands in a text");
    EXPECT_EQ(read_text("abc").error, "a text in quotes is expected");
    EXPECT_EQ(read_text("\"a\" b").error, "something follows the end");
}

TEST(JsonReader, RefusesWhatIsNotUtf8) {
    for (const char* bad : {"\"\xff\"", "\"\x80\"", "\"\xc0\x80\"", "\"\xe0\x80\x80\"", "\"\xed\xa0\x80\"",
                            "\"\xf4\x90\x80\x80\"", "\"\xc3\"", "\"\xf0\x9f\x98\""})
        EXPECT_EQ(read_text(bad).error, "a text is not UTF-8") << bad;
}

TEST(JsonReader, FillsAPlaceToItsLastByteAndNotBeyond) {
    EXPECT_EQ(read_text("\"abc\"", 4).text, "abc");
    EXPECT_EQ(read_text("\"abcd\"", 4).error, "the text is too long");
    EXPECT_EQ(read_text("\"ab\xc3\xa9\"", 4).error, "the text is too long");
}

TEST(JsonReader, ReadsIntegersOf64BitsAndNothingElse) {
    const std::string text = "[0, -0, 18446744073709551615, -9223372036854775808]";
    JsonReader reader(text.data(), text.size());
    JsonInteger integer;
    ASSERT_TRUE(reader.open('['));
    for (const uint64_t expected : {uint64_t{0}, uint64_t{0}, UINT64_MAX, uint64_t{1} << 63}) {
        ASSERT_TRUE(reader.next(']') && reader.integer(&integer));
        EXPECT_EQ(integer.magnitude, expected);
    }
    EXPECT_TRUE(integer.is_negative && integer.is_within(INT64_MIN, UINT64_MAX));
    EXPECT_FALSE(reader.next(']'));
    EXPECT_TRUE(reader.end());
    EXPECT_EQ(error_of_integer("18446744073709551616"), "the number is too large");
    EXPECT_EQ(error_of_integer("01"), "a number begins with a zero");
    EXPECT_EQ(error_of_integer("00"), "a number begins with a zero");
    for (const char* bad : {"1.5", "1e3", "", "-", "NaN", "Infinity", "+1", "\"1\"", "0x1", "0."})
        EXPECT_NE(error_of_integer(bad), "") << bad;
}

TEST(JsonReader, KeepsTheFirstErrorAndSaysWhere) {
    const std::string text = "{\"a\":1 \"b\":2}";
    JsonReader reader(text.data(), text.size());
    char key[8];
    JsonInteger integer;
    ASSERT_TRUE(reader.open('{') && reader.next('}') && reader.key(key, sizeof key) && reader.integer(&integer));
    EXPECT_FALSE(reader.next('}'));
    EXPECT_STREQ(reader.error(), "a comma or a closing bracket is expected");
    EXPECT_EQ(reader.position(), 7u);
    EXPECT_FALSE(reader.key(key, sizeof key));
    EXPECT_STREQ(reader.error(), "a comma or a closing bracket is expected");
}

TEST(JsonWriter, EscapesWhatItIsGivenAndWritesThousandths) {
    JsonWriter json;
    json.field("reason", "unknown key \"a\\b\n\"");
    json.field_milli("ultra", -12345);
    json.field_milli("least", INT32_MIN);
    json.field_milli("none", -7);
    const size_t size = json.close();
    EXPECT_EQ(std::string(reinterpret_cast<const char*>(json.bytes()), size),
              R"({"reason": "unknown key \"a\\b?\"", "ultra": -12.345, "least": -2147483.648, "none": -0.007})");
}
