#include "app/tools/model_evaluation.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <mutex>

#include "app/tools/simulated_people.h"
#include "model/train_person.h"
#include "model/vertex_fit.h"

namespace sole::tools {
namespace {

constexpr std::uint64_t kFirstHeldOutSeed = 800;

struct Row {
  std::string name;
  std::vector<double> means_mm, largest_mm, betas;
};

void Fit(const model::FootModel& foot, const Eigen::MatrixX3d& target, Row& row) {
  const model::VertexFitResult fit =
      FitVertices(foot, model::Variant::kCoarse, target, model::RigidStart(foot, target));
  row.means_mm.push_back(1e3 * fit.mean_distance_m);
  row.largest_mm.push_back(1e3 * fit.max_distance_m);
}

double Mean(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value / static_cast<double>(values.size());
  return sum;
}

}  // namespace

std::vector<std::string> EvaluateOnHeldOutPeople(const model::FootModel& foot, int people) {
  std::vector<std::uint64_t> seeds;
  for (int p = 0; p < people; ++p)
    seeds.push_back(kFirstHeldOutSeed + static_cast<std::uint64_t>(p));
  const std::vector<Person> drawn =
      DrawPeople(seeds, foot.material, {.poses = 4, .pose_share = 0.7, .loads_n = {370, 740}});
  std::vector<Row> rows(4);
  rows[0].name = "at rest, in the air";
  rows[1].name = "random poses, in the air";
  rows[2].name = "standing, 370 N";
  rows[3].name = "standing, 740 N";
  for (const Person& person : drawn) {
    Fit(foot, person.rest_m, rows[0]);
    for (const Eigen::MatrixX3d& posed : person.posed_m) Fit(foot, posed, rows[1]);
    for (std::size_t l = 0; l < person.standing_m.size(); ++l) Fit(foot, person.standing_m[l], rows[2 + l]);
  }
  std::vector<std::string> lines;
  for (const Row& row : rows) {
    if (row.means_mm.empty()) continue;
    lines.push_back(fmt::format(
        "{:26} v2v mean {:.3f} mm (worst foot {:.3f}), largest vertex {:.2f} mm", row.name,
        Mean(row.means_mm), *std::max_element(row.means_mm.begin(), row.means_mm.end()),
        Mean(row.largest_mm)));
  }
  return lines;
}

}  // namespace sole::tools
