// Registration, fit and contact labels of whole motions against truth, on clouds without images
// (sim/scan_cloud.h): minutes instead of hours, so many people and motions can be tried.
// usage: bench_registration [--motion NAME,...] [--people N] [--seed S] [--frames F] [--rate HZ] [--down] [--missing SHARE] [--model FILE,...]
#include <fmt/format.h>

#include <sys/resource.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <cstdio>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "app/fit_labels.h"
#include "app/fit_sequences.h"
#include "app/stages.h"
#include "app/truth.h"
#include "contact/label.h"
#include "contact/temporal.h"
#include "core/error.h"
#include "model/fit.h"
#include "model/forward.h"
#include "sim/foot.h"
#include "sim/motion.h"
#include "sim/scan_cloud.h"
#include "sim/true_rig.h"

namespace sole::bench {
namespace {

struct Arguments {
  std::vector<std::string> motions{"stand", "rock", "walk", "run", "toes", "air", "jump"};
  int people = 2, frames = 10;
  double rate_hz = 10, any_heading = 0, missing = 0;
  std::uint64_t seed = 200;
  std::vector<std::string> models;
  bool down = false, verbose = false;
  std::string evidence;
};

/// One motion of one person: what the stages get, and what they should find.
struct Take {
  Side side = Side::kRight;
  std::vector<PointCloud> clouds;
  std::vector<std::int64_t> triggers;
  std::vector<TriangleMesh> truth;
};

/// Material points that touch, of a body in the plate's frame.
bool IsDown(const TriangleMesh& mesh, const app::ModelPair& models, Side side) {
  const std::vector<Eigen::Vector3d> places = app::MaterialPositions(side == Side::kRight ? models.right : models.left, mesh, side);
  return std::any_of(places.begin(), places.end(), [](const Eigen::Vector3d& p) { return p.z() < contact::kContactGap_m; });
}

/// `count` of `all`, the first and the last among them.
std::vector<std::size_t> Spread(const std::vector<std::size_t>& all, std::size_t count) {
  if (all.size() <= count) return all;
  std::vector<std::size_t> some;
  for (std::size_t k = 0; k < count; ++k) some.push_back(all[count > 1 ? k * (all.size() - 1) / (count - 1) : all.size() / 2]);
  return some;
}

/// Without the share of its points that lies furthest in a direction.
PointCloud WithoutPart(const PointCloud& cloud, const Eigen::Vector3f& direction, double share) {
  std::vector<float> along;
  for (const Eigen::Vector3f& p : cloud.points_m) along.push_back(p.dot(direction));
  std::vector<float> sorted = along;
  const auto end = static_cast<std::size_t>((1 - share) * static_cast<double>(cloud.Size()));
  if (end >= cloud.Size()) return cloud;
  std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(end), sorted.end());
  PointCloud rest;
  for (std::size_t i = 0; i < cloud.Size(); ++i) {
    if (along[i] >= sorted[end]) continue;
    rest.points_m.push_back(cloud.points_m[i]);
    if (!cloud.normals.empty()) rest.normals.push_back(cloud.normals[i]);
    if (!cloud.sigma_m.empty()) rest.sigma_m.push_back(cloud.sigma_m[i]);
  }
  return rest;
}

Take MakeTake(const std::string& name, std::uint64_t seed, const Arguments& a, const app::ModelPair& models) {
  const RigConfig config = MakeDefaultRig(20);
  const sim::Subject subject = sim::DrawSubject(seed);
  const sim::TrueRig rig = sim::DrawTrueRig(config, seed);
  std::vector<std::uint8_t> dark;
  for (const sim::FootMaterial m : sim::FootMaterials())
    dark.push_back(m == sim::FootMaterial::kCut ? 1 : 0);
  std::mt19937_64 random(seed);
  sim::MotionOptions options;
  options.motion = name;
  // A foot that comes down does so in the first second.
  constexpr double kDown_s = 1.2;
  options.frames = a.down ? std::max(a.frames, static_cast<int>(kDown_s * a.rate_hz)) : a.frames;
  options.rate_hz = a.rate_hz;
  options.seed = seed;
  options.mean_load = 0.25 + 0.75 * std::uniform_real_distribution<double>()(random);
  options.heading_rad = a.any_heading * std::uniform_real_distribution<double>(-M_PI, M_PI)(random);
  const sim::FootMotion motion = sim::MakeMotion(subject, options);
  std::normal_distribution<float> normal;
  std::mt19937_64 part_random(seed ^ 0x9e3779b97f4a7c15U);  // of its own: the same clouds with and without the part
  const float x = normal(part_random), y = normal(part_random), z = normal(part_random);
  const Eigen::Vector3f part = Eigen::Vector3f(x, y, z).normalized();
  Take take;
  take.side = subject.side;
  std::vector<std::size_t> chosen;
  for (std::size_t f = 0; f < motion.frames.size(); ++f) {
    if (!a.down || IsDown({motion.frames[f].foot.foot.vertices_m, motion.triangles}, models, take.side)) chosen.push_back(f);
  }
  for (const std::size_t f : Spread(chosen, static_cast<std::size_t>(a.frames))) {
    TriangleMesh mesh{motion.frames[f].foot.foot.vertices_m, motion.triangles};
    const std::vector<sim::ScanView> views = sim::FindScanViews(config, rig, mesh, dark);
    take.clouds.push_back(sim::MakeScanCloud(
        mesh, views, sim::DefaultScanNoise(),
        {.seed = random(), .sequence_seed = seed, .max_points = 30000}));
    if (a.missing > 0) take.clouds.back() = WithoutPart(take.clouds.back(), part, a.missing);
    take.triggers.push_back(static_cast<std::int64_t>(take.triggers.size()) + 1);
    take.truth.push_back(std::move(mesh));
  }
  return take;
}

/// Processor time of this process, all threads, user and system.
double ProcessorSeconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) { return double(t.tv_sec) + 1e-6 * double(t.tv_usec); };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

