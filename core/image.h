#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace sole {

/// Row-major single-channel image; owns its pixels.
template <typename T>
struct Image {
  int width = 0;
  int height = 0;
  std::vector<T> pixels;

  Image() = default;
  Image(int w, int h, T fill = T{})
      : width(w), height(h), pixels(static_cast<std::size_t>(w) * static_cast<std::size_t>(h), fill) {}

  T& At(int x, int y) { return pixels[Index(x, y)]; }
  const T& At(int x, int y) const { return pixels[Index(x, y)]; }
  std::span<T> Row(int y) { return {&pixels[Index(0, y)], static_cast<std::size_t>(width)}; }
  std::span<const T> Row(int y) const { return {&pixels[Index(0, y)], static_cast<std::size_t>(width)}; }
  bool Empty() const { return pixels.empty(); }

 private:
  std::size_t Index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
  }
};

using ImageU8 = Image<std::uint8_t>;
using ImageF = Image<float>;

}  // namespace sole
