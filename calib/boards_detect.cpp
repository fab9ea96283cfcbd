#include <algorithm>
#include <cmath>
#include <map>

#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "calib/boards_internal.h"
#include "calib/edge_fit.h"
#include "calib/markers_internal.h"

namespace sole::calib {
namespace {

constexpr double kSigmaFloor_px = 0.03;  ///< lenses and prints of others
constexpr double kMaxSigma_px = 0.3;
constexpr double kRadius_px = 8;
constexpr int kMirroredMarkers = 3;

/// A found marker and where it is on the board.
struct Found {
  Marker marker;
  Quad in_board;
};

/// The board's markers, sought in an enlarged image, too, if some are missing: OpenCV wants more
/// pixels a cell than it takes to see one, above all where black squares touch a tag's corners.
std::vector<Marker> Seek(const ImageU8& image, bool mirrored, const Board& board) {
  constexpr int kLargest_px = 2600;
  const int dictionary = DictionaryNumber(board), border = BorderCells(board);
  const std::vector<BoardMarker> known = BoardMarkers(board);
  const auto ours = [&](std::vector<Marker> markers) {
    std::erase_if(markers, [&](const Marker& m) {
      return m.id < 0 || m.id >= static_cast<int>(known.size());
    });
    return markers;
  };
  std::vector<Marker> markers = ours(FindMarkers(image, mirrored, dictionary, border));
  if (markers.size() >= known.size() || std::max(image.width, image.height) > kLargest_px)
    return markers;
  ImageU8 enlarged(2 * image.width, 2 * image.height);
  const cv::Mat from(image.height, image.width, CV_8UC1,
                     const_cast<std::uint8_t*>(image.pixels.data()));
  cv::Mat to(enlarged.height, enlarged.width, CV_8UC1, enlarged.pixels.data());
  cv::resize(from, to, to.size(), 0, 0, cv::INTER_CUBIC);
  const std::size_t at_first = markers.size();
  for (Marker marker : ours(FindMarkers(enlarged, mirrored, dictionary, border))) {
    for (Eigen::Vector2d& corner : marker.corners) corner = 0.5 * corner.array() - 0.25;
    const bool again = std::any_of(
        markers.begin(), markers.begin() + static_cast<std::ptrdiff_t>(at_first),
        [&](const Marker& other) {
          return other.id == marker.id && (other.corners[0] - marker.corners[0]).norm() < 5;
        });
    if (!again) markers.push_back(marker);
  }
  return markers;
}

std::vector<Found> MarkersOf(const Board& board, const std::vector<Marker>& markers) {
  const std::vector<BoardMarker> known = BoardMarkers(board);
  std::map<int, int> count;
  for (const Marker& m : markers) ++count[m.id];
  std::vector<Found> found;
  for (const Marker& m : markers) {
    // A marker that is seen twice tells nothing: a second board, or a reflection.
    if (count[m.id] > 1) continue;
    found.push_back({m, known[static_cast<std::size_t>(m.id)].corners});
  }
  return found;
}

Eigen::Vector2d Centre(const Quad& quad) { return 0.25 * (quad[0] + quad[1] + quad[2] + quad[3]); }

/// Homography through whole markers; empty if it cannot be.
std::optional<Homography> Through(const std::vector<const Found*>& markers) {
  std::vector<cv::Point2d> plane, image;
  for (const Found* f : markers) {
    for (std::size_t k = 0; k < 4; ++k) {
      plane.emplace_back(f->in_board[k].x(), f->in_board[k].y());
      image.emplace_back(f->marker.corners[k].x(), f->marker.corners[k].y());
    }
  }
  const cv::Mat h = cv::findHomography(plane, image, 0);
  if (h.empty()) return {};
  Homography homography;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) homography.image_from_plane(r, c) = h.at<double>(r, c);
  }
  return homography;
}

/// Leaves out markers whose own corners lie elsewhere than their neighbours say: wrong ids, other
/// boards. Neighbours only, so that the lens may bend the board as it likes.
std::vector<Found> Agreeing(const std::vector<Found>& markers, double pitch_m) {
  constexpr double kTolerance = 0.25;  // of the marker's edge
  std::vector<Found> agreeing;
  for (const Found& one : markers) {
    int votes = 0, judges = 0;
    for (const Found& other : markers) {
      const double distance = (Centre(one.in_board) - Centre(other.in_board)).norm();
      if (&one == &other || distance > 2.3 * pitch_m) continue;
      const auto homography = Through({&other});
      if (!homography) continue;
      ++judges;
      const double edge = (one.marker.corners[1] - one.marker.corners[0]).norm();
      const double miss =
          ((*homography * Centre(one.in_board)) - Centre(one.marker.corners)).norm();
      votes += miss < kTolerance * edge * std::max(1.0, distance / pitch_m);
    }
    if (judges > 0 && 2 * votes > judges) agreeing.push_back(one);
  }
  return agreeing;
}

