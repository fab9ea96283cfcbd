// Damages valid files at random (seeded): every reader must end in an Error or a valid object,
// never crash and never ask for much more memory than the file could fill.
#include <sys/resource.h>

#include <functional>
#include <random>

#include <gtest/gtest.h>

#include "core/error.h"
#include "io/atomic_file.h"
#include "io/calibration_file.h"
#include "io/image_file.h"
#include "io/mesh_file.h"
#include "io/npz.h"
#include "io/raw_file.h"
#include "io/rig_file.h"
#include "io/scan_file.h"
#include "io/take.h"
#include "tests/support/temp_dir.h"

namespace sole::io {
namespace {

namespace fs = std::filesystem;
using testing_support::TempDir;

long PeakMemoryKib() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  return usage.ru_maxrss;
}

/// One to eight random byte changes, and sometimes a cut, an insertion or a doubled piece.
std::string Damaged(std::string bytes, std::mt19937_64& random) {
  const auto below = [&](std::size_t n) { return static_cast<std::size_t>(random() % n); };
  const std::size_t changes = 1 + below(8);
  static const std::string interesting("\x00\xff\x7f\x80 0-9.\"[", 12);
  for (std::size_t i = 0; i < changes && !bytes.empty(); ++i) {
    char& byte = bytes[below(bytes.size())];
    switch (below(3)) {
      case 0:
        byte = static_cast<char>(byte ^ (1 << below(8)));
        break;
      case 1:
        byte = static_cast<char>(random() & 0xff);
        break;
      default:
        byte = interesting[below(interesting.size())];
    }
  }
  if (bytes.empty()) return bytes;
  switch (below(8)) {
    case 0:
      bytes.resize(below(bytes.size()));
      break;
    case 1:
      bytes.insert(below(bytes.size()), 1 + below(9), static_cast<char>(random() & 0xff));
      break;
    case 2:
      bytes += bytes.substr(below(bytes.size()));
      break;
    default:
      break;
  }
  return bytes;
}

/// Writes damaged copies of `valid` under the name of `path` and reads them, after the whole one, which
/// must be accepted; returns how many of the damaged were.
int Fuzz(const fs::path& path, const std::string& valid, int rounds,
         const std::function<void()>& read) {
  std::mt19937_64 random(7);
  WriteStringAtomically(path, valid);
  EXPECT_NO_THROW(read());
  int accepted = 0;
  const long before = PeakMemoryKib();
  for (int round = 0; round < rounds; ++round) {
    WriteStringAtomically(path, Damaged(valid, random));
    try {
      read();
      ++accepted;
    } catch (const Error& error) {
      const std::string what = error.what();
      EXPECT_NE(what.find(path.filename().string()), std::string::npos)
          << "names no path: " << what;
      EXPECT_EQ(what.find('\n'), std::string::npos) << "more than one line: " << what;
    } catch (const std::exception& error) {
      ADD_FAILURE() << "round " << round << ": not a sole::Error: " << error.what();
    }
  }
  EXPECT_LT(PeakMemoryKib() - before, 512 * 1024)
      << "a damaged file of " << valid.size() << " bytes";
  return accepted;
}

Eigen::MatrixXd SomeMatrix() { return Eigen::MatrixXd::Random(6, 5); }

TEST(Fuzz, Npy) {
  const TempDir dir;
  const fs::path path = dir / "a.npy";
  WriteNpy(path, Reshaped(NpyFrom(SomeMatrix()), {2, 3, 5}));
  Fuzz(path, ReadFile(path), 1000, [&] {
    const NpyArray array = ReadNpy(path);
    if (array.dtype[1] != 'U') MatrixFrom({{"a", array}}, "a");
  });
}

TEST(Fuzz, Npz) {
  const TempDir dir;
  const fs::path path = dir / "a.npz";
  WriteNpz(path, {{"a", NpyFrom(SomeMatrix())},
                  {"zeros", NpyFrom(std::vector<int>(500, 0))},
                  {"text", NpyFrom(std::string("x"))}});
  Fuzz(path, ReadFile(path), 400, [&] { ReadNpz(path); });
}

TEST(Fuzz, FitAndContact) {
  const TempDir dir;
  FitSequence fit;
  fit.beta = fit.beta_sd = Eigen::VectorXd::Random(3);
  fit.frames.resize(2);
  for (FrameFit& frame : fit.frames) {
    frame.found = true;
    frame.theta = frame.vertices_m = Eigen::MatrixX3d::Random(2, 3);
  }
  const fs::path path = dir / "fit.npz";
  WriteFit(path, fit);
  Npz npz = ReadNpz(path);
  std::mt19937_64 random(11);
  // Damage below the checksum: shapes, types and values of the arrays themselves.
  for (int round = 0; round < 500; ++round) {
    Npz damaged = npz;
    auto victim =
        std::next(damaged.begin(), static_cast<std::ptrdiff_t>(random() % damaged.size()));
    switch (random() % 4) {
      case 0:
        damaged.erase(victim);
        break;
      case 1:
        victim->second = NpyFrom(std::vector<double>{1, 2});
        break;
      case 2:
        victim->second = NpyFrom(std::string("left"));
        break;
      default:
        victim->second.shape.push_back(1);
        break;
    }
    WriteNpz(path, damaged);
    try {
      const FitSequence read = ReadFit(path);
      for (const FrameFit& frame : read.frames) EXPECT_EQ(frame.theta.cols(), 3);
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find("fit.npz"), std::string::npos) << error.what();
    }
  }
}

