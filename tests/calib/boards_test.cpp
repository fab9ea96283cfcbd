#include "calib/boards.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "calib/targets.h"
#include "tests/calib/photograph.h"
#include "tests/support/error_matcher.h"

namespace sole::calib {
namespace {

using sole::testing_support::ErrorOf;
using testing::HasSubstr;
using testing_support::Photograph;

/// A turned, slanted view of a page and its inverse, the same for pages of all sizes.
struct View {
  Eigen::Matrix3d image_from_page;
  explicit View(const io::PrintSheet& page, double turn_rad = 0.2) {
    const double c = std::cos(turn_rad), s = std::sin(turn_rad), scale = 450 / page.width_m;
    Eigen::Matrix3d centre = Eigen::Matrix3d::Identity(), place = centre, slant = centre;
    centre.topRightCorner<2, 1>() << -0.5 * page.width_m, -0.5 * page.height_m;
    place << scale * c, -scale * s, 330, scale * s, scale * c, 330, 0, 0, 1;
    slant(2, 0) = 0.5 / page.width_m * 0.5;
    slant(2, 1) = 0.2 / page.width_m * 0.5;
    image_from_page = place * slant * centre;
  }
  Eigen::Vector2d ToImage(const Eigen::Vector2d& p) const {
    return (image_from_page * p.homogeneous()).hnormalized();
  }
  ImageU8 Take(const io::PrintSheet& page) const {
    const Eigen::Matrix3d back = image_from_page.inverse();
    return Photograph(page, 660, 660, [&](const Eigen::Vector2d& p) {
      return Eigen::Vector2d((back * p.homogeneous()).hnormalized());
    });
  }
};

/// RMS distance (px) of found corners from where they were printed; checks their numbers.
double Rms(const ViewObservations& view, const PrintedSheet& sheet, const View& camera) {
  double squares = 0;
  for (const PointObservation& o : view.target) {
    const PrintedCorner& corner = sheet.corners.at(static_cast<std::size_t>(o.point));
    const double miss = (o.pixel - camera.ToImage(corner.page_m)).norm();
    EXPECT_LT(miss, 1.0) << o.point;
    squares += miss * miss;
  }
  return std::sqrt(squares / static_cast<double>(std::max<std::size_t>(1, view.target.size())));
}

const Board kCharuco = ParseBoard("charuco:6x5:20mm:14mm");
const Board kLegacy = ParseBoard("charuco:5x4:22mm:15mm:4X4_50:legacy");
const Board kGrid = ParseBoard("aprilgrid:4x3:30mm:0.3");

TEST(ParseBoard, ReadsEveryKindAndWritesItBack) {
  const Board charuco = ParseBoard("charuco:7x5:0.03:22mm:DICT_6X6_250");
  EXPECT_EQ(charuco.kind, BoardKind::kCharuco);
  EXPECT_EQ(charuco.columns, 7);
  EXPECT_DOUBLE_EQ(charuco.marker_m, 0.022);
  EXPECT_EQ(FormatBoard(charuco), "charuco:7x5:30mm:22mm:6X6_250");
  EXPECT_EQ(FormatBoard(kLegacy), "charuco:5x4:22mm:15mm:4X4_50:legacy");
  EXPECT_DOUBLE_EQ(kGrid.gap_m, 0.009);
  EXPECT_EQ(FormatBoard(kGrid), "aprilgrid:4x3:30mm:0.3");
  EXPECT_EQ(FormatBoard(ParseBoard("chessboard:9x6:25mm")), "chessboard:9x6:25mm");
}

TEST(ParseBoard, SaysWhatIsWrong) {
  for (const auto& [text, what] : std::initializer_list<std::pair<const char*, const char*>>{
           {"", "give chessboard:"},
           {"circles:9x6:25mm", "give chessboard:"},
           {"chessboard:9x6", "give chessboard:"},
           {"chessboard:9x6:25", "is not 0.1 to 1000 mm"},
           {"chessboard:2x6:25mm", "3 to 100 each"},
           {"charuco:7x5:20mm:20mm", "smaller than a square"},
           {"charuco:7x5:20mm:15cm", "is no length"},
           {"charuco:7x5:20mm:15mm:4X4_50:legacy", "odd number of rows"},
           {"charuco:7x5:20mm:15mm:4X4_50:old", "give chessboard:"},
           {"charuco:7x5:20mm:15mm:9X9_1", "there is no dictionary '9X9_1'"},
           {"charuco:30x30:20mm:15mm", "has 450 markers, dictionary 5X5_250 only 250"},
           {"aprilgrid:6x6:30mm:9mm", "gap between tags over their edge"},
           {"aprilgrid:30x30:30mm:0.3", "has 900 markers"},
           {"aprilgrid:6y6:30mm:0.3", "COLUMNSxROWS"}}) {
    EXPECT_THAT(ErrorOf([&] { ParseBoard(text); }), HasSubstr(what)) << text;
  }
}

TEST(BoardMarkers, LegacyBoardsBeginWithAMarker) {
  const std::vector<BoardMarker> markers = BoardMarkers(kLegacy);
  ASSERT_EQ(markers.size(), 10u);
  EXPECT_LT((markers[0].corners[0] - Eigen::Vector2d(0.0035, 0.0035)).norm(), 1e-12);
  EXPECT_NEAR(markers[3].corners[0].x(), 0.0255, 1e-12);  // second row, second square
}

TEST(CellsOf, AprilGridTagsStandAsKalibrPrintsThem) {
  // The codes of tag36h11 as the AprilTag library publishes them, most significant bit first from
  // the upper left, 1 white; Kalibr's border has two cells.
  const std::pair<int, std::uint64_t> codes[] = {
      {0, 0xd5d628584}, {1, 0xd97f18b49}, {4, 0xebcbca822}};
  for (const auto& [id, code] : codes) {
    const MarkerCells cells = CellsOf(kGrid, id);
    ASSERT_EQ(cells.side, 10);
    std::uint64_t read = 0;
    for (int y = 2; y < 8; ++y) {
      for (int x = 2; x < 8; ++x)
        read = 2 * read + cells.white[static_cast<std::size_t>(10 * y + x)];
    }
    EXPECT_EQ(read, code);
    EXPECT_EQ(std::count(cells.white.begin(), cells.white.begin() + 20, 1), 0);
  }
}

TEST(BoardCorners, AprilGridIsNumberedAsKalibrDoes) {
  const auto corners = BoardCorners(kGrid);
  ASSERT_EQ(corners.size(), 48u);
  EXPECT_LT((corners[1] - Eigen::Vector3d(0.03, 0, 0)).norm(), 1e-12);
  EXPECT_LT((corners[2] - Eigen::Vector3d(0.039, 0, 0)).norm(), 1e-12);
  EXPECT_LT((corners[8] - Eigen::Vector3d(0, 0.03, 0)).norm(), 1e-12);
  EXPECT_LT((corners[17] - Eigen::Vector3d(0.03, 0.039, 0)).norm(), 1e-12);
}

class DetectPrinted : public testing::TestWithParam<Board> {};

TEST_P(DetectPrinted, FindsEveryCornerHoweverTheBoardIsTurned) {
  const PrintedSheet sheet = DrawBoard(GetParam());
  for (const double turn : {0.2, 1.8, 3.5}) {
    const View camera(sheet.page, turn);
    const ViewObservations view = DetectBoard(camera.Take(sheet.page), GetParam());
    EXPECT_GE(view.target.size(), sheet.corners.size() - 2) << turn;
    EXPECT_LT(Rms(view, sheet, camera), 0.05) << turn;
    EXPECT_FALSE(view.mirrored_target);
  }
}

TEST_P(DetectPrinted, PartOfItSuffices) {
  const PrintedSheet sheet = DrawBoard(GetParam());
  const View camera(sheet.page);
  ImageU8 image = camera.Take(sheet.page);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < 330; ++x) image.At(x, y) = 90;  // an arm before its left half
  }
  const ViewObservations view = DetectBoard(image, GetParam());
  EXPECT_GE(view.target.size(), sheet.corners.size() / 4);
  EXPECT_LE(view.target.size(), 3 * sheet.corners.size() / 4);
  EXPECT_LT(Rms(view, sheet, camera), 0.05);
}

