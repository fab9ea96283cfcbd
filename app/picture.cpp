#include "app/picture.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Geometry>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/error.h"
#include "io/atomic_file.h"

namespace sole::app {
namespace {
constexpr int kSuper = 2;  // samples per pixel and axis
constexpr Colour kBackground{245, 245, 242};
}  // namespace

Picture::Picture(int width, int height, const View& view, const Eigen::Vector3d& low, const Eigen::Vector3d& high)
    : width_(kSuper * width),
      height_(kSuper * height),
      depth_(static_cast<std::size_t>(width_ * height_), std::numeric_limits<float>::infinity()),
      pixels_(static_cast<std::size_t>(width_ * height_), kBackground) {
  const Eigen::Vector3d forward = view.direction.normalized();
  const Eigen::Vector3d right = forward.cross(view.up).normalized();
  screen_from_world_.row(0) = right;
  screen_from_world_.row(1) = forward.cross(right);
  screen_from_world_.row(2) = forward;
  Eigen::AlignedBox2d box;
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3d p(corner & 1 ? high.x() : low.x(), corner & 2 ? high.y() : low.y(),
                            corner & 4 ? high.z() : low.z());
    box.extend((screen_from_world_ * p).head<2>());
  }
  scale_ = 0.96 * std::min(width_ / box.sizes().x(), height_ / box.sizes().y());
  offset_ = Eigen::Vector2d(0.5 * width_, 0.5 * height_) - scale_ * box.center();
}

Eigen::Vector3d Picture::ToScreen(const Eigen::Vector3d& point) const {
  const Eigen::Vector3d p = screen_from_world_ * point;
  return {scale_ * p.x() + offset_.x(), scale_ * p.y() + offset_.y(), p.z()};
}

void Picture::Put(int x, int y, double depth, const Colour& colour) {
  if (x < 0 || y < 0 || x >= width_ || y >= height_) return;
  const auto index = static_cast<std::size_t>(y * width_ + x);
  if (static_cast<float>(depth) >= depth_[index]) return;
  depth_[index] = static_cast<float>(depth);
  pixels_[index] = colour;
}

void Picture::DrawMesh(const TriangleMesh& mesh, const std::vector<Colour>& colours) {
  const std::vector<Eigen::Vector3d> normals = VertexNormals(mesh);
  const Eigen::Vector3d light =
      (-screen_from_world_.row(2) - 0.4 * screen_from_world_.row(1) - 0.3 * screen_from_world_.row(0)).normalized();
  const auto shade = [&](std::size_t v) {
    return 0.35 + 0.65 * std::max(0.0, normals[v].dot(light));
  };
  for (const Eigen::Vector3i& t : mesh.triangles) {
    Eigen::Vector3d s[3];
    Eigen::Vector3d rgb[3];
    for (int k = 0; k < 3; ++k) {
      const auto v = static_cast<std::size_t>(t[k]);
      s[k] = ToScreen(mesh.vertices[v]);
      const Colour& c = colours.size() == 1 ? colours[0] : colours[v];
      rgb[k] = shade(v) * Eigen::Vector3d(c[0], c[1], c[2]);
    }
    const double area = (s[1] - s[0]).head<2>().x() * (s[2] - s[0]).y() - (s[1] - s[0]).y() * (s[2] - s[0]).x();
    if (!(std::abs(area) > 1e-12)) continue;
    const int x0 = static_cast<int>(std::floor(std::min({s[0].x(), s[1].x(), s[2].x()})));
    const int x1 = static_cast<int>(std::ceil(std::max({s[0].x(), s[1].x(), s[2].x()})));
    const int y0 = static_cast<int>(std::floor(std::min({s[0].y(), s[1].y(), s[2].y()})));
    const int y1 = static_cast<int>(std::ceil(std::max({s[0].y(), s[1].y(), s[2].y()})));
    for (int y = std::max(0, y0); y <= std::min(height_ - 1, y1); ++y) {
      for (int x = std::max(0, x0); x <= std::min(width_ - 1, x1); ++x) {
        const double b1 = ((x - s[0].x()) * (s[2].y() - s[0].y()) - (y - s[0].y()) * (s[2].x() - s[0].x())) / area;
        const double b2 = ((s[1].x() - s[0].x()) * (y - s[0].y()) - (s[1].y() - s[0].y()) * (x - s[0].x())) / area;
        const double b0 = 1 - b1 - b2;
        if (b0 < -1e-9 || b1 < -1e-9 || b2 < -1e-9) continue;
        const Eigen::Vector3d c = b0 * rgb[0] + b1 * rgb[1] + b2 * rgb[2];
        Put(x, y, b0 * s[0].z() + b1 * s[1].z() + b2 * s[2].z(),
            {static_cast<std::uint8_t>(std::min(255.0, c[0])), static_cast<std::uint8_t>(std::min(255.0, c[1])),
             static_cast<std::uint8_t>(std::min(255.0, c[2]))});
      }
    }
  }
}

void Picture::DrawPoints(const std::vector<Eigen::Vector3f>& points, const std::vector<Colour>& colours,
                         int size_px) {
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d s = ToScreen(points[i].cast<double>());
    const Colour& colour = colours.size() == 1 ? colours[0] : colours[i];
    const int x = static_cast<int>(std::lround(s.x())), y = static_cast<int>(std::lround(s.y()));
    for (int dy = -size_px / 2; dy <= size_px / 2; ++dy) {
      for (int dx = -size_px / 2; dx <= size_px / 2; ++dx) Put(x + dx, y + dy, s.z(), colour);
    }
  }
}

std::vector<std::uint8_t> Picture::Pixels() const {
  cv::Mat image(height_, width_, CV_8UC3, const_cast<Colour*>(pixels_.data())), small;
  cv::resize(image, small, {}, 1.0 / kSuper, 1.0 / kSuper, cv::INTER_AREA);
  return {small.data, small.data + small.total() * 3};
}

void Picture::WritePng(const std::filesystem::path& path) const {
  std::vector<std::uint8_t> pixels = Pixels(), bytes;
  cv::Mat image(height_ / kSuper, width_ / kSuper, CV_8UC3, pixels.data());
  cv::cvtColor(image, image, cv::COLOR_RGB2BGR);
  Require(cv::imencode(".png", image, bytes), "cannot encode " + path.string());
  io::WriteStringAtomically(path, std::string(bytes.begin(), bytes.end()));
}

Colour HeatColour(double value) {
  if (!std::isfinite(value)) return {160, 160, 160};
  const double v = std::clamp(value, 0.0, 1.0);
  const auto channel = [](double x) {
    return static_cast<std::uint8_t>(std::lround(255 * std::clamp(x, 0.0, 1.0)));
  };
  return {channel(1.5 - std::abs(4 * v - 3)), channel(1.5 - std::abs(4 * v - 2)), channel(1.5 - std::abs(4 * v - 1))};
}

}  // namespace sole::app
