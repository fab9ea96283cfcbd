// Conversions between NpyArray and Eigen and std types.
#include <cmath>
#include <cstring>
#include <limits>

#include "core/error.h"
#include "io/npy_internal.h"
#include "io/npz.h"

namespace sole::io {
namespace {

template <typename T>
NpyArray FromVector(const char* dtype, const std::vector<T>& values) {
  NpyArray array{dtype, {values.size()}, std::vector<std::uint8_t>(values.size() * sizeof(T))};
  if (!values.empty()) std::memcpy(array.bytes.data(), values.data(), array.bytes.size());
  return array;
}

template <typename Matrix>
NpyArray FromMatrix(const char* dtype, const Matrix& matrix) {
  using T = typename Matrix::Scalar;
  const auto rows = static_cast<std::size_t>(matrix.rows()),
             cols = static_cast<std::size_t>(matrix.cols());
  NpyArray array{dtype, {rows, cols}, std::vector<std::uint8_t>(rows * cols * sizeof(T))};
  std::uint8_t* to = array.bytes.data();
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    for (Eigen::Index j = 0; j < matrix.cols(); ++j, to += sizeof(T)) {
      const T value = matrix(i, j);
      std::memcpy(to, &value, sizeof value);
    }
  }
  return array;
}

template <typename T>
double LoadAs(const std::uint8_t* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof value);
  return static_cast<double>(value);
}

using Loader = double (*)(const std::uint8_t*);

/// Null if the dtype is not numeric.
Loader LoaderOf(const std::string& dtype) {
  if (dtype == "<f8") return LoadAs<double>;
  if (dtype == "<f4") return LoadAs<float>;
  if (dtype == "|u1" || dtype == "|b1") return LoadAs<std::uint8_t>;
  if (dtype == "|i1") return LoadAs<std::int8_t>;
  if (dtype == "<i2") return LoadAs<std::int16_t>;
  if (dtype == "<u2") return LoadAs<std::uint16_t>;
  if (dtype == "<i4") return LoadAs<std::int32_t>;
  if (dtype == "<u4") return LoadAs<std::uint32_t>;
  if (dtype == "<i8") return LoadAs<std::int64_t>;
  if (dtype == "<u8") return LoadAs<std::uint64_t>;
  return nullptr;
}

const NpyArray& Find(const Npz& npz, const std::string& name) {
  const auto found = npz.find(name);
  Require(found != npz.end(),
          "array '" + name + "' is missing: the file was written by another program or version");
  return found->second;
}

void AppendUtf8(std::string& text, std::uint32_t c, const std::string& name) {
  Require(c <= 0x10ffff && (c < 0xd800 || c > 0xdfff),
          "array '" + name + "' holds text that is not Unicode: the file is damaged");
  const auto put = [&](std::uint32_t byte) {
    text += static_cast<char>(static_cast<unsigned char>(byte));
  };
  if (c < 0x80) {
    put(c);
  } else if (c < 0x800) {
    put(0xc0 | c >> 6);
    put(0x80 | (c & 0x3f));
  } else if (c < 0x10000) {
    put(0xe0 | c >> 12);
    put(0x80 | (c >> 6 & 0x3f));
    put(0x80 | (c & 0x3f));
  } else {
    put(0xf0 | c >> 18);
    put(0x80 | (c >> 12 & 0x3f));
    put(0x80 | (c >> 6 & 0x3f));
    put(0x80 | (c & 0x3f));
  }
}

/// UTF-8 to code points; a byte that is not UTF-8 becomes U+FFFD.
std::u32string Decode(const std::string& text) {
  std::u32string result;
  for (std::size_t i = 0; i < text.size();) {
    const auto byte = static_cast<unsigned char>(text[i]);
    const int more = byte < 0x80 ? 0 : byte >= 0xf0 && byte < 0xf5 ? 3 : byte >= 0xe0 ? 2 : 1;
    std::uint32_t c = more == 0 ? byte : byte & (0x3fU >> more);
    bool good = byte < 0x80 || (byte >= 0xc2 && byte < 0xf5);
    int taken = 0;
    while (good && taken < more) {
      const std::size_t at = i + 1 + static_cast<std::size_t>(taken);
      good = at < text.size() && (static_cast<unsigned char>(text[at]) & 0xc0) == 0x80;
      if (good) c = c << 6 | (static_cast<unsigned char>(text[at]) & 0x3fU), ++taken;
    }
    good = good && c <= 0x10ffff && (c < 0xd800 || c > 0xdfff);
    result += good ? static_cast<char32_t>(c) : U'\ufffd';
    i += good ? static_cast<std::size_t>(taken) + 1 : 1;
  }
  return result;
}

}  // namespace