/// Sums over frames; lengths in mm.
struct Score {
  int takes = 0, frames = 0, found = 0, good = 0, wrong_side = 0;
  int good_but_far = 0;  ///< verdict good, registered points 3 mm from their places and more
  double registration = 0, worst_registration = 0, fit[2] = {0, 0}, residual = 0;
  double first_seconds = 0, later_seconds = 0;  ///< of processor: subject pass with a take's first frame, the others
  int fitted[2] = {0, 0};
  double vertex[2] = {0, 0};  ///< registered vertices' distances, free and touching ones
  long vertices[2] = {0, 0};
  long both = 0, said = 0, touching = 0, free_right = 0, free = 0;
};

/// Of labels by their probability: how many there are and how many truly touch.
struct Reliability {
  std::array<long, 10> count{}, touching{};
  void Add(double probability, bool touches) {
    const auto bin = static_cast<std::size_t>(std::clamp(10 * probability, 0.0, 9.0));
    ++count[bin];
    touching[bin] += touches;
  }
  std::string Cell(std::size_t b) const {
    return count[b] ? fmt::format("{:.2f} of {}", double(touching[b]) / double(count[b]), count[b]) : "-";
  }
};

/// Share that truly touches of the labels of every probability, a column a motion.
void PrintReliability(const std::string& model, const std::map<std::string, Reliability>& motions) {
  Reliability all;
  fmt::print("\n{}\n\n| probability said |", model);
  for (const auto& [name, r] : motions) {
    fmt::print(" {} |", name);
    for (std::size_t b = 0; b < r.count.size(); ++b) all.count[b] += r.count[b], all.touching[b] += r.touching[b];
  }
  fmt::print(" all |\n|---|---|");
  for (std::size_t k = 0; k < motions.size(); ++k) fmt::print("---|");
  for (std::size_t b = 0; b < all.count.size(); ++b) {
    fmt::print("\n| {:.1f} to {:.1f} |", 0.1 * double(b), 0.1 * double(b + 1));
    for (const auto& [name, r] : motions) fmt::print(" {} |", r.Cell(b));
    fmt::print(" {} |", all.Cell(b));
  }
  fmt::print("\n");
}

