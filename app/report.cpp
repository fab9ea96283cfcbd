#include "app/report.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include <Eigen/Geometry>
#include <fmt/format.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "app/console.h"
#include "app/evaluate.h"
#include "app/picture.h"
#include "app/truth.h"
#include "core/error.h"
#include "io/atomic_file.h"
#include "io/mesh_file.h"
#include "io/take.h"
#include "model/contact_network.h"
#include "model/forward.h"
#include "model/surface_query.h"

namespace sole::app {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

std::string Base64(const std::string& bytes) {
  constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    unsigned value = 0;
    for (std::size_t k = 0; k < 3; ++k) value = value << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0u);
    for (std::size_t k = 0; k < 4; ++k) text += i + k <= bytes.size() ? kDigits[value >> (18 - 6 * k) & 63] : '=';
  }
  return text;
}

std::string Figure(const std::string& mime, const std::string& bytes, const std::string& caption) {
  return fmt::format("<figure><img alt=\"{0}\" src=\"data:{1};base64,{2}\"><figcaption>{0}</figcaption></figure>\n",
                     caption, mime, Base64(bytes));
}

std::string CameraFigure(const ImageU8& image, const std::string& serial) {
  const cv::Mat full(image.height, image.width, CV_8UC1, const_cast<std::uint8_t*>(image.pixels.data()));
  cv::Mat small;
  cv::resize(full, small, cv::Size(640, 640 * image.height / image.width), 0, 0, cv::INTER_AREA);
  std::vector<std::uint8_t> bytes;
  cv::imencode(".jpg", small, bytes, {cv::IMWRITE_JPEG_QUALITY, 85});
  return Figure("image/jpeg", std::string(bytes.begin(), bytes.end()), "camera " + serial);
}

/// Views every picture of the foot is drawn from, in the frame of a foot that walks along +y.
struct NamedView {
  const char* name;
  View view;
};
std::array<NamedView, 3> Views(Side side) {
  const double lateral = side == Side::kRight ? 1 : -1;
  return {{{"from above, medial side", {{0.55 * lateral, 0.25, -0.6}}},
           {"lateral side", {{-0.9 * lateral, -0.15, -0.3}}},
           {"sole", {{0, 0, 1}, Eigen::Vector3d::UnitY()}}}};
}

/// Renders through a temporary PNG and returns its bytes.
std::string PngBytes(const Picture& picture, const fs::path& folder) {
  const fs::path path = folder / ".picture.png";
  picture.WritePng(path);
  const std::string bytes = io::ReadFile(path);
  fs::remove(path);
  return bytes;
}

Eigen::AlignedBox3d BoxOf(const auto& points) {
  Eigen::AlignedBox3d box;
  for (const auto& p : points) box.extend(p.template cast<double>());
  return box;
}

/// The frame that shows most: of those with the foot the one that touches the glass most.
std::optional<std::size_t> ShownFrame(const FitSequence& fit, const io::ContactFile& contact) {
  std::optional<std::size_t> shown;
  double most = -1;
  for (std::size_t f = 0; f < fit.frames.size() && f < contact.contact.size(); ++f) {
    const double touches = contact.contact[f].probability.sum();
    if (!fit.frames[f].found || touches <= most) continue;
    most = touches;
    shown = f;
  }
  return shown;
}

/// Distance of every point to the true surface, metres; NaN beyond 10 mm or without truth.
std::vector<double> PointErrors(const PointCloud& cloud, const TriangleMesh& truth) {
  std::vector<double> errors;
  const model::SurfaceQuery query(truth);
  for (const Eigen::Vector3f& p : cloud.points_m) {
    const auto hit = query.Closest(p.cast<double>(), 0.01);
    errors.push_back(hit ? hit->distance_m : std::nan(""));
  }
  return errors;
}

