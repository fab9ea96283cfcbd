#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>

#include <Eigen/Core>

#include "core/image.h"
#include "io/print_sheet.h"

namespace sole::calib::testing_support {

/// A picture of a printed page, of which `page_from_image` gives the place (m) of a pixel: 25
/// samples a pixel, so that edges are smooth.
inline ImageU8 Photograph(const io::PrintSheet& page, int width, int height,
                   const std::function<Eigen::Vector2d(const Eigen::Vector2d&)>& page_from_image) {
  // The page once, finely; a lookup a sample.
  constexpr double kCell = 0.00025;
  const int cols = static_cast<int>(page.width_m / kCell) + 1,
            rows = static_cast<int>(page.height_m / kCell) + 1;
  ImageU8 fine(cols, rows, 1);
  for (const io::PrintRect& r : page.rects) {
    for (int y = static_cast<int>(std::lround(r.y_m / kCell));
         y < static_cast<int>(std::lround((r.y_m + r.height_m) / kCell)); ++y) {
      for (int x = static_cast<int>(std::lround(r.x_m / kCell));
           x < static_cast<int>(std::lround((r.x_m + r.width_m) / kCell)); ++x)
        fine.At(x, y) = 0;
    }
  }
  ImageU8 image(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      int white = 0;
      for (int k = 0; k < 25; ++k) {
        const Eigen::Vector2d at = page_from_image(
            {x - 0.5 + (k % 5 + 0.5) / 5, y - 0.5 + (k / 5 + 0.5) / 5});
        const int u = static_cast<int>(std::floor(at.x() / kCell)),
                  v = static_cast<int>(std::floor(at.y() / kCell));
        white += u < 0 || v < 0 || u >= cols || v >= rows ? 0 : fine.At(u, v);
      }
      image.At(x, y) = static_cast<std::uint8_t>(30 + 180 * white / 25);
    }
  }
  return image;
}

}  // namespace sole::calib::testing_support