void Add(const Take& take, const FitSequence& fit, const app::ModelPair& models,
         const std::string& name, bool verbose, Score& score, Reliability& reliability) {
  ++score.takes;
  bool wrong = false;
  std::vector<FrameContact> contact =
      app::LabelFit(models, fit, take.clouds, std::vector<GroundPlane>(take.clouds.size()));
  contact::SmoothLabels(contact);
  for (std::size_t f = 0; f < fit.frames.size(); ++f) {
    const FrameFit& frame = fit.frames[f];
    ++score.frames;
    if (!frame.found) {
      if (verbose) fmt::print("  {} {}: {}\n", name, f + 1, frame.verdict);
      continue;
    }
    ++score.found;
    wrong |= frame.side != take.side;
    const model::FootModel& model = take.side == Side::kRight ? models.right : models.left;
    const std::vector<Eigen::Vector3d> places =
        app::MaterialPositions(model, take.truth[f], take.side);
    double registration = 0, fitted = 0;
    bool touches = false;
    const FrameContact& labels = contact[f];
    for (std::size_t v = 0; v < places.size(); ++v) {
      const auto row = static_cast<Eigen::Index>(v);
      registration += (frame.registration_m.row(row).transpose() - places[v]).norm();
      fitted += (frame.vertices_m.row(row).transpose() - places[v]).norm();
      const double gap = places[v].z();
      const bool is = gap < contact::kContactGap_m, label = labels.contact[v] != 0;
      score.vertex[is] += 1e3 * (frame.registration_m.row(row).transpose() - places[v]).norm();
      ++score.vertices[is];
      touches |= is;
      reliability.Add(labels.probability[row], is);
      if (gap < 0.00005 || gap > 0.00015) {
        score.both += is && label;
        score.said += label;
        score.touching += is;
      }
      if (gap > 0.00015 && gap < 0.003) {
        ++score.free;
        score.free_right += !label;
      }
    }
    const double scale = 1e3 / static_cast<double>(places.size());
    score.registration += scale * registration;
    score.worst_registration = std::max(score.worst_registration, scale * registration);
    score.fit[touches] += scale * fitted;
    ++score.fitted[touches];
    score.residual += 1e3 * frame.residual_m;
    score.good += frame.verdict == "good";
    score.good_but_far += frame.verdict == "good" && scale * registration > 3;
    if (verbose) {
      fmt::print("  {} {}: registration {:.2f} mm, fit {:.2f} mm, residual {:.3f} mm, {} points, {}\n", name,
                 f + 1, scale * registration, scale * fitted, 1e3 * frame.residual_m,
                 take.clouds[f].Size(), frame.verdict);
    }
  }
  score.wrong_side += wrong;
}

/// A line a vertex near the glass: what labels rest on and the true gap, for a regression of LabelOptions.
void WriteEvidence(const Take& take, const FitSequence& fit, const app::ModelPair& models, const std::string& label, std::FILE* file) {
  for (std::size_t f = 0; f < fit.frames.size(); ++f) {
    const FrameFit& frame = fit.frames[f];
    if (!frame.found || frame.side != take.side) continue;
    const model::FootModel& model = take.side == Side::kRight ? models.right : models.left;
    const Eigen::MatrixX3d undeformed = model::Forward(model, {frame.theta, fit.beta, frame.translation_m, {}}).vertices_m;
    const std::vector<contact::VertexEvidence> evidence =
        contact::GatherEvidence({frame.registration_m, frame.registration_sd_m, undeformed, take.clouds[f]}, GroundPlane{});
    const std::vector<Eigen::Vector3d> places = app::MaterialPositions(model, take.truth[f], take.side);
    for (std::size_t v = 0; v < places.size(); ++v) {
      const contact::VertexEvidence& e = evidence[v];
      if (e.gap_m > 0.01 && places[v].z() > 0.01) continue;
      fmt::print(file, "{},{},{},{:.4f},{:.4f},{:.6f},{:.6f},{:.6f},{:.6f}\n", label, f, v, e.share, e.gap, e.depth_m, e.sd_m, e.gap_m,
                 places[v].z());
    }
  }
}

void FitTake(const Take& take, const app::ModelPair& models, const std::string& name, bool verbose, Score& s,
             Reliability& reliability, std::FILE* evidence, const std::string& label) {
  model::FitOptions options;
  options.label_contact = [&](const Eigen::MatrixX3d& registered_m, const Eigen::VectorXd& sd_m,
                              const Eigen::MatrixX3d& undeformed_m, std::size_t f) {
    return contact::LabelContact({registered_m, sd_m, undeformed_m, take.clouds[f]}, GroundPlane{}).probability;
  };
  const double begin = ProcessorSeconds();
  double first = 0;
  FitSequence fit =
      model::FitFrames(models.right, models.left, take.clouds, take.triggers, options, [&](int done, int) {
        if (done == 1) first = ProcessorSeconds() - begin;
      });
  s.first_seconds += first;
  s.later_seconds += ProcessorSeconds() - begin - first;
  app::CurateFit(models, take.clouds, fit);
  Add(take, fit, models, name, verbose, s, reliability);
  if (evidence) WriteEvidence(take, fit, models, label, evidence);
}