std::string ScanFigures(const PointCloud& cloud, const TriangleMesh& truth, Side side, const fs::path& folder) {
  constexpr double kFullScale_m = 0.0001;
  std::vector<Colour> colours;
  for (const double error : PointErrors(cloud, truth)) colours.push_back(HeatColour(error / kFullScale_m));
  std::string html;
  const Eigen::AlignedBox3d box = BoxOf(cloud.points_m);
  if (box.isEmpty()) return "<p>No point.</p>\n";
  for (const NamedView& view : Views(side)) {
    Picture picture(480, 480, view.view, box.min(), box.max());
    picture.DrawPoints(cloud.points_m, colours);
    html += Figure("image/png", PngBytes(picture, folder), fmt::format("scan, {}: blue 0 to red 0.1 mm from the true surface", view.name));
  }
  return html;
}

/// Skin to red as contact, spread from the template's vertices to the fine ones, passes a half.
Colour ContactColour(double contact) {
  const double red = std::clamp(3 * (contact - 0.5) + 0.5, 0.0, 1.0);
  const auto mix = [&](double skin, double touching) { return static_cast<std::uint8_t>(std::lround(skin + red * (touching - skin))); };
  return {mix(224, 214), mix(190, 84), mix(168, 58)};
}

/// The registered surface and its contact.
std::string FitFigures(const ModelPair& models, const FrameFit& fit, const FrameContact& contact, const fs::path& folder) {
  const model::FootModel& model = fit.side == Side::kRight ? models.right : models.left;
  const bool fine = fit.registration_fine_m.rows() > 0 && !model.upsampling.empty();
  const TriangleMesh mesh = model::MeshOf(model, fine ? model::Variant::kFine : model::Variant::kCoarse,
                                          fine ? fit.registration_fine_m : fit.registration_m);
  std::vector<Colour> colours;
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    double touches = 0;
    for (const auto& [vertex, weight] : fine ? model.upsampling[v] : model::UpsamplingRow{{static_cast<int>(v), 1.0}}) {
      touches += weight * contact.contact[static_cast<std::size_t>(vertex)];
    }
    colours.push_back(ContactColour(touches));
  }
  std::string html;
  const Eigen::AlignedBox3d box = BoxOf(mesh.vertices);
  for (const NamedView& view : Views(fit.side)) {
    Picture picture(480, 480, view.view, box.min(), box.max());
    picture.DrawMesh(mesh, colours);
    html += Figure("image/png", PngBytes(picture, folder), fmt::format("fitted foot, {}: red touches the glass", view.name));
  }
  return html;
}

/// What the contact-conditioned network makes of contact: how far it moves the skin, in frames spread over the take.
std::string NetworkFigures(const ModelPair& models, const FitSequence& fit, const io::ContactFile& contact, const fs::path& folder) {
  constexpr double kFullScale_m = 0.004;
  constexpr std::size_t kPictures = 6;
  std::vector<std::size_t> touching;
  for (std::size_t f = 0; f < fit.frames.size() && f < contact.contact.size(); ++f) {
    if (fit.frames[f].found && contact.contact[f].probability.sum() > 1) touching.push_back(f);
  }
  std::string html;
  const std::size_t pictures = std::min(kPictures, touching.size());
  for (std::size_t i = 0; i < pictures; ++i) {
    const std::size_t f = touching[i * touching.size() / pictures];
    const FrameFit& frame = fit.frames[f];
    const model::FootModel& model = frame.side == Side::kRight ? models.right : models.left;
    const model::Variant variant = model.HasFine() ? model::Variant::kFine : model::Variant::kCoarse;
    const model::ModelParameters pose{frame.theta, fit.beta, frame.translation_m, contact.contact[f].probability};
    const Eigen::VectorXd moved = model::ContactOffsets(model, variant, pose.theta, pose.beta, pose.contact);
    const Eigen::VectorXd resting = model::ContactOffsets(model, variant, pose.theta, pose.beta, 0 * pose.contact);
    std::vector<Colour> colours;
    for (Eigen::Index v = 0; 3 * v < moved.size(); ++v) {
      colours.push_back(HeatColour((moved - resting).segment<3>(3 * v).norm() / kFullScale_m));
    }
    const TriangleMesh mesh = model::MeshOf(model, variant, Forward(model, pose, variant).vertices_m);
    const Eigen::AlignedBox3d box = BoxOf(mesh.vertices);
    Picture picture(240, 480, {{0, 0, 1}, {0, 1, 0}}, box.min(), box.max());
    picture.DrawMesh(mesh, colours);
    html += Figure("image/png", PngBytes(picture, folder), fmt::format("trigger {}, from below: moved by contact, blue 0 to red 4 mm", frame.trigger));
  }
  return html;
}

