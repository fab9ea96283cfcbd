#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <sstream>
#include <string_view>

#include "core/error.h"
#include "io/bytes_internal.h"
#include "io/ply_internal.h"
#include "io/shown_internal.h"

namespace sole::io {
namespace {

enum class Encoding { kAscii, kLittle, kBig };
enum class Type { kI1, kU1, kI2, kU2, kI4, kU4, kF4, kF8 };

struct Property {
  std::string name;
  Type type = Type::kF4;
  bool list = false;
  Type count_type = Type::kU1;
};

struct Element {
  std::string name;
  std::size_t count = 0;
  std::vector<Property> properties;
};

struct Header {
  Encoding encoding = Encoding::kAscii;
  std::vector<Element> elements;
  std::size_t size = 0;  ///< bytes
};

std::size_t SizeOf(Type type) {
  constexpr std::array<std::size_t, 8> sizes{1, 1, 2, 2, 4, 4, 4, 8};
  return sizes[static_cast<std::size_t>(type)];
}

Type TypeFrom(const std::string& name, const std::string& where) {
  constexpr std::array<std::array<std::string_view, 2>, 8> names{{{"char", "int8"},
                                                                  {"uchar", "uint8"},
                                                                  {"short", "int16"},
                                                                  {"ushort", "uint16"},
                                                                  {"int", "int32"},
                                                                  {"uint", "uint32"},
                                                                  {"float", "float32"},
                                                                  {"double", "float64"}}};
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (name == names[i][0] || name == names[i][1]) return static_cast<Type>(i);
  }
  throw Error(where + ": unknown PLY type '" + Shown(name) + "'");
}

void AddProperty(std::istringstream& words, Header& header, const std::string& where) {
  Require(!header.elements.empty(), where + ": a property stands before the first element");
  Property property;
  std::string type;
  words >> type;
  property.list = type == "list";
  if (property.list) {
    words >> type;
    property.count_type = TypeFrom(type, where);
    words >> type;
  }
  property.type = TypeFrom(type, where);
  words >> property.name;
  Require(bool(words), where + ": a property line is incomplete");
  header.elements.back().properties.push_back(property);
}

Header ParseHeader(const std::string& file, const std::string& path) {
  Require(file.starts_with("ply\n") || file.starts_with("ply\r"), path + ": is not a PLY file");
  Header header;
  bool has_format = false;
  std::size_t at = 0;
  for (int number = 1;; ++number) {
    const std::size_t end = file.find('\n', at);
    Require(end != std::string::npos, path + ": the PLY header has no end: the file is cut short");
    std::istringstream words(file.substr(at, end - at));
    at = end + 1;
    const std::string where = path + ":" + std::to_string(number);
    std::string word;
    words >> word;
    if (word == "end_header") break;
    if (word == "format") {
      words >> word;
      header.encoding = word == "ascii"               ? Encoding::kAscii
                        : word == "binary_big_endian" ? Encoding::kBig
                                                      : Encoding::kLittle;
      Require(header.encoding != Encoding::kLittle || word == "binary_little_endian",
              where + ": unknown PLY format '" + Shown(word) + "'");
      has_format = true;
    } else if (word == "element") {
      Element element;
      words >> element.name >> element.count;
      Require(bool(words), where + ": an element line is incomplete");
      header.elements.push_back(element);
    } else if (word == "property") {
      AddProperty(words, header, where);
    } else {
      Require(word == "comment" || word == "obj_info" || word == "ply" || word.empty(),
              where + ": unknown PLY header line '" + Shown(word) + "'");
    }
  }
  Require(has_format, path + ": the PLY header names no format");
  header.size = at;
  return header;
}

/// Takes values one after the other from the body.
class Body {
 public:
  Body(std::string_view bytes, Encoding encoding, std::string where)
      : bytes_(bytes), encoding_(encoding), where_(std::move(where)) {}

  double Next(Type type) { return encoding_ == Encoding::kAscii ? NextWord() : NextBinary(type); }
  std::size_t Left() const { return bytes_.size() - at_; }
  std::size_t SmallestSize(Type type) const {
    return encoding_ == Encoding::kAscii ? 1 : SizeOf(type);
  }

 private:
  double NextWord() {
    while (at_ < bytes_.size() && std::isspace(static_cast<unsigned char>(bytes_[at_]))) ++at_;
    if (at_ < bytes_.size() && bytes_[at_] == '+') ++at_;
    double value = 0;
    const char* begin = bytes_.data() + at_;
    const auto [end, code] = std::from_chars(begin, bytes_.data() + bytes_.size(), value);
    Require(code == std::errc() || code == std::errc::result_out_of_range,
            where_ + (at_ == bytes_.size() ? ": is cut short"
                                           : ": holds something that is not a number"));
    at_ += static_cast<std::size_t>(end - begin);
    return value;
  }

