#include "app/calibration_report.h"

#include <cmath>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "calib/summary.h"
#include "io/atomic_file.h"

namespace sole::app {
namespace {

std::string Escaped(const std::string& text) {
  std::string html;
  for (const char c : text) {
    if (c == '<') html += "&lt;";
    else if (c == '>') html += "&gt;";
    else if (c == '&') html += "&amp;";
    else html += c;
  }
  return html;
}

std::string Number(double value, const char* format) {
  return std::isfinite(value) ? fmt::format(fmt::runtime(format), value) : "not seen";
}

std::string List(const std::vector<std::string>& lines) {
  std::string html = "<ul>";
  for (const std::string& line : lines) html += "<li>" + Escaped(line) + "</li>";
  return html + "</ul>\n";
}

std::string Row(const std::vector<std::string>& cells, const char* kind = "td") {
  std::string html = "<tr>";
  for (const std::string& cell : cells) html += fmt::format("<{0}>{1}</{0}>", kind, cell);
  return html + "</tr>\n";
}

/// The nine parts of the image, darker where there are more corners, red where there is none.
std::string CoverageGrid(const std::array<int, 9>& counts) {
  std::string svg = "<svg width=\"48\" height=\"36\">";
  for (std::size_t i = 0; i < counts.size(); ++i) {
    const std::string fill = counts[i] == 0 ? "#e33" : fmt::format("rgba(20,90,160,{:.2f})", std::min(1.0, 0.2 + counts[i] / 100.0));
    svg += fmt::format("<rect x=\"{}\" y=\"{}\" width=\"15\" height=\"11\" fill=\"{}\"><title>{} corners</title></rect>",
                       16 * (i % 3), 12 * (i / 3), fill, counts[i]);
  }
  return svg + "</svg>";
}

std::string Cameras(const Calibration& calibration, const calib::TakeObservations& observations) {
  const std::vector<calib::CameraSigmas> sigmas = calib::Sigmas(calibration);
  const CalibrationStats& stats = calibration.stats;
  std::string html = "<table>" + Row({"camera", "corners", "residual, px", "coverage", "sd of centre, mm", "sd of direction, deg",
                                      "sd of focal length, px", "sd of principal point, px"}, "th");
  for (std::size_t c = 0; c < calibration.rig.cameras.size(); ++c) {
    const Camera& camera = calibration.rig.cameras[c];
    const calib::CameraSigmas s = c < sigmas.size() ? sigmas[c] : calib::CameraSigmas{NAN, NAN, NAN, NAN};
    html += Row({Escaped(camera.serial), c < stats.camera_corners.size() ? std::to_string(stats.camera_corners[c]) : "",
                 c < stats.camera_rms_px.size() ? Number(stats.camera_rms_px[c], "{:.4f}") : "",
                 CoverageGrid(calib::Coverage(observations, c, camera.width, camera.height)), Number(s.centre_mm, "{:.3f}"),
                 Number(s.direction_deg, "{:.4f}"), Number(s.focal_px, "{:.2f}"), Number(s.principal_px, "{:.2f}")});
  }
  return html + "</table>\n";
}

std::string CrossCheck(const ColmapCheck& check) {
  const auto& [colmap, agreement] = check;
  std::string html = fmt::format(
      "<h2>Cross-check by COLMAP</h2><p>COLMAP found the {} cameras in air anew from nominal lenses: {} of {} images placed, RMS "
      "{:.4f} px, its target {:.4f} mm from the known one. Laid onto this calibration, centres agree to {:.3f} mm RMS, directions to "
      "{:.4f} degrees, and both see the target {:.4f} px apart; its scale, taken from the target, differs by {:+.4f} %.</p>",
      agreement.cameras.size(), colmap.images_placed, colmap.images, colmap.reprojection_rms_px, colmap.target_rms_mm,
      agreement.centre_rms_mm, agreement.direction_rms_deg, agreement.view_rms_px, 100 * (agreement.scale - 1));
  html += "<table>" + Row({"camera", "centre, mm", "direction, deg", "focal length, px", "view, px", "residual, px", ""}, "th");
  for (std::size_t i = 0; i < agreement.cameras.size(); ++i) {
    const calib::CameraAgreement& c = agreement.cameras[i];
    html += Row({Escaped(c.serial), Number(c.centre_mm, "{:.3f}"), Number(c.direction_deg, "{:.4f}"), Number(c.focal_px, "{:+.2f}"),
                 Number(c.view_px, "{:.4f}"), Number(colmap.camera_rms_px[i], "{:.4f}"),
                 c.agrees ? "agrees" : "<b class=\"bad\">disagrees</b>"});
  }
  return html + "</table>\n";
}

std::string Ground(const GroundSurface& ground) {
  double low = 0, high = 0, sum = 0;
  for (std::size_t i = 0; i < ground.residual_m.size(); ++i) {
    const auto node = static_cast<int>(i);
    const Eigen::Vector2d place =
        ground.first_node_m + ground.spacing_m * Eigen::Vector2d(node % ground.nodes_x, node / ground.nodes_x);
    const double height = 1000 * HeightAt(ground, place);
    low = i == 0 ? height : std::min(low, height);
    high = i == 0 ? height : std::max(high, height);
    sum += height / static_cast<double>(ground.residual_m.size());
  }
  return "<h2>Ground surface</h2><p>The glass top as the contact sheet showed it, in the frame that the fiducials give.</p><table>" +
         Row({"height, mean, mm", Number(sum, "{:+.4f}")}) + Row({"lowest", Number(low, "{:+.4f}")}) +
         Row({"highest", Number(high, "{:+.4f}")}) + Row({"single points off the surface, RMS", Number(1000 * ground.rms_m, "{:.4f}")}) +
         Row({"points", std::to_string(ground.points)}) +
         Row({"fiducials beside the sheet", std::to_string(ground.marks.size())}) + "</table>\n";
}

}  // namespace

void WriteCalibrationReport(const std::filesystem::path& path, const Calibration& calibration,
                            const calib::TakeObservations& observations, const ColmapCheck* check) {
  const CalibrationStats& s = calibration.stats;
  const Rig& rig = calibration.rig;
  std::string html =
      "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>Calibration</title><style>"
      "body{font:15px/1.4 sans-serif;max-width:60em;margin:2em auto;padding:0 1em}table{border-collapse:collapse}"
      "td,th{border:1px solid #bbb;padding:.2em .6em;text-align:right}td:first-child,th:first-child{text-align:left}"
      ".ok{color:#161}.bad{color:#a11}</style>\n<h1>Calibration</h1>\n";
  html += s.failures.empty() ? "<h2 class=\"ok\">PASSES</h2>\n" : "<h2 class=\"bad\">FAILS</h2>\n" + List(s.failures);
  html += fmt::format("<p>{}; rig {}; {} poses adjusted, {} held out; plate {:.3f} mm, index {}.</p>\n", Escaped(calibration.created),
                      Escaped(rig.rig_hash), s.poses_used, s.poses_heldout, 1000 * rig.plate.thickness_m, rig.plate.index);
  html += "<h2>Held-out poses, millimetres</h2><table>" +
          Row({"distances above the plate, RMS", Number(s.heldout_rms_air_mm, "{:.4f}")}) +
          Row({"distances through the plate, RMS", Number(s.heldout_rms_glass_mm, "{:.4f}")}) +
          Row({"distances from above to below, RMS", Number(s.heldout_rms_across_mm, "{:.4f}")}) +
          Row({"largest single distance error", Number(s.heldout_max_mm, "{:.4f}")}) +
          Row({"fiducials off the glass top, RMS", Number(s.ground_rms_mm, "{:.4f}")}) +
          Row({"points rejected", fmt::format("{} of {}", s.heldout_rejected, s.heldout_points)}) + "</table>\n";
  html += "<h2>Pairs</h2><p>Where each pair alone sees the held-out target, against all cameras together.</p><table>" +
          Row({"pair", "displaced, mm", "epipolar miss, px"}, "th");
  for (std::size_t p = 0; p < rig.pairs.size() && p < s.pair_offset_mm.size(); ++p) {
    html += Row({Escaped(rig.pairs[p].name), Number(s.pair_offset_mm[p], "{:.4f}"), Number(s.pair_epipolar_px[p], "{:.4f}")});
  }
  html += "</table>\n" + fmt::format("<h2>Cameras</h2><p>Reprojection RMS {:.4f} px.</p>", s.reprojection_rms_px) +
          Cameras(calibration, observations);
  if (check) html += CrossCheck(*check);
  if (calibration.ground) html += Ground(*calibration.ground);
  if (calibration.covariance.size() > 0) {
    const Eigen::Index last = calibration.covariance.rows() - 1;
    html += fmt::format("<p>Standard deviation of the plate's thickness: {:.3f} mm (index kept from the data sheet).</p>\n",
                        1000 * std::sqrt(calibration.covariance(last, last)));
  }
  const std::vector<std::string> correlations = calib::StrongCorrelations(calibration), advice = calib::Advice(rig, observations);
  html += "<h2>Strong correlations</h2>" + (correlations.empty() ? "<p>None above 0.95.</p>" : List(correlations));
  html += "<h2>What to do next</h2>" + (advice.empty() ? "<p>Nothing.</p>" : List(advice)) + "</html>\n";
  io::WriteStringAtomically(path, html);
}

}  // namespace sole::app
