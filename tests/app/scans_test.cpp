// `sole sim scans`: what is in the dataset, and that it can be stopped, completed and made again.
#include "app/scans.h"

#include <fstream>
#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "app/console.h"
#include "io/atomic_file.h"
#include "io/npz.h"
#include "model/surface_query.h"
#include "sim/foot.h"
#include "tests/app/run_program.h"
#include "tests/support/error_matcher.h"
#include "tests/support/temp_dir.h"

namespace sole::app {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing_support::ErrorOf;
using testing_support::ProgramResult;
using testing_support::RunSole;
using testing_support::TempDir;

constexpr std::uint64_t kSeed = 31;

std::string PersonFile(std::uint64_t person) {
  return "people/0000" + std::to_string(person) + ".npz";
}

class Scans : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    directory = new TempDir;
    MakeScanDataset(*directory / "set", {.people = 2, .frames = 2, .seed = kSeed});
  }
  static void TearDownTestSuite() { delete directory; }
  static fs::path Set() { return *directory / "set"; }
  static std::string Bytes(const fs::path& set, std::uint64_t person) {
    return io::ReadFile(set / PersonFile(person));
  }
  static TempDir* directory;
};
TempDir* Scans::directory = nullptr;

TEST_F(Scans, CloudsLieOnTheTrueMeshAsTheParametersSay) {
  const io::Npz npz = io::ReadNpz(Set() / PersonFile(kSeed));
  const Side side = io::StringFrom(npz, "side") == "left" ? Side::kLeft : Side::kRight;
  const Eigen::MatrixXd vertices = io::MatrixFrom(npz, "vertices_m"),
                        points = io::MatrixFrom(npz, "points_m"),
                        contact = io::MatrixFrom(npz, "contact"),
                        load = io::MatrixFrom(npz, "load_n");
  const std::vector<int> start = io::IntsFrom(npz, "frame_start");
  ASSERT_EQ(start.size(), 3U);
  ASSERT_EQ(start.back(), points.rows());
  EXPECT_EQ(io::StringsFrom(npz, "motion").size(), 2U);
  EXPECT_EQ(io::IntsFrom(npz, "sequence"), (std::vector<int>{0, 1}));
  for (Eigen::Index f = 0; f < 2; ++f) {
    TriangleMesh mesh{{}, sim::FootTriangles(side)};
    int touching = 0;
    for (Eigen::Index v = 0; v < contact.cols(); ++v) {
      mesh.vertices.emplace_back(vertices(f, 3 * v), vertices(f, 3 * v + 1),
                                 vertices(f, 3 * v + 2));
      if (contact(f, v) != 0) {
        EXPECT_LT(mesh.vertices.back().z(), 1.01e-4);
      }
      touching += contact(f, v) != 0;
    }
    if (f == 1) {
      EXPECT_EQ(touching, 0) << "the second sequence is in the air";
      EXPECT_EQ(load(f, 0), 0);
    }
    const model::SurfaceQuery query(mesh);
    double squares = 0;
    int near = 0;
    const int count = start[static_cast<std::size_t>(f) + 1] - start[static_cast<std::size_t>(f)];
    EXPECT_GT(count, 20000);
    EXPECT_LE(count, 30000);
    for (int i = start[static_cast<std::size_t>(f)]; i < start[static_cast<std::size_t>(f) + 1];
         i += 5) {
      const auto hit = query.Closest(points.row(i).transpose(), 0.0005);
      if (!hit) continue;
      ++near;
      squares += hit->distance_m * hit->distance_m;
    }
    EXPECT_GT(near, 0.97 * count / 5);
    const double rms = std::sqrt(squares / near);
    const sim::ScanNoise& noise = sim::DefaultScanNoise();
    EXPECT_GT(rms, 0.5 * std::min(noise.air.sd_m[2], noise.glass.sd_m[2]));
    EXPECT_LT(rms, 2.5 * std::max(noise.air.sd_m[4], noise.glass.sd_m[4]));
  }
}

