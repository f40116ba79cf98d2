#include "baud.h"

#include <gtest/gtest.h>

#include <string>

namespace gemelo {
namespace {

// A board on a line whose sender speaks at `sender` baud, 40 bytes every 40 ms: bytes at another rate are garbage.
struct LineRig {
    explicit LineRig(uint32_t set_rate) : search(set_rate) {}
    BaudSearch search;
    uint32_t understood = 0;
    uint64_t now_us = 0;
    int changes = 0;

    void run(uint32_t sender, double seconds) {
        for (const uint64_t end_us = now_us + static_cast<uint64_t>(seconds * 1e6); now_us < end_us;) {
            now_us += 40000;
            if (search.rate() == sender) ++understood;
            if (search.hear(40, understood, now_us)) ++changes;
        }
    }
};

TEST(Baud, TheRateThatWasSetIsTriedFirstAndKept) {
    LineRig line(115200);
    EXPECT_EQ(line.search.rate(), 115200u);
    line.run(115200, 60.0);
    EXPECT_EQ(line.changes, 0);
    EXPECT_EQ(LineRig(0).search.rate(), kDefaultBaud);
}

TEST(Baud, ADriverOfTextLinesIsFoundWithinTwoSecondsWhateverWasSet) {
    for (const uint32_t set : {0u, 921600u, 57600u, 250000u}) {
        LineRig line(set);
        line.run(115200, 2.0);
        EXPECT_EQ(line.search.rate(), 115200u) << set;
        const int changes = line.changes;
        line.run(115200, 30.0);
        EXPECT_EQ(line.changes, changes);
    }
}

TEST(Baud, AnotherSenderIsFoundAfterOneWasBelieved) {
    LineRig line(0);
    line.run(921600, 10.0);
    EXPECT_EQ(line.changes, 0);
    line.run(115200, 5.0);
    EXPECT_EQ(line.search.rate(), 115200u);
    line.run(921600, 8.0);
    EXPECT_EQ(line.search.rate(), 921600u);
}

TEST(Baud, NoiseOfAMomentDoesNotLoseABelievedSender) {
    LineRig line(0);
    line.run(921600, 1.0);
    line.run(1, 1.5);
    EXPECT_EQ(line.search.rate(), 921600u);
}

TEST(Baud, SilenceChangesNothing) {
    BaudSearch search;
    for (uint64_t now_us = 0; now_us < 60000000; now_us += 100000) EXPECT_FALSE(search.hear(0, 0, now_us));
}

TEST(Baud, OnlyANumberWithinTheBoundsIsARate) {
    EXPECT_EQ(read_baud("115200"), 115200u);
    EXPECT_EQ(read_baud("9600"), 9600u);
    EXPECT_EQ(read_baud("3000000"), 3000000u);
    for (const char* text : {"", "0", "9599", "3000001", "1e5", "-9600", "115200 ", "99999999999999999999"})
        EXPECT_EQ(read_baud(text), 0u) << text;
}

}  // namespace
}  // namespace gemelo
