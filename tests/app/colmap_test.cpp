// COLMAP, run as a program, reads our models and fuses our depth maps.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "app/export_colmap.h"
#include "io/calibration_file.h"
#include "io/colmap_maps.h"
#include "io/mesh_file.h"
#include "recon/depth_map.h"
#include "tests/recon/ellipsoid_cloud.h"
#include "tests/recon/speckle_scene.h"
#include "tests/support/error_matcher.h"
#include "tests/support/temp_dir.h"

namespace sole {
namespace {

namespace fs = std::filesystem;

const Eigen::Vector3d kCentre(0, 0, 0.05), kRadii(0.04, 0.1, 0.045);

bool HasColmap() { return std::system("command -v colmap > /dev/null 2>&1") == 0; }

bool RunColmap(const std::string& arguments, const fs::path& log) {
  return std::system(("QT_QPA_PLATFORM=offscreen colmap " + arguments + " > " + log.string() + " 2>&1").c_str()) == 0;
}

class Colmap : public testing::Test {
 protected:
  void SetUp() override {
    if (!HasColmap()) GTEST_SKIP() << "colmap is not installed: run scripts/setup";
  }
  testing_support::TempDir folder;
  Rig rig = testing_support::NominalRig(MakeDefaultRig(8, 812, 618));
};

TEST_F(Colmap, ConvertsOurModelAndWeReadItBack) {
  std::vector<io::ColmapView> views;
  for (const Camera& camera : rig.cameras) views.push_back({camera, camera.serial + ".png"});
  io::ColmapModel model = io::ModelOfViews(views);
  model.points = {{{0.1, 0.2, 0.3}, 128}, {{0, 0, 0}, 99}};
  model.images[0].pixels = {{{400, 300}, 1}, {{7, 8}, -1}};
  model.images[1].pixels = {{{410, 310}, 1}};
  io::WriteColmapModel(folder / "text", model);
  for (const char* sub : {"binary", "back"}) fs::create_directory(folder / sub);
  const auto convert = [&](const std::string& from, const std::string& to, const std::string& type) {
    return RunColmap("model_converter --input_path " + (folder / from).string() + " --output_path " +
                         (folder / to).string() + " --output_type " + type,
                     folder / "log");
  };
  ASSERT_TRUE(convert("text", "binary", "BIN"));
  ASSERT_TRUE(fs::exists(folder / "binary" / "points3D.bin"));
  ASSERT_TRUE(convert("binary", "back", "TXT"));
  const io::ColmapModel back = io::ReadColmapModel(folder / "back");
  const std::vector<io::ColmapView> read = io::ViewsOf(back);
  ASSERT_EQ(read.size(), views.size());
  for (std::size_t i = 0; i < views.size(); ++i) {
    EXPECT_EQ(read[i].image, views[i].image);
    EXPECT_LT((read[i].camera.intrinsics - views[i].camera.intrinsics).cwiseAbs().maxCoeff(), 1e-9);
    EXPECT_LT((read[i].camera.CentreInWorld() - views[i].camera.CentreInWorld()).norm(), 1e-9);
  }
  ASSERT_EQ(back.points.size(), 2U);
  EXPECT_EQ(back.points[0].point_m, model.points[0].point_m);
  ASSERT_EQ(back.images[0].pixels.size(), 2U);
  EXPECT_EQ(back.images[0].pixels[1].point, -1);
  EXPECT_EQ(back.images[1].pixels[0].point, 1);
  EXPECT_LT((back.images[1].pixels[0].pixel - Eigen::Vector2d(410, 310)).norm(), 1e-9);
}

TEST_F(Colmap, FusesOurDepthAndNormalMaps) {
  const PointCloud cloud = testing_support::EllipsoidCloud(kCentre, kRadii, 0.0015);
  std::vector<io::ColmapDenseView> views;
  for (const Camera& camera : rig.cameras) {
    recon::DepthMap map = recon::RenderDepthMap(cloud, camera, {.spacing_m = 0.0015});
    views.push_back({{map.camera, camera.serial + ".png"}, map.grey, map.depth_m, map.normals});
  }
  io::WriteColmapWorkspace(folder / "dense", views, cloud);
  const fs::path fused = folder / "fused.ply";
  ASSERT_TRUE(RunColmap("stereo_fusion --workspace_path " + (folder / "dense").string() +
                            " --input_type geometric --StereoFusion.min_num_pixels 2 --StereoFusion.num_threads 2"
                            " --output_path " + fused.string(),
                        folder / "log"));
  const PointCloud read = io::ReadPlyCloud(fused);
  std::printf("%zu points from %zu\n", read.Size(), cloud.Size());
  EXPECT_GT(read.Size(), cloud.Size() / 4);
  const auto truth = testing_support::Ellipsoid(kCentre, kRadii);
  double squares = 0;
  int flipped = 0;
  ASSERT_EQ(read.normals.size(), read.Size());
  for (std::size_t i = 0; i < read.Size(); ++i) {
    const Eigen::Vector3d p = read.points_m[i].cast<double>();
    squares += std::pow(truth.distance(p), 2);
    const Eigen::Vector3d normal = (p - kCentre).cwiseQuotient(kRadii.cwiseAbs2()).normalized();
    flipped += normal.dot(read.normals[i].cast<double>()) < 0.9 ? 1 : 0;
  }
  const double rms_m = std::sqrt(squares / static_cast<double>(read.Size()));
  std::printf("rms %.4f mm, %d normals off\n", 1000 * rms_m, flipped);
  EXPECT_LT(rms_m, 0.0001);
  EXPECT_LT(flipped, 0.01 * static_cast<double>(read.Size()));
}

TEST(ExportColmap, WritesAWorkspaceForEveryScanWithPoints) {
  const testing_support::TempDir take;
  const auto error = [&] { return testing_support::ErrorOf([&] { app::ExportColmap(take.Path()); }); };
  EXPECT_THAT(error(), testing::HasSubstr("has no scans: run `sole reconstruct"));
  Calibration calibration;
  calibration.rig = testing_support::NominalRig(MakeDefaultRig(4, 812, 618));
  io::WriteCalibration(take / "calibration.json", calibration);
  fs::create_directory(take / "scans");
  io::WritePly(take / "scans" / "000002.ply", PointCloud{});
  EXPECT_THAT(error(), testing::HasSubstr("has points: nothing to export"));
  io::WritePly(take / "scans" / "000003.ply", testing_support::EllipsoidCloud(kCentre, kRadii, 0.0015));
  const fs::path out = app::ExportColmap(take.Path());
  EXPECT_FALSE(fs::exists(out / "000002"));
  const std::vector<io::ColmapView> views = io::ViewsOf(io::ReadColmapModel(out / "000003" / "sparse"));
  ASSERT_EQ(views.size(), 4U);
  for (const io::ColmapView& view : views) {
    const ImageF depth =
        io::ReadColmapDepthMap(out / "000003" / "stereo" / "depth_maps" / (view.image + ".geometric.bin"));
    EXPECT_EQ(depth.width, view.camera.width);
    EXPECT_GT(std::count_if(depth.pixels.begin(), depth.pixels.end(), [](float d) { return d > 0.3F && d < 1; }), 3000);
  }
}

}  // namespace
}  // namespace sole
