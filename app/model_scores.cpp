#include "app/model_scores.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include "core/error.h"
#include "model/contact_network.h"
#include "model/surface_query.h"
#include "model/train_person.h"
#include "model/vertex_fit.h"

namespace sole::app {
namespace {

using Eigen::Index;
using model::FootModel;
using model::ModelParameters;
using model::Variant;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr float kSeenSd_m = 0.0002F;  // scan points hold a vertex that is known better than this
constexpr double kSurfaceReach_m = 0.02;
// What a registered vertex is worth against beta ~ N(0, I): a model that fits explains them to 0.2 mm, and with
// much more the fit holds shape coefficients of a tenth of a millimetre near zero.
constexpr double kSigma_m = 0.0003, kThetaSd_rad = 0.3;

Eigen::MatrixX3d Mirrored(const Eigen::MatrixX3f& points, Side side) {
  Eigen::MatrixX3d result = points.cast<double>();
  if (side == Side::kLeft) result.col(0) *= -1;
  return result;
}

Specimen SpecimenOf(const SubjectRegistrations& r, std::size_t f, std::size_t subject) {
  const auto row = static_cast<Index>(f);
  Specimen s;
  s.subject = subject;
  s.motion = r.motion.at(static_cast<std::size_t>(r.sequence[f]));
  s.fine_m = Mirrored(r.fine_m[f], r.side);
  s.coarse_m = s.fine_m.topRows(r.NumVertices());
  s.seen = (r.sd_m.row(row).array() < kSeenSd_m).cast<double>().transpose();
  s.contact = r.contact.row(row).cast<double>().transpose();
  s.touches = s.contact.sum() > 0;
  if (!r.true_m.empty()) s.true_m = Mirrored(r.true_m[f], r.side);
  return s;
}

double MeanSurfaceDistance(const FootModel& model, const ModelParameters& parameters,
                           const Specimen& specimen) {
  const Variant variant = model.HasFine() ? Variant::kFine : Variant::kCoarse;
  const model::SurfaceQuery query(
      MeshOf(model, variant, Forward(model, parameters, variant).vertices_m));
  double sum = 0, count = 0;
  for (Index v = 0; v < specimen.coarse_m.rows(); ++v) {
    if (specimen.seen[v] == 0) continue;
    const auto hit = query.Closest(specimen.coarse_m.row(v).transpose(), kSurfaceReach_m);
    sum += hit ? hit->distance_m : kSurfaceReach_m;
    ++count;
  }
  return sum / count;
}

SpecimenScore ScoreSpecimen(const FootModel& model, const Specimen& specimen, int betas) {
  ModelParameters start = model::RigidStart(model, specimen.coarse_m, specimen.seen);
  if (betas >= 0) start.beta = Eigen::VectorXd::Zero(std::min<Index>(betas, model.NumBetas()));
  start.contact = specimen.contact;
  model::VertexFitOptions options{.sigma_m = kSigma_m, .theta_sd_rad = kThetaSd_rad, .weights = specimen.seen};
  const ModelParameters fit =
      FitVertices(model, Variant::kCoarse, specimen.coarse_m, start, options).parameters;
  const Eigen::MatrixX3d fitted = Forward(model, fit).vertices_m;
  const Eigen::ArrayXd distance = (fitted - specimen.coarse_m).rowwise().norm();
  const Eigen::ArrayXd seen = specimen.seen, touching = specimen.contact.array() * seen;
  SpecimenScore score{fit.theta, fit.beta};
  score.v2v_m = (distance * seen).sum() / seen.sum();
  score.square_m2 = (distance.square() * seen).sum() / seen.sum();
  score.touching_v2v_m = touching.sum() > 0 ? (distance * touching).sum() / touching.sum() : kNan;
  score.true_v2v_m = specimen.true_m.rows() > 0
                         ? (fitted - specimen.true_m).rowwise().norm().mean()
                         : kNan;
  score.surface_m = MeanSurfaceDistance(model, fit, specimen);
  return score;
}

}  // namespace

Specimens ReadSpecimens(const std::filesystem::path& dataset, const std::string& split,
                        int per_subject) {
  Specimens specimens;
  for (const std::filesystem::path& path : ListRegistrations(dataset)) {
    // The name tells the split; files of others are not opened.
    std::string name = path.stem().string();
    for (const char* side : {"-left", "-right"}) {
      if (name.ends_with(side)) name.resize(name.size() - std::string(side).size());
    }
    if (split != "all" && SplitOfSubject(name) != split) continue;
    const SubjectRegistrations r = ReadRegistrations(path);
    std::vector<std::size_t> good;
    for (std::size_t f = 0; f < r.NumFrames(); ++f) {
      if (r.verdict[f] == "good") good.push_back(f);
    }
    if (good.empty()) continue;
    if (specimens.subjects.empty() || specimens.subjects.back() != name)
      specimens.subjects.push_back(name);
    const std::size_t take = std::min(good.size(), static_cast<std::size_t>(per_subject));
    for (std::size_t i = 0; i < take; ++i)
      specimens.all.push_back(
          SpecimenOf(r, good[i * good.size() / take], specimens.subjects.size() - 1));
  }
  Require(!specimens.all.empty(),
          fmt::format("{} holds no good registration of the split '{}'", dataset.string(), split));
  return specimens;
}

std::vector<SpecimenScore> ScoreModel(const FootModel& model, const Specimens& specimens,
                                      int betas) {
  for (const Specimen& s : specimens.all)
    Require(s.coarse_m.rows() == model.NumVertices(),
            fmt::format("the dataset's registrations have {} vertices, the model {}",
                        s.coarse_m.rows(), model.NumVertices()));
  std::vector<SpecimenScore> scores(specimens.all.size());
  tbb::parallel_for(std::size_t{0}, scores.size(), [&](std::size_t i) {
    scores[i] = ScoreSpecimen(model, specimens.all[i], betas);
  });
  return scores;
}

Spread SpreadOf(const Specimens& specimens, const std::vector<double>& values) {
  std::vector<std::pair<double, int>> by_subject(specimens.subjects.size());
  double sum = 0, squares = 0;
  Spread spread;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (std::isnan(values[i])) continue;
    sum += values[i];
    squares += values[i] * values[i];
    ++spread.count;
    auto& [total, count] = by_subject[specimens.all[i].subject];
    total += values[i];
    ++count;
  }
  if (spread.count == 0) return {kNan, kNan, kNan, kNan, 0};
  spread.mean = sum / spread.count;
  spread.sd = std::sqrt(std::max(0.0, squares / spread.count - spread.mean * spread.mean));
  std::erase_if(by_subject, [](const auto& subject) { return subject.second == 0; });
  std::mt19937_64 random(1);
  std::vector<double> means(2000);
  for (double& mean : means) {
    double total = 0, count = 0;
    for (std::size_t k = 0; k < by_subject.size(); ++k) {
      const auto& drawn = by_subject[random() % by_subject.size()];
      total += drawn.first;
      count += drawn.second;
    }
    mean = total / count;
  }
  std::sort(means.begin(), means.end());
  spread.low = means[means.size() / 40];
  spread.high = means[means.size() - 1 - means.size() / 40];
  return spread;
}

