#include <zlib.h>

#include <limits>
#include <string_view>

#include "core/error.h"
#include "io/bytes_internal.h"
#include "io/shown_internal.h"
#include "io/zip_internal.h"

namespace sole::io {
namespace {

constexpr std::uint32_t kLocalMagic = 0x04034b50, kCentralMagic = 0x02014b50,
                        kEndMagic = 0x06054b50;
constexpr std::size_t kLocalSize = 30, kCentralSize = 46, kEndSize = 22;
constexpr std::uint16_t kDosDate1980 = 0x0021;

struct Entry {
  std::string name;
  std::uint16_t flags = 0, method = 0;
  std::uint32_t crc = 0, packed_size = 0, size = 0, local_offset = 0;
};

/// Raw deflate; empty result and `ok` false on failure.
Bytes Inflate(std::string_view packed, std::size_t size, bool& ok) {
  Bytes result(size);
  z_stream stream{};
  ok = inflateInit2(&stream, -MAX_WBITS) == Z_OK;
  if (!ok) return {};
  std::uint8_t nothing = 0;
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(packed.data()));
  stream.avail_in = static_cast<uInt>(packed.size());
  stream.next_out = result.empty() ? &nothing : result.data();
  stream.avail_out = static_cast<uInt>(size);
  const int status = inflate(&stream, Z_FINISH);
  ok = status == Z_STREAM_END && stream.total_out == size;
  inflateEnd(&stream);
  return result;
}

std::string Deflate(const Bytes& bytes) {
  z_stream stream{};
  Require(deflateInit2(&stream, 3, Z_DEFLATED, -MAX_WBITS, 8, Z_DEFAULT_STRATEGY) == Z_OK,
          "cannot compress: out of memory");
  std::string packed(deflateBound(&stream, static_cast<uLong>(bytes.size())), '\0');
  stream.next_in = const_cast<Bytef*>(bytes.data());
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(packed.data());
  stream.avail_out = static_cast<uInt>(packed.size());
  deflate(&stream, Z_FINISH);
  packed.resize(stream.total_out);
  deflateEnd(&stream);
  return packed;
}

/// Offset of the end-of-central-directory record.
std::size_t FindEnd(const std::string& archive, const std::string& where) {
  Require(archive.size() >= kEndSize,
          where + ": too short for a zip archive: write the file again");
  const std::size_t last = archive.size() - kEndSize;
  const std::size_t first = last > 0xffff ? last - 0xffff : 0;
  for (std::size_t at = last + 1; at-- > first;) {
    if (LoadLittle<std::uint32_t>(archive.data(), at) != kEndMagic) continue;
    if (at + kEndSize + LoadLittle<std::uint16_t>(archive.data(), at + 20) == archive.size())
      return at;
  }
  throw Error(where + ": not a zip archive or cut short: write the file again");
}

std::vector<Entry> ReadDirectory(const std::string& archive, const std::string& where) {
  const std::size_t end = FindEnd(archive, where);
  const auto count = LoadLittle<std::uint16_t>(archive.data(), end + 10);
  std::size_t at = LoadLittle<std::uint32_t>(archive.data(), end + 16);
  Require(count != 0xffff && at != 0xffffffff,
          where + ": is a zip64 archive, which Sole does not read: save smaller arrays");
  std::vector<Entry> entries;
  std::uint64_t packed_total = 0;
  for (std::uint16_t i = 0; i < count; ++i) {
    const std::string damaged = where + ": damaged zip directory: write the file again";
    Require(at <= end && end - at >= kCentralSize, damaged);
    const char* header = archive.data() + at;
    Require(LoadLittle<std::uint32_t>(header) == kCentralMagic, damaged);
    const std::size_t name_size = LoadLittle<std::uint16_t>(header, 28);
    const std::size_t extra =
        LoadLittle<std::uint16_t>(header, 30) + LoadLittle<std::uint16_t>(header, 32);
    Require(end - at - kCentralSize >= name_size + extra, damaged);
    Entry entry;
    entry.name.assign(header + kCentralSize, name_size);
    entry.flags = LoadLittle<std::uint16_t>(header, 8);
    entry.method = LoadLittle<std::uint16_t>(header, 10);
    entry.crc = LoadLittle<std::uint32_t>(header, 16);
    entry.packed_size = LoadLittle<std::uint32_t>(header, 20);
    entry.size = LoadLittle<std::uint32_t>(header, 24);
    entry.local_offset = LoadLittle<std::uint32_t>(header, 42);
    packed_total += entry.packed_size;
    entries.push_back(entry);
    at += kCentralSize + name_size + extra;
  }
  // Entries that share bytes would let a small file expand without bound.
  Require(packed_total <= archive.size(), where + ": damaged zip directory: its entries overlap");
  return entries;
}

Bytes ReadEntry(const std::string& archive, const Entry& entry, const std::string& where) {
  const std::string item = where + ": entry '" + Shown(entry.name) + "' ";
  Require(entry.packed_size != 0xffffffff && entry.size != 0xffffffff &&
              entry.local_offset != 0xffffffff,
          item + "is zip64, which Sole does not read: save smaller arrays");
  Require((entry.flags & 1) == 0, item + "is encrypted: save it without a password");
  Require(entry.method == 0 || entry.method == 8, item + "uses zip method " +
                                                      std::to_string(entry.method) +
                                                      ": only stored and deflated are read");
  const std::size_t offset = entry.local_offset;
  const std::string outside = item + "lies outside the file: it is damaged or cut short";
  Require(offset <= archive.size() && archive.size() - offset >= kLocalSize, outside);
  const char* header = archive.data() + offset;
  Require(LoadLittle<std::uint32_t>(header) == kLocalMagic,
          item + "has no local header: the file is damaged");
  const std::size_t skip =
      kLocalSize + LoadLittle<std::uint16_t>(header, 26) + LoadLittle<std::uint16_t>(header, 28);
  Require(archive.size() - offset >= skip && archive.size() - offset - skip >= entry.packed_size,
          outside);
  const std::string_view packed(header + skip, entry.packed_size);
  Bytes bytes;
  if (entry.method == 0) {
    Require(entry.size == entry.packed_size, item + "has contradicting sizes: the file is damaged");
    bytes.assign(packed.begin(), packed.end());
  } else {
    // Deflate expands at most 1032-fold: a larger claim is damage, found before memory is taken.
    Require(entry.size <= std::uint64_t{1032} * (packed.size() + 1),
            item + "claims an impossible size: the file is damaged");
    bool ok = false;
    bytes = Inflate(packed, entry.size, ok);
    Require(ok, item + "does not decompress: the file is damaged");
  }
  Require(Crc32(bytes.data(), bytes.size()) == entry.crc,
          item + "fails its checksum: the file is damaged");
  return bytes;
}

/// The fields that local and central headers share, from "version needed" to "extra size".
void AppendShared(std::string& out, const Entry& entry) {
  AppendLittle<std::uint16_t>(out, 20);
  AppendLittle<std::uint16_t>(out, 0);
  AppendLittle<std::uint16_t>(out, entry.method);
  AppendLittle<std::uint16_t>(out, 0);
  AppendLittle<std::uint16_t>(out, kDosDate1980);
  AppendLittle(out, entry.crc);
  AppendLittle(out, entry.packed_size);
  AppendLittle(out, entry.size);
  AppendLittle(out, static_cast<std::uint16_t>(entry.name.size()));
  AppendLittle<std::uint16_t>(out, 0);
}

}  // namespace

