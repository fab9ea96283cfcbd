#pragma once

#include <random>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "sim/subject.h"

namespace sole::sim {

/// Means, standard deviations and correlations of one sex, embedded (data/ansur2_foot.json; mm, kg).
struct Survey {
  std::vector<std::string> columns;
  Eigen::VectorXd mean;
  Eigen::VectorXd sd;
  Eigen::MatrixXd covariance;
};

const Survey& SurveyOf(Sex sex);

/// A draw from the survey's normal, within the 99.9 % Mahalanobis radius.
Eigen::VectorXd DrawFromSurvey(const Survey& survey, std::mt19937_64& random);

}  // namespace sole::sim
