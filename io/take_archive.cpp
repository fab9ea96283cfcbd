#include "io/take_archive.h"

#include <mutex>
#include <vector>

#include "core/error.h"
#include "io/atomic_file.h"
#include "io/parallel_internal.h"
#include "io/raw_archive.h"
#include "io/rig_file.h"
#include "io/take.h"

namespace sole::io {

namespace fs = std::filesystem;

namespace {

struct Job {
  fs::path from, to;
  std::int64_t records = 0;
};

/// Everything of a take but its images.
void CopyRest(const fs::path& from, const fs::path& to) {
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(from)) {
    const fs::path name = entry.path().filename();
    if (name == "cameras" || name == "take.json") continue;
    fs::copy(entry.path(), to / name,
             fs::copy_options::recursive | fs::copy_options::overwrite_existing, error);
    Require(!error,
            "cannot copy " + entry.path().string() + " to " + to.string() + ": " + error.message());
  }
  // Last, since it makes the folder a take.
  WriteStringAtomically(to / "take.json", ReadFile(from / "take.json"));
}

TakePaths Prepare(const TakePaths& take, const fs::path& out) {
  if (out.empty()) return take;
  const TakePaths target{out};
  Require(!fs::exists(target.Info()),
          out.string() + " already holds a take: choose another folder");
  MakeDirectory(out / "cameras");
  return target;
}

using Convert = std::function<void(const Job&, const ArchiveOptions&)>;

void RunJobs(const std::vector<Job>& jobs, double rate_hz, const TakeArchiveOptions& options,
             int passes, const Convert& convert) {
  std::int64_t total = 0, done = 0;
  for (const Job& job : jobs) total += passes * job.records;
  std::mutex mutex;
  const auto step = [&] {
    const std::lock_guard lock(mutex);
    if (options.progress) options.progress(std::min(++done, total), total);
  };
  ForEach(jobs.size(), options.threads, [&](std::size_t i) {
    convert(jobs[i], {.rate_hz = rate_hz, .progress = step, .stop = options.stop});
  });
}

void DeleteSources(const std::vector<Job>& jobs, TakeArchiveResult& result) {
  for (const Job& job : jobs) {
    std::error_code error;
    Require(fs::remove(job.from, error) && !error,
            "cannot delete " + job.from.string() + ": " + error.message());
    ++result.deleted;
  }
}

}  // namespace

TakeArchiveResult ArchiveTake(const fs::path& directory, const TakeArchiveOptions& options) {
  const TakePaths take{directory};
  const TakeInfo info = ReadTakeInfo(take);
  const RigConfig config = ReadRigFile(take.RigFile());
  Require(info.state != "recording",
          directory.string() + " was not closed: run sole take recover " + directory.string());
  TakeArchiveResult result;
  std::vector<Job> jobs;
  for (const CameraConfig& camera : config.cameras) {
    const fs::path raw = take.Raw(camera.serial);
    Require(fs::exists(raw),
            raw.string() + " is missing: " +
                (fs::exists(take.Archive(camera.serial)) ? "the take is archived already"
                                                         : "recover the take first"));
    jobs.push_back({raw, {}, static_cast<std::int64_t>(ReadRawIndex(raw).records.size())});
    result.records += jobs.back().records;
    result.raw_bytes += fs::file_size(raw);
  }
  const TakePaths target = Prepare(take, options.out);
  for (std::size_t i = 0; i < jobs.size(); ++i)
    jobs[i].to = target.Archive(config.cameras[i].serial);
  RunJobs(jobs, config.trigger.rate_hz, options, 2,
          [](const Job& job, const ArchiveOptions& o) { ArchiveRawFile(job.from, job.to, o); });
  if (!options.out.empty()) CopyRest(directory, options.out);
  for (const Job& job : jobs) result.archive_bytes += fs::file_size(job.to);
  if (options.delete_source) DeleteSources(jobs, result);
  return result;
}

TakeArchiveResult RestoreTake(const fs::path& directory, const TakeArchiveOptions& options) {
  const TakePaths take{directory};
  ReadTakeInfo(take);
  const RigConfig config = ReadRigFile(take.RigFile());
  const TakePaths target = Prepare(take, options.out);
  TakeArchiveResult result;
  std::vector<Job> jobs, todo;
  for (const CameraConfig& camera : config.cameras) {
    const Job job{take.Archive(camera.serial), target.Raw(camera.serial),
                  fs::exists(take.Archive(camera.serial))
                      ? static_cast<std::int64_t>(
                            ReadArchiveIndex(take.Archive(camera.serial)).records.size())
                      : 0};
    // A file that stands under its final name is whole: an earlier attempt was interrupted.
    if (!fs::exists(job.to)) todo.push_back(job);
    jobs.push_back(job);
    Require(fs::exists(job.from) || fs::exists(job.to),
            job.from.string() + " is missing: the take is not archived");
  }
  Require(!todo.empty() || options.delete_source,
          directory.string() + ": nothing to restore: its raw files are there");
  RunJobs(todo, config.trigger.rate_hz, options, 1,
          [](const Job& job, const ArchiveOptions& o) { RestoreRawFile(job.from, job.to, o); });
  if (!options.out.empty()) CopyRest(directory, options.out);
  for (const Job& job : jobs) {
    result.records += job.records;
    result.raw_bytes += fs::file_size(job.to);
    if (fs::exists(job.from)) result.archive_bytes += fs::file_size(job.from);
  }
  // Files of an earlier attempt count as restored only where they are what the archive gives.
  if (options.delete_source) {
    std::erase_if(jobs, [](const Job& job) { return !fs::exists(job.from); });
    for (const Job& job : jobs) ArchiveRawFile(job.to, job.from, {.stop = options.stop});
    DeleteSources(jobs, result);
  }
  return result;
}

}  // namespace sole::io