  template <typename T>
  double Take() {
    std::array<char, sizeof(T)> raw;
    std::memcpy(raw.data(), bytes_.data() + at_, sizeof(T));
    at_ += sizeof(T);
    if (encoding_ == Encoding::kBig) std::reverse(raw.begin(), raw.end());
    return static_cast<double>(LoadLittle<T>(raw.data()));
  }

  double NextBinary(Type type) {
    Require(Left() >= SizeOf(type), where_ + ": is cut short");
    switch (type) {
      case Type::kI1:
        return Take<std::int8_t>();
      case Type::kU1:
        return Take<std::uint8_t>();
      case Type::kI2:
        return Take<std::int16_t>();
      case Type::kU2:
        return Take<std::uint16_t>();
      case Type::kI4:
        return Take<std::int32_t>();
      case Type::kU4:
        return Take<std::uint32_t>();
      case Type::kF4:
        return Take<float>();
      case Type::kF8:
        break;
    }
    return Take<double>();
  }

  std::string_view bytes_;
  Encoding encoding_;
  std::string where_;
  std::size_t at_ = 0;
};

/// Where the values of each property of an element go; null where they are dropped.
struct Sinks {
  std::vector<std::vector<double>*> scalars;
  std::vector<std::vector<long long>>* faces = nullptr;
  std::size_t face_property = 0;
};

long long ToIndex(double value, const std::string& where) {
  Require(value == std::floor(value) && std::abs(value) < 1e15,
          where + ": a face holds " + std::to_string(value) + ", expected a vertex number");
  return static_cast<long long>(value);
}

void ReadElement(Body& body, const Element& element, const Sinks& sinks, const std::string& where) {
  for (std::size_t i = 0; i < element.count; ++i) {
    for (std::size_t p = 0; p < element.properties.size(); ++p) {
      const Property& property = element.properties[p];
      if (!property.list) {
        const double value = body.Next(property.type);
        if (sinks.scalars[p]) sinks.scalars[p]->push_back(value);
        continue;
      }
      const double count = body.Next(property.count_type);
      Require(count >= 0 && count == std::floor(count) &&
                  count * static_cast<double>(body.SmallestSize(property.type)) <=
                      static_cast<double>(body.Left()),
              where + ": a list of element '" + Shown(element.name) + "' is longer than the file");
      const bool keep = sinks.faces && p == sinks.face_property;
      if (keep) sinks.faces->emplace_back();
      for (double k = 0; k < count; ++k) {
        const double value = body.Next(property.type);
        if (keep) sinks.faces->back().push_back(ToIndex(value, where));
      }
    }
  }
}

/// Smallest number of bytes an entry of `element` can take.
std::size_t SmallestEntry(const Element& element, const Body& body) {
  std::size_t size = 0;
  for (const Property& p : element.properties)
    size += body.SmallestSize(p.list ? p.count_type : p.type);
  return size;
}

}  // namespace

const std::vector<double>* PlyContent::Find(const std::string& name) const {
  for (const Column& column : columns) {
    if (column.name == name) return &column.values;
  }
  return nullptr;
}

PlyContent ParsePly(const std::string& file, const std::vector<std::string>& wanted,
                    bool want_faces, const std::string& where) {
  const Header header = ParseHeader(file, where);
  Body body(std::string_view(file).substr(header.size), header.encoding, where);
  PlyContent content;
  for (const Element& element : header.elements) {
    const std::size_t smallest = SmallestEntry(element, body);
    Require(smallest == 0 ? element.count == 0 || element.name != "vertex"
                          : element.count <= body.Left() / smallest,
            where + ": claims " + std::to_string(element.count) + " entries of '" +
                Shown(element.name) + "', more than the file can hold: it is damaged or cut short");
    if (smallest == 0) continue;
    Sinks sinks{std::vector<std::vector<double>*>(element.properties.size(), nullptr)};
    const bool is_vertex = element.name == "vertex", is_face = element.name == "face";
    if (is_vertex) {
      Require(content.columns.empty(), where + ": element 'vertex' appears twice");
      content.vertices = element.count;
      content.columns.reserve(element.properties.size());  // sinks point into it
    }
    for (std::size_t p = 0; p < element.properties.size(); ++p) {
      const Property& property = element.properties[p];
      const bool keep = is_vertex && !property.list && !content.Find(property.name) &&
                        std::find(wanted.begin(), wanted.end(), property.name) != wanted.end();
      if (keep) {
        content.columns.push_back({property.name, {}});
        content.columns.back().values.reserve(element.count);
        sinks.scalars[p] = &content.columns.back().values;
      }
      if (is_face && property.list &&
          (property.name == "vertex_indices" || property.name == "vertex_index")) {
        content.has_faces = true;
        if (want_faces) sinks.faces = &content.faces;
        sinks.face_property = p;
      }
    }
    ReadElement(body, element, sinks, where);
  }
  return content;
}

}  // namespace sole::io
