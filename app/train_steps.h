#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "app/train_data.h"
#include "model/train_network.h"

namespace sole::app {

/// What every step of a training knows.
struct TrainContext {
  TrainConfig config;
  TrainingFiles files;
  std::filesystem::path folder;  ///< of the checkpoints
  std::string origin;            ///< what they belong to
  bool truth = false;
  const std::atomic<bool>* stop = nullptr;

  /// Throws Error where a stop was asked for.
  void CheckStop() const;
};

/// The model of a step: read if its file is there, else made, written and read again.
model::FootModel ModelStep(const TrainContext& context, const std::string& name,
                           const std::function<model::FootModel()>& make);

/// A fit of every training and validation subject into folder/NAME/SUBJECT.npz, those that are there
/// are kept. `before`: name of the step whose fits to start from, or empty.
using SubjectFit = std::function<model::PersonalFit(const TrainingSubject& subject,
                                                    const model::PersonalFit* before)>;
void PosesStep(const TrainContext& context, const std::string& name, const std::string& before,
               const model::FootModel& foot, const SubjectFit& fit);

/// Mean distance of a step's fits over the coarse vertices of the training frames, m.
double MeanDistance(const TrainContext& context, const std::string& poses);

/// Weights and joint regressor from a step's fits.
model::FootModel LearnSkinning(const TrainContext& context, const std::string& poses,
                               const model::FootModel& foot, const Eigen::MatrixXd& prior);

/// Sparse correctives from a step's fits.
model::FootModel LearnCorrectives(const TrainContext& context, const std::string& poses,
                                  const model::FootModel& foot);

/// Template and shape components from a step's rest shapes; `variances` of all components.
model::FootModel LearnShape(const TrainContext& context, const std::string& poses,
                            const model::FootModel& foot, Eigen::VectorXd& variances);

/// Shape coefficients nearest to a rest shape of the fine surface.
Eigen::VectorXd BetaOf(const model::FootModel& foot, const Eigen::MatrixX3d& rest_m);

/// What the linear model lacks in every frame of the subjects, with a step's fits.
model::NetworkSamples CollectSamples(const TrainContext& context, const std::string& poses,
                                     const std::vector<std::filesystem::path>& files,
                                     const model::FootModel& foot);

/// Pose values of all training frames, a row each.
Eigen::MatrixXd CollectPoses(const TrainContext& context, const std::string& poses,
                             const model::FootModel& foot);

}  // namespace sole::app
