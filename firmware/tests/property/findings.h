// Violations of the properties: how often each was found, and the first of each in words.
#pragma once

#include <array>
#include <cstdint>
#include <sstream>
#include <string>

namespace property {

enum class Property : uint8_t {
    EmittedSteps,
    PulseTiming,
    Limits,
    OnThePath,
    Idempotence,
    EStop,
    Answers,  // the last one
};
constexpr size_t kProperties = static_cast<size_t>(Property::Answers) + 1;

class Findings {
  public:
    template <typename... Words>
    void add(Property property, const Words&... words) {
        Entry& entry = entry_[static_cast<size_t>(property)];
        if (entry.count++ != 0) return;
        std::ostringstream text;
        text << context << ": ";
        (text << ... << words);
        entry.first = text.str();
    }
    uint64_t count(Property property) const { return entry_[static_cast<size_t>(property)].count; }
    const std::string& first(Property property) const { return entry_[static_cast<size_t>(property)].first; }

    std::string context;  // which play, and when

  private:
    struct Entry {
        uint64_t count = 0;
        std::string first;
    };
    std::array<Entry, kProperties> entry_;
};

}  // namespace property
