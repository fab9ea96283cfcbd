#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "sim/subject.h"

namespace sole::app {

/// One simulated person: what was drawn and what the finished foot measures.
struct Person {
  sim::Subject subject;                          ///< without its shape
  std::map<std::string, double> measured_mm;     ///< sim::MeasureFoot, standing at half the body weight
};

/// Draws the people of seeds first_seed, first_seed + 1, ... and measures them, in parallel. `done` hears how many are
/// finished, one call at a time.
std::vector<Person> MakePeople(int count, std::uint64_t first_seed, const std::function<void(int)>& done);

/// Columns id, sex, side, weight_kg, stature_mm, hallux_valgus_deg, second_toe_longest, heel_pad_mm, drawn_NAME and
/// measured_NAME (mm); docs/formats.md.
std::string PeopleCsv(const std::vector<Person>& people);

/// Means, standard deviations and correlations of the nine measures taken on the meshes against the survey's, per sex with
/// at least three people.
nlohmann::json ComparePeople(const std::vector<Person>& people);

/// The comparison as Markdown tables.
std::string FormatComparison(const nlohmann::json& comparison);

}  // namespace sole::app