ContactResponse MeasureContactResponse(const FootModel& model, const Specimens& specimens,
                                       const std::vector<SpecimenScore>& scores) {
  ContactResponse response;
  double offset = 0, with = 0, without = 0;
  long vertices = 0, steady = 0;
  for (std::size_t i = 0; i < specimens.all.size(); ++i) {
    const Specimen& s = specimens.all[i];
    if (!s.touches || model.network.empty()) continue;
    ++response.specimens;
    // Five steps of fading contact, in the rest pose of the foot.
    std::vector<Eigen::VectorXd> offsets;
    for (int step = 0; step <= 4; ++step)
      offsets.push_back(ContactOffsets(model, Variant::kCoarse, scores[i].theta, scores[i].beta,
                                       0.25 * step * s.contact));
    ModelParameters fitted{scores[i].theta, scores[i].beta, Eigen::Vector3d::Zero(), s.contact};
    FootModel bare = model;
    bare.network.clear();
    Eigen::MatrixX3d flat = Forward(model, fitted).vertices_m,
                     round = Forward(bare, fitted).vertices_m;
    // Both at the place of the fit: the translation that lays the full model on the specimen.
    const Eigen::RowVector3d shift =
        (s.seen.transpose() * (s.coarse_m - flat)) / s.seen.sum();
    for (Index v = 0; v < s.contact.size(); ++v) {
      if (s.contact[v] == 0 || s.seen[v] == 0) continue;
      ++vertices;
      offset += offsets[0].segment<3>(3 * v).norm();
      with += (s.coarse_m.row(v) - flat.row(v) - shift).norm();
      without += (s.coarse_m.row(v) - round.row(v) - shift).norm();
      const Eigen::Vector3d whole = offsets[4].segment<3>(3 * v) - offsets[0].segment<3>(3 * v);
      bool rises = true;
      for (std::size_t step = 0; step < 4; ++step)
        rises &= (offsets[step + 1] - offsets[step]).segment<3>(3 * v).dot(whole) >= 0;
      steady += rises;
    }
  }
  if (vertices == 0) return {kNan, kNan, kNan, response.specimens};
  const auto n = static_cast<double>(vertices);
  response.free_m = offset / n;
  response.share = 1 - with / without;
  response.monotonic = static_cast<double>(steady) / n;
  return response;
}

}  // namespace sole::app
