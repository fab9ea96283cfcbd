#include "sim/reference_codec.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <vector>

#include <zlib.h>

#include "core/error.h"

namespace sole::sim {
namespace {

constexpr char kMagic[9] = "SOLEFOOT";

/// Signed to unsigned, small magnitudes first; then four byte planes.
class PlaneWriter {
 public:
  void Add(std::int32_t value) {
    values_.push_back((static_cast<std::uint32_t>(value) << 1) ^ static_cast<std::uint32_t>(value >> 31));
  }
  std::string Bytes() const {
    std::string bytes;
    for (int plane = 0; plane < 4; ++plane) {
      for (const std::uint32_t v : values_) bytes.push_back(static_cast<char>(v >> (8 * plane) & 255));
    }
    return bytes;
  }

 private:
  std::vector<std::uint32_t> values_;
};

class PlaneReader {
 public:
  explicit PlaneReader(const std::string& bytes) : bytes_(bytes), count_(bytes.size() / 4) {}
  std::int32_t Next() {
    Require(index_ < count_, "reference foot: data end too early; rebuild the program");
    std::uint32_t v = 0;
    for (std::size_t plane = 0; plane < 4; ++plane) {
      v |= static_cast<std::uint32_t>(static_cast<std::uint8_t>(bytes_[plane * count_ + index_])) << (8 * plane);
    }
    ++index_;
    return static_cast<std::int32_t>(v >> 1) ^ -static_cast<std::int32_t>(v & 1);
  }

 private:
  const std::string& bytes_;
  std::size_t count_;
  std::size_t index_ = 0;
};

Eigen::Vector3i Quantised(const Eigen::Vector3d& point) {
  return ((point.array() - kReferenceLow) / kReferenceStep).round().cast<int>();
}

}  // namespace

std::string EncodeReference(const TriangleMesh& mesh) {
  PlaneWriter writer;
  Eigen::Vector3i last = Eigen::Vector3i::Zero();
  for (const Eigen::Vector3d& vertex : mesh.vertices) {
    const Eigen::Vector3i q = Quantised(vertex);
    for (int i = 0; i < 3; ++i) writer.Add(q[i] - last[i]);
    last = q;
  }
  std::vector<std::array<int, 3>> triangles;
  for (const Eigen::Vector3i& t : mesh.triangles) {
    const int first = t[0] < t[1] ? (t[0] < t[2] ? 0 : 2) : (t[1] < t[2] ? 1 : 2);
    triangles.push_back({t[first], t[(first + 1) % 3], t[(first + 2) % 3]});
  }
  std::sort(triangles.begin(), triangles.end());
  int previous = 0;
  for (const auto& t : triangles) {
    writer.Add(t[0] - previous);
    writer.Add(t[1] - t[0]);
    writer.Add(t[2] - t[0]);
    previous = t[0];
  }
  const std::string bytes = writer.Bytes();
  std::string packed(compressBound(bytes.size()), '\0');
  uLongf size = packed.size();
  compress2(reinterpret_cast<Bytef*>(packed.data()), &size, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size(), 9);
  packed.resize(size);
  const std::array<std::uint32_t, 2> counts = {static_cast<std::uint32_t>(mesh.vertices.size()),
                                               static_cast<std::uint32_t>(mesh.triangles.size())};
  std::string file(kMagic, 8);
  file.append(reinterpret_cast<const char*>(counts.data()), sizeof(counts));
  return file + packed;
}

TriangleMesh DecodeReference(std::string_view bytes) {
  Require(bytes.size() > 16 && bytes.substr(0, 8) == kMagic, "reference foot: wrong magic; rebuild the program");
  std::array<std::uint32_t, 2> counts{};
  std::memcpy(counts.data(), bytes.data() + 8, sizeof(counts));
  const std::size_t unpacked = (static_cast<std::size_t>(counts[0]) + counts[1]) * 12;
  constexpr std::size_t kLargestRatio = 1032;  // deflate packs no tighter, so a larger claim is damage
  Require(unpacked <= kLargestRatio * bytes.size(), "reference foot: impossible size; rebuild the program");
  std::string planes(unpacked, '\0');
  uLongf size = planes.size();
  const int status = uncompress(reinterpret_cast<Bytef*>(planes.data()), &size,
                                reinterpret_cast<const Bytef*>(bytes.data() + 16), bytes.size() - 16);
  Require(status == Z_OK && size == planes.size(), "reference foot: damaged data; rebuild the program");
  PlaneReader reader(planes);
  TriangleMesh mesh;
  Eigen::Vector3i q = Eigen::Vector3i::Zero();
  for (std::uint32_t v = 0; v < counts[0]; ++v) {
    for (int i = 0; i < 3; ++i) q[i] += reader.Next();
    mesh.vertices.push_back(kReferenceStep * q.cast<double>() + Eigen::Vector3d::Constant(kReferenceLow));
  }
  int first = 0;
  for (std::uint32_t t = 0; t < counts[1]; ++t) {
    first += reader.Next();
    const int b = first + reader.Next(), c = first + reader.Next();
    const auto known = [&](int index) { return index >= 0 && index < static_cast<int>(counts[0]); };
    Require(known(first) && known(b) && known(c), "reference foot: a triangle without vertices; rebuild the program");
    mesh.triangles.emplace_back(first, b, c);
  }
  return mesh;
}

}  // namespace sole::sim