TEST_F(Scans, IndexTellsPeopleOnceAndHowTheyWereMade) {
  const auto index = nlohmann::json::parse(io::ReadFile(Set() / "dataset.json"));
  EXPECT_EQ(index.at("format"), "sole-scans");
  EXPECT_EQ(index.at("state"), "complete");
  EXPECT_EQ(index.at("seed"), kSeed);
  EXPECT_TRUE(index.at("noise").contains("glass"));
  std::map<std::uint64_t, int> times;
  for (const auto& [name, people] : index.at("split").items()) {
    for (const auto& person : people) {
      ++times[person.get<std::uint64_t>()];
      EXPECT_EQ(SplitOf(person.get<std::uint64_t>()), name);
    }
  }
  EXPECT_EQ(times, (std::map<std::uint64_t, int>{{kSeed, 1}, {kSeed + 1, 1}}));
  std::map<std::string, int> shares;
  for (std::uint64_t person = 1; person <= 10000; ++person) ++shares[SplitOf(person)];
  EXPECT_NEAR(shares["train"], 8000, 150);
  EXPECT_NEAR(shares["test"], 1000, 100);
  const io::Npz topology = io::ReadNpz(Set() / "topology.npz");
  EXPECT_EQ(io::ShapeOf(topology, "triangles")[0], sim::ReferenceFoot().triangles.size());
}

TEST_F(Scans, InterruptedOrEnlargedTheyAreTheSame) {
  const TempDir other;
  const fs::path set = other / "set";
  std::atomic<bool> stop{false};
  // Stopped after the first person.
  const ThreadCap one_thread(1);
  const ScanDatasetResult first = MakeScanDataset(
      set, {.people = 2, .frames = 2, .seed = kSeed, .stop = &stop}, [&](int) { stop = true; });
  EXPECT_TRUE(first.stopped);
  EXPECT_EQ(first.made, 1);
  EXPECT_EQ(nlohmann::json::parse(io::ReadFile(set / "dataset.json")).at("state"), "partial");
  std::size_t files = 0;
  for (const auto& entry : fs::directory_iterator(set / "people")) {
    EXPECT_EQ(entry.path().extension(), ".npz") << entry.path();
    ++files;
  }
  EXPECT_EQ(files, 1U);
  const ScanDatasetResult second = MakeScanDataset(set, {.people = 2, .frames = 2, .seed = kSeed});
  EXPECT_FALSE(second.stopped);
  EXPECT_EQ(second.made, 1);
  EXPECT_EQ(second.people, 2);
  for (const std::uint64_t person : {kSeed, kSeed + 1})
    EXPECT_TRUE(Bytes(set, person) == Bytes(Set(), person)) << "whatever the threads and the order";
  EXPECT_FALSE(Bytes(set, kSeed) == Bytes(set, kSeed + 1));
}

TEST_F(Scans, ADatasetOfOtherParametersIsLeftAlone) {
  const std::string before = io::ReadFile(Set() / "dataset.json");
  const auto error = [&](ScanDatasetOptions options) {
    return ErrorOf([&] { MakeScanDataset(Set(), options); });
  };
  EXPECT_THAT(error({.people = 2, .frames = 3, .seed = kSeed}), HasSubstr("another 'frames'"));
  EXPECT_THAT(error({.people = 2, .frames = 2, .seed = 5}), HasSubstr("another 'seed'"));
  ScanDatasetOptions louder{.people = 2, .frames = 2, .seed = kSeed};
  louder.noise.air.sd_m[0] *= 2;
  EXPECT_THAT(error(louder), HasSubstr("another 'noise'"));
  EXPECT_THAT(error({.people = 1, .frames = 2, .seed = kSeed}), HasSubstr("2 people already"));
  EXPECT_EQ(io::ReadFile(Set() / "dataset.json"), before);
  const TempDir other;
  std::ofstream(other / "thesis.txt") << "mine";
  EXPECT_THAT(ErrorOf([&] { MakeScanDataset(other.Path(), {.people = 1, .frames = 1}); }),
              HasSubstr("in the way"));
}

TEST_F(Scans, ProgramRefusesBadOptionsAndTellsWhatItMade) {
  const TempDir other;
  const std::string out = " --out " + (other / "set").string();
  EXPECT_EQ(RunSole("sim scans --people 0 --frames 1" + out).status, 2);
  EXPECT_EQ(RunSole("sim scans --people 1 --frames 0" + out).status, 2);
  EXPECT_EQ(RunSole("sim scans --people 1 --frames 1").status, 2);
  std::ofstream(other / "bad.json") << "{}";
  const ProgramResult bad = RunSole("sim scans --people 1 --frames 1 --parameters " +
                                    (other / "bad.json").string() + out);
  EXPECT_EQ(bad.status, 1);
  EXPECT_EQ(bad.ErrorLines(), 1) << bad.output;
  EXPECT_THAT(bad.output, HasSubstr("bad.json"));
  EXPECT_FALSE(fs::exists(other / "set"));
  const ProgramResult again =
      RunSole("sim scans --people 2 --frames 2 --seed 31 --out " + Set().string());
  EXPECT_EQ(again.status, 0) << again.output;
  EXPECT_THAT(again.output, HasSubstr("2 people, 0 of them made now"));
}

}  // namespace
}  // namespace sole::app
