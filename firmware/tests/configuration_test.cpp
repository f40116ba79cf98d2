// Configurations that a device takes and refuses.
#include <gtest/gtest.h>

#include <cstring>

#include "crc32.h"
#include "rig.h"

using namespace gemelo;

namespace {

const std::string kOneJoint =
    R"({"name":"one","joints":[{"name":"q1","lower_q8":0,"upper_q8":2560,"max_velocity_q8":2560,"max_acceleration_q8":2560}]})";

uint32_t crc_of(const std::string& text) { return crc32(reinterpret_cast<const uint8_t*>(text.data()), text.size()); }

// A machine without a platform: what it says and keeps, as texts.
class Bare {
  public:
    explicit Bare(const DeviceConfig& wanted) : config(wanted) {
        machine.begin(config, Identity{rig::kBoot, "power_on"}, Sink{this, put, keep});
        const int32_t steps[kMaxJoints] = {};
        machine.start(0, steps, true);
        said.clear();
    }
    // The answer.
    std::string configure(const std::string& text) {
        said.clear();
        machine.receive_config(Arrival{reinterpret_cast<const uint8_t*>(text.data()), text.size(), true, 0}, 0);
        return said.empty() ? "" : said.front().second;
    }
    int count(Output output, const std::string& part) const {
        int count = 0;
        for (const auto& [kind, text] : said) count += kind == output && text.find(part) != std::string::npos;
        return count;
    }

    DeviceConfig config;
    Machine machine;
    std::vector<std::pair<Output, std::string>> said;
    std::string kept;

  private:
    static void put(void* self, Output output, const uint8_t* bytes, size_t size) {
        static_cast<Bare*>(self)->said.emplace_back(output, std::string(bytes, bytes + size));
    }
    static void keep(void* self, const uint8_t* text, size_t size) {
        static_cast<Bare*>(self)->kept.assign(text, text + size);
    }
};

DeviceConfig disarmed() {
    DeviceConfig config = rig::two_joints();
    config.is_armed_at_boot = 0;
    return config;
}

std::string answer(uint32_t crc, const std::string& rest) { return "{\"crc32\": " + std::to_string(crc) + rest; }

}  // namespace

TEST(Configuration, IsTakenByADeviceThatHasNone) {
    Bare device{DeviceConfig{}};
    EXPECT_EQ(device.configure(kOneJoint),
              answer(crc_of(kOneJoint), R"(, "accepted": true, "part": "", "reason": ""})"));
    EXPECT_EQ(device.kept, kOneJoint);
    EXPECT_EQ(device.config.joints, 1);
    EXPECT_EQ(device.machine.config_crc32(), crc_of(kOneJoint));
    EXPECT_EQ(device.machine.mode(), Mode::Unreferenced);
    EXPECT_EQ(device.count(Output::Event, "\"configured\""), 1);
    EXPECT_EQ(device.count(Output::Status, "\"joints\": 1"), 1);
}

TEST(Configuration, IsTakenDisarmedAndLeavesTheDeviceUnreferencedAndDisarmed) {
    Bare device{disarmed()};
    device.configure(kOneJoint);
    EXPECT_EQ(device.config.joints, 1);
    EXPECT_EQ(device.machine.mode(), Mode::Unreferenced);
    EXPECT_FALSE(device.machine.is_enabled());
    EXPECT_FALSE(device.machine.is_referenced());
}

TEST(Configuration, IsRefusedByAnArmedDeviceAndChangesNothing) {
    Bare device{rig::two_joints()};
    EXPECT_EQ(device.configure(kOneJoint),
              answer(crc_of(kOneJoint),
                     R"(, "accepted": false, "part": "", "reason": "the device is armed: disarm it first"})"));
    EXPECT_EQ(device.config.joints, 2);
    EXPECT_EQ(device.machine.mode(), Mode::Idle);
    EXPECT_EQ(device.kept, "");
}

TEST(Configuration, ThatItHasAlreadyIsAcknowledgedInEveryModeAndChangesNothing) {
    DeviceConfig config = rig::two_joints();
    config.crc32 = crc_of(kOneJoint);
    Bare device{config};
    EXPECT_EQ(device.configure(kOneJoint),
              answer(crc_of(kOneJoint), R"(, "accepted": true, "part": "", "reason": ""})"));
    EXPECT_EQ(device.config.joints, 2);
    EXPECT_EQ(device.machine.mode(), Mode::Idle);
    EXPECT_EQ(device.kept, "");
    EXPECT_EQ(device.said.size(), 1u);
}

TEST(Configuration, WithAFaultIsRefusedWithItsPartAndReasonAndChangesNothing) {
    Bare device{disarmed()};
    const std::string wrong = std::string(kOneJoint).replace(kOneJoint.find("2560"), 4, "0");
    EXPECT_EQ(device.configure(wrong), answer(crc_of(wrong), R"(, "accepted": false, "part": "q1", "reason": )"
                                                             R"("its lower limit is not below its upper limit"})"));
    const std::string unknown = std::string(kOneJoint).replace(kOneJoint.find("lower_q8"), 8, "l\\\"o\\nr");
    EXPECT_EQ(device.configure(unknown), answer(crc_of(unknown), R"(, "accepted": false, "part": "q1", "reason": )"
                                                                 R"("\"l\"o?r\" is not a key that is known here"})"));
    EXPECT_EQ(device.config.joints, 2);
    EXPECT_EQ(device.kept, "");
    EXPECT_EQ(device.said.size(), 1u);
}

TEST(Configuration, OfAnyGarbageIsAnsweredOnce) {
    Bare device{disarmed()};
    for (const std::string text : {"", "{", "null", "\xff\xfe", "{\"name\": \"\\u0000\"}"}) {
        EXPECT_NE(device.configure(text).find("\"accepted\": false"), std::string::npos);
        EXPECT_EQ(device.said.size(), 1u);
    }
    EXPECT_EQ(device.config.joints, 2);
}
