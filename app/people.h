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
  sim::Subject subject;                       ///< without its shape
  std::map<std::string, double> measured_mm;  ///< sim::MeasureFoot standing at half the body weight, but navicular_height at rest
};

/// `count` seeds from `first_seed` on, both sexes as they come.
std::vector<std::uint64_t> PeopleSeeds(int count, std::uint64_t first_seed);
/// The first `count` women and the first `count` men among the seeds from `first_seed` on, ascending.
std::vector<std::uint64_t> SeedsPerSex(int count, std::uint64_t first_seed);

/// Draws these people and measures them, in parallel. `done` hears how many are finished, one call at a time.
std::vector<Person> MakePeople(const std::vector<std::uint64_t>& seeds, const std::function<void(int)>& done);

/// Columns id, sex, side, weight_kg, stature_mm, age_years, hallux_valgus_deg, second_toe_longest, heel_pad_mm, drawn_NAME and
/// measured_NAME (mm); docs/formats.md.
std::string PeopleCsv(const std::vector<Person>& people);

/// Means, standard deviations and correlations of the nine measures taken on the meshes against the survey's, per sex with
/// at least three people; and what is drawn apart from the survey.
nlohmann::json ComparePeople(const std::vector<Person>& people);

/// The comparison as Markdown tables.
std::string FormatComparison(const nlohmann::json& comparison);

}  // namespace sole::app