NpyArray NpyFrom(const Eigen::Ref<const Eigen::MatrixXd>& matrix) {
  return FromMatrix("<f8", matrix);
}
NpyArray NpyFrom(const Eigen::Ref<const Eigen::MatrixXi>& matrix) {
  return FromMatrix("<i4", matrix);
}
NpyArray NpyFrom(const Eigen::Ref<const Eigen::MatrixXf>& matrix) {
  return FromMatrix("<f4", matrix);
}
NpyArray NpyFrom(const std::vector<double>& values) { return FromVector("<f8", values); }
NpyArray NpyFrom(const std::vector<float>& values) { return FromVector("<f4", values); }
NpyArray NpyFrom(const std::vector<int>& values) { return FromVector("<i4", values); }
NpyArray NpyFrom(const std::vector<std::int64_t>& values) { return FromVector("<i8", values); }
NpyArray NpyFrom(const std::vector<std::uint8_t>& values) { return FromVector("|u1", values); }

NpyArray NpyFrom(const std::string& text) {
  return Reshaped(NpyFrom(std::vector<std::string>{text}), {});
}

NpyArray NpyFrom(const std::vector<std::string>& texts) {
  std::vector<std::u32string> decoded;
  std::size_t longest = 1;
  for (const std::string& text : texts) {
    decoded.push_back(Decode(text));
    longest = std::max(longest, decoded.back().size());
  }
  NpyArray array{"<U" + std::to_string(longest),
                 {texts.size()},
                 std::vector<std::uint8_t>(4 * longest * texts.size())};
  for (std::size_t i = 0; i < decoded.size(); ++i) {
    if (!decoded[i].empty())
      std::memcpy(&array.bytes[4 * longest * i], decoded[i].data(), 4 * decoded[i].size());
  }
  return array;
}

NpyArray Reshaped(NpyArray array, std::vector<std::size_t> shape) {
  NpyArray result{std::move(array.dtype), std::move(shape), std::move(array.bytes)};
  Require(result.Count() * ItemSize(result.dtype) == result.bytes.size(),
          "an array of " + std::to_string(array.Count()) + " values does not take a shape of " +
              std::to_string(result.Count()));
  return result;
}

Eigen::MatrixXd MatrixFrom(const Npz& npz, const std::string& name) {
  const NpyArray& array = Find(npz, name);
  const Loader load = LoaderOf(array.dtype);
  Require(load != nullptr, "array '" + name + "' has dtype " + array.dtype + ", expected numbers");
  const std::size_t item = ItemSize(array.dtype);
  const std::size_t rows = array.shape.empty() ? 1 : array.shape[0];
  std::size_t cols = 1;
  for (std::size_t i = 1; i < array.shape.size(); ++i) cols *= array.shape[i];
  Eigen::MatrixXd matrix(static_cast<Eigen::Index>(rows), static_cast<Eigen::Index>(cols));
  const std::uint8_t* from = array.bytes.data();
  if (matrix.size() == 0) return matrix;
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    for (Eigen::Index j = 0; j < matrix.cols(); ++j, from += item) matrix(i, j) = load(from);
  }
  return matrix;
}

std::vector<int> IntsFrom(const Npz& npz, const std::string& name) {
  const NpyArray& array = Find(npz, name);
  const Loader load = LoaderOf(array.dtype);
  Require(load != nullptr, "array '" + name + "' has dtype " + array.dtype + ", expected integers");
  const std::size_t item = ItemSize(array.dtype);
  std::vector<int> values;
  for (std::size_t at = 0; at + item <= array.bytes.size(); at += item) {
    const double value = load(&array.bytes[at]);
    Require(value == std::floor(value) && std::abs(value) <= std::numeric_limits<int>::max(),
            "array '" + name + "' holds " + std::to_string(value) + ", expected integers");
    values.push_back(static_cast<int>(value));
  }
  return values;
}

std::string StringFrom(const Npz& npz, const std::string& name) {
  const std::vector<std::string> texts = StringsFrom(npz, name);
  Require(texts.size() == 1,
          "array '" + name + "' holds " + std::to_string(texts.size()) + " texts, expected one");
  return texts[0];
}

std::vector<std::string> StringsFrom(const Npz& npz, const std::string& name) {
  const NpyArray& array = Find(npz, name);
  Require(array.dtype.starts_with("<U"),
          "array '" + name + "' has dtype " + array.dtype + ", expected text");
  const std::size_t item = ItemSize(array.dtype);
  std::vector<std::string> texts;
  for (std::size_t at = 0; item > 0 && at + item <= array.bytes.size(); at += item) {
    std::string text;
    std::size_t end = item;
    const auto character = [&](std::size_t i) {
      std::uint32_t c;
      std::memcpy(&c, &array.bytes[at + i], 4);
      return c;
    };
    while (end > 0 && character(end - 4) == 0) end -= 4;
    for (std::size_t i = 0; i < end; i += 4) AppendUtf8(text, character(i), name);
    texts.push_back(text);
  }
  return texts;
}

const std::vector<std::size_t>& ShapeOf(const Npz& npz, const std::string& name) {
  return Find(npz, name).shape;
}

}  // namespace sole::io
