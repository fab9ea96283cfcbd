#pragma once

#include <span>
#include <vector>

#include "app/tools/simulated_people.h"

namespace sole::tools {

/// `count` invented people for a model that knows nobody yet: the mean foot made longer, wider or
/// higher, fuller at heel, ball or ankle, with longer toes or a higher arch, by smooth functions of the
/// place. Nobody's true shape goes into them but the mean foot's. Deterministic.
std::vector<Person> DeformMeanFoot(std::span<const SurfacePoint> points, int count);

/// Every row's four largest weights, summing to 1.
Eigen::MatrixXd FourInfluences(Eigen::MatrixXd weights);

}  // namespace sole::tools
