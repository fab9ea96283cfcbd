#include "io/colmap_maps.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <sstream>

#include "core/error.h"
#include "io/atomic_file.h"
#include "io/image_file.h"

namespace sole::io {
namespace {

namespace fs = std::filesystem;

/// "width&height&channels&", then one plane of little-endian floats after the other.
struct Planes {
  std::size_t width = 0, height = 0, channels = 0;
  std::vector<float> values;
};

void Write(const fs::path& path, const Planes& planes) {
  static_assert(std::endian::native == std::endian::little);
  Require(planes.values.size() == planes.width * planes.height * planes.channels &&
              !planes.values.empty(),
          path.string() + ": the map's values do not fill its " + std::to_string(planes.width) +
              " x " + std::to_string(planes.height) + " pixels");
  std::string content = std::to_string(planes.width) + "&" + std::to_string(planes.height) + "&" +
                        std::to_string(planes.channels) + "&";
  const std::size_t start = content.size();
  content.resize(start + 4 * planes.values.size());
  std::memcpy(content.data() + start, planes.values.data(), 4 * planes.values.size());
  WriteStringAtomically(path, content);
}

Planes Read(const fs::path& path, std::size_t channels) {
  const std::string content = ReadFile(path);
  std::istringstream header(content.substr(0, 64));
  Planes planes;
  std::array<char, 3> separators{};
  header >> planes.width >> separators[0] >> planes.height >> separators[1] >> planes.channels >>
      separators[2];
  Require(header.good() && separators == std::array<char, 3>{'&', '&', '&'} && planes.width > 0 &&
              planes.height > 0 && planes.width <= 65536 && planes.height <= 65536 &&
              planes.channels == channels,
          path.string() + ": is not a COLMAP map with " + std::to_string(channels) +
              " channels (width&height&channels&)");
  const auto start = static_cast<std::size_t>(header.tellg());
  const std::size_t count = planes.width * planes.height * channels;
  Require(content.size() == start + 4 * count,
          path.string() + ": is " + std::to_string(content.size()) +
              " bytes long, its header asks for " + std::to_string(start + 4 * count) +
              ": the file is damaged");
  planes.values.resize(count);
  std::memcpy(planes.values.data(), content.data() + start, 4 * count);
  return planes;
}

/// stereo_fusion takes pixel (0, 0) of a map at image position (0, 0), where COLMAP's models have the
/// corner of the first pixel, not its centre. The models of workspaces are moved to agree.
const Eigen::Vector2d kHalfPixel(0.5, 0.5);

/// Adds about a thousand of the points, where the views see them.
void AddTracks(const std::vector<ColmapDenseView>& views, const PointCloud& cloud, ColmapModel& model) {
  constexpr std::size_t kPoints = 1000;
  constexpr double kAgreement = 0.005;  // of the depth
  for (std::size_t i = 0; i < cloud.Size(); i += std::max<std::size_t>(1, cloud.Size() / kPoints)) {
    ColmapPoint point{cloud.points_m[i].cast<double>(), 128};
    if (!cloud.intensity.empty())
      point.grey = static_cast<int>(std::clamp(cloud.intensity[i], 0.0F, 255.0F));
    std::vector<std::pair<std::size_t, Eigen::Vector2d>> seen;
    for (std::size_t v = 0; v < views.size(); ++v) {
      const Camera& camera = views[v].view.camera;
      const Eigen::Vector3d p = camera.cam_from_world * point.point_m;
      if (!(p.z() > 0)) continue;
      const Eigen::Vector2d px = PixelFromPointInCam<double>(camera.intrinsics.data(), p);
      const Eigen::Vector2d nearest = px.array().round();
      if (!(nearest.minCoeff() >= 0 && nearest.x() < camera.width && nearest.y() < camera.height))
        continue;
      const auto depth = static_cast<double>(views[v].depth_m.At(
          static_cast<int>(nearest.x()), static_cast<int>(nearest.y())));
      if (std::abs(depth - p.z()) < kAgreement * p.z()) seen.emplace_back(v, px - kHalfPixel);
    }
    if (seen.size() < 2) continue;
    for (const auto& [v, pixel] : seen)
      model.images[v].pixels.push_back({pixel, static_cast<int>(model.points.size())});
    model.points.push_back(point);
  }
}

}  // namespace

void WriteColmapDepthMap(const fs::path& path, const ImageF& depth_m) {
  Write(path, {static_cast<std::size_t>(depth_m.width), static_cast<std::size_t>(depth_m.height), 1,
               depth_m.pixels});
}

ImageF ReadColmapDepthMap(const fs::path& path) {
  Planes planes = Read(path, 1);
  ImageF depth;
  depth.width = static_cast<int>(planes.width);
  depth.height = static_cast<int>(planes.height);
  depth.pixels = std::move(planes.values);
  return depth;
}

void WriteColmapNormalMap(const fs::path& path, int width, int height,
                          const std::vector<Eigen::Vector3f>& normals) {
  Planes planes{static_cast<std::size_t>(width), static_cast<std::size_t>(height), 3, {}};
  planes.values.reserve(3 * normals.size());
  for (int axis = 0; axis < 3; ++axis) {
    for (const Eigen::Vector3f& normal : normals) planes.values.push_back(normal[axis]);
  }
  Write(path, planes);
}

std::vector<Eigen::Vector3f> ReadColmapNormalMap(const fs::path& path, int& width, int& height) {
  const Planes planes = Read(path, 3);
  width = static_cast<int>(planes.width);
  height = static_cast<int>(planes.height);
  const std::size_t count = planes.width * planes.height;
  std::vector<Eigen::Vector3f> normals(count);
  for (std::size_t i = 0; i < count; ++i) {
    normals[i] = {planes.values[i], planes.values[count + i], planes.values[2 * count + i]};
  }
  return normals;
}

void WriteColmapWorkspace(const fs::path& folder, const std::vector<ColmapDenseView>& views,
                          const PointCloud& points) {
  std::vector<ColmapView> pinholes;
  std::string names;
  for (const ColmapDenseView& dense : views) {
    const Camera& camera = dense.view.camera;
    Require(camera.intrinsics.tail<5>().isZero(0) && dense.grey.width == camera.width &&
                dense.grey.height == camera.height && dense.depth_m.width == camera.width &&
                dense.depth_m.height == camera.height,
            folder.string() + ": the views of a dense workspace are pinholes with maps of their "
                              "image's size");
    pinholes.push_back(dense.view);
    pinholes.back().camera.intrinsics.segment<2>(2) -= kHalfPixel;
    names += dense.view.image + "\n";
  }
  ColmapModel model = ModelOfViews(pinholes);
  AddTracks(views, points, model);
  WriteColmapModel(folder / "sparse", model);
  const fs::path depths = folder / "stereo" / "depth_maps", normals = folder / "stereo" / "normal_maps";
  for (const fs::path& sub : {folder / "images", depths, normals}) MakeDirectory(sub);
  for (const ColmapDenseView& dense : views) {
    const std::string& name = dense.view.image;
    WriteImage(folder / "images" / name, dense.grey);
    WriteColmapDepthMap(depths / (name + ".geometric.bin"), dense.depth_m);
    WriteColmapNormalMap(normals / (name + ".geometric.bin"), dense.depth_m.width,
                         dense.depth_m.height, dense.normals);
  }
  WriteStringAtomically(folder / "stereo" / "fusion.cfg", names);
}

}  // namespace sole::io
