#include "app/target_files.h"

#include <array>
#include <cstdlib>
#include <cstring>
#include <map>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/aruco/charuco.hpp>
#include <opencv2/imgproc.hpp>

#include "calib/boards.h"
#include "calib/detect.h"
#include "io/atomic_file.h"
#include "io/image_file.h"
#include "tests/support/error_matcher.h"
#include "tests/support/temp_dir.h"

namespace sole::app {
namespace {

using nlohmann::json;
using testing::HasSubstr;
using testing_support::ErrorOf;
using testing_support::TempDir;

constexpr double kDpi = 150;
constexpr double kPixel_m = 0.0254 / kDpi;
constexpr double kTolerance_m = 0.00002;

void Run(const std::string& command) { ASSERT_EQ(std::system(command.c_str()), 0) << command; }

/// A page of the PDF as another program draws it.
ImageU8 PageOfPdf(const std::filesystem::path& folder, const std::string& name, int page) {
  const auto out = (folder / "page").string();
  Run(fmt::format("pdftocairo -r {} -gray -singlefile -png -f {} -l {} '{}' '{}'", kDpi, page, page,
                  (folder / (name + ".pdf")).string(), out));
  return io::ReadImage(out + ".png");
}
ImageU8 PictureOfSvg(const std::filesystem::path& folder, const std::string& name) {
  const auto out = (folder / "svg.png").string();
  Run(fmt::format("rsvg-convert -d {0} -p {0} '{1}' -o '{2}'", kDpi, (folder / (name + ".svg")).string(), out));
  return io::ReadImage(out);
}

json JsonOf(const std::filesystem::path& folder, const std::string& name) {
  return json::parse(io::ReadFile(folder / (name + ".json")));
}

Eigen::Vector2d OnPage(const Eigen::Vector2d& pixel) { return kPixel_m * (pixel.array() + 0.5); }

/// As a lens shows it: no picture has edges sharper than a pixel.
ImageU8 Seen(ImageU8 image) {
  cv::Mat view(image.height, image.width, CV_8UC1, image.pixels.data());
  cv::GaussianBlur(view, view, {}, 1.0);
  return image;
}

/// Every corner of the page is found within 0.02 mm of where the JSON file has it.
void ExpectCorners(const std::vector<calib::PointObservation>& found, const json& page) {
  std::map<int, Eigen::Vector2d> places;
  for (const calib::PointObservation& o : found) places[o.point] = OnPage(o.pixel);
  EXPECT_EQ(places.size(), page["corners"].size());
  for (const json& corner : page["corners"]) {
    const int id = corner["id"];
    ASSERT_TRUE(places.contains(id)) << id;
    const Eigen::Vector2d known(corner["page_m"][0], corner["page_m"][1]);
    EXPECT_LT((places[id] - known).norm(), kTolerance_m) << id;
  }
}

/// Length of the scale bar by the grey levels of its row.
void ExpectBar(const ImageU8& image, const json& page) {
  const json& bar = page["scale_bar"];
  EXPECT_DOUBLE_EQ(bar["length_m"], 0.1);
  const int row = static_cast<int>(bar["from_m"][1].get<double>() / kPixel_m);
  int first = 0, last = image.width - 1;
  while (image.At(first, row) > 250) ++first;
  while (image.At(last, row) > 250) --last;
  const double inked = (last - first - 1) + (510 - image.At(first, row) - image.At(last, row)) / 255.0;
  EXPECT_NEAR(inked * kPixel_m, 0.1, kTolerance_m);
  EXPECT_NEAR((first + image.At(first, row) / 255.0) * kPixel_m, bar["from_m"][0].get<double>(), kTolerance_m);
}

class PrintBoard : public testing::TestWithParam<std::pair<const char*, const char*>> {};

TEST_P(PrintBoard, PdfAndSvgAreTrueToScale) {
  const auto& [target, name] = GetParam();
  const TempDir dir;
  PrintTarget(target, {}, dir / "out");
  const json described = JsonOf(dir / "out", name), page = described["pages"][0];
  EXPECT_EQ(described["format"], "sole-target");
  const calib::Board board = calib::ParseBoard(described["target"]);
  for (const ImageU8& image : {PageOfPdf(dir / "out", name, 1), PictureOfSvg(dir / "out", name)}) {
    EXPECT_NEAR(image.width * kPixel_m, page["width_m"], kPixel_m);
    EXPECT_NEAR(image.height * kPixel_m, page["height_m"], kPixel_m);
    ExpectCorners(calib::DetectBoard(Seen(image), board).target, page);
    ExpectBar(image, page);
  }
  // Distances on paper are those on the target.
  const json &a = page["corners"].front(), &b = page["corners"].back();
  const auto distance = [](const json& p, const json& q) {
    return std::hypot(p[0].get<double>() - q[0].get<double>(), p[1].get<double>() - q[1].get<double>());
  };
  EXPECT_NEAR(distance(a["page_m"], b["page_m"]), distance(a["target_m"], b["target_m"]), 1e-9);
}

INSTANTIATE_TEST_SUITE_P(Kinds, PrintBoard,
                         testing::Values(std::pair("chessboard:7x5:20mm", "chessboard-7x5"),
                                         std::pair("charuco:8x5:22mm:16.5mm", "charuco-8x5"),
                                         std::pair("aprilgrid:4x3:30mm:0.3", "aprilgrid-4x3")));

TEST(PrintTarget, OpenCvReadsTheCharucoBoardAsItsOwn) {
  const TempDir dir;
  PrintTarget("charuco:7x6:25mm:18mm:6X6_250", {}, dir / "out");
  const ImageU8 image = PageOfPdf(dir / "out", "charuco-7x6", 1);
  const json page = JsonOf(dir / "out", "charuco-7x6")["pages"][0];
  const auto dictionary = cv::aruco::getPredefinedDictionary(cv::aruco::DICT_6X6_250);
  const auto board = cv::aruco::CharucoBoard::create(7, 6, 0.025f, 0.018f, dictionary);
  const cv::Mat view(image.height, image.width, CV_8UC1, const_cast<std::uint8_t*>(image.pixels.data()));
  std::vector<std::vector<cv::Point2f>> markers;
  std::vector<int> ids, corner_ids;
  std::vector<cv::Point2f> corners;
  cv::aruco::detectMarkers(view, dictionary, markers, ids);
  cv::aruco::interpolateCornersCharuco(markers, ids, view, board, corners, corner_ids);
  ASSERT_EQ(corners.size(), 30u);
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const json& known = page["corners"][static_cast<std::size_t>(corner_ids[i])];
    const Eigen::Vector2d place = OnPage({corners[i].x, corners[i].y});
    EXPECT_NEAR(place.x(), known["page_m"][0].get<double>(), 1e-4);
    EXPECT_NEAR(place.y(), known["page_m"][1].get<double>(), 1e-4);
  }
}

TEST(PrintTarget, TheCubesFacesCarryItsCorners) {
  const TempDir dir;
  const TargetConfig cube{0.08, 4, 0.019, 0.014};
  RigConfig config;
  config.target = cube;
  PrintTarget("cube", config, dir / "out", {.paper_thickness_m = 0.00025});
  const json described = JsonOf(dir / "out", "cube");
  ASSERT_EQ(described["pages"].size(), 5u);
  const calib::DetectTarget target = calib::TargetOf(config);
  const std::vector<Eigen::Vector3d> corners = calib::TargetCorners(target.body);
  for (int page = 1; page <= 5; ++page) {
    const json& known = described["pages"][static_cast<std::size_t>(page - 1)];
    ExpectCorners(calib::DetectInImage(Seen(PageOfPdf(dir / "out", "cube", page)), target, false).target, known);
    for (const json& corner : known["corners"]) {
      const Eigen::Vector3d& place = corners[corner["id"].get<std::size_t>()];
      EXPECT_NEAR(place.x(), corner["target_m"][0].get<double>(), 1e-12);
      EXPECT_NEAR(place.z(), corner["target_m"][2].get<double>(), 1e-12);
    }
  }
  ExpectBar(PictureOfSvg(dir / "out", "cube-3"), described["pages"][2]);

  // The body: with the paper glued on it is the cube.
  const std::string stl = io::ReadFile(dir / "out" / "cube.stl");
  ASSERT_EQ(stl.size(), 84u + 50 * 12);
  double volume_mm3 = 0;
  for (std::size_t t = 0; t < 12; ++t) {
    std::array<float, 9> v;
    std::memcpy(v.data(), stl.data() + 84 + 50 * t + 12, sizeof v);
    const Eigen::Vector3d a(v[0], v[1], v[2]), b(v[3], v[4], v[5]), c(v[6], v[7], v[8]);
    volume_mm3 += a.dot(b.cross(c)) / 6;  // positive if all triangles look outwards
    for (const float x : v) EXPECT_NEAR(std::abs(x), 39.75, 1e-5);
  }
  EXPECT_NEAR(volume_mm3, 79.5 * 79.5 * 79.5, 0.1);
}

TEST(PrintTarget, TheContactSheetIsSpeckledAllOver) {
  const TempDir dir;
  RigConfig config;
  config.sheet = {0.15, 0.22, 0.0001};
  PrintTarget("sheet", config, dir / "out");
  const json described = JsonOf(dir / "out", "sheet");
  ASSERT_EQ(described["pages"].size(), 2u);
  const ImageU8 image = PageOfPdf(dir / "out", "sheet", 2), svg = PictureOfSvg(dir / "out", "sheet-1");
  ASSERT_EQ(image.width, svg.width);
  // Every patch of 4 mm inside the sheet's borders is a third to a half black.
  const double left = 0.5 * described["pages"][0]["width_m"].get<double>() - 0.075;
  int patches = 0, unlike = 0;
  const int patch = static_cast<int>(0.004 / kPixel_m);
  const int x0 = static_cast<int>(std::lround(left / kPixel_m));
  int y0 = 0;  // the sheet's upper edge: the first row with much ink
  for (int ink = 0; ink < 100; ++y0) {
    ink = 0;
    for (int x = x0; x < x0 + 20 * patch; ++x) ink += image.At(x, y0) < 128;
  }
  for (int y = y0; y + patch < y0 + 0.215 / kPixel_m; y += patch) {
    for (int x = x0; x + patch < x0 + 0.149 / kPixel_m; x += patch, ++patches) {
      double ink = 0;
      for (int k = 0; k < patch * patch; ++k)
        ink += (255 - image.At(x + k % patch, y + k / patch)) / 255.0 / (patch * patch);
      unlike += ink < 0.2 || ink > 0.65;
    }
  }
  EXPECT_GT(patches, 1800);
  EXPECT_LT(unlike, patches / 100);
  EXPECT_EQ(described["sheet"]["size_y_m"], 0.22);
}

TEST(PrintTarget, SaysWhatDoesNotFitAndWritesNothing) {
  const TempDir dir;
  const auto error = [&](const std::string& kind, const TargetPrintOptions& options = {}) {
    return ErrorOf([&] { PrintTarget(kind, {}, dir / "out", options); });
  };
  EXPECT_THAT(error("charuco:7x5:60mm:45mm", {.page = "A4"}),
              HasSubstr("page 'A4' is too small: the target needs 440 x 338 mm"));
  EXPECT_THAT(error("chessboard:7x5:20mm", {.page = "letter"}), HasSubstr("give auto, A4"));
  EXPECT_THAT(error("sphere"), HasSubstr("target 'sphere': give chessboard:"));
  EXPECT_THAT(error("cube", {.paper_thickness_m = 0.02}), HasSubstr("paper's thickness"));
  EXPECT_FALSE(std::filesystem::exists(dir / "out"));
  EXPECT_EQ(error("charuco:7x5:60mm:45mm", {.page = "340x450"}), "(no error was thrown)");
}

}  // namespace
}  // namespace sole::app
