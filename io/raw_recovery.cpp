#include "io/raw_recovery_internal.h"

#include <sys/file.h>

#include <cerrno>
#include <cstring>

#include "core/error.h"
#include "io/raw_layout_internal.h"
#include "io/shown_internal.h"

namespace sole::io {

namespace fs = std::filesystem;

namespace {

[[noreturn]] void Fail(const std::string& action, const fs::path& path) {
  throw Error("cannot " + action + " " + path.string() + ": " + std::strerror(errno) +
              ": check that the folder is writable and has room, then recover again");
}

void Rename(const fs::path& from, const fs::path& to) {
  if (::rename(from.c_str(), to.c_str()) != 0) Fail("rename", from);
  SyncDirectory(to);
}

fs::path With(const fs::path& path, const char* extension) { return path.string() + extension; }

/// The records of a file whose own header may be torn or damaged. Throws Error for a file of
/// another camera or a version that is not known.
RawIndex Scan(const fs::path& file, const std::string& serial, bool& head_holds,
              std::uint64_t& block) {
  std::uint64_t size = 0;
  const FileDescriptor opened = OpenForReading(file, size);
  head_holds = true;
  RawFileHead head{serial, kRawBlock};
  try {
    head = ReadRawFileHead(opened, size, file);
  } catch (const UnknownVersionError&) {
    throw;
  } catch (const Error&) {
    head_holds = false;
  }
  Require(head.serial == serial, file.string() + ": holds camera '" + Shown(head.serial) +
                                     "', not '" + Shown(serial) +
                                     "': put the right file in its place");
  block = head.block;
  return ScanRawRecords(opened, size, head.block);
}

/// Writes a file of just these records under a temporary name.
std::vector<RawRecord> Rewrite(const fs::path& from, const fs::path& to, const std::string& serial,
                               const std::vector<RawRecord>& records) {
  std::uint64_t size = 0;
  const FileDescriptor source = OpenForReading(from, size);
  const FileDescriptor target(::open(to.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644));
  if (!target.Valid()) Fail("create", to);
  const auto write_block = [&](const RawHeaderBytes& bytes) {
    std::array<char, kRawBlock> padded{};
    std::memcpy(padded.data(), bytes.data(), bytes.size());
    if (!target.Write(padded.data(), padded.size())) Fail("write", to);
  };
  write_block(EncodeRawFileHeader(serial));
  std::vector<RawRecord> written;
  std::uint64_t at = kRawBlock;
  for (RawRecord record : records) {
    RawHeaderBytes header{};
    const std::uint64_t payload = RawPayloadSize(record.header);
    if (!source.ReadAt(header.data(), header.size(), record.header_offset)) Fail("read", from);
    write_block(header);
    if (!CopyBytes(source, record.payload_offset, payload, target)) Fail("copy to", to);
    const std::vector<char> padding(RoundUp(payload, kRawBlock) - payload);
    if (!target.Write(padding.data(), padding.size())) Fail("write", to);
    record.header_offset = at;
    record.payload_offset = at + kRawBlock;
    at = record.payload_offset + payload + padding.size();
    written.push_back(record);
  }
  if (::fsync(target.Get()) != 0) Fail("write", to);
  return written;
}

/// Keeps the original of a rewritten file: under another name, since nobody can tell what it is
/// still good for.
fs::path SetAside(const fs::path& file, const fs::path& path, const fs::path& rewritten) {
  const fs::path damaged = With(path, ".damaged");
  if (file == path) {
    ::unlink(damaged.c_str());
    if (::link(file.c_str(), damaged.c_str()) != 0) Fail("keep a copy of", file);
    Rename(rewritten, path);
  } else {
    Rename(rewritten, path);  // an interruption leaves both names, which the next attempt mends
    Rename(file, damaged);
  }
  return damaged;
}

}  // namespace

RawRecovery RecoverRawFile(
    const fs::path& path, const std::string& serial,
    const std::function<bool(const fs::path& file, const RawRecord& record)>& keep) {
  const fs::path partial = With(path, ".partial"), rewritten = With(path, ".recovering");
  RawRecovery result;
  const fs::path file = fs::exists(path) ? path : partial;
  if (!fs::exists(file)) {
    RawFileWriter(path, serial).Close();
    result.changed = true;
    return result;
  }
  const FileDescriptor opened(::open(file.c_str(), O_RDWR | O_CLOEXEC));
  if (!opened.Valid()) Fail("open", file);
  Require(::flock(opened.Get(), LOCK_EX | LOCK_NB) == 0,
          file.string() + ": is being recorded right now: stop the recording first");
  bool whole = false;
  std::uint64_t block = kRawBlock;
  const RawIndex index = Scan(file, serial, whole, block);
  std::uint64_t at = RawHeaderBlock(block);
  for (const RawRecord& record : index.records) {
    if (!keep(file, record)) {
      ++result.dropped;
      continue;
    }
    whole = whole && record.header_offset == at;
    at = RoundUp(record.payload_offset + RawPayloadSize(record.header), block);
    result.records.push_back(record);
  }
  result.torn = index.truncated;
  const bool last_refused =
      !index.records.empty() && (result.records.empty() || result.records.back().header_offset !=
                                                               index.records.back().header_offset);
  if (last_refused && !result.torn) {  // a header whose pixels did not reach the disk any more
    result.torn = true;
    --result.dropped;
  }
  std::error_code error;
  const std::uint64_t size = fs::file_size(file, error);
  if (!whole) {
    result.records = Rewrite(file, rewritten, serial, result.records);
    result.damaged_copy = SetAside(file, path, rewritten);
    if (size <= kRawBlock) {  // no more than a torn file header
      fs::remove(result.damaged_copy, error);
      result.damaged_copy.clear();
    }
    result.changed = true;
    return result;
  }
  if (size != at || file == partial) {
    if (::ftruncate(opened.Get(), static_cast<off_t>(at)) != 0 || ::fsync(opened.Get()) != 0)
      Fail("cut", file);
    result.changed = true;
  }
  if (file == partial) {
    Rename(partial, path);
  } else if (fs::exists(partial)) {  // left by an attempt that was interrupted
    result.damaged_copy = With(path, ".damaged");
    Rename(partial, result.damaged_copy);
    result.changed = true;
  }
  return result;
}

}  // namespace sole::io