std::string Table(const json& summary) {
  std::string html = "<table>\n";
  for (const auto& [section, values] : summary.items()) {
    if (!values.is_object()) {
      html += fmt::format("<tr><th>{}</th><td></td><td>{}</td></tr>\n", section,
                          values.is_string() ? values.get<std::string>() : values.is_number() ? fmt::format("{:.1f}", values.get<double>()) : "&ndash;");
      continue;
    }
    for (const auto& [name, value] : values.items()) {
      const std::string text = value.is_null()           ? "&ndash;"
                               : value.is_number_float() ? fmt::format("{:.4g}", value.get<double>())
                                                         : value.dump();
      html += fmt::format("<tr><th>{}</th><td>{}</td><td>{}</td></tr>\n", section, name, text);
    }
  }
  return html + "</table>\n";
}

constexpr char kStyle[] =
    "body{font:15px/1.5 system-ui,sans-serif;max-width:1500px;margin:2em auto;padding:0 1em;color:#222}"
    "figure{display:inline-block;margin:4px;vertical-align:top}figure img{max-width:100%;display:block}"
    "figcaption{font-size:13px;color:#555;max-width:480px}table{border-collapse:collapse}"
    "th,td{text-align:left;padding:2px 14px 2px 0;border-bottom:1px solid #ddd;font-weight:normal}td:last-child{text-align:right;font-variant-numeric:tabular-nums}";

}  // namespace

void WriteReport(const fs::path& path, const fs::path& directory, const ModelPair& models, const json& summary) {
  const io::TakePaths take{directory};
  const io::TakeReader reader(directory, Log);
  const fs::path folder = path.parent_path().empty() ? fs::path(".") : path.parent_path();
  std::string html = fmt::format(
      "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><title>Sole report: {0}</title><style>{1}</style>"
      "</head><body><h1>Sole report: {0}</h1>\n",
      reader.Info().name, kStyle);
  std::string feet;
  Side side = Side::kRight;
  std::int64_t shown_trigger = reader.Triggers().empty() ? 0 : reader.Triggers()[0].trigger;
  for (int foot = 1; fs::exists(OfFoot(take.Fit(), foot)); ++foot) {
    const FitSequence fit = io::ReadFit(OfFoot(take.Fit(), foot));
    const io::ContactFile contact = io::ReadContact(OfFoot(take.Contact(), foot));
    if (const auto f = ShownFrame(fit, contact)) {
      if (foot == 1) {
        shown_trigger = fit.frames[*f].trigger;
        side = fit.frames[*f].side;
      }
      feet += fmt::format("<h2>The fitted foot{} and its contact, trigger {}</h2>\n", foot == 1 ? "" : fmt::format(" {}", foot),
                          fit.frames[*f].trigger) +
              FitFigures(models, fit.frames[*f], contact.contact[*f], folder);
    }
    if (!models.right.network.empty()) feet += "<h2>How contact deforms the sole</h2>\n" + NetworkFigures(models, fit, contact, folder);
  }
  for (std::size_t t = 0; t < reader.Triggers().size(); ++t) {
    if (reader.Triggers()[t].trigger != shown_trigger) continue;
    html += fmt::format("<h2>What the cameras saw, trigger {}</h2>\n", shown_trigger);
    const FrameSet set = reader.Read(t);
    for (std::size_t c = 0; c < set.images.size(); ++c) {
      if (set.images[c]) html += CameraFigure(*set.images[c], reader.Config().cameras[c].serial);
    }
  }
  if (fs::exists(take.Truth()) && fs::exists(take.Scan(shown_trigger))) {
    html += fmt::format("<h2>The scan, trigger {}</h2>\n", shown_trigger) +
            ScanFigures(io::ReadPlyCloud(take.Scan(shown_trigger)), io::ReadPlyMesh(take.TruthMesh(shown_trigger)), side, folder);
  }
  html += feet;
  html += "<h2>Figures against truth</h2>\n" + Table(summary) + "</body></html>\n";
  io::WriteStringAtomically(path, html);
}

}  // namespace sole::app
