#pragma once

#include <span>
#include <string>
#include <vector>

#include "app/tools/simulated_people.h"
#include "model/forward.h"

namespace sole::tools {

std::vector<Eigen::Vector3d> PointsToVector(const Eigen::MatrixX3d& points);

/// Learns skinning weights and (if asked) linear pose correctives of both surfaces from the posed
/// people: poses are estimated with each person's own rest shape and joints as template, then the
/// weights that fit all poses best, in turn. `shares` is the prior (fine vertices x K).
void LearnMotion(std::span<const Person> people, const Eigen::MatrixXd& shares, int rounds,
                 bool correctives, model::FootModel& foot,
                 const std::function<void(const std::string&)>& log);

}  // namespace sole::tools