void PrintScore(const std::string& name, const std::string& model, const Score& s) {
  const auto mean = [](double sum, int n) { return n ? fmt::format("{:.2f}", sum / n) : "-"; };
  fmt::print("| {} | {} | {} | {} | {} | {} | {} | {} | {}, {:.2f}, {:.2f}, {:.2f} | {}, {} | {:.3f} | {:.3f} | {:.3f} | {:.2f}, {:.2f} |\n",
             name, model, s.takes, s.frames, s.found, s.good, s.good_but_far, s.wrong_side,
             mean(s.registration, s.found), s.worst_registration,
             s.vertex[0] / double(std::max(s.vertices[0], 1L)), s.vertex[1] / double(std::max(s.vertices[1], 1L)),
             mean(s.fit[1], s.fitted[1]), mean(s.fit[0], s.fitted[0]), s.found ? s.residual / s.found : 0.0,
             s.said + s.touching ? 2.0 * double(s.both) / double(s.said + s.touching) : 1.0,
             s.free ? double(s.free_right) / double(s.free) : 1.0, s.first_seconds / std::max(1, s.takes),
             s.later_seconds / std::max(1, s.frames - s.takes));
  std::fflush(stdout);
}

int Run(const Arguments& a) {
  std::vector<std::filesystem::path> paths(a.models.begin(), a.models.end());
  if (paths.empty()) paths.push_back(app::DefaultModelPath());
  std::vector<app::ModelPair> models;
  for (const std::filesystem::path& path : paths) models.push_back(app::LoadModelPair(path));
  fmt::print(
      "| motion | model | takes | frames | found | good | good but off | wrong side | registration, mm: mean, worst, of free and touching "
      "vertices | fit, mm: contact, air | scan to surface, mm | contact F1 | near but free | CPU s: first frame, each further one |\n"
      "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n");
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> evidence(a.evidence.empty() ? nullptr : std::fopen(a.evidence.c_str(), "w"), std::fclose);
  Require(a.evidence.empty() || evidence, a.evidence + " cannot be written");
  if (evidence) fmt::print(evidence.get(), "model,motion,person,frame,vertex,share,gap,depth_m,sd_m,gap_m,true_gap_m\n");
  std::vector<std::map<std::string, Reliability>> reliability(models.size());
  for (const std::string& name : a.motions) {
    std::vector<Score> scores(models.size());
    for (int p = 0; p < a.people; ++p) {
      const Take take = MakeTake(name, a.seed + static_cast<std::uint64_t>(p), a, models.front());
      if (take.clouds.empty()) continue;
      for (std::size_t m = 0; m < models.size(); ++m)
        FitTake(take, models[m], name, a.verbose, scores[m], reliability[m][name], evidence.get(),
                fmt::format("{},{},{}", paths[m].stem().string(), name, a.seed + static_cast<std::uint64_t>(p)));
    }
    for (std::size_t m = 0; m < models.size(); ++m) PrintScore(name, paths[m].stem().string(), scores[m]);
  }
  for (std::size_t m = 0; m < models.size(); ++m) PrintReliability(paths[m].stem().string(), reliability[m]);
  return 0;
}

}  // namespace
}  // namespace sole::bench

int main(int argc, char** argv) {
  CLI::App program("Registration, fit and contact against truth, on clouds without images");
  sole::bench::Arguments a;
  program.add_option("--motion", a.motions, "Motions")->delimiter(',');
  program.add_option("--people", a.people, "Takes of each motion, each of another person");
  program.add_option("--frames", a.frames, "Frames of a take");
  program.add_option("--rate", a.rate_hz, "Frames a second");
  program.add_option("--turn", a.any_heading, "Share of a half turn that feet are turned by at most");
  program.add_option("--missing", a.missing, "Share of the points that every cloud lacks on one side, a direction drawn for each take")->check(CLI::Range(0.0, 0.9));
  program.add_option("--seed", a.seed, "First person")->capture_default_str();
  program.add_flag("--down", a.down, "Only frames in which the foot is down, at least in part, spread over the first 1.2 s");
  program.add_option("--model", a.models, "Model files instead of the shipped one; all fit the same clouds")->delimiter(',');
  program.add_option("--evidence", a.evidence, "CSV file of what labels rest on and the true gaps, a line a vertex");
  program.add_flag("--verbose", a.verbose, "A line a frame");
  CLI11_PARSE(program, argc, argv);
  try {
    return sole::bench::Run(a);
  } catch (const sole::Error& error) {
    fmt::print(stderr, "bench_registration: {}\n", error.what());
    return 1;
  }
}
