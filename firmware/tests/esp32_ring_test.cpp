// Records between tasks, and messages put together from pieces.
#include <gtest/gtest.h>

#include <cstring>
#include <deque>
#include <memory>
#include <random>
#include <thread>
#include <vector>

#include "assembly.h"
#include "ring.h"

using namespace gemelo;

namespace {

std::vector<uint8_t> pattern(uint32_t seed, size_t size) {
    std::vector<uint8_t> bytes(size);
    for (size_t i = 0; i < size; ++i) bytes[i] = static_cast<uint8_t>(seed * 31 + i * 7);
    return bytes;
}

}  // namespace

TEST(Ring, IsEmptyAtFirst) {
    Ring<256> ring;
    Record record;
    EXPECT_FALSE(ring.front(&record));
}

TEST(Ring, GivesBackInOrderWhateverTheSizesAndFills) {
    auto ring = std::make_unique<Ring<1024>>();
    struct Sent {
        uint64_t time_us;
        uint8_t kind, flags;
        std::vector<uint8_t> bytes;
    };
    std::deque<Sent> sent;
    std::mt19937 random(3);
    uint32_t refused = 0;
    for (uint32_t i = 0; i < 200000; ++i) {
        if (random() % 2 == 0) {
            Sent one{i, static_cast<uint8_t>(random()), static_cast<uint8_t>(random()), pattern(i, random() % 300)};
            if (ring->push(one.kind, one.flags, one.time_us, one.bytes.data(), one.bytes.size()))
                sent.push_back(one);
            else
                ++refused;
            continue;
        }
        Record record;
        ASSERT_EQ(ring->front(&record), !sent.empty());
        if (sent.empty()) continue;
        const Sent& expected = sent.front();
        ASSERT_EQ(record.time_us, expected.time_us);
        ASSERT_EQ(record.kind, expected.kind);
        ASSERT_EQ(record.flags, expected.flags);
        ASSERT_EQ(std::vector<uint8_t>(record.bytes, record.bytes + record.size), expected.bytes);
        ring->pop();
        sent.pop_front();
    }
    EXPECT_GT(refused, 1000u);  // it was full often enough
}

TEST(Ring, TakesTheLargestRecordWheneverItIsEmpty) {
    Ring<1024> ring;
    const std::vector<uint8_t> largest = pattern(1, 1024 / 2 - 16), small = pattern(2, 5);
    for (int i = 0; i < 200; ++i) {
        ASSERT_TRUE(ring.push(1, 0, 0, small.data(), small.size()));
        Record record;
        ASSERT_TRUE(ring.front(&record));
        ring.pop();
        ASSERT_TRUE(ring.push(2, 0, 0, largest.data(), largest.size())) << i;
        ASSERT_TRUE(ring.front(&record));
        ASSERT_EQ(record.size, largest.size());
        ASSERT_EQ(std::memcmp(record.bytes, largest.data(), largest.size()), 0);
        ring.pop();
    }
}

TEST(Ring, RefusesWhatCanNeverFit) {
    Ring<256> ring;
    const std::vector<uint8_t> bytes(256);
    EXPECT_FALSE(ring.push(0, 0, 0, bytes.data(), 113));
    EXPECT_FALSE(ring.push(0, 0, 0, bytes.data(), SIZE_MAX));
    EXPECT_TRUE(ring.push(0, 0, 0, bytes.data(), 112));
}

TEST(Ring, LosesAndTearsNothingBetweenTwoThreads) {
    auto ring = std::make_unique<Ring<2048>>();
    constexpr uint32_t kRecords = 100000;
    std::thread writer([&] {
        for (uint32_t i = 0; i < kRecords; ++i) {
            const std::vector<uint8_t> bytes = pattern(i, i % 257);
            while (!ring->push(static_cast<uint8_t>(i), 0, i, bytes.data(), bytes.size())) std::this_thread::yield();
        }
    });
    uint32_t torn = 0;
    for (uint32_t i = 0; i < kRecords;) {
        Record record;
        if (!ring->front(&record)) {
            std::this_thread::yield();
            continue;
        }
        const std::vector<uint8_t> expected = pattern(i, i % 257);
        torn += record.time_us != i || std::vector<uint8_t>(record.bytes, record.bytes + record.size) != expected;
        ring->pop();
        ++i;
    }
    writer.join();
    EXPECT_EQ(torn, 0u);
}

