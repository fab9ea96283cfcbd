#include "tests/io/take_fuzz.h"

#include <array>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <random>
#include <vector>

#include "core/error.h"
#include "io/atomic_file.h"
#include "io/bytes_internal.h"
#include "io/raw_archive.h"
#include "io/take_archive.h"
#include "io/take_check.h"
#include "io/take_recovery.h"
#include "tests/support/recorded_take.h"
#include "tests/support/temp_dir.h"

namespace sole::io {
namespace {

namespace fs = std::filesystem;
using namespace testing_support;

constexpr std::int64_t kTriggers = 4;

/// Recomputes the CRC of every header in sight, and sometimes that of its pixels.
void SealAnew(std::string& bytes, bool pixels) {
  if (bytes.size() >= 64 && bytes.starts_with("SOLERAW1")) {
    const std::uint32_t crc = Crc32(bytes.data(), 60);
    std::memcpy(&bytes[60], &crc, 4);
  }
  for (std::size_t at = bytes.find("SREC"); at != std::string::npos && at + 64 <= bytes.size();
       at = bytes.find("SREC", at + 1)) {
    const std::size_t payload = at + kRawBlock;
    std::uint32_t size = 0;
    std::memcpy(&size, &bytes[at + 48], 4);
    if (pixels && payload < bytes.size() && size <= bytes.size() - payload) {
      const std::uint32_t crc = Crc32(&bytes[payload], size);
      std::memcpy(&bytes[at + 52], &crc, 4);
    }
    const std::uint32_t crc = Crc32(&bytes[at], 60);
    std::memcpy(&bytes[at + 60], &crc, 4);
  }
}

class Fuzzer {
 public:
  explicit Fuzzer(const TakeFuzzOptions& options) : options_(options), random_(options.seed) {
    WriteTinyTake(dir_ / "raw", config_, kTriggers);
    fs::copy(dir_ / "raw", dir_ / "archive", fs::copy_options::recursive);
    ArchiveTake(dir_ / "archive", {.delete_source = true, .threads = 1});
    for (const char* take : {"raw", "archive"}) {
      for (const auto& entry : fs::recursive_directory_iterator(dir_ / take)) {
        if (entry.is_regular_file())
          files_.push_back({fs::relative(entry.path(), dir_.Path()), ReadFile(entry.path())});
      }
    }
    std::ranges::sort(files_, {}, [](const File& f) { return f.path; });
  }

  TakeFuzzResult Run() {
    const auto begin = std::chrono::steady_clock::now();
    while (result_.rounds < options_.rounds && result_.finding.empty()) {
      if (std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count() >
          options_.seconds)
        break;
      Round();
      ++result_.rounds;
    }
    return result_;
  }

 private:
  struct File {
    fs::path path;  ///< from the scratch directory
    std::string bytes;
  };

  std::size_t Below(std::size_t n) { return static_cast<std::size_t>(random_() % n); }

  /// A place that is a header as often as anything else.
  std::size_t Place(const std::string& bytes) {
    if (Below(2) == 0) return Below(bytes.size());
    const std::size_t header = bytes.find("SREC", Below(bytes.size()));
    if (header == std::string::npos || header + 64 > bytes.size())
      return Below(std::min<std::size_t>(64, bytes.size()));
    return header + Below(64);
  }

  void Mutate(std::string& bytes, const std::string& other) {
    static constexpr std::array<std::uint64_t, 10> kNumbers{
        0,   1, 0x7f, 0xff, 0xffff, 0x7fffffff, 0xffffffff, 0x7fffffffffffffff, 0xffffffffffffffff,
        4096};
    for (std::size_t n = 1 + Below(5); n > 0 && !bytes.empty(); --n) {
      const std::size_t at = Place(bytes);
      const std::size_t rest = bytes.size() - at;
      switch (Below(9)) {
        case 0:
          bytes[at] = static_cast<char>(bytes[at] ^ (1 << Below(8)));
          break;
        case 1:
          bytes[at] = static_cast<char>(random_());
          break;
        case 2:
          std::memcpy(&bytes[at], &kNumbers[Below(kNumbers.size())],
                      std::min(rest, std::size_t{1} << Below(4)));
          break;
        case 3:
          bytes.resize(at);
          break;
        case 4:
          bytes.insert(at, 1 + Below(70), static_cast<char>(random_()));
          break;
        case 5:
          bytes.erase(at, 1 + Below(70));
          break;
        case 6:
          bytes.insert(at / kRawBlock * kRawBlock,
                       bytes.substr(Below(bytes.size()) / kRawBlock * kRawBlock,
                                    kRawBlock * (1 + Below(3))));
          break;
        case 7:
          bytes.replace(at, std::min(rest, Below(200)),
                        other.substr(Below(other.size() + 1), Below(200)));
          break;
        default:
          bytes.replace(at, std::min(rest, std::size_t{16}), std::min(rest, std::size_t{16}), '\0');
          break;
      }
    }
  }

