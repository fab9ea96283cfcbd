#include "app/fit_sheet.h"

#include <algorithm>
#include <set>
#include <string>
#include <vector>

#include <Eigen/Geometry>
#include <fmt/format.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "app/picture.h"
#include "core/error.h"
#include "io/atomic_file.h"
#include "model/fit.h"
#include "model/surface_query.h"

namespace sole::app {
namespace {

constexpr int kWidth = 150, kHeight = 190, kBar = 18, kColumns = 10;
constexpr std::size_t kMostFrames = 200, kPoints = 2500;
constexpr double kFullScale_m = 0.002;  ///< distance of a scan point at which its colour is red
const cv::Scalar kGood(80, 160, 70), kBad(60, 60, 210), kNone(150, 150, 150), kPaper(242, 245, 245), kInk(255, 255, 255);

/// Frames that are shown: those that are not good, and others evenly.
std::vector<std::size_t> ShownFrames(const FitSequence& fit) {
  std::set<std::size_t> shown;
  for (std::size_t f = 0; f < fit.frames.size() && shown.size() < kMostFrames / 2; ++f) {
    if (fit.frames[f].found && fit.frames[f].verdict != "good") shown.insert(f);
  }
  const std::size_t room = std::min(fit.frames.size(), kMostFrames - shown.size());
  for (std::size_t k = 0; k < room; ++k) shown.insert(k * fit.frames.size() / room);
  return {shown.begin(), shown.end()};
}

/// The foot from the side and above, turned so that its toes point right.
cv::Mat Thumbnail(const model::FootModel& model, const FrameFit& frame, const PointCloud& scan) {
  const bool fine = frame.registration_fine_m.rows() > 0;
  const TriangleMesh mesh = model::MeshOf(model, fine ? model::Variant::kFine : model::Variant::kCoarse,
                                          fine ? frame.registration_fine_m : frame.registration_m);
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3d& v : mesh.vertices) box.extend(v);
  const Eigen::Vector3d middle = box.center();
  const Eigen::MatrixX3d& rest = model.coarse.template_m;
  const Eigen::Matrix3d turn =
      Eigen::umeyama(rest.transpose(), frame.registration_m.transpose(), false).topLeftCorner<3, 3>();
  const double side = model.side == Side::kRight ? 1 : -1;
  const View view{turn * Eigen::Vector3d(-0.8 * side, 0.25, -0.6), turn * Eigen::Vector3d::UnitY()};
  const Eigen::Vector3d reach = Eigen::Vector3d::Constant(0.105);
  Picture picture(kWidth, kHeight - kBar, view, middle - reach, middle + reach);
  picture.DrawMesh(mesh, {{224, 190, 168}});
  const PointCloud thinned = model::ThinForFit(scan, kPoints);
  const model::SurfaceQuery query(mesh);
  std::vector<Colour> colours;
  for (const Eigen::Vector3f& p : thinned.points_m) {
    const auto hit = query.Closest(p.cast<double>(), kFullScale_m);
    colours.push_back(HeatColour(hit ? hit->distance_m / kFullScale_m : 1));
  }
  if (!colours.empty()) picture.DrawPoints(thinned.points_m, colours, 1);
  std::vector<std::uint8_t> pixels = picture.Pixels();
  cv::Mat image;
  cv::cvtColor(cv::Mat(kHeight - kBar, kWidth, CV_8UC3, pixels.data()), image, cv::COLOR_RGB2BGR);
  return image;
}

void DrawCell(const FootFit& foot, int number, std::size_t f, const ModelPair& models, cv::Mat cell) {
  const FrameFit& frame = foot.fit.frames[f];
  if (frame.found && frame.registration_m.allFinite()) {
    const model::FootModel& model = frame.side == Side::kRight ? models.right : models.left;
    Thumbnail(model, frame, foot.clouds[f]).copyTo(cell(cv::Rect(0, 0, kWidth, kHeight - kBar)));
  }
  const cv::Scalar colour = !frame.found ? kNone : frame.verdict == "good" ? kGood : kBad;
  cv::rectangle(cell, cv::Rect(0, kHeight - kBar, kWidth - 2, kBar - 2), colour, cv::FILLED);
  std::string text = fmt::format("{}{} {}", frame.trigger, number > 1 ? fmt::format(" ({})", number) : "",
                                 !frame.found ? "-" : frame.side == Side::kLeft ? "L" : "R");
  // The first words of a verdict say what is wrong.
  if (frame.found && frame.verdict != "good") text += " " + frame.verdict.substr(0, std::min<std::size_t>(frame.verdict.find(':'), 18));
  cv::putText(cell, text, {4, kHeight - 6}, cv::FONT_HERSHEY_SIMPLEX, 0.36, kInk, 1, cv::LINE_AA);
}

}  // namespace

void WriteFitSheet(const std::filesystem::path& path, const ModelPair& models, std::span<const FootFit> feet) {
  std::vector<std::pair<int, std::size_t>> cells;
  int rows = 0;
  std::vector<cv::Point> places;
  for (std::size_t k = 0; k < feet.size(); ++k) {
    const std::vector<std::size_t> shown = ShownFrames(feet[k].fit);
    for (std::size_t i = 0; i < shown.size(); ++i) {
      cells.emplace_back(static_cast<int>(k), shown[i]);
      places.emplace_back(static_cast<int>(i) % kColumns * kWidth, (rows + static_cast<int>(i) / kColumns) * kHeight);
    }
    rows += (static_cast<int>(shown.size()) + kColumns - 1) / kColumns;
  }
  int width = kWidth;
  for (const cv::Point& place : places) width = std::max(width, place.x + kWidth);
  cv::Mat sheet(std::max(rows, 1) * kHeight, width, CV_8UC3, kPaper);
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const auto [k, f] = cells[i];
    DrawCell(feet[static_cast<std::size_t>(k)], k + 1, f, models, sheet(cv::Rect(places[i].x, places[i].y, kWidth, kHeight)));
  }
  std::vector<std::uint8_t> bytes;
  Require(cv::imencode(".png", sheet, bytes), "cannot encode " + path.string());
  io::WriteStringAtomically(path, std::string(bytes.begin(), bytes.end()));
}

}  // namespace sole::app
