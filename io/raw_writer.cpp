#include <sys/file.h>
#include <sys/uio.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>

#include "io/bytes_internal.h"
#include "io/raw_layout_internal.h"

namespace sole::io {

namespace fs = std::filesystem;

namespace {

struct Free {
  void operator()(void* memory) const { std::free(memory); }
};
/// Memory that starts at a multiple of kRawBlock.
using Blocks = std::unique_ptr<char, Free>;

Blocks AllocateBlocks(std::size_t bytes) {
  Blocks blocks(static_cast<char*>(std::aligned_alloc(kRawBlock, RoundUp(bytes, kRawBlock))));
  if (!blocks) throw std::bad_alloc();
  return blocks;
}

bool IsAligned(const void* memory) {
  return reinterpret_cast<std::uintptr_t>(memory) % kRawBlock == 0;
}

}  // namespace

struct RawFileWriter::State {
  fs::path path;
  fs::path partial;
  RawFileOptions options;
  FileDescriptor file;
  bool closed = false;
  std::uint64_t end = 0;                        ///< of the last whole record
  std::uint64_t reserved = 0;                   ///< room is set aside up to here
  Blocks ends = AllocateBlocks(2 * kRawBlock);  ///< a record's header block; its last block
  Blocks copy;                                  ///< of pixels that do not start at a block
  std::size_t copy_size = 0;

  [[noreturn]] void Fail(const char* action) const {
    throw Error(std::string("cannot ") + action + " " + partial.string() + ": " +
                std::strerror(errno) + ": check that the folder exists, is writable and has room");
  }

  /// Sets room aside, so that the file lies in few pieces. The file's length does not change;
  /// where there is no room or the file system cannot do it, writing itself will tell.
  void Reserve(std::uint64_t bytes) {
    if (options.reserve_bytes == 0 || end + bytes <= reserved) return;
    const std::uint64_t more = std::max(options.reserve_bytes, bytes);
    ::fallocate(file.Get(), FALLOC_FL_KEEP_SIZE, static_cast<off_t>(end), static_cast<off_t>(more));
    reserved = end + more;
  }

  /// Writes all pieces at `end`, going on after short writes.
  bool WriteAt(std::array<iovec, 3> pieces) {
    std::uint64_t at = end;
    for (std::size_t first = 0; first < pieces.size();) {
      ssize_t done = ::pwritev(file.Get(), &pieces[first], static_cast<int>(pieces.size() - first),
                               static_cast<off_t>(at));
      if (done < 0 && errno == EINTR) continue;
      // Some file systems accept O_DIRECT and then refuse to write so.
      if (done < 0 && errno == EINVAL && (::fcntl(file.Get(), F_GETFL) & O_DIRECT) != 0) {
        ::fcntl(file.Get(), F_SETFL, ::fcntl(file.Get(), F_GETFL) & ~O_DIRECT);
        continue;
      }
      if (done <= 0) return false;
      at += static_cast<std::uint64_t>(done);
      for (; first < pieces.size() && static_cast<std::size_t>(done) >= pieces[first].iov_len;
           ++first)
        done -= static_cast<ssize_t>(pieces[first].iov_len);
      if (first < pieces.size()) {
        pieces[first].iov_base = static_cast<char*>(pieces[first].iov_base) + done;
        pieces[first].iov_len -= static_cast<std::size_t>(done);
      }
    }
    return true;
  }

  /// Puts `header` and `pixels` into whole blocks and writes them.
  bool WriteRecord(const RawHeaderBytes& header, const std::uint8_t* pixels, std::size_t size) {
    std::memcpy(ends.get(), header.data(), header.size());
    if (!IsAligned(pixels)) {
      if (copy_size < size) copy = AllocateBlocks(copy_size = size);
      std::memcpy(copy.get(), pixels, size);
      pixels = reinterpret_cast<const std::uint8_t*>(copy.get());
    }
    const std::size_t whole = size / kRawBlock * kRawBlock;
    char* last = ends.get() + kRawBlock;
    std::memcpy(last, pixels + whole, size - whole);
    std::memset(last + (size - whole), 0, kRawBlock - (size - whole));
    const std::size_t rest = size > whole ? kRawBlock : 0;
    Reserve(kRawBlock + whole + rest);
    // pwritev only reads.
    void* body = const_cast<std::uint8_t*>(pixels);
    if (!WriteAt({iovec{ends.get(), kRawBlock}, iovec{body, whole}, iovec{last, rest}}))
      return false;
    end += kRawBlock + whole + rest;
    return true;
  }
};

RawFileWriter::RawFileWriter(const fs::path& path, const std::string& serial,
                             const RawFileOptions& options)
    : state_(std::make_unique<State>()) {
  Require(serial.size() < kRawSerialSize,
          path.string() + ": serial '" + serial + "' is longer than 43 bytes");
  State& state = *state_;
  state.path = path;
  state.partial = path.string() + ".partial";
  state.options = options;
  std::memset(state.ends.get(), 0, 2 * kRawBlock);
  if (options.discard) return;
  Require(!fs::exists(path),
          "cannot write " + path.string() + ": it exists already: record under another name");
  constexpr int kFlags = O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC;
  state.file = FileDescriptor(::open(state.partial.c_str(), kFlags, 0644));
  if (!state.file.Valid()) state.Fail("create");
  // Past the page cache: no copy, and a long take does not push everything else out of memory.
  ::fcntl(state.file.Get(), F_SETFL, O_DIRECT);
  // Tells `sole take recover` that somebody is still writing.
  ::flock(state.file.Get(), LOCK_EX | LOCK_NB);
  const RawHeaderBytes head = EncodeRawFileHeader(serial);
  std::memcpy(state.ends.get(), head.data(), head.size());
  if (!state.WriteAt({iovec{state.ends.get(), kRawBlock}, iovec{}, iovec{}})) state.Fail("write");
  state.end = kRawBlock;
}

RawFileWriter::~RawFileWriter() = default;

std::uint32_t RawFileWriter::Append(const RawRecordHeader& header, const std::uint8_t* pixels) {
  State& state = *state_;
  Require(state.file.Valid() || (state.options.discard && !state.closed),
          state.path.string() + " is closed: nothing more can be recorded into it");
  Require(header.width > 0 && header.height > 0 && header.width < kRawMaxSide &&
              header.height < kRawMaxSide,
          state.path.string() + ": an image of " + std::to_string(header.width) + " x " +
              std::to_string(header.height) + " pixels cannot be recorded");
  const std::size_t size = RawPayloadSize(header);
  const std::uint32_t crc = Crc32(pixels, size);
  if (state.options.discard) return crc;
  if (!state.WriteRecord(EncodeRawRecord(header, crc), pixels, size)) {
    const int reason = errno;
    // Take the torn record away, so that a later one follows the last whole one.
    if (::ftruncate(state.file.Get(), static_cast<off_t>(state.end)) != 0) state.file.Close();
    state.reserved = 0;
    errno = reason;
    state.Fail("write");
  }
  return crc;
}

void RawFileWriter::Close() {
  State& state = *state_;
  state.closed = true;
  if (!state.file.Valid()) return;
  // Truncating to the present length frees what was set aside beyond it.
  if (::ftruncate(state.file.Get(), static_cast<off_t>(state.end)) != 0 ||
      ::fsync(state.file.Get()) != 0 || !state.file.Close())
    state.Fail("finish");
  if (::rename(state.partial.c_str(), state.path.c_str()) != 0) state.Fail("rename");
  SyncDirectory(state.path);
}

}  // namespace sole::io
