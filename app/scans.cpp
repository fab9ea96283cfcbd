#include "app/scans.h"

#include <cstring>
#include <mutex>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "app/console.h"
#include "app/scan_person.h"
#include "core/error.h"
#include "core/rig_config.h"
#include "io/atomic_file.h"
#include "io/npz.h"
#include "sim/foot.h"

namespace sole::app {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr int kCameras = 20;

fs::path PersonFile(const fs::path& directory, std::uint64_t person) {
  return directory / "people" / fmt::format("{:06}.npz", person);
}

/// What must be equal for a dataset to be completed.
Json Identity(const ScanDatasetOptions& options) {
  return {{"format", "sole-scans"},
          {"format_version", 1},
          {"software", Version()},
          {"seed", options.seed},
          {"frames", options.frames},
          {"population", options.population == sim::Population::kSurvey ? "survey" : "other"},
          {"noise", Json::parse(sim::FormatScanNoise(options.noise))}};
}

Json Index(const ScanDatasetOptions& options, const RigConfig& config, bool complete) {
  Json index = Identity(options);
  index["units"] =
      "metres, seconds, newtons, radians, kg; drawn_NAME in mm; world frame: z = 0 is the "
      "glass top, z up, toes towards +y";
  index["state"] = complete ? "complete" : "partial";
  index["people"] = options.people;
  index["rig"] = fmt::format("default rig of {} cameras, drawn anew for every person", kCameras);
  for (const PairConfig& pair : config.pairs) index["pairs"].push_back(pair.name);
  const sim::Subject mean = sim::MeanSubject();
  for (const sim::JointAxis& axis : sim::JointAxes(mean)) index["axes"].push_back(axis.name);
  for (const sim::BoneInfo& bone : sim::Bones(mean)) index["bones"].push_back(bone.name);
  Json split = {{"train", Json::array()}, {"validation", Json::array()}, {"test", Json::array()}};
  for (int i = 0; i < options.people; ++i) {
    const std::uint64_t person = options.seed + static_cast<std::uint64_t>(i);
    split[SplitOf(person)].push_back(person);
  }
  index["split"] = split;
  return index;
}

/// Throws Error unless the directory is new, empty or holds a dataset that these options complete.
void CheckPlace(const fs::path& directory, const ScanDatasetOptions& options) {
  const fs::path path = directory / "dataset.json";
  if (!fs::exists(path)) {
    Require(!fs::exists(directory) || (fs::is_directory(directory) && fs::is_empty(directory)),
            directory.string() + " is in the way and is no scan dataset: choose another --out");
    return;
  }
  const Json earlier = Json::parse(io::ReadFile(path), nullptr, false);
  Require(
      earlier.is_object() && earlier.contains("people") && earlier["people"].is_number_integer(),
      path.string() + " is damaged: remove the dataset or choose another --out");
  const Json identity = Identity(options);
  for (const auto& [key, value] : identity.items()) {
    Require(
        earlier.contains(key) && earlier[key] == value,
        fmt::format("{} was made with another '{}': choose another --out, or the same seed, frames "
                    "and parameters to complete it",
                    path.string(), key));
  }
  Require(earlier["people"].get<int>() <= options.people,
          fmt::format("{} has {} people already: ask for as many or more", path.string(),
                      earlier["people"].get<int>()));
}

/// Connectivity and the mean foot, the same for all people.
void WriteTopology(const fs::path& path) {
  const TriangleMesh& foot = sim::ReferenceFoot();
  Eigen::MatrixXi triangles(static_cast<Eigen::Index>(foot.triangles.size()), 3);
  for (std::size_t i = 0; i < foot.triangles.size(); ++i)
    triangles.row(static_cast<Eigen::Index>(i)) = foot.triangles[i].transpose();
  Eigen::MatrixXd vertices(static_cast<Eigen::Index>(foot.vertices.size()), 3);
  for (std::size_t i = 0; i < foot.vertices.size(); ++i)
    vertices.row(static_cast<Eigen::Index>(i)) = foot.vertices[i].transpose();
  std::vector<std::uint8_t> material;
  for (const sim::FootMaterial m : sim::FootMaterials())
    material.push_back(static_cast<std::uint8_t>(m));
  io::Npz npz;
  npz["triangles"] = io::NpyFrom(triangles);
  npz["mean_m"] = io::NpyFrom(vertices);
  npz["material"] = io::NpyFrom(material);
  io::WriteNpz(path, npz);
}

}  // namespace

const char* SplitOf(std::uint64_t person) {
  std::uint64_t x = person + 0x9E3779B97F4A7C15ULL;
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9ULL;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBULL;
  const std::uint64_t tenth = (x ^ (x >> 31)) % 10;
  return tenth == 0 ? "test" : tenth == 1 ? "validation" : "train";
}

ScanDatasetResult MakeScanDataset(const fs::path& directory, const ScanDatasetOptions& options,
                                  const std::function<void(int)>& done) {
  Require(options.people > 0 && options.frames > 0 && options.points >= 0,
          "scans: people and frames must be positive, points not negative");
  CheckPlace(directory, options);
  const RigConfig config = MakeDefaultRig(kCameras);
  io::MakeDirectory(directory / "people");
  const auto write_index = [&](bool complete) {
    io::WriteStringAtomically(directory / "dataset.json",
                              Index(options, config, complete).dump(1) + "\n");
  };
  write_index(false);
  WriteTopology(directory / "topology.npz");
  ScanDatasetResult result;
  std::mutex mutex;
  sim::MeanSubject();  // What all people share is computed once, before the threads begin.
  tbb::parallel_for(
      tbb::blocked_range<int>(0, options.people, 1),
      [&](const tbb::blocked_range<int>& range) {
        for (int i = range.begin(); i < range.end(); ++i) {
          const std::uint64_t person = options.seed + static_cast<std::uint64_t>(i);
          const fs::path path = PersonFile(directory, person);
          std::int64_t points = 0;
          const bool there = fs::exists(path);
          if (!there) {
            const auto scans = MakePersonScans(
                person, config, options.noise,
                {.frames = options.frames,
                 .points = options.points,
                 .population = options.population,
                 .stop = options.stop});
            if (!scans) return;
            io::WriteNpz(path, scans->arrays);
            points = scans->points;
          }
          const std::lock_guard<std::mutex> lock(mutex);
          ++result.people;
          if (!there) {
            ++result.made;
            result.scans += options.frames;
            result.points += points;
          }
          if (done) done(result.people);
        }
      },
      tbb::simple_partitioner());
  result.stopped = result.people < options.people;
  if (!result.stopped) write_index(true);
  return result;
}

}  // namespace sole::app
