#include "app/train_networks.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <vector>

#include "app/console.h"
#include "core/error.h"
#include "model/train_checkpoint.h"

namespace sole::app {
namespace {

namespace fs = std::filesystem;

/// Seconds of training that an interruption may cost.
constexpr double kCheckpointSeconds = 20;

model::NetworkTraining RunTraining(const TrainContext& context, const std::string& name,
                                   const model::NetworkSamples& samples,
                                   const model::NetworkSamples& validation,
                                   const model::NetworkTrainingOptions& options) {
  const fs::path path = context.folder / (name + ".npz");
  model::NetworkTraining training = fs::exists(path)
                                        ? model::LoadNetworkTraining(path, context.origin)
                                        : model::StartNetworkTraining(samples, options);
  Progress progress(name, options.epochs);
  Stopwatch since;
  while (!training.finished) {
    const bool stopping = context.stop != nullptr && *context.stop;
    if (stopping || since.Seconds() > kCheckpointSeconds) {
      model::SaveNetworkTraining(path, training, context.origin);
      since = {};
    }
    context.CheckStop();
    TrainEpoch(samples, validation, options, training);
    progress.Set(training.epoch);
  }
  model::SaveNetworkTraining(path, training, context.origin);
  return training;
}

}  // namespace

std::string NameOf(model::NetworkKind kind) {
  return kind == model::NetworkKind::kPose        ? "f_theta"
         : kind == model::NetworkKind::kPoseShape ? "f_theta_beta"
                                                  : "full";
}

TrainedNetworks TrainNetworks(const TrainContext& context, const std::string& poses,
                              const model::FootModel& foot, bool all) {
  TrainedNetworks result;
  result.poses = poses;
  const int rounds = context.config.network_rounds;
  for (int round = 1; round <= rounds; ++round) {
    const bool last = round == rounds;
    const model::NetworkSamples
        samples = CollectSamples(context, result.poses, context.files.train, foot),
        validation = CollectSamples(context, result.poses, context.files.validation, foot);
    Require(samples.Size() > 0 && validation.Size() > 0,
            "no subject with enough good registrations to train or to validate the network with");
    std::vector<model::NetworkKind> kinds{model::NetworkKind::kPoseShapeContact};
    if (last && all) {
      kinds.push_back(model::NetworkKind::kPose);
      kinds.push_back(model::NetworkKind::kPoseShape);
    }
    // A batch is too small for many threads, so kinds are trained side by side.
    std::vector<model::NetworkTraining> trainings(kinds.size());
    tbb::parallel_for(std::size_t{0}, kinds.size(), [&](std::size_t k) {
      model::NetworkTrainingOptions options = context.config.training;
      options.kind = kinds[k];
      trainings[k] = RunTraining(context, fmt::format("network_{}_{}", NameOf(kinds[k]), round),
                                 samples, validation, options);
    });
    for (std::size_t k = 0; k < kinds.size(); ++k) {
      const std::string name = NameOf(kinds[k]);
      const model::NetworkTraining& training = trainings[k];
      Log(fmt::format("network {}, round {}: {:.3f} mm a coordinate on {} validation frames after "
                      "{} epochs, {:.3f} mm on {} training frames",
                      name, round, training.best_mm, validation.Size(), training.epoch,
                      training.train_mm.back(), samples.Size()));
      model::FootModel trained = foot;
      trained.network = TrainedLayers(training);
      Prepare(trained);
      result.models[name] = trained;
      result.curves[name] = {training.train_mm, training.validation_mm, training.best_mm};
    }
    if (last) break;
    const model::FootModel& full = result.models.at("full");
    const std::string next = fmt::format("poses_network_{}", round);
    PosesStep(context, next, result.poses, full,
              [&](const TrainingSubject& subject, const model::PersonalFit* before) {
                return RefitPoses(full, subject.frames, *before, BetaOf(full, before->rest_m),
                                  context.config.person);
              });
    Log(fmt::format("{}: {:.3f} mm", next, 1e3 * MeanDistance(context, next)));
    result.poses = next;
  }
  return result;
}

}  // namespace sole::app
