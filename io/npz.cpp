#include "io/npz.h"

#include "core/error.h"
#include "io/atomic_file.h"
#include "io/npy_internal.h"
#include "io/shown_internal.h"
#include "io/zip_internal.h"

namespace sole::io {

namespace fs = std::filesystem;

std::size_t NpyArray::Count() const {
  std::size_t count = 1;
  for (const std::size_t n : shape) count *= n;
  return count;
}

NpyArray ReadNpy(const fs::path& path) {
  const std::string content = ReadFile(path);
  return ParseNpy({reinterpret_cast<const std::uint8_t*>(content.data()), content.size()},
                  path.string());
}

Npz ReadNpz(const fs::path& path) {
  Npz arrays;
  for (const auto& [name, bytes] : ReadZip(ReadFile(path), path.string())) {
    const bool has_suffix = name.ends_with(".npy");
    Require(has_suffix, path.string() + ": entry '" + Shown(name) +
                            "' is not an array: save it with numpy.savez");
    const std::string key = name.substr(0, name.size() - 4);
    arrays[key] = ParseNpy(bytes, path.string() + ": array '" + Shown(key) + "'");
  }
  return arrays;
}

void WriteNpy(const fs::path& path, const NpyArray& array) {
  const std::vector<std::uint8_t> bytes = FormatNpy(array, path.string());
  WriteStringAtomically(path, std::string(bytes.begin(), bytes.end()));
}

void WriteNpz(const fs::path& path, const Npz& arrays) {
  std::map<std::string, Bytes> entries;
  for (const auto& [name, array] : arrays) {
    entries[name + ".npy"] = FormatNpy(array, path.string() + ": array '" + Shown(name) + "'");
  }
  WriteStringAtomically(path, FormatZip(entries, path.string()));
}

}  // namespace sole::io
