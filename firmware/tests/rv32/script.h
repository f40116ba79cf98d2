// The plays: there with everything that can happen to a stream, and straight back.
#pragma once

#include "player.h"

constexpr int32_t kThere[kMostJoints] = {6000, -3500, 1200, -6000, 731, 4999};
constexpr int32_t kBack[kMostJoints] = {-6000, 3500, -1200, 6000, -731, -4999};
constexpr int32_t kZero[kMostJoints] = {};

// Held and resumed at speed, starved at speed until it stands, fed again.
constexpr Cue kEventful[] = {
    {300, Deed::RepeatChunk},  {500, Deed::SkipChunk}, {1000, Deed::Hold}, {2200, Deed::Resume},
    {2700, Deed::StopFeeding}, {5200, Deed::Feed},     {9000, Deed::End},
};
constexpr Cue kPlain[] = {{3200, Deed::End}};
