#include "io/scan_file.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <limits>
#include <numeric>
#include <string>
#include <string_view>

#include "core/error.h"
#include "io/atomic_file.h"
#include "io/bytes_internal.h"
#include "io/ply_internal.h"
#include "io/shown_internal.h"

namespace sole::io {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kStlHeader = 84, kStlTriangle = 50;

/// Takes a text apart, line by line and word by word.
class Words {
 public:
  Words(std::string_view text, std::string path) : text_(text), path_(std::move(path)) {}

  /// False at the end of the text.
  bool NextLine() {
    if (at_ >= text_.size()) return false;
    const std::size_t end = std::min(text_.find('\n', at_), text_.size());
    line_ = text_.substr(at_, end - at_);
    at_ = end + 1;
    ++number_;
    return true;
  }
  /// Empty at the end of the line.
  std::string_view NextWord() {
    const auto space = [](char c) { return std::isspace(static_cast<unsigned char>(c)) != 0; };
    while (!line_.empty() && space(line_.front())) line_.remove_prefix(1);
    std::size_t length = 0;
    while (length < line_.size() && !space(line_[length])) ++length;
    const std::string_view word = line_.substr(0, length);
    line_.remove_prefix(length);
    return word;
  }
  Eigen::Vector3d NextPoint() {
    Eigen::Vector3d point;
    for (int i = 0; i < 3; ++i) point[i] = Number(NextWord());
    return point;
  }
  double Number(std::string_view word) const {
    if (word.starts_with('+')) word.remove_prefix(1);
    double value = 0;
    const auto [end, code] = std::from_chars(word.data(), word.data() + word.size(), value);
    Require(!word.empty() && end == word.data() + word.size() && code != std::errc::invalid_argument,
            Where() + ": '" + Shown(word) + "' is not a number");
    // Beyond a double's range.
    return code == std::errc() ? value : std::numeric_limits<double>::quiet_NaN();
  }
  std::string Where() const { return path_ + ":" + std::to_string(number_); }

