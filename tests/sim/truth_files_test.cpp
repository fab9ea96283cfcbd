#include "sim/truth_files.h"

#include <filesystem>

#include <gtest/gtest.h>
#include <unistd.h>

#include "core/error.h"
#include "io/mesh_file.h"
#include "io/npz.h"

namespace sole::sim {
namespace {

TakeTruth MakeTruth() {
  TakeTruth truth;
  truth.side = Side::kLeft;
  truth.pairs = {"below", "dorsum"};
  truth.bones = {"tibia"};
  truth.measures_mm = {{"footlength", 262.5}};
  for (int f = 0; f < 3; ++f) {
    TruthFrame frame;
    frame.trigger = f + 4;
    frame.mesh.vertices = {{0, 0, 0}, {0.1, 0, 0}, {0, 0.1, 0}, {0, 0, 0.1 + f}};
    frame.mesh.triangles = {{0, 2, 1}, {0, 1, 3}};
    frame.contact = {1, 1, 0, 0};
    frame.pressure_pa = {1e5, 2e5, 0, 1000.0 * f};
    frame.penetration_m = {0.001, 0.002, 0, 0};
    frame.load_n = 300 + f;
    frame.visible = {{1, 0, 0, 1}, {0, 0, 1, static_cast<std::uint8_t>(f == 2)}};
    frame.world_from_bone = {Rigid3{Eigen::Quaterniond(0, 1, 0, 0), Eigen::Vector3d(1, 2, f)}};
    truth.frames.push_back(frame);
  }
  return truth;
}

class WriteTruthTest : public testing::Test {
 protected:
  WriteTruthTest() {
    take_.root =
        std::filesystem::temp_directory_path() / ("sole_truth_test_" + std::to_string(getpid()));
  }
  ~WriteTruthTest() override { std::filesystem::remove_all(take_.root); }
  io::TakePaths take_;
};

TEST_F(WriteTruthTest, ReadsBackInTheDocumentedShapes) {
  WriteTruth(take_, MakeTruth());
  const io::Npz npz = io::ReadNpz(take_.Truth());
  using Shape = std::vector<std::size_t>;
  EXPECT_EQ(io::ShapeOf(npz, "contact"), (Shape{3, 4}));
  EXPECT_EQ(io::ShapeOf(npz, "visible"), (Shape{3, 2, 4}));
  EXPECT_EQ(io::ShapeOf(npz, "world_from_bone"), (Shape{3, 1, 7}));
  EXPECT_EQ(npz.at("contact").dtype, "|u1");
  EXPECT_EQ(io::MatrixFrom(npz, "visible")(2, 7), 1);
  EXPECT_EQ(io::MatrixFrom(npz, "visible")(1, 7), 0);
  EXPECT_EQ(io::MatrixFrom(npz, "pressure_pa")(2, 3), 2000);
  EXPECT_NEAR(io::MatrixFrom(npz, "penetration_m")(1, 1), 0.002, 1e-9);
  EXPECT_EQ(io::MatrixFrom(npz, "load_n")(1, 0), 301);
  EXPECT_EQ(io::MatrixFrom(npz, "plate_sag_m")(1, 0), 0);
  EXPECT_EQ(io::MatrixFrom(npz, "measure_footlength")(0, 0), 262.5);
  EXPECT_EQ(io::MatrixFrom(npz, "world_from_bone")(2, 6), 2);
  EXPECT_EQ(io::StringFrom(npz, "side"), "left");
  EXPECT_EQ(io::StringsFrom(npz, "pair")[1], "dorsum");
  EXPECT_EQ(io::IntsFrom(npz, "frames"), (std::vector<int>{4, 5, 6}));
  const TriangleMesh mesh = io::ReadPlyMesh(take_.TruthMesh(6));
  ASSERT_EQ(mesh.vertices.size(), 4U);
  EXPECT_NEAR(mesh.vertices[3].z(), 2.1, 1e-6);
}

TEST_F(WriteTruthTest, SagIsAGridWithItsNodes) {
  TakeTruth truth = MakeTruth();
  PlateSag& sag = truth.frames[1].plate_sag;
  sag = {0.4, 0.6, 3, 5, std::vector<double>(15, 0)};
  sag.down_m[7] = 1e-4;  // the middle
  sag.down_m[8] = 5e-5;  // one node further in x
  WriteTruth(take_, truth);
  const io::Npz npz = io::ReadNpz(take_.Truth());
  EXPECT_EQ(io::ShapeOf(npz, "plate_sag_grid_m"), (std::vector<std::size_t>{3, 5, 3}));
  const Eigen::MatrixXd grid = io::MatrixFrom(npz, "plate_sag_grid_m");
  EXPECT_NEAR(grid(1, 8), 5e-5, 1e-11);
  EXPECT_EQ(grid(0, 8), 0);
  EXPECT_NEAR(io::MatrixFrom(npz, "plate_sag_m")(1, 0), 1e-4, 1e-15);
  EXPECT_NEAR(io::MatrixFrom(npz, "plate_sag_x_m")(2, 0), 0.2, 1e-15);
  EXPECT_NEAR(io::MatrixFrom(npz, "plate_sag_y_m")(1, 0), -0.15, 1e-15);
  EXPECT_NEAR(sag.At(0.1, 0), 7.5e-5, 1e-15);
  truth.frames[2].plate_sag = {0.4, 0.6, 2, 2, std::vector<double>(4, 0)};
  EXPECT_THROW(WriteTruth(take_, truth), Error);
}

TEST_F(WriteTruthTest, RefusesFramesThatDisagree) {
  TakeTruth truth = MakeTruth();
  truth.frames[1].visible.pop_back();
  EXPECT_THROW(WriteTruth(take_, truth), Error);
  truth = MakeTruth();
  truth.frames[2].contact.push_back(1);
  EXPECT_THROW(WriteTruth(take_, truth), Error);
  truth = MakeTruth();
  truth.frames.clear();
  EXPECT_THROW(WriteTruth(take_, truth), Error);
}

}  // namespace
}  // namespace sole::sim
