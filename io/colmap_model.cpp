#include "io/colmap_model.h"

#include <fmt/format.h>

#include <cmath>
#include <map>
#include <sstream>

#include "core/error.h"
#include "io/atomic_file.h"

namespace sole::io {
namespace {

namespace fs = std::filesystem;

std::string CameraLine(std::size_t id, const Camera& camera) {
  const Intrinsics& k = camera.intrinsics;
  const bool pinhole = k.tail<5>().isZero(0);
  std::string line =
      fmt::format("{} {} {} {} {} {} {} {}", id, pinhole ? "PINHOLE" : "FULL_OPENCV", camera.width,
                  camera.height, k[0], k[1], k[2] + 0.5, k[3] + 0.5);
  if (!pinhole) line += fmt::format(" {} {} {} {} {} 0 0 0", k[4], k[5], k[6], k[7], k[8]);
  return line + "\n";
}

std::string ImageLines(std::size_t id, const ColmapView& view, const std::string& pixels) {
  const Eigen::Quaterniond& q = view.camera.cam_from_world.rotation;
  const Eigen::Vector3d& t = view.camera.cam_from_world.translation;
  return fmt::format("{} {} {} {} {} {} {} {} {} {}\n{}\n", id, q.w(), q.x(), q.y(), q.z(), t.x(),
                     t.y(), t.z(), id, view.image, pixels);
}

/// Lines that are no comments, with their numbers.
struct Line {
  std::string where;
  std::string text;
};
std::vector<Line> ReadLines(const fs::path& path) {
  std::istringstream stream(ReadFile(path));
  std::vector<Line> lines;
  std::string text;
  for (int number = 1; std::getline(stream, text); ++number) {
    if (!text.empty() && text.back() == '\r') text.pop_back();
    if (text.starts_with('#')) continue;
    lines.push_back({path.string() + ":" + std::to_string(number), text});
  }
  return lines;
}

/// Positions of a model's parameters in [fx fy cx cy k1 k2 p1 p2 k3]; -1: must be zero.
const std::map<std::string, std::vector<int>>& Models() {
  static const std::map<std::string, std::vector<int>> models{
      {"SIMPLE_PINHOLE", {0, 2, 3}},
      {"PINHOLE", {0, 1, 2, 3}},
      {"SIMPLE_RADIAL", {0, 2, 3, 4}},
      {"RADIAL", {0, 2, 3, 4, 5}},
      {"OPENCV", {0, 1, 2, 3, 4, 5, 6, 7}},
      {"FULL_OPENCV", {0, 1, 2, 3, 4, 5, 6, 7, 8, -1, -1, -1}}};
  return models;
}

Camera ParseCamera(const Line& line) {
  std::istringstream words(line.text);
  Camera camera;
  std::string model;
  words >> camera.serial >> model >> camera.width >> camera.height;
  Require(!words.fail() && camera.width > 0 && camera.height > 0,
          line.where + ": is not a camera: id, model, width, height, parameters");
  const auto known = Models().find(model);
  Require(known != Models().end(),
          line.where + ": camera model " + model + " is not known: convert it to OPENCV");
  for (const int place : known->second) {
    double value = 0;
    words >> value;
    Require(!words.fail() && std::isfinite(value), line.where + ": parameters are missing");
    Require(place >= 0 || value == 0,
            line.where + ": distortion beyond k3 is not known: convert it to OPENCV");
    if (place >= 0) camera.intrinsics[place] = value;
  }
  if (known->second[1] != 1) camera.intrinsics[1] = camera.intrinsics[0];
  camera.intrinsics[2] -= 0.5;
  camera.intrinsics[3] -= 0.5;
  return camera;
}

}  // namespace

void WriteColmapModel(const fs::path& folder, const std::vector<ColmapView>& views,
                      const std::vector<ColmapPoint>& points) {
  std::string cloud = "# POINT3D_ID X Y Z R G B ERROR TRACK (IMAGE_ID POINT2D_INDEX ...), metres\n";
  std::vector<std::string> pixels(views.size());
  std::vector<int> counts(views.size(), 0);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const ColmapPoint& p = points[i];
    cloud += fmt::format("{} {} {} {} {} {} {} 0", i + 1, p.point_m.x(), p.point_m.y(),
                         p.point_m.z(), p.grey, p.grey, p.grey);
    for (const ColmapPoint::Observation& seen : p.seen) {
      Require(seen.view >= 0 && seen.view < static_cast<int>(views.size()),
              folder.string() + ": a point is seen by a view that the model does not have");
      const auto view = static_cast<std::size_t>(seen.view);
      cloud += fmt::format(" {} {}", view + 1, counts[view]++);
      pixels[view] += fmt::format("{}{} {} {}", pixels[view].empty() ? "" : " ",
                                  seen.pixel.x() + 0.5, seen.pixel.y() + 0.5, i + 1);
    }
    cloud += '\n';
  }
  std::string cameras = "# CAMERA_ID MODEL WIDTH HEIGHT PARAMS\n";
  std::string images =
      "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, metres; next line: X Y POINT3D_ID ...\n";
  for (std::size_t i = 0; i < views.size(); ++i) {
    const std::string& name = views[i].image;
    Require(!name.empty() && name.find_first_of(" \t\r\n") == std::string::npos,
            folder.string() + ": COLMAP's text models know no image name '" + name +
                "': use one without spaces");
    cameras += CameraLine(i + 1, views[i].camera);
    images += ImageLines(i + 1, views[i], pixels[i]);
  }
  MakeDirectory(folder);
  WriteStringAtomically(folder / "cameras.txt", cameras);
  WriteStringAtomically(folder / "images.txt", images);
  WriteStringAtomically(folder / "points3D.txt", cloud);
}

std::vector<ColmapView> ReadColmapModel(const fs::path& folder) {
  std::map<std::string, Camera> cameras;
  for (const Line& line : ReadLines(folder / "cameras.txt")) {
    if (line.text.empty()) continue;
    const Camera camera = ParseCamera(line);
    Require(cameras.emplace(camera.serial, camera).second,
            line.where + ": camera " + camera.serial + " is there twice");
  }
  std::map<long, ColmapView> views;
  const std::vector<Line> lines = ReadLines(folder / "images.txt");
  for (std::size_t i = 0; i < lines.size(); i += 2) {  // every other line lists 2-D points
    if (lines[i].text.empty()) continue;
    std::istringstream words(lines[i].text);
    long id = 0;
    Eigen::Vector4d q;
    Eigen::Vector3d t;
    ColmapView view;
    std::string camera;
    words >> id >> q[0] >> q[1] >> q[2] >> q[3] >> t[0] >> t[1] >> t[2] >> camera >> view.image;
    Require(!words.fail() && q.allFinite() && t.allFinite() && std::abs(q.norm() - 1) < 0.01,
            lines[i].where + ": is not an image: id, unit quaternion, translation, camera, name");
    const auto found = cameras.find(camera);
    Require(found != cameras.end(), lines[i].where + ": camera " + camera + " is not in cameras.txt");
    view.camera = found->second;
    view.camera.cam_from_world.rotation = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized();
    view.camera.cam_from_world.translation = t;
    Require(views.emplace(id, view).second,
            lines[i].where + ": image " + std::to_string(id) + " is there twice");
  }
  std::vector<ColmapView> result;
  for (auto& [id, view] : views) result.push_back(std::move(view));
  return result;
}

}  // namespace sole::io
