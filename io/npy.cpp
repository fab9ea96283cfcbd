#include <cctype>
#include <charconv>
#include <limits>
#include <optional>
#include <string_view>

#include "core/error.h"
#include "io/bytes_internal.h"
#include "io/npy_internal.h"
#include "io/shown_internal.h"

namespace sole::io {
namespace {

constexpr std::string_view kMagic = "\x93NUMPY";
constexpr std::size_t kMaxCharacters = 1 << 20;  ///< of one string

/// Reads the Python dictionary of a .npy header: strings, True, False and tuples of integers.
class HeaderParser {
 public:
  HeaderParser(std::string_view text, const std::string& where) : text_(text), where_(where) {}

  NpyHeader Parse() {
    NpyHeader header;
    int seen = 0;
    Expect('{');
    while (!Accept('}')) {
      const std::string key = String();
      Expect(':');
      if (key == "descr") {
        Skip();
        Require(
            at_ < text_.size() && (text_[at_] == '\'' || text_[at_] == '"'),
            where_ + ": structured arrays are not read: save each field as an array of its own");
        header.descr = String();
      } else if (key == "fortran_order") {
        header.fortran = Bool();
      } else if (key == "shape") {
        header.shape = Tuple();
      } else {
        Fail();
      }
      ++seen;
      if (!Accept(',')) {
        Expect('}');
        break;
      }
    }
    if (seen != 3 || header.descr.empty()) Fail();
    return header;
  }

 private:
  [[noreturn]] void Fail() const {
    throw Error(where_ + ": damaged npy header: write the file again");
  }
  void Skip() {
    while (at_ < text_.size() && std::isspace(static_cast<unsigned char>(text_[at_]))) ++at_;
  }
  bool Accept(char c) {
    Skip();
    if (at_ >= text_.size() || text_[at_] != c) return false;
    ++at_;
    return true;
  }
  void Expect(char c) {
    if (!Accept(c)) Fail();
  }
  std::string String() {
    Skip();
    if (at_ >= text_.size() || (text_[at_] != '\'' && text_[at_] != '"')) Fail();
    const std::size_t end = text_.find(text_[at_], at_ + 1);
    if (end == std::string_view::npos) Fail();
    std::string result(text_.substr(at_ + 1, end - at_ - 1));
    at_ = end + 1;
    return result;
  }
  bool Bool() {
    Skip();
    for (const bool value : {true, false}) {
      const std::string_view word = value ? "True" : "False";
      if (text_.substr(at_).starts_with(word)) {
        at_ += word.size();
        return value;
      }
    }
    Fail();
  }
  std::vector<std::size_t> Tuple() {
    std::vector<std::size_t> values;
    Expect('(');
    while (!Accept(')')) {
      Skip();
      std::size_t value = 0;
      const char* begin = text_.data() + at_;
      const auto [end, code] = std::from_chars(begin, text_.data() + text_.size(), value);
      if (code != std::errc() || values.size() == 32) Fail();
      at_ += static_cast<std::size_t>(end - begin);
      values.push_back(value);
      if (!Accept(',')) {
        Expect(')');
        break;
      }
    }
    return values;
  }

