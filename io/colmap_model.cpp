#include "io/colmap_model.h"

#include <fmt/format.h>

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

std::string ImageLines(std::size_t id, const ColmapImage& image) {
  const Eigen::Quaterniond& q = image.cam_from_world.rotation;
  const Eigen::Vector3d& t = image.cam_from_world.translation;
  std::string lines = fmt::format("{} {} {} {} {} {} {} {} {} {}\n", id, q.w(), q.x(), q.y(), q.z(),
                                  t.x(), t.y(), t.z(), image.camera + 1, image.name);
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    const ColmapPixel& seen = image.pixels[i];
    lines += fmt::format("{}{} {} {}", i == 0 ? "" : " ", seen.pixel.x() + 0.5,
                         seen.pixel.y() + 0.5, seen.point < 0 ? -1 : seen.point + 1);
  }
  return lines + "\n";
}

}  // namespace

ColmapModel ModelOfViews(const std::vector<ColmapView>& views) {
  ColmapModel model;
  for (const ColmapView& view : views) {
    model.images.push_back(
        {view.image, static_cast<int>(model.cameras.size()), view.camera.cam_from_world, {}});
    model.cameras.push_back(view.camera);
  }
  return model;
}

std::vector<ColmapView> ViewsOf(const ColmapModel& model) {
  std::vector<ColmapView> views;
  for (const ColmapImage& image : model.images) {
    views.push_back({model.cameras.at(static_cast<std::size_t>(image.camera)), image.name});
    views.back().camera.cam_from_world = image.cam_from_world;
  }
  return views;
}

void WriteColmapModel(const fs::path& folder, const ColmapModel& model) {
  std::string cameras = "# CAMERA_ID MODEL WIDTH HEIGHT PARAMS\n";
  for (std::size_t c = 0; c < model.cameras.size(); ++c)
    cameras += CameraLine(c + 1, model.cameras[c]);
  std::string images =
      "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, metres; next line: X Y POINT3D_ID ...\n";
  std::vector<std::string> tracks(model.points.size());
  for (std::size_t i = 0; i < model.images.size(); ++i) {
    const ColmapImage& image = model.images[i];
    Require(!image.name.empty() && image.name.find_first_of(" \t\r\n") == std::string::npos,
            folder.string() + ": COLMAP's text models know no image name '" + image.name +
                "': use one without spaces");
    Require(image.camera >= 0 && image.camera < static_cast<int>(model.cameras.size()),
            folder.string() + ": image " + image.name + " is of a camera that the model does not have");
    images += ImageLines(i + 1, image);
    for (std::size_t k = 0; k < image.pixels.size(); ++k) {
      const int point = image.pixels[k].point;
      if (point < 0) continue;
      Require(point < static_cast<int>(tracks.size()),
              folder.string() + ": image " + image.name + " sees a point that the model does not have");
      tracks[static_cast<std::size_t>(point)] += fmt::format(" {} {}", i + 1, k);
    }
  }
  std::string points = "# POINT3D_ID X Y Z R G B ERROR TRACK (IMAGE_ID POINT2D_INDEX ...), metres\n";
  for (std::size_t i = 0; i < model.points.size(); ++i) {
    const Eigen::Vector3d& p = model.points[i].point_m;
    const int grey = model.points[i].grey;
    points += fmt::format("{} {} {} {} {} {} {} 0{}\n", i + 1, p.x(), p.y(), p.z(), grey, grey, grey,
                          tracks[i]);
  }
  MakeDirectory(folder);
  WriteStringAtomically(folder / "cameras.txt", cameras);
  WriteStringAtomically(folder / "images.txt", images);
  WriteStringAtomically(folder / "points3D.txt", points);
}

}  // namespace sole::io
