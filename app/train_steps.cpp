#include "app/train_steps.h"

#include <fmt/format.h>

#include <mutex>

#include "app/console.h"
#include "core/error.h"
#include "io/atomic_file.h"
#include "model/constraints.h"
#include "model/joint_regressor_fit.h"
#include "model/model_file.h"
#include "model/shape_space.h"

namespace sole::app {
namespace {

namespace fs = std::filesystem;
using Eigen::Index;
using model::FootModel;
using model::PersonalFit;

fs::path FitFile(const TrainContext& context, const std::string& step, const fs::path& subject) {
  return context.folder / step / subject.filename();
}

/// A subject with its fit.
struct Fitted {
  TrainingSubject subject;
  PersonalFit fit;
};

std::function<Fitted(const fs::path&)> FittedReader(const TrainContext& context,
                                                    const std::string& poses,
                                                    const FootModel& foot) {
  return [&context, poses, &foot](const fs::path& path) {
    Fitted read{{}, ReadPersonalFit(FitFile(context, poses, path))};
    if (read.fit.poses.empty()) return read;
    read.subject = ReadTrainingSubject(path, foot, context.config, context.truth);
    Require(read.subject.frames.size() == read.fit.poses.size(),
            FitFile(context, poses, path).string() + ": belongs to other registrations");
    return read;
  };
}

Eigen::VectorXd Stacked(const Eigen::MatrixX3d& points) {
  const Eigen::Matrix3Xd transposed = points.transpose();
  return Eigen::Map<const Eigen::VectorXd>(transposed.data(), transposed.size());
}

Eigen::MatrixX3d Unstacked(const Eigen::VectorXd& stacked) {
  return Eigen::Map<const Eigen::Matrix3Xd>(stacked.data(), 3, stacked.size() / 3).transpose();
}

/// Components point to larger feet, so that the first one grows with foot length.
void OrientComponents(model::ShapeSpace& space) {
  const Eigen::Map<const Eigen::Matrix3Xd> mean(space.mean.data(), 3, space.mean.size() / 3);
  const Eigen::Matrix3Xd radial = mean.colwise() - mean.rowwise().mean();
  for (Index c = 0; c < space.components.cols(); ++c) {
    if (space.components.col(c).dot(Eigen::Map<const Eigen::VectorXd>(radial.data(), radial.size())) < 0)
      space.components.col(c) *= -1;
  }
}

/// Regressor of all joints but the root, whose row stays.
void LearnRegressor(const TrainContext& context, const std::string& poses, FootModel& foot) {
  std::vector<Eigen::MatrixX3d> vertices, joints;
  ForEachFile<PersonalFit>(
      context.files.train,
      [&](const fs::path& path) { return ReadPersonalFit(FitFile(context, poses, path)); },
      [&](const fs::path&, PersonalFit& fit) {
        if (fit.poses.empty()) return;
        vertices.push_back(fit.rest_m.topRows(foot.NumVertices()));
        joints.push_back(fit.joints_m);
      });
  const Eigen::RowVectorXd root = foot.joint_regressor.row(0);
  foot.joint_regressor = model::FitJointRegressor(vertices, joints);
  foot.joint_regressor.row(0) = root;
}

void Precise(const fs::path& path, const FootModel& foot) {
  model::SaveModel(path, foot, {.single_precision = false});
}

}  // namespace

void TrainContext::CheckStop() const {
  Require(stop == nullptr || !*stop,
          "stopped: what is finished is in " + folder.string() + "; the same command goes on");
}

FootModel ModelStep(const TrainContext& context, const std::string& name,
                    const std::function<FootModel()>& make) {
  const fs::path path = context.folder / (name + ".npz");
  if (!fs::exists(path)) {
    context.CheckStop();
    Precise(path, make());
  }
  return model::LoadModel(path);
}

void PosesStep(const TrainContext& context, const std::string& name, const std::string& before,
               const FootModel& foot, const SubjectFit& fit) {
  io::MakeDirectory(context.folder / name);
  std::vector<fs::path> all = context.files.train;
  all.insert(all.end(), context.files.validation.begin(), context.files.validation.end());
  Progress progress(name, static_cast<int>(all.size()));
  std::mutex mutex;
  int done = 0;
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, all.size(), 1),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t i = range.begin(); i < range.end(); ++i) {
          context.CheckStop();
          const fs::path path = FitFile(context, name, all[i]);
          if (!fs::exists(path)) {
            const TrainingSubject subject =
                ReadTrainingSubject(all[i], foot, context.config, context.truth);
            PersonalFit made;
            if (!subject.frames.empty()) {
              PersonalFit start;
              if (!before.empty()) start = ReadPersonalFit(FitFile(context, before, all[i]));
              made = fit(subject, before.empty() ? nullptr : &start);
            } else {
              made.rest_m.resize(0, 3);
              made.joints_m.resize(0, 3);
            }
            WritePersonalFit(path, made);
          }
          const std::lock_guard<std::mutex> lock(mutex);
          progress.Set(++done);
        }
      },
      tbb::simple_partitioner());
}

