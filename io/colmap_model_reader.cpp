#include <cmath>
#include <map>
#include <sstream>

#include "core/error.h"
#include "io/atomic_file.h"
#include "io/colmap_model.h"
#include "io/shown_internal.h"

namespace sole::io {
namespace {

namespace fs = std::filesystem;

/// Lines that are no comments, with their numbers.
struct Line {
  std::string where;
  std::string text;
};
std::vector<Line> ReadLines(const fs::path& path) {
  if (!fs::exists(path) && fs::exists(fs::path(path).replace_extension(".bin"))) {
    throw Error(path.parent_path().string() + ": is a binary COLMAP model: make it text with `colmap "
                "model_converter --output_type TXT`");
  }
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

Camera ParseCamera(const Line& line, long long& id) {
  std::istringstream words(line.text);
  Camera camera;
  std::string model;
  words >> id >> model >> camera.width >> camera.height;
  Require(!words.fail() && camera.width > 0 && camera.height > 0,
          line.where + ": is not a camera: id, model, width, height, parameters");
  camera.serial = std::to_string(id);
  const auto known = Models().find(model);
  Require(known != Models().end(), line.where + ": camera model " + Shown(model) +
                                       " is not known: convert it to OPENCV");
  for (const int place : known->second) {
    double value = 0;
    words >> value;
    Require(!words.fail() && std::isfinite(value), line.where + ": parameters are missing");
    Require(place >= 0 || value == 0,
            line.where + ": distortion beyond k3 is not known: convert it to OPENCV");
    if (place >= 0) camera.intrinsics[place] = value;
  }
  if (known->second[1] != 1) camera.intrinsics[1] = camera.intrinsics[0];
  Require(camera.intrinsics[0] > 0 && camera.intrinsics[1] > 0,
          line.where + ": the focal length must be positive");
  camera.intrinsics[2] -= 0.5;
  camera.intrinsics[3] -= 0.5;
  return camera;
}

/// An image and the ids of the points that its pixels see, -1 for none.
struct ReadImage {
  ColmapImage image;
  std::vector<long long> points;
  std::string where;
};

ReadImage ParseImage(const Line& line, const std::map<long long, int>& cameras, long long& id) {
  std::istringstream words(line.text);
  Eigen::Vector4d q;
  Eigen::Vector3d t;
  long long camera = 0;
  ReadImage read;
  words >> id >> q[0] >> q[1] >> q[2] >> q[3] >> t[0] >> t[1] >> t[2] >> camera >> read.image.name;
  Require(!words.fail() && q.allFinite() && t.allFinite() && std::abs(q.norm() - 1) < 0.01,
          line.where + ": is not an image: id, unit quaternion, translation, camera, name");
  const auto found = cameras.find(camera);
  Require(found != cameras.end(),
          line.where + ": camera " + std::to_string(camera) + " is not in cameras.txt");
  read.image.camera = found->second;
  read.image.cam_from_world.rotation = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized();
  read.image.cam_from_world.translation = t;
  return read;
}

void ParsePixels(const Line& line, ReadImage& read) {
  read.where = line.where;
  std::istringstream words(line.text);
  while (!(words >> std::ws).eof()) {
    ColmapPixel seen;
    long long point = 0;
    words >> seen.pixel.x() >> seen.pixel.y() >> point;
    Require(!words.fail() && seen.pixel.allFinite(),
            line.where + ": is not a list of x, y and point id");
    seen.pixel -= Eigen::Vector2d(0.5, 0.5);
    read.image.pixels.push_back(seen);
    read.points.push_back(point);
  }
}

/// Reads points3D.txt and connects pixels and points, which must name each other.
void ConnectPoints(const fs::path& path, std::map<long long, ReadImage>& images, ColmapModel& model) {
  struct ReadPoint {
    ColmapPoint point;
    Line line;
  };
  std::map<long long, ReadPoint> points;
  for (const Line& line : ReadLines(path)) {
    if (line.text.empty()) continue;
    std::istringstream words(line.text);
    long long id = 0;
    int red = 0, green = 0, blue = 0;
    double error = 0;
    ReadPoint read;
    Eigen::Vector3d& p = read.point.point_m;
    words >> id >> p.x() >> p.y() >> p.z() >> red >> green >> blue >> error;
    Require(!words.fail() && p.allFinite() && std::min({red, green, blue}) >= 0 &&
                std::max({red, green, blue}) <= 255,
            line.where + ": is not a point: id, x, y, z, red, green, blue, error, track");
    read.point.grey = (red + green + blue) / 3;
    std::string rest;
    std::getline(words, rest);
    read.line = {line.where, rest};
    Require(points.emplace(id, std::move(read)).second,
            line.where + ": point " + std::to_string(id) + " is there twice");
  }
  std::map<long long, int> index;
  std::map<long long, int> unnamed;  // pixels that no track has named yet, of each point
  for (const auto& [id, read] : points) {
    index[id] = static_cast<int>(model.points.size());
    model.points.push_back(read.point);
  }
  for (auto& [image_id, read] : images) {
    for (std::size_t k = 0; k < read.points.size(); ++k) {
      if (read.points[k] == -1) continue;
      const auto found = index.find(read.points[k]);
      Require(found != index.end(), read.where + ": point " + std::to_string(read.points[k]) +
                                        " is not in points3D.txt");
      read.image.pixels[k].point = found->second;
      ++unnamed[read.points[k]];
    }
  }
  for (const auto& [id, read] : points) {
    std::istringstream words(read.line.text);
    while (!(words >> std::ws).eof()) {
      long long image = 0, place = 0;
      words >> image >> place;
      const auto found = images.find(image);
      Require(!words.fail() && found != images.end() && place >= 0 &&
                  place < static_cast<long long>(found->second.points.size()) &&
                  found->second.points[static_cast<std::size_t>(place)] == id,
              read.line.where + ": images.txt does not see point " + std::to_string(id) +
                  " where its track says");
      --unnamed[id];
    }
    Require(unnamed[id] == 0, read.line.where + ": the track of point " + std::to_string(id) +
                                  " is not what images.txt sees of it");
  }
}

}  // namespace

ColmapModel ReadColmapModel(const fs::path& folder) {
  std::map<long long, Camera> cameras;
  for (const Line& line : ReadLines(folder / "cameras.txt")) {
    if (line.text.empty()) continue;
    long long id = 0;
    const Camera camera = ParseCamera(line, id);
    Require(cameras.emplace(id, camera).second,
            line.where + ": camera " + camera.serial + " is there twice");
  }
  ColmapModel model;
  std::map<long long, int> camera_index;
  for (const auto& [id, camera] : cameras) {
    camera_index[id] = static_cast<int>(model.cameras.size());
    model.cameras.push_back(camera);
  }
  std::map<long long, ReadImage> images;
  const std::vector<Line> lines = ReadLines(folder / "images.txt");
  for (std::size_t i = 0; i < lines.size(); i += 2) {  // every other line lists 2-D points
    if (lines[i].text.empty()) continue;
    long long id = 0;
    ReadImage read = ParseImage(lines[i], camera_index, id);
    if (i + 1 < lines.size()) ParsePixels(lines[i + 1], read);
    Require(images.emplace(id, std::move(read)).second,
            lines[i].where + ": image " + std::to_string(id) + " is there twice");
  }
  ConnectPoints(folder / "points3D.txt", images, model);
  for (auto& [id, read] : images) model.images.push_back(std::move(read.image));
  return model;
}

}  // namespace sole::io