  std::string_view text_;
  std::string where_;
  std::size_t at_ = 0;
};

/// Number of elements; empty if it cannot be that of a real array. Bounds empty arrays too, so that
/// nobody who loops over the other dimensions runs for ever.
std::optional<std::size_t> CheckedCount(const std::vector<std::size_t>& shape, std::size_t limit) {
  std::size_t nonzero = 1;
  bool empty = false;
  for (const std::size_t n : shape) {
    empty = empty || n == 0;
    if (n != 0 && nonzero > std::numeric_limits<std::uint32_t>::max()) return {};
    if (n != 0 && n > std::numeric_limits<std::size_t>::max() / nonzero) return {};
    if (n != 0) nonzero *= n;
  }
  if (empty)
    return nonzero <= (std::size_t{1} << 31) ? std::optional<std::size_t>(0) : std::nullopt;
  return nonzero <= limit ? std::optional(nonzero) : std::nullopt;
}

/// Reorders elements from Fortran order (first index fastest) to C order (last index fastest).
std::vector<std::uint8_t> FromFortran(const std::vector<std::uint8_t>& bytes,
                                      const std::vector<std::size_t>& shape, std::size_t item) {
  std::vector<std::uint8_t> result(bytes.size());
  std::vector<std::size_t> index(shape.size(), 0), stride(shape.size(), item);
  for (std::size_t d = 1; d < shape.size(); ++d) stride[d] = stride[d - 1] * shape[d - 1];
  for (std::size_t to = 0; to < result.size(); to += item) {
    std::size_t from = 0;
    for (std::size_t d = 0; d < shape.size(); ++d) from += index[d] * stride[d];
    std::memcpy(&result[to], &bytes[from], item);
    for (std::size_t d = shape.size(); d-- > 0;) {
      if (++index[d] < shape[d]) break;
      index[d] = 0;
    }
  }
  return result;
}

std::size_t UnitSize(const std::string& dtype, std::size_t item) {
  return dtype[1] == 'U' ? 4 : item;
}

}  // namespace

std::size_t ItemSize(const std::string& dtype) {
  for (const char* known : {"|b1", "|i1", "|u1"}) {
    if (dtype == known) return 1;
  }
  for (const char* known : {"<i2", "<u2", "<i4", "<u4", "<i8", "<u8", "<f4", "<f8"}) {
    if (dtype == known) return static_cast<std::size_t>(dtype[2] - '0');
  }
  if (!dtype.starts_with("<U")) return 0;
  std::size_t characters = 0;
  const auto [end, code] =
      std::from_chars(dtype.data() + 2, dtype.data() + dtype.size(), characters);
  const bool good =
      code == std::errc() && end == dtype.data() + dtype.size() && characters <= kMaxCharacters;
  return good ? 4 * characters : 0;
}

NpyHeader ParseNpyHeader(std::span<const std::uint8_t> file, const std::string& where) {
  const std::string_view text(reinterpret_cast<const char*>(file.data()), file.size());
  Require(text.starts_with(kMagic) && text.size() >= 12, where + ": is not an npy file");
  const int major = text[6];
  Require(major >= 1 && major <= 3,
          where + ": npy format version " + std::to_string(major) + " is unknown: save it as 1.0");
  const std::size_t start = major == 1 ? 10 : 12;
  const std::size_t header_size = major == 1 ? LoadLittle<std::uint16_t>(text.data(), 8)
                                             : LoadLittle<std::uint32_t>(text.data(), 8);
  Require(header_size <= text.size() - start,
          where + ": the npy header is cut short: write the file again");
  NpyHeader header = HeaderParser(text.substr(start, header_size), where).Parse();
  header.data_offset = start + header_size;
  return header;
}

NpyArray ArrayFrom(NpyHeader header, std::span<const std::uint8_t> data, const std::string& where) {
  const bool big = header.descr[0] == '>';
  std::string dtype = header.descr;
  if (dtype[0] == '>' || dtype[0] == '=') dtype[0] = '<';
  const std::size_t item = ItemSize(dtype);
  Require(item > 0, where + ": dtype '" + Shown(header.descr) +
                        "' is not read: save it as float, integer, bool or text (U)");
  const std::optional<std::size_t> count = CheckedCount(header.shape, data.size() / item);
  Require(count && *count * item == data.size(),
          where + ": " + std::to_string(data.size()) +
              " bytes of data do not match its shape: it is damaged or cut short");
  NpyArray array{dtype, std::move(header.shape), {data.begin(), data.end()}};
  if (big) SwapElements(array.bytes, UnitSize(dtype, item));
  if (header.fortran && array.shape.size() > 1)
    array.bytes = FromFortran(array.bytes, array.shape, item);
  return array;
}

NpyArray ParseNpy(std::span<const std::uint8_t> file, const std::string& where) {
  NpyHeader header = ParseNpyHeader(file, where);
  Require(
      !header.HoldsObjects(),
      where +
          ": holds Python objects, which are never read: save it with a numeric or string dtype");
  const auto data = file.subspan(header.data_offset);
  return ArrayFrom(std::move(header), data, where);
}

std::vector<std::uint8_t> FormatNpy(const NpyArray& array, const std::string& where) {
  const std::size_t item = ItemSize(array.dtype);
  Require(item > 0, where + ": dtype '" + array.dtype + "' cannot be written");
  Require(array.Count() * item == array.bytes.size(),
          where + ": array holds " + std::to_string(array.bytes.size()) +
              " bytes, its shape needs " + std::to_string(array.Count() * item));
  std::string header = "{'descr': '" + array.dtype + "', 'fortran_order': False, 'shape': (";
  for (std::size_t i = 0; i < array.shape.size(); ++i) {
    header += std::to_string(array.shape[i]) + (array.shape.size() == 1      ? ","
                                                : i + 1 < array.shape.size() ? ", "
                                                                             : "");
  }
  header += "), }";
  header.append(63 - (10 + header.size()) % 64, ' ');  // data starts at a multiple of 64
  header += '\n';
  std::string out(kMagic);
  out += '\x01';
  out += '\0';
  AppendLittle(out, static_cast<std::uint16_t>(header.size()));
  out += header;
  std::vector<std::uint8_t> bytes(out.begin(), out.end());
  bytes.insert(bytes.end(), array.bytes.begin(), array.bytes.end());
  return bytes;
}

}  // namespace sole::io
