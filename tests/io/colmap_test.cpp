#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <cstring>
#include <filesystem>
#include <random>

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

const std::string kNoError = ErrorOf([] {});

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
  ColmapModel model = ModelOfViews(views);
  model.images.push_back({"again.png", 0, model.images[1].cam_from_world, {{{3, 4}, 1}}});
  model.images[0].pixels = {{{5, 6}, -1}, {{1.25, 2}, 1}};
  model.images[1].pixels = {{{10, 20}, 1}};
  model.points = {{{0.125, 0.25, -0.5}, 128}, {{1, 2, 3}, 50}};
  WriteColmapModel(folder / "model", model);
  const ColmapModel read = ReadColmapModel(folder / "model");
  ASSERT_EQ(read.cameras.size(), 2U);
  ASSERT_EQ(read.images.size(), 3U);
  ASSERT_EQ(read.points.size(), 2U);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(read.images[i].name, model.images[i].name);
    EXPECT_EQ(read.images[i].camera, model.images[i].camera);
    EXPECT_EQ(read.images[i].cam_from_world.translation, model.images[i].cam_from_world.translation);
    EXPECT_LT(read.images[i].cam_from_world.rotation.angularDistance(model.images[i].cam_from_world.rotation), 1e-7);
    ASSERT_EQ(read.images[i].pixels.size(), model.images[i].pixels.size());
    for (std::size_t k = 0; k < read.images[i].pixels.size(); ++k) {
      EXPECT_EQ(read.images[i].pixels[k].pixel, model.images[i].pixels[k].pixel);
      EXPECT_EQ(read.images[i].pixels[k].point, model.images[i].pixels[k].point);
    }
  }
  const std::vector<ColmapView> read_views = ViewsOf(read);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(read_views[i].image, views[i].image);
    EXPECT_EQ(read_views[i].camera.width, 640);
    EXPECT_EQ(read_views[i].camera.height, 480);
    EXPECT_LT((read_views[i].camera.intrinsics - views[i].camera.intrinsics).cwiseAbs().maxCoeff(), 1e-12);
    EXPECT_EQ(read.points[i].point_m, model.points[i].point_m);
    EXPECT_EQ(read.points[i].grey, model.points[i].grey);
  }
  // COLMAP's pixel (0.5, 0.5) is the centre of the first one.
  EXPECT_THAT(ReadFile(folder / "model" / "cameras.txt"),
              HasSubstr("2 PINHOLE 640 480 801.25 802.5 319.25 241.625\n"));
  EXPECT_THAT(ReadFile(folder / "model" / "points3D.txt"),
              HasSubstr("\n1 0.125 0.25 -0.5 128 128 128 0\n2 1 2 3 50 50 50 0 1 1 2 0 3 0\n"));
  EXPECT_THAT(ReadFile(folder / "model" / "images.txt"), HasSubstr("right.png\n10.5 20.5 2\n"));
  model.images[0].pixels[0].point = 2;
  EXPECT_THAT(ErrorOf([&] { WriteColmapModel(folder / "m", model); }), HasSubstr("a point that the model does not have"));
  model.images[0].camera = 2;
  EXPECT_THAT(ErrorOf([&] { WriteColmapModel(folder / "m", model); }), HasSubstr("a camera that the model does not have"));
  EXPECT_FALSE(std::filesystem::exists(folder / "m"));
}

TEST(ColmapModel, ReadsOtherModelsAndTheirPointLines) {
  const TempDir folder;
  WriteStringAtomically(folder / "cameras.txt", "# comment\n7 SIMPLE_RADIAL 100 80 90 50 40 -0.02\n");
  WriteStringAtomically(folder / "images.txt",
                        "# comment\n"
                        "2 1 0 0 0 0 0 2 7 b.jpg\n10 20 -1 11 21 5\n"
                        "1 1 0 0 0 0 0 1 7 a.jpg\n\n");
  WriteStringAtomically(folder / "points3D.txt", "5 1 2 3 10 20 30 0.5 2 1\n");
  const ColmapModel model = ReadColmapModel(folder.Path());
  ASSERT_EQ(model.points.size(), 1U);
  EXPECT_EQ(model.points[0].grey, 20);
  ASSERT_EQ(model.images[1].pixels.size(), 2U);
  EXPECT_EQ(model.images[1].pixels[0].point, -1);
  EXPECT_EQ(model.images[1].pixels[1].point, 0);
  EXPECT_EQ(model.images[1].pixels[1].pixel, Eigen::Vector2d(10.5, 20.5));
  const std::vector<ColmapView> views = ViewsOf(model);
  ASSERT_EQ(views.size(), 2U);
  EXPECT_EQ(views[0].image, "a.jpg");
  EXPECT_EQ(views[1].camera.cam_from_world.translation.z(), 2);
  Intrinsics expected;
  expected << 90, 90, 49.5, 39.5, -0.02, 0, 0, 0, 0;
  EXPECT_EQ(views[0].camera.intrinsics, expected);
}

