// The plays: there with everything that can happen to a stream, straight back, and what ends a motion.
#pragma once

#include "player.h"

constexpr int32_t kThere[kMostJoints] = {6000, -3500, 1200, -6000, 731, 4999};
constexpr int32_t kBack[kMostJoints] = {-6000, 3500, -1200, 6000, -731, -4999};
constexpr int32_t kZero[kMostJoints] = {};

// Replaced by a path that ends at speed; held and resumed at speed, starved at speed until it stands, fed again, and
// replaced by a path to rest.
constexpr Cue kEventful[] = {
    {300, Deed::RepeatChunk},  {500, Deed::SkipChunk}, {600, Deed::Replace},  {1000, Deed::Hold}, {2200, Deed::Resume},
    {2700, Deed::StopFeeding}, {5200, Deed::Feed},     {5800, Deed::Replace}, {9000, Deed::End},
};
constexpr Cue kPlain[] = {{3200, Deed::End}};

// Homed, from switches that are active and others that are not; a limit switch at speed; the e-stop at speed, and in
// homing.
constexpr Cue kHoming[] = {{10, Deed::Home}, {6000, Deed::End}};
constexpr Cue kLimit[] = {{800, Deed::CloseLimit}, {900, Deed::OpenLimit}, {950, Deed::Reset}, {1000, Deed::End}};
constexpr Cue kEStop[] = {
    {600, Deed::Slow},           {900, Deed::Full},   {1200, Deed::PressButton}, {1300, Deed::Reset},
    {1350, Deed::ReleaseButton}, {1400, Deed::Reset}, {1410, Deed::Arm},         {1420, Deed::Home},
    {1700, Deed::PressButton},   {1800, Deed::End},
};
// From where homing has left the joints: 40 steps off their switches.
constexpr int32_t kHome[kMostJoints] = {260, -260, -260, 260, -260, -260};
constexpr int32_t kAway[kMostJoints] = {-5000, 3000, 900, -4000, 500, 4000};

inline void play_safety(Player& player, uint8_t joints) {
    const Move none{0, joints, kZero, kZero};
    player.play(none, kHoming);
    player.play(Move{3, joints, kHome, kAway}, kLimit);
    player.play(none, kHoming);
    player.play(Move{4, joints, kHome, kAway}, kEStop);
}
