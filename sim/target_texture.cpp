#include "sim/target_texture.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include <opencv2/aruco/dictionary.hpp>

#include "core/error.h"

namespace sole::sim {
namespace {

constexpr int kBits = 5;   // without the border
constexpr int kCells = 7;  // with it

using Cells = std::array<std::uint8_t, kCells * kCells>;

std::vector<Cells> ReadDictionary() {
  const auto dictionary = cv::aruco::getPredefinedDictionary(cv::aruco::DICT_5X5_250);
  std::vector<Cells> markers;
  for (int id = 0; id < dictionary->bytesList.rows; ++id) {
    const cv::Mat bits =
        cv::aruco::Dictionary::getBitsFromByteList(dictionary->bytesList.row(id), kBits);
    Cells cells{};
    for (int y = 0; y < kBits; ++y) {
      for (int x = 0; x < kBits; ++x) {
        cells[static_cast<std::size_t>((y + 1) * kCells + x + 1)] = bits.at<std::uint8_t>(y, x);
      }
    }
    markers.push_back(cells);
  }
  return markers;
}

}  // namespace

bool MarkerIsWhite(int id, double u, double v) {
  static const std::vector<Cells> markers = ReadDictionary();
  Require(id >= 0 && id < static_cast<int>(markers.size()),
          "marker " + std::to_string(id) + ": the dictionary DICT_5X5_250 has ids 0 to 249");
  if (!(u >= 0 && u < 1 && v >= 0 && v < 1)) return false;
  const int x = static_cast<int>(u * kCells), y = static_cast<int>(v * kCells);
  return markers[static_cast<std::size_t>(id)][static_cast<std::size_t>(y * kCells + x)] != 0;
}

float AlbedoOnBoard(const CharucoFace& face, double x, double y) {
  const double sx = x / face.square_m, sy = y / face.square_m;
  if (!(sx >= 0 && sx < face.squares_x && sy >= 0 && sy < face.squares_y)) return kWhiteAlbedo;
  const int column = static_cast<int>(sx), row = static_cast<int>(sy);
  if ((column + row) % 2 == 0) return kBlackAlbedo;
  const double margin = 0.5 * (1 - face.marker_m / face.square_m);
  const double u = (sx - column - margin) / (1 - 2 * margin),
               v = (sy - row - margin) / (1 - 2 * margin);
  if (!(u >= 0 && u < 1 && v >= 0 && v < 1)) return kWhiteAlbedo;
  // White squares are counted row by row: square (column, row) is number (row * squares_x + column)
  // / 2.
  const int id = face.first_id + (row * face.squares_x + column) / 2;
  return MarkerIsWhite(id, u, v) ? kWhiteAlbedo : kBlackAlbedo;
}

double FiducialPatchHalf(const Fiducial& fiducial) {
  return fiducial.size_m * (0.5 + kQuietCells / kCells);
}

float AlbedoOnFiducial(const Fiducial& fiducial, double x, double y) {
  const double dx = x - fiducial.centre_m.x(), dy = y - fiducial.centre_m.y();
  const double half = FiducialPatchHalf(fiducial);
  if (std::abs(dx) > half || std::abs(dy) > half) return -1;
  const double u = dx / fiducial.size_m + 0.5, v = 0.5 - dy / fiducial.size_m;
  if (!(u >= 0 && u < 1 && v >= 0 && v < 1)) return kWhiteAlbedo;
  return MarkerIsWhite(fiducial.id, u, v) ? kWhiteAlbedo : kBlackAlbedo;
}

}  // namespace sole::sim
