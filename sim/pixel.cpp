#include <algorithm>
#include <array>
#include <limits>

#include <tbb/blocked_range2d.h>
#include <tbb/parallel_for.h>

#include "sim/renderer_internal.h"

namespace sole::sim {
namespace {

using Eigen::Vector2d;

/// Sixteen points of a pixel, each alone in its sixteenth of the width and of the height; the first
/// four likewise in quarters. Times of a moving pixel's rays, unlike both.
struct SamplePoints {
  std::array<Vector2d, 4> few;
  std::array<Vector2d, 16> many;
  std::array<float, 16> times;
  SamplePoints() {
    few = {Vector2d(-0.375, -0.125), Vector2d(-0.125, 0.375), Vector2d(0.125, -0.375),
           Vector2d(0.375, 0.125)};
    for (int i = 0; i < 16; ++i) {
      const auto k = static_cast<std::size_t>(i);
      many[k] = {(i + 0.5) / 16 - 0.5, ((i * 5 + 2) % 16 + 0.5) / 16 - 0.5};
      times[k] = (static_cast<float>((i * 7 + 4) % 16) + 0.5f) / 16;
    }
  }
};

class PixelPainter {
 public:
  PixelPainter(const Renderer::State& renderer, const PathTracer& tracer, const TrueCamera& camera,
               const Shutter& shutter)
      : renderer_(renderer), tracer_(tracer), rays_(camera), shutter_(shutter) {}

  /// Mean radiance of a pixel where something can be seen: four rays; then the mean of the print,
  /// or sixteen rays where the four differ at a hard edge or things move.
  float Pixel(int x, int y, unsigned content) const;
  /// Fills a block of nothing but background: evenly from a few rays if these agree, else with a
  /// ray per pixel (lamps, the plate's edge).
  void FillBackground(int x0, int y0, int x1, int y1, ImageF& radiance) const;

 private:
  float Skin(const Sample& sample) const;
  float MeanAlbedo(const std::array<Sample, 4>& samples) const;

