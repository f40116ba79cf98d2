// Credentials over the serial line: bounds are named, and nothing that was said comes back.
#include "provision.h"

#include <gtest/gtest.h>

#include <string>

using namespace gemelo;

namespace {

bool parse(const std::string& text, Credentials* credentials, std::string* reason = nullptr) {
    Refusal refusal;
    const bool is_taken = parse_provision(text.data(), text.size(), credentials, &refusal);
    if (reason != nullptr) *reason = refusal.reason;
    return is_taken;
}

std::string reason_of(const std::string& text) {
    Credentials credentials;
    std::string reason;
    EXPECT_FALSE(parse(text, &credentials, &reason)) << text;
    return reason;
}

std::string member(const std::string& key, const std::string& value) { return "{\"" + key + "\":\"" + value + "\"}"; }

}  // namespace

TEST(Provision, EveryKeyArrivesAndWhatIsMissingStays) {
    Credentials credentials;
    ASSERT_TRUE(
        parse(R"({"device":"rm1","wifi_ssid":"my net","wifi_password":"s\"ecret\u00e9","mqtt_uri":"mqtts://h:8883",)"
              R"("mqtt_user":"u","mqtt_password":"p","mqtt_ca":"-----BEGIN\nabc\n"})",
              &credentials));
    EXPECT_STREQ(credentials.device, "rm1");
    EXPECT_STREQ(credentials.wifi_ssid, "my net");
    EXPECT_STREQ(credentials.wifi_password, "s\"ecret\xc3\xa9");
    EXPECT_STREQ(credentials.mqtt_uri, "mqtts://h:8883");
    EXPECT_STREQ(credentials.mqtt_ca, "-----BEGIN\nabc\n");
    EXPECT_FALSE(credentials.is_factory_reset);
    ASSERT_TRUE(parse(R"({"wifi_ssid":"","factory_reset":true})", &credentials));
    EXPECT_STREQ(credentials.wifi_ssid, "");
    EXPECT_STREQ(credentials.mqtt_user, "u");
    EXPECT_STREQ(credentials.mqtt_password, "p");
    EXPECT_TRUE(credentials.is_factory_reset);
    ASSERT_TRUE(parse("{}", &credentials));
    EXPECT_FALSE(credentials.is_factory_reset);
}

TEST(Provision, EveryBoundHoldsToTheByteAndIsNamed) {
    const std::pair<const char*, size_t> bounds[] = {{"device", 31},     {"wifi_ssid", 32},     {"wifi_password", 63},
                                                     {"mqtt_user", 63},  {"mqtt_password", 63}, {"mqtt_ca", 2048},
                                                     {"update_key", 256}};
    const std::pair<const char*, const char*> pairs[] = {{"mqtt_certificate", "mqtt_key"},
                                                         {"mqtt_key", "mqtt_certificate"}};
    for (const auto& [key, other] : pairs) {
        const auto both = [&](size_t size) {
            return "{\"" + std::string(other) + "\":\"x\",\"" + key + "\":\"" + std::string(size, 'a') + "\"}";
        };
        Credentials credentials;
        EXPECT_TRUE(parse(both(2048), &credentials)) << key;
        EXPECT_EQ(reason_of(both(2049)), "\"" + std::string(key) + "\" is longer than 2048 bytes");
        EXPECT_EQ(reason_of(member(key, "x")),
                  "\"mqtt_certificate\" and \"mqtt_key\" belong together: give both, or both empty");
    }
    for (const auto& [key, most] : bounds) {
        Credentials credentials;
        EXPECT_TRUE(parse(member(key, std::string(most, 'a')), &credentials)) << key;
        EXPECT_EQ(reason_of(member(key, std::string(most + 1, 'a'))),
                  "\"" + std::string(key) + "\" is longer than " + std::to_string(most) + " bytes");
    }
}

TEST(Provision, WhatCannotWorkIsRefused) {
    EXPECT_EQ(reason_of(member("device", "a/b")), "\"device\" is not 1 to 31 letters, digits, '_' or '-'");
    EXPECT_EQ(reason_of(member("mqtt_uri", "http://x")), "\"mqtt_uri\" does not begin with mqtt:// or mqtts://");
    EXPECT_EQ(reason_of(member("wifi_password", "seven77")), "\"wifi_password\" is shorter than the 8 bytes of WPA2");
    for (const char* rate : {"9599", "3000001", "fast", "1e5"})
        EXPECT_EQ(reason_of(member("serial_baud", rate)), "\"serial_baud\" is not a number of 9600 to 3000000");
    Credentials credentials;
    EXPECT_TRUE(parse(member("serial_baud", "115200"), &credentials));
    EXPECT_STREQ(credentials.serial_baud, "115200");
    EXPECT_EQ(reason_of(R"({"wifi_ssid":"a","wifi_ssid":"b"})"), "\"wifi_ssid\" is there twice");
    EXPECT_EQ(reason_of("hello"), "an object is expected (byte 0)");
}

TEST(Provision, NoRefusalHoldsWhatWasSaid) {
    for (const char* text :
         {R"({"wifi_password":"TOPSECRET\x"})", R"({"TOPSECRET":"wifi_password"})", R"({"wifi_password":TOPSECRET})",
          R"({"wifi_password":"a" "TOPSECRET"})", R"({"mqtt_password":"a","TOPSECRET"})",
          R"({"mqtt_password":["TOPSECRET"]})", R"({"factory_reset":"TOPSECRET"})", R"(TOPSECRET)"}) {
        const std::string reason = reason_of(text);
        EXPECT_EQ(reason.find("TOP"), std::string::npos) << reason;
        EXPECT_FALSE(reason.empty());
    }
}
