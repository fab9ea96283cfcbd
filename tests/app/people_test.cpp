#include "app/people.h"

#include <algorithm>
#include <random>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "sim/survey.h"

namespace sole::app {
namespace {

TEST(SeedsPerSex, GivesAsManyOfEachInAscendingOrder) {
  const std::vector<std::uint64_t> seeds = SeedsPerSex(20, 500);
  ASSERT_EQ(seeds.size(), 40U);
  EXPECT_TRUE(std::is_sorted(seeds.begin(), seeds.end()));
  EXPECT_GE(seeds.front(), 500U);
  EXPECT_EQ(std::count_if(seeds.begin(), seeds.end(), [](auto seed) { return sim::SubjectSex(seed) == sim::Sex::kMale; }), 20);
}

/// Women whose meshes measure what was drawn from the survey, but for `change`.
std::vector<Person> DrawnWomen(int count, const std::function<void(Person&)>& change) {
  const sim::Survey& survey = sim::SurveyOf(sim::Sex::kFemale);
  std::mt19937_64 random(3);
  std::vector<Person> people;
  for (int i = 0; i < count; ++i) {
    const Eigen::VectorXd drawn = sim::DrawFromSurvey(survey, random);
    Person person;
    person.subject.sex = sim::Sex::kFemale;
    for (std::size_t k = 0; k < 9; ++k) person.subject.measures_mm[survey.columns[k]] = drawn[static_cast<Eigen::Index>(k)];
    person.measured_mm = person.subject.measures_mm;
    person.subject.measures_mm["navicular_height"] = 40;
    person.measured_mm["navicular_height"] = 41;
    person.measured_mm["arch_height"] = 20;
    person.measured_mm["second_toe_lead"] = i % 4 == 0 ? 1 : -1;
    change(person);
    people.push_back(person);
  }
  return people;
}

TEST(ComparePeople, DrawsFromTheSurveyAgreeWithIt) {
  const nlohmann::json women = ComparePeople(DrawnWomen(3000, [](Person&) {})).at("female");
  EXPECT_EQ(women.at("people"), 3000);
  for (const auto& measure : women.at("measures")) {
    EXPECT_NEAR(measure.at("mean_difference").get<double>(), 0, 0.005);
    EXPECT_NEAR(measure.at("sd_difference").get<double>(), 0, 0.05);
    EXPECT_EQ(measure.at("miss_max_mm"), 0);
  }
  EXPECT_LT(women.at("correlation_difference").get<double>(), 0.05);
  EXPECT_EQ(women.at("missed_by_2mm"), 0);
  EXPECT_EQ(women.at("drawn_apart").at("second_toe_longest_on_mesh"), 0.25);
}

TEST(ComparePeople, FindsAMeasureThatIsOffAndWider) {
  const double mean = sim::SurveyOf(sim::Sex::kFemale).mean[7];
  const auto widen = [&](Person& person) {
    double& value = person.measured_mm.at("lateralmalleolusheight");
    value = mean + 3 + 1.5 * (value - mean);
  };
  const nlohmann::json women = ComparePeople(DrawnWomen(3000, widen)).at("female");
  const nlohmann::json& measure = women.at("measures").at(7);
  EXPECT_EQ(measure.at("name"), "lateralmalleolusheight");
  EXPECT_NEAR(measure.at("mean_mm").get<double>() - measure.at("survey_mean_mm").get<double>(), 3, 0.3);
  EXPECT_NEAR(measure.at("sd_difference").get<double>(), 0.5, 0.05);
  EXPECT_GT(women.at("missed_by_2mm").get<double>(), 0.5);
}

}  // namespace
}  // namespace sole::app
