// Measures how reconstructed scans of simulated takes differ from the truth, in the classes that
// sim/scan_noise.h tells, and writes the parameter file of `sole sim scans`. Usage:
//   bench_scan_noise --out sim/data/scan_noise.json TAKE...
// TAKE is a processed simulated take (OUT/take of `sole demo`). A table goes to stdout.
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "app/truth.h"
#include "bench/accuracy/error_covariance.h"
#include "bench/accuracy/scan_samples.h"
#include "core/error.h"
#include "io/atomic_file.h"
#include "io/mesh_file.h"
#include "io/take.h"
#include "model/surface_query.h"
#include "sim/scan_cloud.h"

namespace {

using namespace sole;
using bench::Place;
using bench::Sample;
using bench::Samples;
using sim::ScanView;

struct Moments {
  double weight = 0, sum = 0, squares = 0;
  void Add(double x) { weight += 1, sum += x, squares += x * x; }
  double Mean() const { return weight > 0 ? sum / weight : 0; }
  double Rms() const { return weight > 0 ? std::sqrt(squares / weight) : 0; }
};

/// Classes that few samples fall into take the value of the nearest class that has enough.
template <std::size_t N>
void FillGaps(std::array<double, N>& values, const std::array<double, N>& counts) {
  constexpr double kEnough = 50;
  const std::array<double, N> measured = values;
  for (std::size_t i = 0; i < N; ++i) {
    std::size_t best = N;
    for (std::size_t j = 0; j < N; ++j) {
      const auto distance = [&](std::size_t k) { return k > i ? k - i : i - k; };
      if (counts[j] >= kEnough && (best == N || distance(j) < distance(best))) best = j;
    }
    if (best < N) values[i] = measured[best];
  }
}

/// RMS of x over samples of a class, per class.
template <std::size_t N, typename Class, typename Value>
std::array<double, N> RmsBy(const std::vector<Sample*>& samples, const Class& class_of,
                            const Value& value_of) {
  std::array<Moments, N> moments;
  for (const Sample* s : samples) {
    if (!s->outlier) moments[class_of(s->view)].Add(value_of(*s));
  }
  std::array<double, N> rms{}, counts{};
  for (std::size_t i = 0; i < N; ++i) rms[i] = moments[i].Rms(), counts[i] = moments[i].weight;
  FillGaps(rms, counts);
  return rms;
}

/// Mean of x over samples of a class, per class.
template <typename Value>
std::array<double, sim::kIncidenceBins> MeanByIncidence(const std::vector<Sample*>& samples,
                                                        const Value& value_of) {
  std::array<Moments, sim::kIncidenceBins> moments;
  for (const Sample* s : samples) {
    if (!s->outlier) moments[sim::IncidenceBin(s->view)].Add(value_of(*s));
  }
  std::array<double, sim::kIncidenceBins> mean{}, counts{};
  for (std::size_t i = 0; i < mean.size(); ++i)
    mean[i] = moments[i].Mean(), counts[i] = moments[i].weight;
  FillGaps(mean, counts);
  return mean;
}

/// Bias, SDs and outliers of one side, in turn until they agree.
void MeasureErrors(const std::vector<Sample*>& samples, sim::SideNoise& side) {
  constexpr double kOutlier = 5;  // standard deviations
  side.sd_of_edge.fill(1);
  side.sd_of_pairs.fill(1);
  for (Sample* s : samples) s->outlier = std::abs(s->error_m) > 0.5e-3;
  for (int round = 0; round < 8; ++round) {
    side.mean_m = MeanByIncidence(samples, [](const Sample& s) { return s.error_m; });
    std::map<std::pair<int, int>, Moments> offsets;  // of a take and pair
    const auto unbiased = [&](const Sample& s) {
      return s.error_m - side.mean_m[sim::IncidenceBin(s.view)];
    };
    for (const Sample* s : samples) {
      if (!s->outlier) offsets[{s->take, s->view.pair}].Add(unbiased(*s));
    }
    Moments offset;
    for (const auto& [key, m] : offsets) {
      if (m.weight >= 500) offset.Add(m.Mean());
    }
    side.pair_bias_m = offset.Rms();
    const auto rest = [&](const Sample& s) {
      return unbiased(s) - offsets[{s.take, s.view.pair}].Mean();
    };
    const auto edge = [&](const Sample& s) { return side.sd_of_edge[sim::EdgeBin(s.view)]; };
    const auto pairs = [&](const Sample& s) { return side.sd_of_pairs[sim::PairBin(s.view)]; };
    const auto sd = [&](const Sample& s) { return side.sd_m[sim::IncidenceBin(s.view)]; };
    side.sd_m = RmsBy<sim::kIncidenceBins>(samples, sim::IncidenceBin, [&](const Sample& s) {
      return rest(s) / (edge(s) * pairs(s));
    });
    side.sd_of_edge = RmsBy<sim::kEdgeBins>(
        samples, sim::EdgeBin, [&](const Sample& s) { return rest(s) / (sd(s) * pairs(s)); });
    side.sd_of_pairs = RmsBy<sim::kPairBins>(
        samples, sim::PairBin, [&](const Sample& s) { return rest(s) / (sd(s) * edge(s)); });
    for (Sample* s : samples) {
      s->scaled = rest(*s) / (sd(*s) * edge(*s) * pairs(*s));
      s->outlier = std::abs(s->scaled) > kOutlier;
    }
  }
  std::array<Moments, sim::kEdgeBins> outliers;
  Moments far;
  for (const Sample* s : samples) {
    outliers[sim::EdgeBin(s->view)].Add(s->outlier);
    if (s->outlier) far.Add(std::abs(s->error_m));
  }
  for (std::size_t i = 0; i < outliers.size(); ++i) side.outlier_share[i] = outliers[i].Mean();
  side.outlier_m = far.Mean();
}

/// Points per place where everything is well seen: reconstruction has tried more of each cell.
double MeasureDensity(const Samples& all) {
  const auto good = [](const ScanView& view) {
    return sim::EdgeBin(view) + 1 == sim::kEdgeBins && sim::IncidenceBin(view) < 4;
  };
  double points = 0, places = 0;
  for (const Sample& s : all.points) points += good(s.view);
  for (const Place& p : all.places) places += good(p.view);
  Require(places > 0, "no part of the surface is well seen");
  return points / places;
}

void MeasureCompleteness(const Samples& all, bool glass, double density, sim::SideNoise& side) {
  std::array<std::array<double, sim::kEdgeBins>, sim::kIncidenceBins> found{}, wanted{};
  for (const Sample& s : all.points) {
    if (s.view.through_glass == glass) ++found[sim::IncidenceBin(s.view)][sim::EdgeBin(s.view)];
  }
  for (const Place& p : all.places) {
    if (p.view.through_glass == glass)
      wanted[sim::IncidenceBin(p.view)][sim::EdgeBin(p.view)] += density;
  }
  for (std::size_t i = 0; i < found.size(); ++i) {
    for (std::size_t e = 0; e < found[i].size(); ++e)
      side.completeness[i][e] = wanted[i][e] > 0 ? std::min(1.0, found[i][e] / wanted[i][e]) : 0;
  }
  for (std::size_t e = 0; e < sim::kEdgeBins;
       ++e) {  // Classes that hardly occur: as the next steeper.
    std::array<double, sim::kIncidenceBins> column{}, counts{};
    for (std::size_t i = 0; i < column.size(); ++i)
      column[i] = side.completeness[i][e], counts[i] = wanted[i][e];
    FillGaps(column, counts);
    for (std::size_t i = 0; i < column.size(); ++i) side.completeness[i][e] = column[i];
  }
}

sim::SideNoise MeasureSide(Samples& all, bool glass, double density) {
  std::vector<Sample*> samples;
  for (Sample& s : all.points) {
    if (s.view.through_glass == glass) samples.push_back(&s);
  }
  Require(samples.size() > 1000, "too few points to measure noise on one side of the glass");
  sim::SideNoise side;
  MeasureErrors(samples, side);
  side.stated_sigma_m = MeanByIncidence(samples, [](const Sample& s) { return s.sigma_m; });
  side.normal_rad = RmsBy<sim::kIncidenceBins>(samples, sim::IncidenceBin, [](const Sample& s) {
    return std::min(s.normal_off_rad, 0.5) / std::sqrt(2.0);
  });
  std::vector<bench::FieldSample> field;
  for (const Sample* s : samples) {
    if (!s->outlier) field.push_back({s->frame, s->point_m, s->scaled});
  }
  side.components = bench::FitComponents(bench::MeasureCovariance(field));
  MeasureCompleteness(all, glass, density, side);
  return side;
}

/// Distance at which the covariance of gaps has fallen to exp(-1/2).
double MeasureHoleLength(const Samples& all, const sim::ScanNoise& noise) {
  std::vector<bench::FieldSample> field;
  for (const Place& p : all.places) {
    const double share =
        noise.Side(p.view).completeness[sim::IncidenceBin(p.view)][sim::EdgeBin(p.view)];
    field.push_back({p.frame, p.point_m, (p.there ? 1.0 : 0.0) - share});
  }
  return bench::FallLength(bench::MeasureCovariance(field));
}

/// RMS of the points within 1 mm of the surface, and how many points there are.
struct CloudFigures {
  Moments near;
  double points = 0;
  void Add(const TriangleMesh& truth, const PointCloud& cloud) {
    const model::SurfaceQuery query(truth);
    for (const Eigen::Vector3f& p : cloud.points_m) {
      if (const auto hit = query.Closest(p.cast<double>(), 0.001)) near.Add(hit->distance_m);
    }
    points += static_cast<double>(cloud.Size());
  }
};

/// Reconstructed clouds next to clouds made with the parameters, of the same true surfaces.
void Compare(const std::vector<std::string>& takes, const sim::ScanNoise& noise) {
  CloudFigures real, made;
  const std::vector<std::uint8_t> dark = bench::CutVertices();
  for (const std::string& directory : takes) {
    const io::TakePaths paths{directory};
    const RigConfig config = io::TakeReader(directory).Config();
    const sim::TrueRig rig = bench::ReadTrueRig(paths.TruthRig());
    for (const app::FrameTruth& frame : app::ReadTruth(directory).frames) {
      if (!std::filesystem::exists(paths.Scan(frame.trigger))) continue;
      real.Add(frame.mesh, io::ReadPlyCloud(paths.Scan(frame.trigger)));
      const auto views = sim::FindScanViews(config, rig, frame.mesh, dark);
      made.Add(frame.mesh, sim::MakeScanCloud(frame.mesh, views, noise));
    }
  }
  fmt::print(
      "surface RMS within 1 mm: reconstructed {:.1f} um, made {:.1f} um; points: {:.0f}, {:.0f}\n",
      1e6 * real.near.Rms(), 1e6 * made.near.Rms(), real.points, made.points);
}

void Print(const char* name, const sim::SideNoise& side) {
  fmt::print("{}: pair offsets {:.1f} um, outliers {:.3f} mm off\n", name, 1e6 * side.pair_bias_m,
             1e3 * side.outlier_m);
  for (std::size_t i = 0; i < sim::kIncidenceBins; ++i) {
    fmt::print(
        "  {:2}-{:2} deg: sd {:5.1f} um, mean {:+5.1f} um, stated {:5.1f} um, normals {:.3f} rad, "
        "completeness {:.3f}\n",
        10 * i, 10 * i + 10, 1e6 * side.sd_m[i], 1e6 * side.mean_m[i], 1e6 * side.stated_sigma_m[i],
        side.normal_rad[i], fmt::join(side.completeness[i], " "));
  }
  fmt::print("  by edge {:.2f}, by pairs {:.2f}, outliers by edge {:.5f}\n",
             fmt::join(side.sd_of_edge, " "), fmt::join(side.sd_of_pairs, " "),
             fmt::join(side.outlier_share, " "));
  for (const sim::NoiseComponent& c : side.components)
    fmt::print("  {:.0f} % of the variance over {:.1f} mm\n", 100 * c.share, 1e3 * c.length_m);
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<std::string> takes;
  std::string out, note;
  CLI::App program("Measures the noise of reconstructed scans against the truth");
  program.add_option("TAKE", takes, "Processed simulated takes")->required();
  program.add_option("--out", out, "Parameter file to write");
  program.add_option("--note", note, "What the takes are, for people");
  CLI11_PARSE(program, argc, argv);
  try {
    sim::ScanNoise noise;
    Samples all;
    for (std::size_t i = 0; i < takes.size(); ++i)
      all = bench::ReadTake(takes[i], noise.voxel_m, static_cast<int>(i), std::move(all));
    const double density = MeasureDensity(all);
    noise.glass = MeasureSide(all, true, density);
    noise.air = MeasureSide(all, false, density);
    noise.hole_length_m = MeasureHoleLength(all, noise);
    noise.voxel_m /= std::sqrt(density);
    noise.measured_on = fmt::format("{} points of {} takes{}{}", all.points.size(), takes.size(),
                                    note.empty() ? "" : ": ", note);
    fmt::print(
        "{} points, {} of them where no pair sees the surface; gaps over {:.1f} mm, "
        "cells of {:.2f} mm\n",
        all.points.size(), all.unseen, 1e3 * noise.hole_length_m, 1e3 * noise.voxel_m);
    Print("glass", noise.glass);
    Print("air", noise.air);
    Compare(takes, noise);
    if (!out.empty()) io::WriteStringAtomically(out, sim::FormatScanNoise(noise));
    return 0;
  } catch (const std::exception& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 1;
  }
}