  const Renderer::State& renderer_;
  const PathTracer& tracer_;
  PixelRays rays_;
  Shutter shutter_;
  SamplePoints points_;
};

/// Radiance with the texture of skin.
float PixelPainter::Skin(const Sample& sample) const {
  if (sample.surface < kFirstMeshSurface) return sample.Radiance();
  return SkinTexture(sample.material) * sample.albedo * sample.light + sample.extra;
}

/// Mean albedo over a pixel that lies on one printed surface, from where four rays of the pixel met
/// it: within a pixel the image of a plane is affine to 1e-6. Far finer than rays, so that edges
/// stand where they are. Negative if the pixel reaches the surface's edge.
float PixelPainter::MeanAlbedo(const std::array<Sample, 4>& samples) const {
  Vector2d centre = Vector2d::Zero();
  Eigen::Matrix2d print_from_pixel = Eigen::Matrix2d::Zero();
  for (std::size_t i = 0; i < 4; ++i) {
    centre += 0.25 * samples[i].print;
    print_from_pixel += samples[i].print * points_.few[i].transpose() /
                        0.3125;  // sum of offset * offset' = 0.3125 I
  }
  const int surface = samples[0].surface;
  float low = 2, high = -1;
  for (int i = 0; i < 9;
       ++i) {  // cells are far wider than pixels: nothing hides between these points
    const float albedo = PrintedAlbedo(renderer_, surface,
                                       centre + print_from_pixel * Vector2d(i % 3 - 1, i / 3 - 1));
    low = std::min(low, albedo);
    high = std::max(high, albedo);
  }
  if (low < 0 || low == high) return low;
  constexpr int kSide = 12;
  float sum = 0;
  for (int i = 0; i < kSide * kSide; ++i) {
    const Vector2d offset((i % kSide + 0.5) / kSide - 0.5, (i / kSide + 0.5) / kSide - 0.5);
    sum += PrintedAlbedo(renderer_, surface, centre + print_from_pixel * offset);
  }
  return sum / (kSide * kSide);
}

float PixelPainter::Pixel(int x, int y, unsigned content) const {
  const PixelRays::Around rays = rays_.Near(Vector2d(x, y));
  const auto many = [&] {
    float sum = 0;
    for (std::size_t i = 0; i < 16; ++i) {
      const float time = shutter_.open + points_.times[i] * (shutter_.close - shutter_.open);
      sum += Skin(tracer_.Trace(rays.At(points_.many[i]), content, time));
    }
    return sum / 16;
  };
  if (content & kMoving) return many();
  std::array<LightRay, 4> few;
  for (std::size_t i = 0; i < 4; ++i) few[i] = rays.At(points_.few[i]);
  const std::array<Sample, 4> samples = tracer_.TraceFour(few, content);
  float light = 0, extra = 0, diffuse = 0;
  bool one_surface = true, one_place = true;
  for (std::size_t i = 0; i < 4; ++i) {
    constexpr float kPlace_m = 0.002f;  // texture of skin is coarser than pixels, not than this
    one_surface = one_surface && samples[i].surface == samples[0].surface;
    one_place = one_place &&
                (samples[i].material - samples[0].material).squaredNorm() < kPlace_m * kPlace_m;
    light += 0.25f * samples[i].light;
    extra += 0.25f * samples[i].extra;
    diffuse += 0.25f * samples[i].albedo * samples[i].light;
  }
  const int surface = samples[0].surface;
  if (one_surface && surface >= kFirstMeshSurface && one_place) {
    const Eigen::Vector3f place = 0.25f * (samples[0].material + samples[1].material +
                                           samples[2].material + samples[3].material);
    return SkinTexture(place) * diffuse + extra;
  }
  if (one_surface && surface < 0) {
    const float albedo = MeanAlbedo(samples);
    if (albedo >= 0) return albedo * light + extra;
  }
  float mean = 0, low = std::numeric_limits<float>::infinity(), high = -low;
  for (const Sample& sample : samples) {
    const float radiance = Skin(sample);
    mean += 0.25f * radiance;
    low = std::min(low, radiance);
    high = std::max(high, radiance);
  }
  const bool soft = one_surface && surface >= 0 && surface != kDustSurface;
  return soft || high - low < 0.02f ? mean : many();
}

void PixelPainter::FillBackground(int x0, int y0, int x1, int y1, ImageF& radiance) const {
  float low = std::numeric_limits<float>::infinity(), high = -low;
  for (int i = 0; i < 9; ++i) {
    const Vector2d pixel(x0 - 0.5 + 0.5 * (i % 3) * kBlock, y0 - 0.5 + 0.5 * (i / 3) * kBlock);
    const float value = tracer_.Trace(rays_.At(pixel), kNothing).Radiance();
    low = std::min(low, value);
    high = std::max(high, value);
  }
  const bool even = high - low < 1e-4f;
  for (int y = y0; y < y1; ++y) {
    for (int x = x0; x < x1; ++x) {
      radiance.At(x, y) = even ? 0.5f * (low + high)
                               : tracer_.Trace(rays_.At(Vector2d(x, y)), kNothing).Radiance();
    }
  }
}

}  // namespace

void TraceBlocks(const Renderer::State& renderer, const PreparedScene::State& scene,
                 const SceneView& view, const TrueCamera& camera, const Shutter& shutter,
                 unsigned wanted, ImageF& radiance) {
  const PathTracer tracer(renderer, scene, view);
  const PixelPainter painter(renderer, tracer, camera, shutter);
  tbb::parallel_for(
      tbb::blocked_range2d<int>(0, view.blocks.height, 2, 0, view.blocks.width, 16),
      [&](const auto& range) {
        for (int by = range.rows().begin(); by < range.rows().end(); ++by) {
          for (int bx = range.cols().begin(); bx < range.cols().end(); ++bx) {
            const unsigned content = view.blocks.At(bx, by);
            if (wanted != kAllBlocks && (content & wanted) == 0) continue;
            const int x0 = bx * kBlock, x1 = std::min(x0 + kBlock, camera.width);
            const int y0 = by * kBlock, y1 = std::min(y0 + kBlock, camera.height);
            if (content == kNothing) {
              painter.FillBackground(x0, y0, x1, y1, radiance);
              continue;
            }
            for (int y = y0; y < y1; ++y) {
              for (int x = x0; x < x1; ++x) radiance.At(x, y) = painter.Pixel(x, y, content);
            }
          }
        }
      });
}

}  // namespace sole::sim