TEST(Ring, ShowsNothingOfAReservedRecordBeforeItIsCommitted) {
    Ring<256> ring;
    Record record;
    uint8_t* room = ring.reserve(40);
    ASSERT_NE(room, nullptr);
    std::memset(room, 7, 40);
    EXPECT_FALSE(ring.front(&record));
    ring.commit(3, 1, 99, 40);
    ASSERT_TRUE(ring.front(&record));
    EXPECT_EQ(record.size, 40u);
    EXPECT_EQ(record.kind, 3);
    EXPECT_EQ(record.time_us, 99u);
    EXPECT_EQ(std::vector<uint8_t>(record.bytes, record.bytes + 40), std::vector<uint8_t>(40, 7));
}

TEST(Ring, GivesAReservedPlaceToWhateverIsPushedMeanwhile) {
    Ring<256> ring;
    Record record;
    ASSERT_NE(ring.reserve(100), nullptr);
    ASSERT_TRUE(ring.push(5, 0, 1, "ab", 2));
    ASSERT_TRUE(ring.front(&record));
    EXPECT_EQ(std::memcmp(record.bytes, "ab", 2), 0);
    ring.pop();
    EXPECT_FALSE(ring.front(&record));
}

TEST(Ring, HasNoRoomToReserveForWhatIsTooLong) {
    Ring<256> ring;
    EXPECT_EQ(ring.reserve(256 / 2 - 15), nullptr);
    EXPECT_NE(ring.reserve(256 / 2 - 16), nullptr);
}

TEST(Assembly, PutsPiecesTogetherInTheRing) {
    Ring<512> ring;
    Assembly message;
    Record record;
    const std::vector<uint8_t> bytes = pattern(9, 100);
    for (int round = 0; round < 40; ++round) {  // over the seam too
        message.begin(ring.reserve(100), 100);
        EXPECT_FALSE(message.add(bytes.data(), 40, 0));
        EXPECT_FALSE(message.add(bytes.data() + 40, 59, 40));
        EXPECT_TRUE(message.add(bytes.data() + 99, 1, 99));
        ASSERT_TRUE(message.is_whole());
        ring.commit(1, 0, 0, message.size());
        ASSERT_TRUE(ring.front(&record));
        ASSERT_EQ(std::vector<uint8_t>(record.bytes, record.bytes + record.size), bytes);
        ring.pop();
    }
}

TEST(Assembly, IsNothingWhenAPieceIsMissingTooLongOrOutOfPlaceOrThereIsNoRoom) {
    uint8_t room[100];
    Assembly message;
    const std::vector<uint8_t> bytes = pattern(9, 200);
    message.begin(room, 100);
    message.add(bytes.data(), 40, 0);
    EXPECT_TRUE(message.add(bytes.data(), 50, 50));
    EXPECT_FALSE(message.is_whole());
    message.begin(room, 50);
    EXPECT_TRUE(message.add(bytes.data(), 60, 0));
    EXPECT_FALSE(message.is_whole());
    message.begin(room, 100);
    EXPECT_TRUE(message.add(bytes.data(), 10, 90));
    EXPECT_EQ(message.size(), 0u);
    message.begin(nullptr, 101);
    EXPECT_TRUE(message.add(bytes.data(), 101, 0));
    EXPECT_EQ(message.size(), 0u);
}

TEST(Assembly, BeginsAnewAfterAMessageThatWasNothingOrCutOff) {
    uint8_t room[100];
    Assembly message;
    const std::vector<uint8_t> bytes = pattern(4, 100);
    message.begin(nullptr, 500);
    message.add(bytes.data(), 60, 0);
    message.begin(room, 100);
    message.add(bytes.data(), 60, 0);
    message.forget();  // the connection was lost
    EXPECT_TRUE(message.add(bytes.data(), 40, 60));
    EXPECT_FALSE(message.is_whole());
    message.begin(room, 100);
    EXPECT_TRUE(message.add(bytes.data(), 100, 0));
    EXPECT_EQ(message.size(), 100u);
    EXPECT_EQ(std::memcmp(message.bytes(), bytes.data(), 100), 0);
    message.begin(room, 0);
    EXPECT_TRUE(message.add(bytes.data(), 0, 0));
    EXPECT_EQ(message.size(), 0u);
}
