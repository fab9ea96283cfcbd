#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <cstring>

#include "io/atomic_file.h"
#include "io/colmap_maps.h"
#include "io/colmap_model.h"
#include "tests/support/error_matcher.h"
#include "tests/support/temp_dir.h"

namespace sole::io {
namespace {

using testing::HasSubstr;
using testing_support::ErrorOf;
using testing_support::TempDir;

ColmapView SomeView(bool distorted) {
  ColmapView view;
  view.image = "left.png";
  view.camera.width = 640;
  view.camera.height = 480;
  view.camera.intrinsics << 801.25, 802.5, 318.75, 241.125, 0, 0, 0, 0, 0;
  if (distorted) view.camera.intrinsics.tail<5>() << -0.08, 0.1, 2e-4, -3e-4, 0.01;
  view.camera.cam_from_world.rotation = Eigen::Quaterniond(0.5, -0.1, 0.7, 0.3).normalized();
  view.camera.cam_from_world.translation = {0.1, -0.25, 1.0 / 3};
  return view;
}

TEST(ColmapModel, ReadsBackWhatItWrote) {
  const TempDir folder;
  std::vector<ColmapView> views{SomeView(true), SomeView(false)};
  views[1].image = "right.png";
  WriteColmapModel(folder / "model", views,
                   {{{0.125, 0.25, -0.5}, 128, {}}, {{1, 2, 3}, 50, {{1, {10, 20}}, {0, {1.25, 2}}}}});
  const std::vector<ColmapView> read = ReadColmapModel(folder / "model");
  ASSERT_EQ(read.size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(read[i].image, views[i].image);
    EXPECT_EQ(read[i].camera.width, 640);
    EXPECT_EQ(read[i].camera.height, 480);
    EXPECT_LT((read[i].camera.intrinsics - views[i].camera.intrinsics).cwiseAbs().maxCoeff(), 1e-12);
    EXPECT_LT(read[i].camera.cam_from_world.rotation.angularDistance(
                  views[i].camera.cam_from_world.rotation),
              1e-7);
    EXPECT_EQ(read[i].camera.cam_from_world.translation,
              views[i].camera.cam_from_world.translation);
  }
  // COLMAP's pixel (0.5, 0.5) is the centre of the first one.
  EXPECT_THAT(ReadFile(folder / "model" / "cameras.txt"),
              HasSubstr("2 PINHOLE 640 480 801.25 802.5 319.25 241.625\n"));
  EXPECT_THAT(ReadFile(folder / "model" / "points3D.txt"),
              HasSubstr("\n1 0.125 0.25 -0.5 128 128 128 0\n2 1 2 3 50 50 50 0 2 0 1 0\n"));
  EXPECT_THAT(ReadFile(folder / "model" / "images.txt"), HasSubstr("right.png\n10.5 20.5 2\n"));
  EXPECT_THAT(ErrorOf([&] { WriteColmapModel(folder / "m", views, {{{0, 0, 0}, 0, {{2, {0, 0}}}}}); }),
              HasSubstr("a view that the model does not have"));
}

TEST(ColmapModel, ReadsOtherModelsAndTheirPointLines) {
  const TempDir folder;
  WriteStringAtomically(folder / "cameras.txt", "# comment\n7 SIMPLE_RADIAL 100 80 90 50 40 -0.02\n");
  WriteStringAtomically(folder / "images.txt",
                        "# comment\n"
                        "2 1 0 0 0 0 0 2 7 b.jpg\n10 20 -1 11 21 5\n"
                        "1 1 0 0 0 0 0 1 7 a.jpg\n\n");
  const std::vector<ColmapView> views = ReadColmapModel(folder.Path());
  ASSERT_EQ(views.size(), 2U);
  EXPECT_EQ(views[0].image, "a.jpg");
  EXPECT_EQ(views[1].camera.cam_from_world.translation.z(), 2);
  Intrinsics expected;
  expected << 90, 90, 49.5, 39.5, -0.02, 0, 0, 0, 0;
  EXPECT_EQ(views[0].camera.intrinsics, expected);
}

TEST(ColmapModel, SaysWhatIsWrong) {
  const TempDir folder;
  const auto error_of = [&](const std::string& cameras, const std::string& images) {
    WriteStringAtomically(folder / "cameras.txt", cameras);
    WriteStringAtomically(folder / "images.txt", images);
    return ErrorOf([&] { ReadColmapModel(folder.Path()); });
  };
  const std::string good = "1 PINHOLE 100 80 90 90 50 40\n";
  EXPECT_THAT(error_of("\n1 FOV 100 80 90 90 50 40 1\n", ""), HasSubstr("cameras.txt:2: camera model FOV"));
  EXPECT_THAT(error_of("1 PINHOLE 100 80 90 90\n", ""), HasSubstr("parameters are missing"));
  EXPECT_THAT(error_of("1 PINHOLE -100 80 90 90 50 40\n", ""), HasSubstr("is not a camera"));
  EXPECT_THAT(error_of(good + good, ""), HasSubstr("twice"));
  EXPECT_THAT(error_of(good, "1 1 0 0 0 0 0 1 2 a.jpg\n"), HasSubstr("camera 2 is not in"));
  EXPECT_THAT(error_of(good, "1 9 0 0 0 0 0 1 1 a.jpg\n"), HasSubstr("images.txt:1: is not an image"));
  ColmapView spaced = SomeView(false);
  spaced.image = "a b.png";
  EXPECT_THAT(ErrorOf([&] { WriteColmapModel(folder / "m", {spaced}); }), HasSubstr("without spaces"));
}

TEST(ColmapMaps, ByteForByteAndBack) {
  const TempDir folder;
  ImageF depth(3, 2);
  for (int i = 0; i < 6; ++i) depth.pixels[static_cast<std::size_t>(i)] = 0.25F * static_cast<float>(i);
  WriteColmapDepthMap(folder / "d.bin", depth);
  const std::string bytes = ReadFile(folder / "d.bin");
  ASSERT_EQ(bytes.size(), 6U + 24U);
  EXPECT_EQ(bytes.substr(0, 6), "3&2&1&");
  float last = 0;
  std::memcpy(&last, bytes.data() + 26, 4);
  EXPECT_EQ(last, 1.25F);
  EXPECT_EQ(ReadColmapDepthMap(folder / "d.bin").pixels, depth.pixels);

  std::vector<Eigen::Vector3f> normals;
  for (int i = 0; i < 6; ++i) normals.emplace_back(i, 10 + i, 20 + i);
  WriteColmapNormalMap(folder / "n.bin", 3, 2, normals);
  const std::string planes = ReadFile(folder / "n.bin");  // all x, then all y, then all z
  std::memcpy(&last, planes.data() + 6 + 4 * 7, 4);
  EXPECT_EQ(last, 11.0F);
  int width = 0, height = 0;
  EXPECT_EQ(ReadColmapNormalMap(folder / "n.bin", width, height), normals);
  EXPECT_EQ(width, 3);
  EXPECT_EQ(height, 2);
}

TEST(ColmapMaps, DamagedFilesAreRefused) {
  const TempDir folder;
  WriteColmapDepthMap(folder / "d.bin", ImageF(3, 2, 1));
  const std::string bytes = ReadFile(folder / "d.bin");
  for (const std::string& bad : {bytes.substr(0, bytes.size() - 1), bytes + "x", std::string("3&2"), std::string(),
                                 "0&2&1&" + bytes.substr(6), "3&2&3&" + bytes.substr(6)}) {
    WriteStringAtomically(folder / "bad.bin", bad);
    EXPECT_THAT(ErrorOf([&] { ReadColmapDepthMap(folder / "bad.bin"); }), HasSubstr("bad.bin: is "));
  }
}

}  // namespace
}  // namespace sole::io
