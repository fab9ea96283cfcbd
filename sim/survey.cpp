#include "sim/survey.h"

#include <cmath>
#include <string_view>

#include <Eigen/Cholesky>
#include <nlohmann/json.hpp>

namespace sole::embedded {
std::string_view ansur2_foot_json();
}

namespace sole::sim {
namespace {

/// 99.9 % quantile of chi squared (Wilson and Hilferty).
double ChiSquared999(double degrees) {
  const double a = 2 / (9 * degrees);
  return degrees * std::pow(1 - a + 3.0902 * std::sqrt(a), 3);
}

Survey Load(const char* key) {
  const nlohmann::json root = nlohmann::json::parse(embedded::ansur2_foot_json()).at(key);
  Survey survey;
  survey.columns = root.at("columns").get<std::vector<std::string>>();
  const auto n = static_cast<Eigen::Index>(survey.columns.size());
  survey.mean.resize(n);
  survey.sd.resize(n);
  survey.covariance.resize(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto row = static_cast<std::size_t>(i);
    survey.mean[i] = root.at("mean").at(row);
    survey.sd[i] = root.at("sd").at(row);
    for (Eigen::Index j = 0; j < n; ++j) survey.covariance(i, j) = root.at("corr").at(row).at(static_cast<std::size_t>(j));
  }
  survey.covariance = survey.sd.asDiagonal() * survey.covariance * survey.sd.asDiagonal();
  return survey;
}

}  // namespace

const Survey& SurveyOf(Sex sex) {
  static const Survey female = Load("F"), male = Load("M");
  return sex == Sex::kMale ? male : female;
}

Eigen::VectorXd DrawFromSurvey(const Survey& survey, std::mt19937_64& random) {
  const Eigen::LLT<Eigen::MatrixXd> cholesky(survey.covariance);
  const double limit = ChiSquared999(static_cast<double>(survey.mean.size()));
  std::normal_distribution<double> normal;
  Eigen::VectorXd standard(survey.mean.size());
  do {
    for (double& value : standard) value = normal(random);
  } while (standard.squaredNorm() > limit);
  return survey.mean + cholesky.matrixL() * standard;
}

}  // namespace sole::sim