/// Quads of an AprilGrid's tags from their edges: the black squares at the tags' corners lead
/// OpenCV's contours some pixels astray.
void RefineTags(const ImageU8& image, std::vector<Found>& tags) {
  for (Found& tag : tags) {
    const double edge = (tag.marker.corners[1] - tag.marker.corners[0]).norm();
    const auto fitted = FitSquare(image, tag.marker.corners, std::clamp(0.1 * edge, 2.0, 6.0));
    for (std::size_t k = 0; fitted && k < 4; ++k) tag.marker.corners[k] = (*fitted)[k].pixel;
  }
}

/// The quadrant x, y > 0 of the corner is white; and how far from it other print begins, in board
/// units of length.
struct CornerLook {
  bool white_first;
  double clear_m;
};
CornerLook LookOf(const Board& board, int corner) {
  const int columns = CornersInRow(board), x = corner % columns, y = corner / columns;
  if (board.kind == BoardKind::kCharuco)
    return {IsWhite(board, x + 1, y + 1), 0.85 * 0.5 * (board.size_m - board.marker_m)};
  // The tag lies on the side of even coordinates' greater x and y: black there for equal parity.
  const double cell = board.size_m / 10;
  return {(x + y) % 2 == 1, 0.85 * std::min(board.gap_m, 2 * cell)};
}

}  // namespace

ViewObservations DetectBoard(const ImageU8& image, const Board& board) {
  ViewObservations view;
  if (image.Empty()) return view;
  if (board.kind == BoardKind::kChessboard) {
    view.target = DetectChessboard(image, board);
    return view;
  }
  const bool grid = board.kind == BoardKind::kAprilGrid;
  const double pitch_m = grid ? board.size_m + board.gap_m : board.size_m;
  std::vector<Found> markers = Agreeing(MarkersOf(board, Seek(image, false, board)), pitch_m);
  if (markers.empty()) {
    view.mirrored_target =
        MarkersOf(board, Seek(image, true, board)).size() >= kMirroredMarkers;
    return view;
  }
  if (grid) RefineTags(image, markers);
  const std::vector<Eigen::Vector3d> corners = BoardCorners(board);
  const double beside_m = 0.51 * (grid ? board.size_m : pitch_m);
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Eigen::Vector2d corner = corners[i].head<2>();
    std::vector<const Found*> near;
    for (const Found& f : markers) {
      // Beside the corner: an AprilGrid's own tag, a ChArUco corner's two markers.
      if ((Centre(f.in_board) - corner).cwiseAbs().maxCoeff() < beside_m) near.push_back(&f);
    }
    if (near.empty()) continue;
    const auto plane = Through(near);
    if (!plane) continue;
    const Eigen::Matrix2d jacobian = plane->JacobianAt(corner);  // pixels per metre
    if ((grid ? -1 : 1) * jacobian.determinant() <= 0) continue;
    const CornerLook look = LookOf(board, static_cast<int>(i));
    SaddleGuess guess;
    guess.pixel = *plane * corner;
    guess.along_x = jacobian.col(0) * board.size_m;
    guess.along_y = jacobian.col(1) * board.size_m;
    guess.clear = look.clear_m / board.size_m;
    guess.white_first = look.white_first;
    const double narrow = std::abs(jacobian.determinant()) /
                          std::max(jacobian.col(0).norm(), jacobian.col(1).norm());
    const double reach_m = grid ? 0.9 * board.gap_m : 0.6 * board.size_m;
    const double radius = std::min(kRadius_px, reach_m * narrow);
    if (radius < 2.5) continue;
    const auto point = FitSaddle(image, guess, radius);
    if (!point || point->sigma_px > kMaxSigma_px) continue;
    view.target.push_back(
        {static_cast<int>(i), point->pixel, std::hypot(point->sigma_px, kSigmaFloor_px)});
  }
  return view;
}

}  // namespace sole::calib
