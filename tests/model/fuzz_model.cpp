// Damages model files in every way and loads them: pickles, npy and npz archives (whose entries are
// sometimes damaged below their checksums), best in the asan preset:
// fuzz_model FOLDER [seconds = 600] [seed = 1] [rounds]; FOLDER is made by foreign_files.py.
// A finding is: an exception other than Error, an Error that is not one line naming the file, a
// model that cannot be evaluated, or memory beyond a multiple of the file's size.
#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "core/error.h"
#include "io/atomic_file.h"
#include "io/zip_internal.h"
#include "model/forward.h"
#include "model/released_model.h"
#include "tests/support/temp_dir.h"

#if defined(__SANITIZE_ADDRESS__)
// Debian's gcc comes without the sanitizer's headers.
extern "C" int __sanitizer_install_malloc_and_free_hooks(
    void (*on_malloc)(const volatile void*, std::size_t), void (*on_free)(const volatile void*));
extern "C" std::size_t __sanitizer_get_allocated_size(const volatile void* block);
#endif

namespace sole::model {
namespace {

namespace fs = std::filesystem;
using Random = std::mt19937_64;

// ---- Memory in use, by the sanitizer's hooks; without them the address space is limited.

std::size_t g_used = 0, g_peak = 0;

#if defined(__SANITIZE_ADDRESS__)
constexpr bool kCountsMemory = true;
void OnMalloc(const volatile void*, std::size_t size) {
  g_used += size;
  g_peak = std::max(g_peak, g_used);
}
void OnFree(const volatile void* block) {
  if (block) g_used -= __sanitizer_get_allocated_size(block);
}
void WatchMemory() {
  __sanitizer_install_malloc_and_free_hooks(OnMalloc, OnFree);
}
#else
constexpr bool kCountsMemory = false;
void WatchMemory() {
  rlimit limit{};
  getrlimit(RLIMIT_AS, &limit);
  limit.rlim_cur = std::size_t{2} << 30;
  setrlimit(RLIMIT_AS, &limit);
}
#endif

/// What a file may take: buffers and copies in double precision of what it holds, which deflate and
/// small dtypes make a multiple of its size.
std::size_t AllowedMemory(const std::string& bytes) {
  const bool zip = bytes.starts_with("PK");
  return (std::size_t{4} << 20) + (zip ? std::size_t{8} * 1032 : std::size_t{256}) * bytes.size();
}

// ---- Damage.

std::size_t Below(Random& random, std::size_t n) { return n == 0 ? 0 : random() % n; }

/// A value that length fields trip over, in place of 1, 2, 4 or 8 bytes.
void PutInteger(std::string& bytes, Random& random) {
  static constexpr std::array<std::uint64_t, 12> kValues = {
      0, 1, 2, 0x7f, 0xff, 0x7fff, 0xffff, 0x7fffffff, 0xffffffff, 0x100000000, 1ULL << 62, ~0ULL};
  const std::uint64_t value = kValues[Below(random, kValues.size())];
  const std::size_t size = std::size_t{1} << Below(random, 4);
  if (bytes.size() < size) return;
  std::memcpy(&bytes[Below(random, bytes.size() - size + 1)], &value, size);
}

/// Digits of shapes in npy headers and in textual pickles.
void PutDigit(std::string& bytes, Random& random) {
  const std::size_t from = Below(random, bytes.size());
  const std::size_t at = bytes.find_first_of("0123456789", from);
  if (at == std::string::npos) return;
  static constexpr std::array<const char*, 6> kTexts = {"0", "9", "-1", "4294967295", "1000000", ""};
  bytes.replace(at, 1, kTexts[Below(random, kTexts.size())]);
}

/// An instruction of pickles, put in or over another byte.
void PutOpcode(std::string& bytes, Random& random) {
  static constexpr char kCodes[] =
      "(.012FIJKLMNRSTUVXabcdeghijlopqrstu}BC\x80\x81\x82\x83\x84\x85\x86\x87\x88\x89\x8a\x8b\x8c\x8d"
      "\x8e\x8f\x90\x91\x92\x93\x94\x95\x96\x97\x98";
  const char code = kCodes[Below(random, sizeof(kCodes) - 1)];
  const std::size_t at = Below(random, bytes.size());
  if (random() % 2 == 0)
    bytes[at] = code;
  else
    bytes.insert(at, 1, code);
}

/// A piece of the file, or of another one, at some place.
void Splice(std::string& bytes, const std::string& other, Random& random) {
  const std::size_t from = Below(random, other.size());
  const std::string piece = other.substr(from, 1 + Below(random, 64));
  const std::size_t at = Below(random, bytes.size());
  if (random() % 2 == 0)
    bytes.insert(at, piece);
  else
    bytes.replace(at, piece.size(), piece);
}

void DamageOnce(std::string& bytes, const std::string& other, Random& random) {
  if (bytes.empty()) return;
  switch (Below(random, 9)) {
    case 0:
      bytes[Below(random, bytes.size())] ^= static_cast<char>(1 << Below(random, 8));
      break;
    case 1:
      bytes[Below(random, bytes.size())] = static_cast<char>(random() & 0xff);
      break;
    case 2:
    case 3:
      PutInteger(bytes, random);
      break;
    case 4:
      PutDigit(bytes, random);
      break;
    case 5:
      PutOpcode(bytes, random);
      break;
    case 6:
      Splice(bytes, other, random);
      break;
    case 7:
      Splice(bytes, bytes, random);
      break;
    default:
      if (random() % 4 == 0) bytes.resize(Below(random, bytes.size()));
  }
}

std::string Damaged(std::string bytes, const std::string& other, Random& random) {
  for (std::size_t left = 1 + Below(random, 4); left > 0; --left) DamageOnce(bytes, other, random);
  return bytes;
}

/// Damages an archive's entries and packs them anew, so that checksums hold.
std::string DamagedInside(const std::string& archive, const std::string& other, Random& random) {
  std::map<std::string, io::Bytes> entries = io::ReadZip(archive, "seed");
  auto victim = std::next(entries.begin(), static_cast<std::ptrdiff_t>(Below(random, entries.size())));
  // Most of an array is values: the header is what matters.
  std::string bytes(victim->second.begin(), victim->second.end());
  const std::size_t header = random() % 4 == 0 ? bytes.size() : std::min<std::size_t>(128, bytes.size());
  const std::string changed = Damaged(bytes.substr(0, header), other, random) + bytes.substr(header);
  victim->second.assign(changed.begin(), changed.end());
  if (random() % 16 == 0) entries.erase(victim);
  return io::FormatZip(entries, "seed");
}

// ---- Rounds.

struct Counts {
  long accepted = 0, refused = 0;
  double worst_memory = 0;  ///< bytes in use per byte of file, of files beyond 1 KiB
};

/// Loads and evaluates; what went wrong, or nothing.
std::string Try(const fs::path& path, Counts& counts) {
  try {
    const FootModel model = LoadAnyModel(path);
    ++counts.accepted;
    const PosedFoot foot = Forward(model, RestParameters(model));
    if (foot.vertices_m.rows() != model.NumVertices()) return "vertices were lost";
  } catch (const Error& error) {
    ++counts.refused;
    const std::string what = error.what();
    if (what.find(path.filename().string()) == std::string::npos) return "names no file: " + what;
    if (what.find('\n') != std::string::npos) return "more than one line: " + what;
  } catch (const std::exception& error) {
    return std::string("not a sole::Error: ") + error.what();
  }
  return "";
}

int Run(const fs::path& folder, double seconds, std::uint64_t seed, long rounds) {
  std::vector<std::pair<std::string, std::string>> files;
  for (const auto& entry : fs::directory_iterator(folder))
    files.emplace_back(entry.path().filename(), io::ReadFile(entry.path()));
  std::ranges::sort(files);
  Require(!files.empty(), folder.string() + ": no files to damage: run foreign_files.py on it");
  const testing_support::TempDir dir("/dev/shm");
  std::map<std::string, Counts> counts;
  for (const auto& [name, bytes] : files) {
    io::WriteStringAtomically(dir / name, bytes);
    Counts whole;
    const std::string wrong = Try(dir / name, whole);
    Require(whole.accepted == 1 && wrong.empty(), name + ": the whole file is not read: " + wrong);
  }
  WatchMemory();
  Random random(seed);
  const auto begin = std::chrono::steady_clock::now();
  long round = 0;
  std::string finding;
  for (; round < rounds && finding.empty(); ++round) {
    if (std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count() > seconds)
      break;
    const auto& [name, whole] = files[Below(random, files.size())];
    const std::string& other = files[Below(random, files.size())].second;
    const bool inside = whole.starts_with("PK") && random() % 4 != 0;
    const std::string bytes =
        inside ? DamagedInside(whole, other, random) : Damaged(whole, other, random);
    const fs::path path = dir / name;
    io::WriteStringAtomically(path, bytes);
    Counts& of_file = counts[name];
    const std::size_t before = g_used;
    g_peak = g_used;
    finding = Try(path, of_file);
    const std::size_t taken = g_peak - std::min(before, g_peak);
    if (kCountsMemory && bytes.size() > 1024)
      of_file.worst_memory =
          std::max(of_file.worst_memory, static_cast<double>(taken) / static_cast<double>(bytes.size()));
    if (taken > AllowedMemory(bytes))
      finding = "took " + std::to_string(taken) + " bytes for a file of " + std::to_string(bytes.size());
    if (!finding.empty()) {
      const fs::path kept = fs::temp_directory_path() / ("fuzz_model_finding_" + name);
      fs::copy_file(path, kept, fs::copy_options::overwrite_existing);
      finding = name + ", kept as " + kept.string() + ": " + finding;
    }
  }
  std::printf("%ld rounds in %.0f s\n", round,
              std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
  for (const auto& [name, c] : counts) {
    std::printf("%-18s %7ld read, %7ld refused", name.c_str(), c.accepted, c.refused);
    if (kCountsMemory) std::printf(", at most %.0f bytes a byte of file", c.worst_memory);
    std::printf("\n");
  }
  std::printf("findings: %s\n", finding.empty() ? "none" : finding.c_str());
  return finding.empty() ? 0 : 1;
}

}  // namespace
}  // namespace sole::model

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: fuzz_model FOLDER [seconds] [seed] [rounds]\n");
    return 2;
  }
  try {
    return sole::model::Run(argv[1], argc > 2 ? std::atof(argv[2]) : 600,
                            argc > 3 ? std::strtoull(argv[3], nullptr, 10) : 1,
                            argc > 4 ? std::atol(argv[4]) : 1'000'000'000'000L);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "fuzz_model: %s\n", error.what());
    return 1;
  }
}