TEST_P(DetectPrinted, AMirroredPictureIsRecognised) {
  const PrintedSheet sheet = DrawBoard(GetParam());
  ImageU8 image = View(sheet.page).Take(sheet.page);
  for (int y = 0; y < image.height; ++y)
    std::reverse(&image.At(0, y), &image.At(0, y) + image.width);
  const ViewObservations view = DetectBoard(image, GetParam());
  EXPECT_TRUE(view.target.empty());
  EXPECT_TRUE(view.mirrored_target);
}

INSTANTIATE_TEST_SUITE_P(Kinds, DetectPrinted, testing::Values(kCharuco, kGrid, kLegacy),
                         [](const auto& value) {
                           return value.param.legacy                         ? "LegacyCharuco"
                                  : value.param.kind == BoardKind::kCharuco ? "Charuco"
                                                                            : "AprilGrid";
                         });

TEST(DetectBoard, AMarkerInTheWrongPlaceIsLeftOut) {
  PrintedSheet sheet = DrawBoard(kCharuco);
  // Marker 7 printed where marker 3 belongs, and marker 7 painted over: it contradicts its
  // neighbours.
  const Board board = kCharuco;
  const double s = board.size_m, inset = 0.5 * (s - board.marker_m);
  const Eigen::Vector2d origin = sheet.corners[0].page_m - Eigen::Vector2d(s, s);
  const auto in_square = [&](const io::PrintRect& r, int x, int y) {
    return r.x_m > origin.x() + x * s + 0.5 * inset && r.y_m > origin.y() + y * s + 0.5 * inset &&
           r.x_m < origin.x() + (x + 1) * s && r.y_m < origin.y() + (y + 1) * s;
  };
  // Markers 0, 1, 2 in row 0 (columns 1, 3, 5), 3, 4, 5 in row 1 (columns 0, 2, 4), 6, 7, 8 in row 2.
  std::vector<io::PrintRect> moved;
  std::erase_if(sheet.page.rects, [&](const io::PrintRect& r) { return in_square(r, 2, 1); });
  for (io::PrintRect r : sheet.page.rects) {
    if (!in_square(r, 3, 2)) continue;
    r.x_m -= s;
    r.y_m -= s;
    moved.push_back(r);
  }
  std::erase_if(sheet.page.rects, [&](const io::PrintRect& r) { return in_square(r, 3, 2); });
  ASSERT_GT(moved.size(), 5u);
  sheet.page.rects.insert(sheet.page.rects.end(), moved.begin(), moved.end());
  const View camera(sheet.page);
  const ViewObservations view = DetectBoard(camera.Take(sheet.page), board);
  EXPECT_GE(view.target.size(), 16u);  // every corner has another marker
  EXPECT_LT(Rms(view, sheet, camera), 0.05);
}

TEST(DetectBoard, OtherBoardsAndEmptyPicturesGiveNothing) {
  const PrintedSheet sheet = DrawBoard(kGrid);
  EXPECT_TRUE(DetectBoard(View(sheet.page).Take(sheet.page), kCharuco).target.empty());
  EXPECT_TRUE(DetectBoard(ImageU8(300, 200, 90), kGrid).target.empty());
  EXPECT_TRUE(DetectBoard(ImageU8(), kGrid).target.empty());
}

}  // namespace
}  // namespace sole::calib