 private:
  std::string_view text_, line_;
  std::string path_;
  std::size_t at_ = 0;
  int number_ = 0;
};

/// Vertex of an OBJ face's corner "7", "7/1/3", "7//3" or "-1" (counted from the last one), from 0.
int CornerOf(std::string_view word, std::size_t vertices, const Words& words) {
  const std::string_view digits = word.substr(0, word.find('/'));
  long long number = 0;
  const auto [end, code] = std::from_chars(digits.data(), digits.data() + digits.size(), number);
  Require(code == std::errc() && end == digits.data() + digits.size(),
          words.Where() + ": '" + Shown(word) + "' is no corner of a face");
  const auto count = static_cast<long long>(vertices);
  const long long index = number < 0 ? count + number : number - 1;
  Require(index >= 0 && index < count, words.Where() + ": a face names vertex " + std::to_string(number) +
                                           " of " + std::to_string(count));
  return static_cast<int>(index);
}

ScanFile ParseObj(const std::string& file, const std::string& path) {
  Words words(file, path);
  ScanFile scan;
  TriangleMesh& mesh = scan.mesh;
  while (words.NextLine()) {
    const std::string_view what = words.NextWord();
    if (what == "v") {
      mesh.vertices.push_back(words.NextPoint());
    } else if (what == "vn") {
      scan.normals.push_back(words.NextPoint());
    } else if (what == "f") {
      std::vector<int> corners;
      for (std::string_view word = words.NextWord(); !word.empty(); word = words.NextWord())
        corners.push_back(CornerOf(word, mesh.vertices.size(), words));
      for (std::size_t i = 2; i < corners.size(); ++i)
        mesh.triangles.emplace_back(corners[0], corners[i - 1], corners[i]);
    }
  }
  // Faces may pair normals with vertices in any way; of points alone the first normal is the first point's.
  if (!mesh.triangles.empty() || scan.normals.size() != mesh.vertices.size()) scan.normals.clear();
  return scan;
}

/// A mesh of triangles that repeat their corners: equal corners become one vertex.
TriangleMesh Welded(const std::vector<std::array<Eigen::Vector3d, 3>>& triangles) {
  std::vector<std::size_t> order(3 * triangles.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto corner = [&](std::size_t i) -> const Eigen::Vector3d& { return triangles[i / 3][i % 3]; };
  // NaN must not break the order: it sorts behind everything, and equals nothing.
  const auto key = [](double value) {
    return value == value ? value : std::numeric_limits<double>::infinity();
  };
  const auto before = [&](std::size_t a, std::size_t b) {
    for (int k = 0; k < 3; ++k) {
      const double first = key(corner(a)[k]), second = key(corner(b)[k]);
      if (first != second) return first < second;
    }
    return a < b;
  };
  std::sort(order.begin(), order.end(), before);
  TriangleMesh mesh;
  std::vector<int> vertex(order.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    if (i == 0 || corner(order[i]) != corner(order[i - 1])) mesh.vertices.push_back(corner(order[i]));
    vertex[order[i]] = static_cast<int>(mesh.vertices.size()) - 1;
  }
  for (std::size_t t = 0; t < triangles.size(); ++t)
    mesh.triangles.emplace_back(vertex[3 * t], vertex[3 * t + 1], vertex[3 * t + 2]);
  return mesh;
}

ScanFile ParseTextStl(const std::string& file, const std::string& path) {
  Words words(file, path);
  std::vector<std::array<Eigen::Vector3d, 3>> triangles;
  std::size_t corners = 0;
  while (words.NextLine()) {
    const std::string_view what = words.NextWord();
    if (what == "outer" || what == "endloop") {
      Require(corners == 0 || corners == 3, words.Where() + ": a triangle has " + std::to_string(corners) + " corners");
      corners = 0;
    } else if (what == "vertex") {
      Require(corners < 3, words.Where() + ": a triangle has more than 3 corners");
      if (corners == 0) triangles.emplace_back();
      triangles.back()[corners++] = words.NextPoint();
    }
  }
  Require(corners == 0, path + ": the last triangle is cut short");
  return {Welded(triangles), {}};
}

ScanFile ParseBinaryStl(const std::string& file, const std::string& path) {
  Require(file.size() >= kStlHeader, path + ": is no STL file: it is shorter than the header");
  const std::size_t count = LoadLittle<std::uint32_t>(file.data(), 80);
  Require(count <= (file.size() - kStlHeader) / kStlTriangle,
          path + ": claims " + std::to_string(count) +
              " triangles, more than the file can hold: it is damaged or cut short");
  std::vector<std::array<Eigen::Vector3d, 3>> triangles(count);
  for (std::size_t t = 0; t < count; ++t) {
    for (std::size_t k = 0; k < 9; ++k) {
      const std::size_t at = kStlHeader + t * kStlTriangle + 12 + 4 * k;
      triangles[t][k / 3][static_cast<Eigen::Index>(k % 3)] = LoadLittle<float>(file.data(), at);
    }
  }
  return {Welded(triangles), {}};
}

ScanFile ParseStl(const std::string& file, const std::string& path) {
  // Some binary files begin with the text's "solid", too: their size tells.
  const bool sizes_fit =
      file.size() >= kStlHeader &&
      file.size() == kStlHeader + kStlTriangle * std::size_t{LoadLittle<std::uint32_t>(file.data(), 80)};
  return file.starts_with("solid") && !sizes_fit ? ParseTextStl(file, path) : ParseBinaryStl(file, path);
}

ScanFile ParseScanPly(const std::string& file, const std::string& path) {
  const PlyContent content = ParsePly(file, {"x", "y", "z", "nx", "ny", "nz"}, true, path);
  const auto triples = [&](const std::array<const char*, 3>& names) {
    std::vector<Eigen::Vector3d> result;
    for (int k = 0; k < 3; ++k) {
      const std::vector<double>* column = content.Find(names[static_cast<std::size_t>(k)]);
      if (!column) return std::vector<Eigen::Vector3d>();
      result.resize(content.vertices);
      for (std::size_t i = 0; i < content.vertices; ++i) result[i][k] = (*column)[i];
    }
    return result;
  };
  ScanFile scan;
  scan.mesh.vertices = triples({"x", "y", "z"});
  scan.normals = triples({"nx", "ny", "nz"});
  const auto count = static_cast<long long>(scan.mesh.vertices.size());
  for (const std::vector<long long>& face : content.faces) {
    for (const long long index : face) {
      Require(index >= 0 && index < count,
              path + ": a face names vertex " + std::to_string(index) + " of " + std::to_string(count));
    }
    for (std::size_t i = 2; i < face.size(); ++i) {
      scan.mesh.triangles.emplace_back(static_cast<int>(face[0]), static_cast<int>(face[i - 1]),
                                       static_cast<int>(face[i]));
    }
  }
  return scan;
}

}  // namespace

ScanFile ReadScanFile(const fs::path& path) {
  std::string ending = path.extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  Require(ending == ".ply" || ending == ".obj" || ending == ".stl",
          path.string() + ": scans are read from .ply, .obj and .stl files");
  const std::string file = ReadFile(path);
  // Indices are ints; a vertex takes six bytes at least.
  Require(file.size() / 6 < static_cast<std::size_t>(std::numeric_limits<int>::max()),
          path.string() + ": is too large");
  ScanFile scan = ending == ".ply"   ? ParseScanPly(file, path.string())
                  : ending == ".obj" ? ParseObj(file, path.string())
                                     : ParseStl(file, path.string());
  Require(!scan.mesh.vertices.empty(), path.string() + ": holds no vertices");
  return scan;
}

}  // namespace sole::io