TEST(Fuzz, Ply) {
  const TempDir dir;
  const fs::path path = dir / "a.ply";
  WritePly(path, TriangleMesh{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}, {0, 2, 1}}});
  Fuzz(path, ReadFile(path), 1000, [&] {
    const TriangleMesh mesh = ReadPlyMesh(path);
    for (const Eigen::Vector3i& t : mesh.triangles)
      EXPECT_LT(t.maxCoeff(), static_cast<int>(mesh.vertices.size()));
  });
  PointCloud cloud;
  cloud.points_m.resize(5, Eigen::Vector3f::Ones());
  cloud.normals = cloud.points_m;
  cloud.pair.resize(5, 1);
  WritePly(path, cloud);
  Fuzz(path, ReadFile(path), 1000, [&] {
    const PointCloud read = ReadPlyCloud(path);
    EXPECT_TRUE(read.normals.empty() || read.normals.size() == read.Size());
  });
}

TEST(Fuzz, ScanFiles) {
  const TempDir dir;
  const TriangleMesh mesh{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}, {0, 2, 1}}};
  WritePly(dir / "a.ply", mesh);
  WriteObj(dir / "a.obj", mesh);
  WriteStl(dir / "a.stl", mesh);
  WriteStringAtomically(dir / "text.stl",
                        "solid\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendsolid\n");
  for (const char* name : {"a.ply", "a.obj", "a.stl", "text.stl"}) {
    Fuzz(dir / name, ReadFile(dir / name), 1000, [&] {
      const ScanFile scan = ReadScanFile(dir / name);
      EXPECT_FALSE(scan.mesh.vertices.empty());
      for (const Eigen::Vector3i& t : scan.mesh.triangles) {
        EXPECT_GE(t.minCoeff(), 0);
        EXPECT_LT(t.maxCoeff(), static_cast<int>(scan.mesh.vertices.size()));
      }
    });
  }
}

TEST(Fuzz, Raw) {
  const TempDir dir;
  const fs::path path = dir / "a.raw";
  const std::vector<std::uint8_t> pixels(12 * 10, 9);
  {
    RawFileWriter writer(path, "A");
    for (int t = 1; t <= 4; ++t)
      writer.Append({.trigger = t, .width = 12, .height = 10}, pixels.data());
    writer.Close();
  }
  Fuzz(path, ReadFile(path), 1000, [&] {
    const RawIndex index = ReadRawIndex(path);
    for (const RawRecord& record : index.records)
      EXPECT_EQ(ReadRawImage(path, record).pixels, pixels);
  });
}

TEST(Fuzz, RigFile) {
  const TempDir dir;
  const fs::path path = dir / "rig.toml";
  const std::string valid = FormatRig(MakeDefaultRig(4));
  Fuzz(path, valid, 800, [&] { Validate(ReadRigFile(path)); });
}

TEST(Fuzz, Calibration) {
  const TempDir dir;
  const fs::path path = dir / "cal.json";
  Calibration calibration;
  for (int i = 0; i < 2; ++i) {
    calibration.rig.cameras.push_back({"A", 100, 100, Intrinsics::Ones(), {}});
  }
  calibration.rig.pairs = {{"p", 0, 1}};
  WriteCalibration(path, calibration);
  const int accepted = Fuzz(path, ReadFile(path), 800, [&] { ReadCalibration(path); });
  EXPECT_GT(accepted, 0);
}

TEST(Fuzz, TakeInfoAndTables) {
  const TempDir dir;
  const TakePaths take{dir.Path()};
  WriteTakeInfo(take, {});
  Fuzz(take.Info(), ReadFile(take.Info()), 400, [&] { ReadTakeInfo(take); });
  WriteTriggers(
      take, {{1, ExposureKind::kSpeckle, 0, 0, 0, 0.1}, {2, ExposureKind::kTexture, 1, 1, 1, 1.1}});
  Fuzz(take.Triggers(), ReadFile(take.Triggers()), 400, [&] { ReadTriggers(take); });
  WriteMeasurements(take.Measurements(), {{1, "a,b", 2, "m", 3, 1}});
  Fuzz(take.Measurements(), ReadFile(take.Measurements()), 400,
       [&] { ReadMeasurements(take.Measurements()); });
}

TEST(Fuzz, Images) {
  const TempDir dir;
  const fs::path path = dir / "a.png";
  WriteImage(path, ImageU8(20, 10, 77));
  Fuzz(path, ReadFile(path), 500, [&] { ReadImage(path); });
}

}  // namespace
}  // namespace sole::io