TEST(ColmapModel, SaysWhatIsWrong) {
  const TempDir folder;
  const auto error_of = [&](const std::string& cameras, const std::string& images, const std::string& points = "") {
    WriteStringAtomically(folder / "cameras.txt", cameras);
    WriteStringAtomically(folder / "images.txt", images);
    WriteStringAtomically(folder / "points3D.txt", points);
    return ErrorOf([&] { ReadColmapModel(folder.Path()); });
  };
  const std::string good = "1 PINHOLE 100 80 90 90 50 40\n";
  EXPECT_THAT(error_of("\n1 FOV 100 80 90 90 50 40 1\n", ""), HasSubstr("cameras.txt:2: camera model FOV"));
  EXPECT_THAT(error_of("1 PINHOLE 100 80 90 90\n", ""), HasSubstr("parameters are missing"));
  EXPECT_THAT(error_of("1 PINHOLE -100 80 90 90 50 40\n", ""), HasSubstr("is not a camera"));
  EXPECT_THAT(error_of("1 PINHOLE 100 80 0 90 50 40\n", ""), HasSubstr("focal length must be positive"));
  EXPECT_THAT(error_of(good + good, ""), HasSubstr("twice"));
  EXPECT_THAT(error_of(good, "1 1 0 0 0 0 0 1 2 a.jpg\n"), HasSubstr("camera 2 is not in"));
  EXPECT_THAT(error_of(good, "1 9 0 0 0 0 0 1 1 a.jpg\n"), HasSubstr("images.txt:1: is not an image"));
  const std::string image = "4 1 0 0 0 0 0 1 1 a.jpg\n";
  EXPECT_THAT(error_of(good, image + "1 2\n"), HasSubstr("images.txt:2: is not a list"));
  EXPECT_THAT(error_of(good, image + "1 2 3\n"), HasSubstr("images.txt:2: point 3 is not in points3D.txt"));
  const std::string seen = image + "1 2 3 1 2 -1\n", point = "3 0 0 0 1 1 1 0 4 0";
  EXPECT_EQ(error_of(good, seen, point), kNoError);
  EXPECT_THAT(error_of(good, seen, "3 0 0 0 1 1 1 0 5 0"), HasSubstr("points3D.txt:1: images.txt does not see point 3"));
  EXPECT_THAT(error_of(good, seen, "3 0 0 0 1 1 1 0 4 1"), HasSubstr("does not see point 3"));
  EXPECT_THAT(error_of(good, seen, "3 0 0 0 1 1 1 0"), HasSubstr("the track of point 3 is not"));
  EXPECT_THAT(error_of(good, seen, point + " 4 0"), HasSubstr("the track of point 3 is not"));
  EXPECT_THAT(error_of(good, seen, point + "\n" + point), HasSubstr("points3D.txt:2: point 3 is there twice"));
  EXPECT_THAT(error_of(good, seen, "3 0 0 x"), HasSubstr("is not a point"));
  std::filesystem::rename(folder / "cameras.txt", folder / "cameras.bin");
  EXPECT_THAT(ErrorOf([&] { ReadColmapModel(folder.Path()); }), HasSubstr("model_converter --output_type TXT"));
  ColmapView spaced = SomeView(false);
  spaced.image = "a b.png";
  EXPECT_THAT(ErrorOf([&] { WriteColmapModel(folder / "m", ModelOfViews({spaced})); }), HasSubstr("without spaces"));
}

/// Any change of a line's words ends in an error of one line or in a model whose indices are valid.
TEST(ColmapModel, DamagedFilesEndInAnErrorOrAValidModel) {
  const TempDir folder("/dev/shm");
  ColmapModel model = ModelOfViews({SomeView(true), SomeView(false)});
  model.images[0].pixels = {{{5, 6}, -1}, {{1.25, 2}, 1}, {{7, 8}, 0}};
  model.images[1].pixels = {{{10, 20}, 1}, {{11, 21}, 0}};
  model.points = {{{0.125, 0.25, -0.5}, 128}, {{1, 2, 3}, 50}};
  std::mt19937_64 random(11);
  int accepted = 0, refused = 0;
  for (const std::string name : {"cameras.txt", "images.txt", "points3D.txt"}) {
    WriteColmapModel(folder.Path(), model);
    const std::string whole = ReadFile(folder / name);
    for (int round = 0; round < 300; ++round) {
      std::string text = whole;
      for (std::size_t changes = 1 + random() % 3; changes > 0; --changes) {
        static const std::string kinds("0123456789-. \n#e\0\xff", 18);
        const std::size_t at = random() % text.size();
        if (random() % 5 == 0) text.resize(at + 1);
        else if (random() % 5 == 0) text.erase(at, 1 + random() % 9);
        else text[at % text.size()] = kinds[random() % kinds.size()];
        if (text.empty()) text = "\n";
      }
      WriteStringAtomically(folder / name, text);
      ColmapModel read;
      const std::string error = ErrorOf([&] { read = ReadColmapModel(folder.Path()); });
      if (error != kNoError) {
        ++refused;
        EXPECT_EQ(error.find('\n'), std::string::npos) << error;
        EXPECT_THAT(error, HasSubstr(folder.Path().string()));
        continue;
      }
      ++accepted;
      for (const ColmapImage& image : read.images) {
        ASSERT_TRUE(image.camera >= 0 && image.camera < static_cast<int>(read.cameras.size()));
        for (const ColmapPixel& seen : image.pixels) ASSERT_TRUE(seen.point >= -1 && seen.point < static_cast<int>(read.points.size()));
      }
    }
  }
  EXPECT_GT(accepted, 50);
  EXPECT_GT(refused, 200);
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