double MeanDistance(const TrainContext& context, const std::string& poses) {
  double sum = 0, count = 0;
  ForEachFile<PersonalFit>(
      context.files.train,
      [&](const fs::path& path) { return ReadPersonalFit(FitFile(context, poses, path)); },
      [&](const fs::path&, PersonalFit& fit) {
        for (const double distance : fit.distance_m) {
          sum += distance;
          ++count;
        }
      });
  Require(count > 0, "no training subject has enough good registrations");
  return sum / count;
}

namespace {

/// Every posed frame of the training subjects in order, with its subject's own model and how far each fine vertex is to
/// be believed.
template <class Visit>
void VisitPosedFrames(const TrainContext& context, const std::string& poses, const FootModel& foot,
                      const Visit& visit) {
  const FootModel coarse = model::CoarseOnly(foot);
  ForEachFile<Fitted>(
      context.files.train, FittedReader(context, poses, foot),
      [&](const fs::path&, Fitted& fitted) {
        context.CheckStop();
        if (fitted.fit.poses.empty()) return;
        const FootModel personal =
            model::PersonalModel(coarse, fitted.fit.rest_m, fitted.fit.joints_m);
        for (std::size_t f = 0; f < fitted.fit.poses.size(); ++f) {
          const model::TrainingFrame& frame = fitted.subject.frames[f];
          visit(fitted, f, personal,
                model::OnFine(foot, frame.certainty.cwiseProduct(frame.free)));
        }
      });
}

}  // namespace

FootModel LearnSkinning(const TrainContext& context, const std::string& poses,
                        const FootModel& foot, const Eigen::MatrixXd& prior) {
  model::SkinningEvidence evidence =
      model::NoSkinningEvidence(foot.fine.NumVertices(), foot.NumJoints());
  VisitPosedFrames(context, poses, foot,
                   [&](const Fitted& fitted, std::size_t f, const FootModel& personal,
                       const Eigen::VectorXd& certainty) {
                     AddEvidence(
                         model::PosedSample{fitted.fit.rest_m, fitted.subject.frames[f].vertices_m,
                                            model::BoneMotions(personal, fitted.fit.poses[f])},
                         certainty, evidence);
                   });
  FootModel learned = foot;
  learned.fine.weights = model::SolveSkinningWeights(evidence, prior, context.config.skinning);
  learned.coarse.weights = learned.fine.weights.topRows(foot.NumVertices());
  LearnRegressor(context, poses, learned);
  Prepare(learned);
  return learned;
}

FootModel LearnCorrectives(const TrainContext& context, const std::string& poses,
                           const FootModel& foot) {
  const Eigen::MatrixXd distances = model::RingDistances(foot);
  model::CorrectiveEvidence evidence =
      model::NoCorrectiveEvidence(distances, context.config.correctives);
  VisitPosedFrames(
      context, poses, foot,
      [&](const Fitted& fitted, std::size_t f, const FootModel& personal,
          const Eigen::VectorXd& certainty) {
        const model::ModelParameters& pose = fitted.fit.poses[f];
        AddEvidence(model::Unposed(fitted.subject.frames[f].vertices_m,
                                   model::BoneMotions(personal, pose), foot.fine.weights) -
                        fitted.fit.rest_m,
                    ConstrainedPoseFeatures(foot, pose.theta, {}), certainty, evidence);
      });
  const model::Correctives correctives = model::SolveCorrectives(
      evidence, distances, foot.NumVertices(), context.config.correctives);
  Log(fmt::format("correctives: {:.1f} % of the values are not zero", 100 * correctives.share));
  FootModel learned = foot;
  const Index n = foot.NumVertices();
  learned.fine.posedirs = correctives.posedirs;
  learned.coarse.posedirs = correctives.posedirs.topRows(3 * n);
  learned.activations = correctives.activations.topRows(n);
  Prepare(learned);
  return learned;
}

