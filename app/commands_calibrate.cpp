#include <cmath>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/calibrate_images.h"
#include "app/calibration_report.h"
#include "app/colmap_check.h"
#include "app/commands.h"
#include "app/console.h"
#include "app/evaluate.h"
#include "app/ground.h"
#include "app/interrupt.h"
#include "app/take_list.h"
#include "calib/calibrate.h"
#include "calib/colmap_calibration.h"
#include "calib/drift.h"
#include "calib/summary.h"
#include "core/error.h"
#include "io/calibration_file.h"
#include "recon/match_pair.h"

namespace sole::app {
namespace {

using nlohmann::json;

struct CalibrateArguments {
  std::vector<std::string> takes;
  std::string out, take, calibration, images, target, judge, sheet;
  std::string method = "target";
  bool no_plate = false;
  bool readjust = false;
};

json StatsJson(const CalibrationStats& s) {
  return {{"reprojection_rms_px", s.reprojection_rms_px}, {"heldout_rms_air_mm", s.heldout_rms_air_mm},
          {"heldout_rms_glass_mm", s.heldout_rms_glass_mm}, {"heldout_rms_across_mm", s.heldout_rms_across_mm},
          {"heldout_max_mm", s.heldout_max_mm}, {"ground_rms_mm", s.ground_rms_mm}, {"poses_used", s.poses_used},
          {"poses_heldout", s.poses_heldout}, {"camera_rms_px", s.camera_rms_px}, {"camera_corners", s.camera_corners},
          {"pair_offset_mm", s.pair_offset_mm}, {"pair_epipolar_px", s.pair_epipolar_px}, {"failures", s.failures}};
}

/// Throws if the calibration must not be used; the report says why in full.
void RequirePassed(const CalibrationStats& stats, const std::filesystem::path& report) {
  if (stats.failures.empty()) return;
  for (const std::string& failure : stats.failures) Log("FAILS: " + failure);
  throw Error(fmt::format("calibration FAILS by {} figure(s), first: {}; no calibration was written, see {}",
                          stats.failures.size(), stats.failures.front(), report.string()));
}

json RunCalibrate(const CalibrateArguments& a, const ColmapRunOptions& colmap_options) {
  TakeList takes({a.takes.begin(), a.takes.end()});
  if (a.method == "colmap") calib::RequireAllInAir(takes.Config());
  if (a.method != "target") RequireColmap();
  calib::CalibrateOptions options;
  options.ignore_plate = a.no_plate;
  const calib::TakeObservations observations = calib::Observe(takes.Config(), takes, options.detect);
  Calibration calibration = a.method == "colmap" ? CalibrateWithColmap(takes.Config(), observations, options, colmap_options)
                                                 : calib::CalibrateFromObservations(takes.Config(), observations, options);
  std::optional<ColmapCheck> check;
  if (a.method == "both") check = CheckWithColmap(takes.Config(), observations, calibration.rig, colmap_options);
  const std::filesystem::path report = std::filesystem::path(a.out).replace_extension(".html");
  WriteCalibrationReport(report, calibration, observations, check ? &*check : nullptr);
  if (check) LogCheck(*check);
  for (const std::string& line : calib::Advice(calibration.rig, observations)) Log("next time: " + line);
  RequirePassed(calibration.stats, report);
  json account = StatsJson(calibration.stats);
  if (!a.sheet.empty()) {
    account["ground"] = AddGround(calibration, a.sheet);
    WriteCalibrationReport(report, calibration, observations, check ? &*check : nullptr);
  }
  io::WriteCalibration(a.out, calibration);
  account["report"] = report.string();
  if (check) account["colmap"] = CheckJson(*check);
  return account;
}

/// Fiducials and target of every frame; under speckle the marks are sought in smoothed images.
calib::TakeObservations ObserveAll(TakeList& takes, std::optional<FrameSet>& speckle) {
  const calib::DetectTarget target = calib::TargetOf(takes.Config());
  calib::TakeObservations observations;
  while (std::optional<FrameSet> frame = takes.Next()) {
    const bool projected = frame->kind == ExposureKind::kSpeckle;
    observations.frames.push_back(calib::DetectInFrame(
        *frame, takes.Config(), target, projected ? calib::SpeckleDetectOptions() : calib::DetectOptions()));
    if (projected && !speckle) speckle = std::move(frame);
  }
  return observations;
}

ImageF Levels(const ImageU8& image) {
  ImageF levels(image.width, image.height);
  std::copy(image.pixels.begin(), image.pixels.end(), levels.pixels.begin());
  return levels;
}

/// Matches of every pair of a frame lit by speckle, on a coarse grid.
std::vector<calib::PairMatch> MatchesOf(const Rig& rig, const FrameSet& frame) {
  constexpr int kStep = 40;
  std::vector<calib::PairMatch> matches;
  for (int p = 0; p < static_cast<int>(rig.pairs.size()); ++p) {
    const StereoPair& pair = rig.pairs[static_cast<std::size_t>(p)];
    const auto &left = frame.images[static_cast<std::size_t>(pair.left)], &right = frame.images[static_cast<std::size_t>(pair.right)];
    if (!left || !right) continue;
    std::vector<Eigen::Vector2d> points;
    for (int y = kStep; y < left->height - kStep; y += kStep) {
      for (int x = kStep; x < left->width - kStep; x += kStep) {
        if (left->At(x, y) > 20) points.emplace_back(x, y);
      }
    }
    for (const recon::PointMatch& match : recon::MatchPoints(Levels(*left), Levels(*right), rig, p, points)) {
      if (match.problem.empty()) matches.push_back({p, match.left_px, match.right_px});
    }
  }
  return matches;
}

json DriftJson(const calib::DriftReport& report) {
  json cameras = json::array(), pairs = json::array(), moved = json::array();
  for (const calib::CameraDrift& c : report.cameras) {
    cameras.push_back({{"serial", c.serial}, {"judged", c.judged}, {"moved", c.moved}, {"fiducial_corners", c.fiducial_corners},
                       {"target_corners", c.target_corners}, {"residual_px", c.residual_px},
                       {"residual_after_px", c.residual_after_px}, {"moved_mm", c.moved_mm},
                       {"moved_sigma_mm", c.moved_sigma_mm}, {"turned_deg", c.turned_deg}});
    if (c.moved) moved.push_back(c.serial);
  }
  for (const calib::PairDrift& p : report.pairs) {
    pairs.push_back({{"name", p.name}, {"matches", p.matches}, {"gap_px", p.gap_px}, {"gap_after_px", p.gap_after_px}});
  }
  return {{"moved", moved}, {"everything_moved", report.everything_moved}, {"cameras", cameras}, {"pairs", pairs}};
}

void LogDrift(const calib::DriftReport& report) {
  for (const calib::CameraDrift& c : report.cameras) {
    if (!c.judged) Log(fmt::format("camera {}: sees too few marks to be judged", c.serial));
    if (c.moved) {
      Log(fmt::format("camera {} MOVED by {:.2f} mm (+- {:.3f}) and turned by {:.3f} degrees: {:.2f} px off, {:.2f} px in its new place",
                      c.serial, c.moved_mm, c.moved_sigma_mm, c.turned_deg, c.residual_px, c.residual_after_px));
    }
  }
  if (report.everything_moved) Log("most cameras moved: rather the plate did, or this is another rig; calibrate again");
  if (report.moved.empty()) Log("no camera moved");
}

json RunCheck(const CalibrateArguments& a) {
  const Calibration calibration = io::ReadCalibration(a.calibration);
  TakeList takes({a.take});
  Require(calibration.rig.rig_hash == RigIdentityHash(takes.Config()),
          a.calibration + ": belongs to another rig than " + a.take);
  std::optional<FrameSet> speckle;
  const calib::TakeObservations observations = ObserveAll(takes, speckle);
  const std::vector<calib::PairMatch> matches =
      speckle ? MatchesOf(calibration.rig, *speckle) : std::vector<calib::PairMatch>{};
  const calib::DriftReport report = calib::CheckDrift(calibration, takes.Config(), observations, matches);
  LogDrift(report);
  json account = DriftJson(report);
  if (const json ground = CompareGround(calibration, takes.Config(), observations); !ground.is_null()) account["ground"] = ground;
  if (!a.readjust || report.moved.empty()) return account;
  Require(report.moved.size() == 1 && !report.everything_moved,
          fmt::format("{}: {} cameras moved; only a single one can be re-adjusted, calibrate again", a.take, report.moved.size()));
  const Calibration readjusted =
      calib::ReadjustCamera(calibration, takes.Config(), observations, report.moved.front());
  io::WriteCalibration(a.out, readjusted);
  account["readjusted"] = a.out;
  account["stats"] = StatsJson(readjusted.stats);
  return account;
}

}  // namespace

void AddCalibrateCommands(CLI::App& app, CommonOptions& common, int& status) {
  const auto a = std::make_shared<CalibrateArguments>();
  const auto print = [&common, &status](const json& account) {
    fmt::print("{}", common.json ? account.dump(2) + "\n" : FormatSummary(account));
    status = 0;
  };
  CLI::App* calibrate = app.add_subcommand("calibrate", "Cameras and plate from takes of the calibration cube, with a report");
  calibrate->footer("Example: sole calibrate takes/cube --out rig-calibration.json\n"
                    "         sole calibrate takes/cube --method both --out rig-calibration.json\n"
                    "Writes rig-calibration.html beside it. A calibration that fails in millimetres is not written (status 1).");
  calibrate->add_option("TAKE", a->takes, "Calibration takes");
  calibrate->add_option("--out", a->out, "Calibration file to write");
  CLI::Option* sheet = calibrate->add_option("--sheet", a->sheet, "Take of the speckled sheet on the glass, which shows where the glass top is");
  calibrate->add_flag("--no-plate", a->no_plate, "As if there were no glass: shows what ignoring it costs");
  CLI::Option* method = calibrate->add_option("--method", a->method,
                                              "target: our adjustment; both: COLMAP also finds the cameras in air, to be compared; "
                                              "colmap: COLMAP alone, for rigs without cameras under the glass")
                            ->check(CLI::IsMember({"target", "colmap", "both"}))->capture_default_str();
  CLI::Option* images = calibrate->add_option("--images", a->images,
                                              "Folder of pictures CAMERA/NUMBER.png or CAMERANUMBER.png instead of takes");
  CLI::Option* target = calibrate->add_option("--target", a->target,
                                              "What the pictures show: chessboard:COLUMNSxROWS:SQUARE (inner corners), such as chessboard:9x6:25mm, "
                                              "charuco:COLUMNSxROWS:SQUARE:MARKER[:DICTIONARY[:legacy]] (squares) or aprilgrid:COLUMNSxROWS:TAG:SPACING (tags)");
  CLI::Option* judge = calibrate->add_option("--judge", a->judge,
                                             "Another board in some of the pictures: its size must agree with --target's");
  judge->needs(images);
  images->needs(target)->excludes(sheet)->excludes(method);
  target->needs(images);
  AddGroundCommand(*calibrate, common, status);
  AddColmapCommands(*calibrate, common, status);
  CLI::App* check = calibrate->add_subcommand("check", "Scores a later take: which camera has moved since, and by how much");
  calibrate->callback([=, &common] {
    if (!calibrate->get_subcommands().empty()) return;
    if (a->takes.empty() == a->images.empty()) throw CLI::RequiredError("either TAKE or --images");
    if (a->out.empty()) throw CLI::RequiredError("--out");
    const ThreadCap cap(common.threads);
    print(a->images.empty() ? RunCalibrate(*a, {.threads = common.threads, .stop = StopOnInterrupt()}) : CalibrateImages(a->images, a->target, a->judge, a->out));
  });
  check->footer("Example: sole calibrate check takes/S017 --calibration rig-calibration.json\n"
                "         sole calibrate check takes/S017 --calibration rig-calibration.json --readjust --out new.json\n"
                "Status 1 if a camera moved and was not re-adjusted.");
  check->add_option("TAKE", a->take, "Any take of the same rig")->required();
  check->add_option("--calibration", a->calibration, "Calibration file")->required();
  CLI::Option* readjust = check->add_flag("--readjust", a->readjust, "Estimates the pose of the one camera that moved anew");
  CLI::Option* out = check->add_option("--out", a->out, "Calibration file to write with it");
  readjust->needs(out);
  out->needs(readjust);
  check->callback([=, &common, &status] {
    const ThreadCap cap(common.threads);
    const json account = RunCheck(*a);
    print(account);
    if (!account["moved"].empty() && !account.contains("readjusted")) status = 1;
  });
}

}  // namespace sole::app
