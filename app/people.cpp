#include "app/people.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <numbers>

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
                                  {"miss_max_mm", miss.maxCoeff()}});
  }
  Eigen::Index a = 0, b = 0;
  const double from_survey = (got.correlation - wanted.correlation).cwiseAbs().maxCoeff(&a, &b);
  result["correlation_difference"] = from_survey;
  result["correlation_pair"] = {names[static_cast<std::size_t>(a)], names[static_cast<std::size_t>(b)]};
  result["correlation_difference_from_drawn"] = (got.correlation - drawn.correlation).cwiseAbs().maxCoeff();
  return result;
}

}  // namespace

std::vector<Person> MakePeople(int count, std::uint64_t first_seed, const std::function<void(int)>& done) {
  Require(count > 0, "people: the number must be positive");
  std::vector<Person> people(static_cast<std::size_t>(count));
  people[0] = MakePerson(first_seed);  // alone: it computes what all share
  done(1);
  std::mutex mutex;
  int finished = 1;
  tbb::parallel_for(1, count, [&](int i) {
    people[static_cast<std::size_t>(i)] = MakePerson(first_seed + static_cast<std::uint64_t>(i));
    const std::lock_guard<std::mutex> lock(mutex);
    done(++finished);
  });
  return people;
}

std::string PeopleCsv(const std::vector<Person>& people) {
  Require(!people.empty(), "people: there is nobody to write");
  std::string text = "id,sex,side,weight_kg,stature_mm,hallux_valgus_deg,second_toe_longest,heel_pad_mm";
  for (const std::string& name : MeasureNames()) text += ",drawn_" + name;
  for (const auto& [name, value] : people.front().measured_mm) text += ",measured_" + name;
  text += '\n';
  for (const Person& person : people) {
    const sim::Subject& s = person.subject;
    text += fmt::format("{},{},{},{:.2f},{:.1f},{:.2f},{},{:.2f}", s.seed, NameOf(s.sex),
                        s.side == Side::kLeft ? "left" : "right", s.weight_kg, 1e3 * s.stature_m,
                        s.hallux_valgus_rad * 180 / std::numbers::pi, s.second_toe_longest ? 1 : 0, 1e3 * s.heel_pad_m);
    for (const std::string& name : MeasureNames()) text += fmt::format(",{:.3f}", s.measures_mm.at(name));
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
  }
  return text;
}

}  // namespace sole::app
