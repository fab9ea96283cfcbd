#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace sole::io {

/// The vertices and faces of a PLY file; properties in columns, absent ones empty.
struct PlyContent {
  std::size_t vertices = 0;
  struct Column {
    std::string name;
    std::vector<double> values;
  };
  std::vector<Column> columns;  ///< scalar vertex properties that were asked for
  std::vector<std::vector<long long>>
      faces;  ///< vertex indices, not checked against the vertex count
  bool has_faces = false;

  const std::vector<double>* Find(const std::string& name) const;
};

/// Parses PLY text or binary (either byte order). Only the vertex properties in `wanted` are kept,
/// faces only if `want_faces`. Throws Error starting with `where`.
PlyContent ParsePly(const std::string& file, const std::vector<std::string>& wanted,
                    bool want_faces, const std::string& where);

}  // namespace sole::io
