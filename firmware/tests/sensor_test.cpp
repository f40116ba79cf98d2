// Sensors: scaled, by name, at a rate of their own.
#include <gtest/gtest.h>

#include "wired.h"

using namespace gemelo;
using namespace rig;

namespace {

DeviceConfig with_sensors() {
    DeviceConfig config = wired_joints();
    config.sensor_hz = 20;
    config.sensors = 2;
    std::strncpy(config.sensor[0].name, "ultra", kNameSize - 1);
    config.sensor[0].kind = SensorKind::Ultrasonic;
    config.sensor[0].scale_q16 = 65536 * 17;  // 17 thousandths of a cm per us, roughly
    std::strncpy(config.sensor[1].name, "bateria", kNameSize - 1);
    config.sensor[1].scale_q16 = 65536 / 2;
    config.sensor[1].offset_milli = -500;
    return config;
}

}  // namespace

TEST(Sensors, AreToldByNameAndScaledAtARateOfTheirOwn) {
    Wired wired(with_sensors());
    wired.run_ms(100);
    EXPECT_TRUE(wired.sensors.empty()) << "nothing was read yet";
    for (int n = 0; n < 20; ++n) {
        wired.machine.set_sensor(0, 735);
        wired.run_ms(50);
    }
    EXPECT_EQ(wired.sensors.size(), 20u);
    EXPECT_NE(wired.sensors.back().find("\"ultra\": 12.495"), std::string::npos) << wired.sensors.back();
    EXPECT_EQ(wired.sensors.back().find("bateria"), std::string::npos);
    wired.machine.set_sensor(1, 100);
    wired.machine.set_sensor(2, 100);  // there is none
    wired.run_ms(100);
    EXPECT_NE(wired.sensors.back().find("\"bateria\": -0.450"), std::string::npos) << wired.sensors.back();
    EXPECT_NE(wired.sensors.back().find("\"boot_id\": 305419896"), std::string::npos);
}

TEST(Sensors, ThatFallSilentAreLeftOutAndComeBack) {
    Wired wired(with_sensors());
    const auto run = [&wired](bool first, bool second) {
        wired.sensors.clear();
        for (int n = 0; n < 20; ++n) {
            if (first) wired.machine.set_sensor(0, 735);
            if (second) wired.machine.set_sensor(1, 100);
            wired.run_ms(50);
        }
        return std::count_if(wired.sensors.begin(), wired.sensors.end(),
                             [](const std::string& said) { return said.find("\"ultra\"") != std::string::npos; });
    };
    EXPECT_EQ(run(true, true), 20);
    EXPECT_EQ(run(false, true), 2) << "its last reading is told thrice in all";
    EXPECT_EQ(wired.sensors.size(), 20u) << "the other one goes on";
    EXPECT_EQ(run(false, false), 0);
    EXPECT_EQ(wired.sensors.size(), 2u);
    EXPECT_EQ(run(true, false), 20);
}

TEST(Sensors, ThatReadNonsenseDoNotWrap) {
    Wired wired(with_sensors());
    wired.machine.set_sensor(0, INT32_MAX);
    wired.run_ms(60);
    EXPECT_NE(wired.sensors.back().find("\"ultra\": 2147483.647"), std::string::npos) << wired.sensors.back();
    wired.machine.set_sensor(0, INT32_MIN);
    wired.run_ms(60);
    EXPECT_NE(wired.sensors.back().find("\"ultra\": -2147483.648"), std::string::npos) << wired.sensors.back();
}
