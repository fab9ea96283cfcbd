#include "app/people.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <mutex>
#include <numbers>
#include <numeric>

#include <Eigen/Core>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <tbb/parallel_for.h>

#include "core/error.h"
#include "sim/foot_measures.h"
#include "sim/soft_contact.h"
#include "sim/survey.h"

namespace sole::app {
namespace {

using nlohmann::json;

constexpr double kGravity = 9.81;
/// The survey's columns that are measures of the foot; the first nine.
constexpr Eigen::Index kNumMeasures = 9;

Person MakePerson(std::uint64_t seed) {
  Person person{sim::DrawSubject(seed), {}};
  const sim::LoadedFoot stood = sim::StandOnPlate(person.subject, 0.5 * kGravity * person.subject.weight_kg);
  person.measured_mm = sim::MeasureFoot(stood.foot.vertices_m, person.subject.side);
  person.measured_mm["navicular_height"] = sim::NavicularHeight(sim::SubjectRestMesh(person.subject).vertices);
  person.subject.shape.reset();
  return person;
}

std::vector<std::string> MeasureNames() {
  const std::vector<std::string>& columns = sim::SurveyOf(sim::Sex::kMale).columns;
  return {columns.begin(), columns.begin() + kNumMeasures};
}

const char* NameOf(sim::Sex sex) { return sex == sim::Sex::kFemale ? "female" : "male"; }

/// People x measures.
Eigen::MatrixXd Table(const std::vector<const Person*>& people, bool measured) {
  const std::vector<std::string> names = MeasureNames();
  Eigen::MatrixXd table(static_cast<Eigen::Index>(people.size()), kNumMeasures);
  for (Eigen::Index i = 0; i < table.rows(); ++i) {
    const Person& person = *people[static_cast<std::size_t>(i)];
    for (Eigen::Index j = 0; j < kNumMeasures; ++j) {
      const std::string& name = names[static_cast<std::size_t>(j)];
      table(i, j) = (measured ? person.measured_mm : person.subject.measures_mm).at(name);
    }
  }
  return table;
}

struct Moments {
  Eigen::VectorXd mean, sd;
  Eigen::MatrixXd correlation;
};

Moments MomentsOf(const Eigen::MatrixXd& covariance, const Eigen::VectorXd& mean) {
  const Eigen::VectorXd sd = covariance.diagonal().cwiseSqrt();
  const Eigen::VectorXd inverse = sd.cwiseInverse();
  return {mean, sd, inverse.asDiagonal() * covariance * inverse.asDiagonal()};
}

Moments MomentsOf(const Eigen::MatrixXd& table) {
  const Eigen::VectorXd mean = table.colwise().mean();
  const Eigen::MatrixXd centred = table.rowwise() - mean.transpose();
  return MomentsOf(centred.transpose() * centred / static_cast<double>(table.rows() - 1), mean);
}

/// Mean, standard deviation and range of one value of everybody.
json Spread(const std::vector<const Person*>& people, const char* name, const char* unit,
            const std::function<double(const Person&)>& value) {
  Eigen::VectorXd values(static_cast<Eigen::Index>(people.size()));
  for (Eigen::Index i = 0; i < values.size(); ++i) values[i] = value(*people[static_cast<std::size_t>(i)]);
  const double mean = values.mean();
  return {{"name", name},
          {"unit", unit},
          {"mean", mean},
          {"sd", std::sqrt((values.array() - mean).square().sum() / static_cast<double>(values.size() - 1))},
          {"min", values.minCoeff()},
          {"max", values.maxCoeff()}};
}

/// What the survey says nothing about.
json DrawnApart(const std::vector<const Person*>& people) {
  const auto share = [&](const std::function<bool(const Person&)>& holds) {
    const auto count = std::count_if(people.begin(), people.end(), [&](const Person* p) { return holds(*p); });
    return static_cast<double>(count) / static_cast<double>(people.size());
  };
  return {{"second_toe_longest_drawn", share([](const Person& p) { return p.subject.second_toe_longest; })},
          {"second_toe_longest_on_mesh", share([](const Person& p) { return p.measured_mm.at("second_toe_lead") > 0; })},
          {"spread",
           {Spread(people, "navicular height, drawn", "mm", [](const Person& p) { return p.subject.measures_mm.at("navicular_height"); }),
            Spread(people, "navicular height, on the mesh", "mm", [](const Person& p) { return p.measured_mm.at("navicular_height"); }),
            Spread(people, "sole under the arch, standing", "mm", [](const Person& p) { return p.measured_mm.at("arch_height"); }),
            Spread(people, "hallux valgus", "degrees",
                   [](const Person& p) { return p.subject.hallux_valgus_rad * 180 / std::numbers::pi; }),
            Spread(people, "age", "years", [](const Person& p) { return p.subject.age_years; }),
            Spread(people, "heel pad", "mm", [](const Person& p) { return 1e3 * p.subject.heel_pad_m; })}}};
}

json CompareSex(const std::vector<const Person*>& people, sim::Sex sex) {
  const sim::Survey& survey = sim::SurveyOf(sex);
  const Moments wanted = MomentsOf(survey.covariance.topLeftCorner(kNumMeasures, kNumMeasures), survey.mean.head(kNumMeasures));
  const Eigen::MatrixXd on_mesh = Table(people, true), as_drawn = Table(people, false);
  const Moments got = MomentsOf(on_mesh), drawn = MomentsOf(as_drawn);
  const std::vector<std::string> names = MeasureNames();
  json result = {{"people", people.size()}, {"measures", json::array()}};
  for (Eigen::Index i = 0; i < kNumMeasures; ++i) {
    const Eigen::VectorXd miss = (on_mesh.col(i) - as_drawn.col(i)).cwiseAbs();
    result["measures"].push_back({{"name", names[static_cast<std::size_t>(i)]},
                                  {"survey_mean_mm", wanted.mean[i]},
                                  {"mean_mm", got.mean[i]},
                                  {"mean_difference", got.mean[i] / wanted.mean[i] - 1},
                                  {"survey_sd_mm", wanted.sd[i]},
                                  {"sd_mm", got.sd[i]},
                                  {"sd_difference", got.sd[i] / wanted.sd[i] - 1},
                                  {"miss_mean_mm", miss.mean()},
                                  {"miss_max_mm", miss.maxCoeff()},
                                  {"missed_by_2mm", (miss.array() > 2).cast<double>().mean()}});
  }
  Eigen::Index a = 0, b = 0;
  const double from_survey = (got.correlation - wanted.correlation).cwiseAbs().maxCoeff(&a, &b);
  result["correlation_difference"] = from_survey;
  result["correlation_pair"] = {names[static_cast<std::size_t>(a)], names[static_cast<std::size_t>(b)]};
  result["correlation_difference_from_drawn"] = (got.correlation - drawn.correlation).cwiseAbs().maxCoeff();
  result["missed_by_2mm"] = ((on_mesh - as_drawn).cwiseAbs().rowwise().maxCoeff().array() > 2).cast<double>().mean();
  result["drawn_apart"] = DrawnApart(people);
  return result;
}

}  // namespace

std::vector<std::uint64_t> PeopleSeeds(int count, std::uint64_t first_seed) {
  Require(count > 0, "people: the number must be positive");
  std::vector<std::uint64_t> seeds(static_cast<std::size_t>(count));
  std::iota(seeds.begin(), seeds.end(), first_seed);
  return seeds;
}

std::vector<std::uint64_t> SeedsPerSex(int count, std::uint64_t first_seed) {
  Require(count > 0, "people: the number must be positive");
  std::vector<std::uint64_t> seeds;
  int women = 0, men = 0;
  for (std::uint64_t seed = first_seed; women < count || men < count; ++seed) {
    int& of_sex = sim::SubjectSex(seed) == sim::Sex::kFemale ? women : men;
    if (of_sex == count) continue;
    ++of_sex;
    seeds.push_back(seed);
  }
  return seeds;
}

std::vector<Person> MakePeople(const std::vector<std::uint64_t>& seeds, const std::function<void(int)>& done) {
  Require(!seeds.empty(), "people: nobody to draw");
  std::vector<Person> people(seeds.size());
  people[0] = MakePerson(seeds[0]);  // alone: it computes what all share
  done(1);
  std::mutex mutex;
  int finished = 1;
  tbb::parallel_for(std::size_t{1}, seeds.size(), [&](std::size_t i) {
    people[i] = MakePerson(seeds[i]);
    const std::lock_guard<std::mutex> lock(mutex);
    done(++finished);
  });
  return people;
}

std::string PeopleCsv(const std::vector<Person>& people) {
  Require(!people.empty(), "people: there is nobody to write");
  std::string text = "id,sex,side,weight_kg,stature_mm,age_years,hallux_valgus_deg,second_toe_longest,heel_pad_mm";
  for (const auto& [name, value] : people.front().subject.measures_mm) text += ",drawn_" + name;
  for (const auto& [name, value] : people.front().measured_mm) text += ",measured_" + name;
  text += '\n';
  for (const Person& person : people) {
    const sim::Subject& s = person.subject;
    text += fmt::format("{},{},{},{:.2f},{:.1f},{:.1f},{:.2f},{},{:.2f}", s.seed, NameOf(s.sex),
                        s.side == Side::kLeft ? "left" : "right", s.weight_kg, 1e3 * s.stature_m, s.age_years,
                        s.hallux_valgus_rad * 180 / std::numbers::pi, s.second_toe_longest ? 1 : 0, 1e3 * s.heel_pad_m);
    for (const auto& [name, value] : s.measures_mm) text += fmt::format(",{:.3f}", value);
    for (const auto& [name, value] : person.measured_mm) text += fmt::format(",{:.3f}", value);
    text += '\n';
  }
  return text;
}

json ComparePeople(const std::vector<Person>& people) {
  json comparison = json::object();
  for (const sim::Sex sex : {sim::Sex::kFemale, sim::Sex::kMale}) {
    std::vector<const Person*> of_sex;
    for (const Person& person : people) {
      if (person.subject.sex == sex) of_sex.push_back(&person);
    }
    if (of_sex.size() >= 3) comparison[NameOf(sex)] = CompareSex(of_sex, sex);
  }
  return comparison;
}

std::string FormatComparison(const json& comparison) {
  std::string text;
  for (const auto& [sex, result] : comparison.items()) {
    text += fmt::format("{}: {} people, measured on the meshes standing at half the body weight\n\n", sex,
                        result.at("people").get<int>());
    text += "| measure | survey mean, mm | mean, mm | difference | survey SD, mm | SD, mm | difference | miss mean, mm | miss max, mm |\n";
    text += "|---|---|---|---|---|---|---|---|---|\n";
    for (const json& m : result.at("measures")) {
      const auto value = [&](const char* key) { return m.at(key).get<double>(); };
      text += fmt::format("| {} | {:.1f} | {:.1f} | {:+.2f} % | {:.2f} | {:.2f} | {:+.1f} % | {:.2f} | {:.1f} |\n",
                          m.at("name").get<std::string>(), value("survey_mean_mm"), value("mean_mm"),
                          100 * value("mean_difference"), value("survey_sd_mm"), value("sd_mm"),
                          100 * value("sd_difference"), value("miss_mean_mm"), value("miss_max_mm"));
    }
    text += fmt::format("\nLargest difference of a correlation: {:.3f} from the survey ({} and {}), {:.3f} from the drawn values.\n\n",
                        result.at("correlation_difference").get<double>(),
                        result.at("correlation_pair").at(0).get<std::string>(),
                        result.at("correlation_pair").at(1).get<std::string>(),
                        result.at("correlation_difference_from_drawn").get<double>());
    text += fmt::format("People who miss one of the nine measures by more than 2 mm: {:.1f} %.\n\n",
                        100 * result.at("missed_by_2mm").get<double>());
    const json& apart = result.at("drawn_apart");
    text += fmt::format("Second toe longest: {:.1f} % drawn, {:.1f} % on the meshes.\n\n",
                        100 * apart.at("second_toe_longest_drawn").get<double>(),
                        100 * apart.at("second_toe_longest_on_mesh").get<double>());
    text += "| drawn apart from the survey | mean | SD | least | most |\n|---|---|---|---|---|\n";
    for (const json& row : apart.at("spread")) {
      const auto value = [&](const char* key) { return row.at(key).get<double>(); };
      text += fmt::format("| {}, {} | {:.1f} | {:.2f} | {:.1f} | {:.1f} |\n", row.at("name").get<std::string>(),
                          row.at("unit").get<std::string>(), value("mean"), value("sd"), value("min"), value("max"));
    }
    text += '\n';
  }
  return text;
}

}  // namespace sole::app
