#include "app/calibrate_images.h"

#include <cmath>
#include <vector>

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include "app/console.h"
#include "calib/pictures.h"
#include "core/error.h"
#include "io/calibration_file.h"
#include "io/image_file.h"
#include "io/image_folder.h"

namespace sole::app {
namespace {

using nlohmann::json;

/// How much the lengths of the second board may be off: more than print shops and rulers are.
constexpr double kMaxScaleError = 0.005;

/// What the pictures show of one board, of the other (if any), and the cameras.
struct Pictures {
  std::vector<calib::ImageCamera> cameras;
  calib::TakeObservations target, judge;
};

struct Size {
  int width = 0, height = 0;
};

Pictures Detect(const io::ImageFolder& folder, const calib::Board& target, const calib::Board* judge) {
  Pictures result;
  const std::size_t cameras = folder.cameras.size(), count = folder.numbers.size();
  result.target.frames.resize(count, std::vector<calib::ViewObservations>(cameras));
  result.judge = result.target;
  for (std::size_t c = 0; c < cameras; ++c) {
    std::vector<Size> sizes(count);
    tbb::parallel_for(std::size_t{0}, count, [&](std::size_t n) {
      if (folder.files[n][c].empty()) return;
      const ImageU8 image = io::ReadImage(folder.files[n][c]);
      sizes[n] = {image.width, image.height};
      result.target.frames[n][c] = calib::DetectBoard(image, target);
      if (judge) result.judge.frames[n][c] = calib::DetectBoard(image, *judge);
    });
    std::size_t first = 0;
    while (folder.files[first][c].empty()) ++first;
    result.cameras.push_back({folder.cameras[c], sizes[first].width, sizes[first].height});
    for (std::size_t n = first; n < count; ++n) {
      Require(folder.files[n][c].empty() || (sizes[n].width == sizes[first].width && sizes[n].height == sizes[first].height),
              fmt::format("{}: is {}x{}, but {} of the same camera {}x{}: calibrate pictures of one size", folder.files[n][c].string(),
                          sizes[n].width, sizes[n].height, folder.files[first][c].filename().string(), sizes[first].width,
                          sizes[first].height));
    }
    for (std::size_t n = 0; n < count; ++n) {
      const calib::ViewObservations& view = result.target.frames[n][c];
      if (folder.files[n][c].empty() || !view.target.empty()) continue;
      const bool whole = target.kind == calib::BoardKind::kChessboard;
      Log(fmt::format("{}: {}", folder.files[n][c].string(),
                      view.mirrored_target ? "the board is mirrored"
                      : whole              ? "the whole chessboard is not seen"
                                           : "the board is not seen"));
    }
  }
  return result;
}

/// Throws if the second board's lengths are not as given.
json Judge(const Rig& rig, const calib::TakeObservations& pictures, const calib::Board& board, const std::string& target) {
  const std::string name = calib::FormatBoard(board);
  const calib::BoardScale scale = calib::JudgeBoard(rig, pictures, board);
  Require(scale.lengths > 0, "--judge " + name + ": no two cameras see it in pictures of one number; show it to both");
  Require(std::abs(scale.scale - 1) <= kMaxScaleError,
          fmt::format("the boards disagree about their size: by {}, lengths on {} are {:.2f} % too {} (RMS {:.2f} mm); measure "
                      "both boards' squares and correct --target or --judge",
                      target, name, 100 * std::abs(scale.scale - 1), scale.scale > 1 ? "long" : "short", scale.rms_mm));
  return {{"lengths", scale.lengths}, {"rms_mm", scale.rms_mm}, {"scale", scale.scale}};
}

json Account(const calib::BoardResult& result, const io::ImageFolder& folder, const std::filesystem::path& path) {
  json views = json::object(), pairs = json::object(), camera_rms = json::object();
  for (std::size_t c = 0; c < folder.cameras.size(); ++c) {
    camera_rms[folder.cameras[c]] = result.camera_rms_px[c];
    for (std::size_t n = 0; n < folder.numbers.size(); ++n) {
      const double rms = result.view_rms_px[n][c];
      if (std::isfinite(rms)) views[folder.files[n][c].lexically_relative(path).string()] = rms;
    }
  }
  for (std::size_t p = 0; p < result.pairs.size(); ++p) {
    const calib::StereoErrors& e = result.pairs[p];
    pairs[result.calibration.rig.pairs[p].name] = {{"views", e.views}, {"stereo_rms_px", e.rms_px},
                                                   {"epipolar_rms_px", e.epipolar_px}, {"square_rms_mm", e.square_rms_mm}};
  }
  return {{"view_rms_px", views}, {"camera_rms_px", camera_rms}, {"pairs", pairs}, {"corners_dropped", result.dropped}};
}

}  // namespace

json CalibrateImages(const std::filesystem::path& path, const std::string& target, const std::string& judge,
                     const std::filesystem::path& out) {
  const calib::Board board = calib::ParseBoard(target);
  const calib::Board other = judge.empty() ? calib::Board{} : calib::ParseBoard(judge);
  const io::ImageFolder folder = io::ListImageFolder(path);
  const Pictures pictures = Detect(folder, board, judge.empty() ? nullptr : &other);
  calib::BoardResult result = calib::CalibrateBoards(pictures.cameras, pictures.target, board);
  result.calibration.rig.rig_hash = "0000000000000000";
  json account = Account(result, folder, path);
  if (!judge.empty()) account["judge"] = Judge(result.calibration.rig, pictures.judge, other, target);
  io::WriteCalibration(out, result.calibration);
  return account;
}

}  // namespace sole::app