FootModel LearnShape(const TrainContext& context, const std::string& poses, const FootModel& foot,
                     Eigen::VectorXd& variances) {
  model::ShapeSum sum;
  sum.rank = context.config.shape_rank;
  Eigen::MatrixXd block;
  const auto flush = [&] {
    model::AddShapes(block, sum);
    block.resize(0, 0);
  };
  ForEachFile<PersonalFit>(
      context.files.train,
      [&](const fs::path& path) { return ReadPersonalFit(FitFile(context, poses, path)); },
      [&](const fs::path&, PersonalFit& fit) {
        if (fit.poses.empty()) return;
        const Index column = block.cols();
        block.conservativeResize(3 * fit.rest_m.rows(), column + 1);
        block.col(column) = Stacked(fit.rest_m);
        if (block.cols() == 64) flush();
      });
  flush();
  const Index betas = std::min<Index>(context.config.betas, sum.samples - 1);
  Require(betas >= model::kNetworkBetas, "training: too few subjects for a shape space");
  model::ShapeSpace space = LearnShapeSpace(sum, betas);
  OrientComponents(space);
  variances = space.variances;
  FootModel learned = foot;
  const Index n = foot.NumVertices();
  learned.fine.template_m = Unstacked(space.mean);
  learned.fine.shapedirs = space.components;
  learned.coarse.template_m = learned.fine.template_m.topRows(n);
  learned.coarse.shapedirs = learned.fine.shapedirs.topRows(3 * n);
  LearnRegressor(context, poses, learned);
  Prepare(learned);
  return learned;
}

Eigen::VectorXd BetaOf(const FootModel& foot, const Eigen::MatrixX3d& rest_m) {
  const Eigen::MatrixXd& s = foot.fine.shapedirs;
  return (s.transpose() * Stacked(rest_m - foot.fine.template_m))
      .cwiseQuotient(s.colwise().squaredNorm().transpose());
}

model::NetworkSamples CollectSamples(const TrainContext& context, const std::string& poses,
                                     const std::vector<fs::path>& files, const FootModel& foot) {
  Index count = 0;
  for (const fs::path& path : files)
    count += static_cast<Index>(ReadPersonalFit(FitFile(context, poses, path)).poses.size());
  const Index n = foot.NumVertices(), given = 4 * foot.NumJoints() + model::kNetworkBetas;
  model::NetworkSamples samples;
  samples.given.resize(given, count);
  samples.contact.resize(n, count);
  samples.probability.resize(n, count);
  samples.offsets_m.resize(3 * n, count);
  samples.weights.resize(n, count);
  FootModel coarse = model::CoarseOnly(foot);
  coarse.network.clear();
  Index at = 0;
  ForEachFile<Fitted>(
      files, FittedReader(context, poses, foot), [&](const fs::path&, Fitted& fitted) {
        context.CheckStop();
        if (fitted.fit.poses.empty()) return;
        const FootModel personal =
            model::PersonalModel(coarse, fitted.fit.rest_m, fitted.fit.joints_m);
        const Eigen::VectorXd beta = BetaOf(foot, fitted.fit.rest_m);
        for (std::size_t f = 0; f < fitted.fit.poses.size(); ++f, ++at) {
          const model::TrainingFrame& frame = fitted.subject.frames[f];
          const model::ModelParameters& pose = fitted.fit.poses[f];
          samples.given.col(at) =
              model::NetworkInput(pose.theta, beta, {}, n).head(given).cast<float>();
          samples.contact.col(at) = frame.contact.cast<float>();
          samples.probability.col(at) = frame.probability.cast<float>();
          samples.weights.col(at) = frame.certainty.cast<float>();
          samples.offsets_m.col(at) =
              Stacked(model::Unposed(frame.vertices_m.topRows(n),
                                     model::BoneMotions(personal, pose), foot.coarse.weights) -
                      RestVertices(personal, pose))
                  .cast<float>();
        }
      });
  return samples;
}

Eigen::MatrixXd CollectPoses(const TrainContext& context, const std::string& poses,
                             const FootModel& foot) {
  std::vector<Eigen::VectorXd> rows;
  ForEachFile<PersonalFit>(
      context.files.train,
      [&](const fs::path& path) { return ReadPersonalFit(FitFile(context, poses, path)); },
      [&](const fs::path&, PersonalFit& fit) {
        for (const model::ModelParameters& pose : fit.poses)
          rows.push_back(model::PoseValues(pose.theta));
      });
  Eigen::MatrixXd all(static_cast<Index>(rows.size()), 3 * (foot.NumJoints() - 1));
  for (std::size_t i = 0; i < rows.size(); ++i) all.row(static_cast<Index>(i)) = rows[i];
  return all;
}

}  // namespace sole::app