std::map<std::string, Bytes> ReadZip(const std::string& archive, const std::string& where) {
  std::map<std::string, Bytes> result;
  for (const Entry& entry : ReadDirectory(archive, where)) {
    Require(result.emplace(entry.name, ReadEntry(archive, entry, where)).second,
            where + ": entry '" + Shown(entry.name) + "' appears twice: the file is damaged");
  }
  return result;
}

std::string FormatZip(const std::map<std::string, Bytes>& entries, const std::string& where) {
  constexpr std::uint64_t kLimit = std::numeric_limits<std::uint32_t>::max();
  const std::string too_large =
      where + ": more than 4 GiB or 65534 arrays do not fit into one npz: split the data";
  Require(entries.size() < 0xffff, too_large);
  std::string out, directory;
  for (const auto& [name, bytes] : entries) {
    Require(bytes.size() < kLimit && name.size() < 0xffff, too_large);
    Entry entry{.name = name, .crc = Crc32(bytes.data(), bytes.size())};
    const std::string packed = Deflate(bytes);
    const bool deflated = packed.size() < bytes.size();
    entry.method = deflated ? 8 : 0;
    entry.size = static_cast<std::uint32_t>(bytes.size());
    entry.packed_size = deflated ? static_cast<std::uint32_t>(packed.size()) : entry.size;
    entry.local_offset = static_cast<std::uint32_t>(out.size());
    AppendLittle(out, kLocalMagic);
    AppendShared(out, entry);
    out += name;
    if (deflated)
      out += packed;
    else
      out.append(bytes.begin(), bytes.end());
    AppendLittle(directory, kCentralMagic);
    AppendLittle<std::uint16_t>(directory, 20);
    AppendShared(directory, entry);
    for (int i = 0; i < 3; ++i)
      AppendLittle<std::uint16_t>(directory, 0);  // comment, disk, internal
    AppendLittle<std::uint32_t>(directory, 0);    // external attributes
    AppendLittle(directory, entry.local_offset);
    directory += name;
    Require(out.size() + directory.size() + kEndSize < kLimit, too_large);
  }
  const auto directory_offset = static_cast<std::uint32_t>(out.size());
  out += directory;
  AppendLittle(out, kEndMagic);
  AppendLittle<std::uint32_t>(out, 0);
  for (int i = 0; i < 2; ++i) AppendLittle(out, static_cast<std::uint16_t>(entries.size()));
  AppendLittle(out, static_cast<std::uint32_t>(directory.size()));
  AppendLittle(out, directory_offset);
  AppendLittle<std::uint16_t>(out, 0);
  return out;
}

}  // namespace sole::io