  static void Put(const fs::path& path, const std::string& bytes) {
    std::ofstream(path, std::ios::binary)
        .write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  }

  void Round() {
    const File& victim = files_[Below(files_.size())];
    const fs::path take = dir_ / victim.path.begin()->string();
    std::string bytes = victim.bytes;
    Mutate(bytes, files_[Below(files_.size())].bytes);
    sealed_ = Below(2) == 0;
    if (sealed_) SealAnew(bytes, Below(2) == 0);
    kind_ = victim.path.extension().string();
    // A recording is sometimes one that was never closed.
    fs::path path = dir_ / victim.path;
    const bool open = kind_ == ".raw" && Below(4) == 0;
    if (open) {
      fs::remove(path);
      path += ".partial";
    }
    Put(path, bytes);
    if (victim.path.begin()->string() == "raw")
      UseRaw(take);
    else
      UseArchive(take, victim);
    fs::remove_all(dir_ / "copy");
    if (open) fs::remove(path);
    Put(dir_ / victim.path, victim.bytes);
  }

  template <typename F>
  bool Try(const char* what, F&& action) {
    try {
      action();
      ++result_.accepted[kind_];
      return true;
    } catch (const Error& error) {
      ++result_.refused[kind_];
      if (std::string(error.what()).find('\n') != std::string::npos)
        Find(what, std::string("an Error of several lines: ") + error.what());
    } catch (const std::exception& error) {
      Find(what, std::string("not a sole::Error: ") + error.what());
    }
    return false;
  }

  void Find(const char* what, const std::string& finding) {
    if (result_.finding.empty())
      result_.finding =
          "round " + std::to_string(result_.rounds) + ", " + kind_ + ", " + what + ": " + finding;
  }

  void ReadAll(const char* what, const fs::path& take) {
    TakeReader reader(take);
    for (std::size_t i = 0; i < std::min<std::size_t>(reader.Triggers().size(), 50); ++i) {
      const FrameSet set = reader.Read(i);
      for (std::size_t c = 0; c < set.images.size() && c < config_.cameras.size(); ++c) {
        if (!set.images[c] || sealed_ || kind_ != ".raw") continue;
        if (set.images[c]->pixels != TinyImage(config_, c, set.trigger).pixels)
          Find(what, "a wrong image of trigger " + std::to_string(set.trigger));
      }
    }
  }

  void UseRaw(const fs::path& take) {
    Try("read", [&] { ReadAll("read", take); });
    Try("check", [&] { CheckTake(take, {.threads = 1}); });
    fs::copy(take, dir_ / "copy", fs::copy_options::recursive);
    if (!Try("recover", [&] { RecoverTake(dir_ / "copy"); })) return;
    Try("read after recovery", [&] { ReadAll("read after recovery", dir_ / "copy"); });
    Try("check after recovery", [&] {
      const TakeCheck check = CheckTake(dir_ / "copy", {.threads = 1});
      // A trigger that is there twice stays: the first one counts.
      for (const std::string& fault : check.faults) {
        if (kind_ == ".raw" && fault.find("is there twice") == std::string::npos &&
            fault.find("the verdict is good") == std::string::npos)
          Find("check after recovery", fault);
      }
    });
  }

  void UseArchive(const fs::path& take, const File& victim) {
    Try("check an archive", [&] { CheckTake(take, {.threads = 1}); });
    if (kind_ != ".mkv") return;
    const fs::path restored = dir_ / "copy";
    Try("read an archive", [&] { ReadArchiveIndex(dir_ / victim.path); });
    if (Try("restore", [&] { RestoreRawFile(dir_ / victim.path, restored); }) && !sealed_) {
      const fs::path raw =
          fs::path("raw") / "cameras" / victim.path.filename().replace_extension(".raw");
      for (const File& file : files_) {
        if (file.path == raw && ReadFile(restored) != file.bytes)
          Find("restore", "gave another file back");
      }
    }
  }

  TakeFuzzOptions options_;
  std::mt19937_64 random_;
  TempDir dir_{"/dev/shm"};
  RigConfig config_ = TinyRig(2);
  std::vector<File> files_;
  std::string kind_;
  bool sealed_ = false;
  TakeFuzzResult result_;
};

}  // namespace

TakeFuzzResult FuzzTake(const TakeFuzzOptions& options) { return Fuzzer(options).Run(); }

}  // namespace sole::io
