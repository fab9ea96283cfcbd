#pragma once

#include <map>
#include <string>

#include "app/train_steps.h"

namespace sole::app {

/// Names of the kinds as in the ablation table: "f_theta", "f_theta_beta", "full".
std::string NameOf(model::NetworkKind kind);

/// Curves of a network's training.
struct LearningCurve {
  std::vector<double> train_mm, validation_mm;
  double best_mm = 0;
};

/// Networks of the linear model `foot`, told pose only, pose and shape, and contact as well; of the
/// first two none where `all` is false. The full one is trained on the fits of step `poses`; then the
/// poses are found anew with it, and all are trained on those.
struct TrainedNetworks {
  std::map<std::string, model::FootModel> models;
  std::map<std::string, LearningCurve> curves;
  std::string poses;  ///< step of the last fits
};
TrainedNetworks TrainNetworks(const TrainContext& context, const std::string& poses,
                              const model::FootModel& foot, bool all);

}  // namespace sole::app
