#include "app/train.h"

#include <fmt/format.h>

#include "app/console.h"
#include "app/train_networks.h"
#include "app/train_report.h"
#include "app/train_steps.h"
#include "app/train_validation.h"
#include "core/error.h"
#include "io/atomic_file.h"
#include "model/mirror.h"
#include "model/model_file.h"
#include "model/train_two_joints.h"

namespace sole::app {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using model::FootModel;

/// Topology, tree and priors: the template without anything that training finds.
FootModel StartModel(const TrainOptions& options) {
  FootModel foot = model::LoadModel(options.model_template);
  const std::string where = options.model_template.string();
  Require(foot.HasFine() && !foot.upsampling.empty(),
          where + ": has no fine variant: training needs a template with one");
  Require(foot.family == model::Family::kSupr && foot.constraints.empty() &&
              foot.joint_regressor.cols() == foot.NumVertices(),
          where + ": is no model of family supr with free joints and a sparse joint regressor, as "
                  "training needs");
  if (foot.side == Side::kLeft) foot = model::MirrorModel(foot);
  foot.coarse.posedirs.resize(0, 0);
  foot.fine.posedirs.resize(0, 0);
  foot.activations.resize(0, 0);
  foot.network.clear();
  foot.pose_space = {};
  if (options.config.joints == "two") foot = model::TwoJointModel(foot);
  Prepare(foot);
  return foot;
}

/// The folder of checkpoints: of this configuration and these data, or new.
void OpenFolder(const TrainContext& context) {
  const fs::path origin = context.folder / "origin.txt";
  if (fs::exists(origin)) {
    Require(io::ReadFile(origin) == context.origin,
            context.folder.string() +
                " holds a training with another configuration or other data: remove it to begin anew");
    return;
  }
  io::MakeDirectory(context.folder);
  io::WriteStringAtomically(origin, context.origin);
}

fs::path Beside(const fs::path& out, const std::string& ending) {
  return out.parent_path() / (out.stem().string() + ending);
}

/// Poses, skinning weights and joints in turn, then correctives and shape. Returns the linear model
/// and the name of the last fits' step.
std::pair<FootModel, std::string> TrainLinear(const TrainContext& context, const FootModel& start,
                                              json& account) {
  const TrainConfig& config = context.config;
  const auto fit = [&](const FootModel& foot) {
    return [&](const TrainingSubject& subject, const model::PersonalFit* before) {
      return FitPerson(foot, subject.frames,
                       before ? *before : StartPerson(foot, subject.frames, config.person),
                       config.person);
    };
  };
  const auto poses = [&](const std::string& name, const std::string& before,
                         const FootModel& foot) {
    PosesStep(context, name, before, foot, fit(foot));
    const double distance_mm = 1e3 * MeanDistance(context, name);
    account["poses_mm"][name] = distance_mm;
    Log(fmt::format("{}: registrations explained to {:.3f} mm", name, distance_mm));
  };
  const Eigen::MatrixXd prior = model::WidenedWeights(start.fine.weights, start.parents);
  FootModel foot = start;
  std::string before;
  for (int round = 1; round <= config.skinning_rounds; ++round) {
    const std::string name = fmt::format("poses_{}", round);
    poses(name, before, foot);
    foot = ModelStep(context, fmt::format("skinning_{}", round),
                     [&] { return LearnSkinning(context, name, foot, prior); });
    before = name;
  }
  poses("poses_skinned", before, foot);
  foot = ModelStep(context, "correctives",
                   [&] { return LearnCorrectives(context, "poses_skinned", foot); });
  poses("poses_corrected", "poses_skinned", foot);
  Eigen::VectorXd variances;
  const FootModel shaped = LearnShape(context, "poses_corrected", foot, variances);
  json explained = json::array();
  double sum = 0;
  for (Eigen::Index c = 0; c < shaped.NumBetas(); ++c) {
    sum += variances[c] / variances.sum();
    explained.push_back(sum);
  }
  account["shape"] = {{"components", shaped.NumBetas()}, {"explained", explained}};
  account["posedirs_nonzero"] =
      static_cast<double>((shaped.coarse.posedirs.array() != 0).count()) /
      static_cast<double>(std::max<Eigen::Index>(1, shaped.coarse.posedirs.size()));
  return {shaped, "poses_corrected"};
}

void AddPoseSpace(const TrainContext& context, const std::string& poses, FootModel& foot,
                  json& account) {
  foot.pose_space =
      model::LearnPoseSpace(CollectPoses(context, poses, foot), context.config.pose_space);
  const Eigen::VectorXd& variances = foot.pose_space.variances;
  json explained = json::array();
  for (Eigen::Index c = 1; c <= foot.pose_space.components.cols(); ++c)
    explained.push_back(variances.head(c).sum() / variances.sum());
  account["pose_space"] = {{"explained", explained},
                           {"gaussians", foot.pose_space.weights.size()}};
}

}  // namespace

json TrainModel(const fs::path& dataset, const fs::path& out, const TrainOptions& options) {
  const Stopwatch watch;
  Require(out.extension() == ".npz", out.string() + ": a model's name ends in .npz");
  const FootModel start = StartModel(options);
  TrainContext context{options.config, ListTrainingFiles(dataset), Beside(out, ".training"), {},
                       options.truth, options.stop};
  context.origin = fmt::format("sole {}\n{}truth = {}\ntemplate = {} bytes\n{}", Version(),
                               FormatTrainConfig(options.config), options.truth,
                               fs::file_size(options.model_template), context.files.fingerprint);
  OpenFolder(context);

  json account = {{"format", "sole-training"}, {"version", 1}, {"dataset", dataset.string()},
                  {"truth", options.truth}};
  auto [foot, poses] = TrainLinear(context, start, account);
  std::map<std::string, FootModel> models;
  models["lbs"] = foot;
  models["lbs"].coarse.posedirs.resize(0, 0);
  models["lbs"].fine.posedirs.resize(0, 0);
  models["lbs"].activations.resize(0, 0);
  models["linear"] = foot;
  std::map<std::string, LearningCurve> curves;
  if (options.config.network == "full") {
    TrainedNetworks trained = TrainNetworks(context, poses, foot, options.ablation);
    models.merge(trained.models);
    curves = trained.curves;
    poses = trained.poses;
  }
  const Eigen::MatrixXd all = CollectPoses(context, poses, foot);
  account["train_frames"] = all.rows();
  AddPoseSpace(context, poses, foot, account);
  for (auto& [name, some] : models) {
    some.pose_space = foot.pose_space;
    Prepare(some);
  }
  const std::string best = models.contains("full") ? "full" : "linear";
  account["validation"] = ValidateModels(dataset, models);
  for (const auto& [name, curve] : curves)
    account["networks"][name] = {{"epochs", curve.validation_mm.size()}, {"best_mm", curve.best_mm}};
  account["train_subjects"] = context.files.train.size();
  account["validation_subjects"] = context.files.validation.size();
  account["seconds"] = watch.Seconds();
  for (const auto& [name, some] : models) {
    if (name != best && options.ablation) model::SaveModel(Beside(out, "-" + name + ".npz"), some);
  }
  io::WriteStringAtomically(Beside(out, "-training.json"), account.dump(2) + "\n");
  WriteTrainReport(Beside(out, "-training.html"), account, curves);
  model::SaveModel(out, models.at(best));
  return account;
}

}  // namespace sole::app
