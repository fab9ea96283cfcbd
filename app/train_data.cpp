#include "app/train_data.h"

#include <fmt/format.h>

#include <cmath>

#include "app/registrations.h"
#include "core/error.h"
#include "io/npz.h"

namespace sole::app {
namespace {

namespace fs = std::filesystem;
using Eigen::Index;

constexpr char kFormat[] = "sole-training-subject";

model::TrainingFrame FrameOf(const SubjectRegistrations& r, std::size_t f,
                             const model::FootModel& foot, const TrainConfig& config, bool truth) {
  const auto row = static_cast<Index>(f);
  const Index n = foot.NumVertices();
  model::TrainingFrame frame;
  frame.vertices_m = r.fine_m[f].cast<double>();
  frame.probability = r.probability.row(row).cast<double>();
  frame.contact = r.contact.row(row).cast<double>();
  Eigen::VectorXd sd = r.sd_m.row(row).cast<double>(), gap = r.gap_m.row(row).cast<double>();
  if (truth) {
    frame.vertices_m.topRows(n) = r.true_m[f].cast<double>();
    gap = frame.vertices_m.col(2).head(n);
    sd.setZero();
    frame.contact = (gap.array() < 1e-4).cast<double>();
    frame.probability = frame.contact;
  }
  frame.certainty.resize(n);
  frame.free.resize(n);
  for (Index i = 0; i < n; ++i) {
    const double relative = sd[i] / config.seen_sd_m;
    frame.certainty[i] = std::isfinite(relative) ? 1 / (1 + relative * relative) : 0;
    frame.free[i] = std::isfinite(gap[i])
                        ? std::clamp((gap[i] - config.pressed_gap_m) /
                                         (config.free_gap_m - config.pressed_gap_m),
                                     0.0, 1.0)
                        : 0;
    if (!std::isfinite(frame.probability[i])) frame.probability[i] = 0;
  }
  if (r.side == Side::kLeft) frame.vertices_m.col(foot.mirror_axis) *= -1;
  return frame;
}

}  // namespace

TrainingFiles ListTrainingFiles(const fs::path& dataset) {
  TrainingFiles files;
  for (const fs::path& path : ListRegistrations(dataset)) {
    std::string name = path.stem().string();  // of a subject's left and right foot: SUBJECT-left
    for (const char* side : {"-left", "-right"}) {
      if (name.ends_with(side)) name.resize(name.size() - std::string(side).size());
    }
    const std::string split = SplitOfSubject(name);
    if (split == "test") continue;
    (split == "train" ? files.train : files.validation).push_back(path);
    files.fingerprint +=
        fmt::format("{} {}\n", path.filename().string(), fs::file_size(path));
  }
  Require(!files.train.empty() && !files.validation.empty(),
          dataset.string() + " holds no subjects to train with or none to validate with: training "
                             "needs both (8 and 1 in 10 subjects by their names)");
  return files;
}

TrainingSubject ReadTrainingSubject(const fs::path& path, const model::FootModel& foot,
                                    const TrainConfig& config, bool truth) {
  const SubjectRegistrations r = ReadRegistrations(path);
  const Index n = foot.NumVertices(), m = foot.fine.NumVertices();
  Require(r.split != "test", path.string() + ": this subject is kept for tests, by its own word");
  Require(r.NumVertices() == n && (r.fine_m.empty() || r.fine_m[0].rows() == m),
          fmt::format("{}: its template has {} and {} vertices, the model {} and {}: train from the "
                      "model that registered it (--template)",
                      path.string(), r.NumVertices(), r.fine_m.empty() ? 0 : r.fine_m[0].rows(), n,
                      m));
  Require(!truth || r.true_m.size() == r.NumFrames(),
          path.string() + ": no truth in it, which only simulated subjects have (--truth)");
  TrainingSubject subject{r.subject, {}};
  if (config.sex != "all" && r.sex != config.sex) return subject;
  for (std::size_t f = 0; f < r.NumFrames(); ++f) {
    if (r.verdict[f] != "good" || !r.fine_m[f].allFinite()) continue;
    subject.frames.push_back(FrameOf(r, f, foot, config, truth));
  }
  if (static_cast<int>(subject.frames.size()) < config.minimum_frames) subject.frames.clear();
  return subject;
}

void WritePersonalFit(const fs::path& path, const model::PersonalFit& fit) {
  const std::size_t f = fit.poses.size(), k = static_cast<std::size_t>(fit.joints_m.rows());
  std::vector<double> theta, translation;
  for (const model::ModelParameters& pose : fit.poses) {
    for (Index j = 0; j < pose.theta.rows(); ++j)
      theta.insert(theta.end(), {pose.theta(j, 0), pose.theta(j, 1), pose.theta(j, 2)});
    for (const double value : pose.translation_m) translation.push_back(value);
  }
  io::WriteNpz(path, {{"format", io::NpyFrom(std::string(kFormat))},
                      {"version", io::NpyFrom(std::vector<int>{1})},
                      {"rest_m", io::NpyFrom(Eigen::MatrixXf(fit.rest_m.cast<float>()))},
                      {"joints_m", io::NpyFrom(Eigen::MatrixXd(fit.joints_m))},
                      {"theta", io::Reshaped(io::NpyFrom(theta), {f, k, 3})},
                      {"translation_m", io::Reshaped(io::NpyFrom(translation), {f, 3})},
                      {"distance_m", io::NpyFrom(fit.distance_m)}});
}

model::PersonalFit ReadPersonalFit(const fs::path& path) {
  const io::Npz npz = io::ReadNpz(path);
  try {
    Require(io::StringFrom(npz, "format") == kFormat, "is no fit of a training subject");
    model::PersonalFit fit;
    const Eigen::MatrixXd rest = io::MatrixFrom(npz, "rest_m"),
                          joints = io::MatrixFrom(npz, "joints_m"),
                          theta = io::MatrixFrom(npz, "theta"),
                          translation = io::MatrixFrom(npz, "translation_m"),
                          distance = io::MatrixFrom(npz, "distance_m");
    const Index f = theta.rows(), k = joints.rows();
    Require(rest.cols() == 3 && joints.cols() == 3 && (f == 0 || theta.cols() == 3 * k) &&
                translation.rows() == f && (f == 0 || translation.cols() == 3) &&
                distance.rows() == f,
            "is damaged: its arrays do not fit together");
    fit.rest_m = rest;
    fit.joints_m = joints;
    for (Index i = 0; i < f; ++i) {
      model::ModelParameters pose;
      const Eigen::RowVectorXd row = theta.row(i);
      pose.theta = Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>>(
          row.data(), k, 3);
      pose.translation_m = translation.row(i);
      fit.poses.push_back(pose);
      fit.distance_m.push_back(distance(i, 0));
    }
    return fit;
  } catch (const Error& error) {
    throw Error(path.string() + ": " + error.what());
  }
}

}  // namespace sole::app
