#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "capture/trigger.h"
#include "core/frame_set.h"
#include "core/rig_config.h"
#include "io/raw_file.h"

namespace sole::capture {

struct RecordProgress {
  std::int64_t fired = 0;     ///< triggers so far
  std::int64_t triggers = 0;  ///< planned
  std::int64_t frames = 0;    ///< stored so far, all cameras
};

struct RecordOptions {
  std::filesystem::path directory;  ///< the take; must not exist or be empty
  std::string name;                 ///< empty: the directory's name
  std::string subject;              ///< pseudonym
  std::string notes;
  std::string software;  ///< Sole's version
  std::int64_t triggers = 100;
  std::vector<ExposureKind> cycle = {
      ExposureKind::kSpeckle};  ///< kinds of successive triggers, repeated
  int warmup_attempts = 4;
  int queue_frames = 32;  ///< per camera, between network and disk
  double usable_loss =
      0.02;  ///< largest share of a camera's triggers that may lack a whole frame in a usable take
  const std::atomic<bool>* stop =
      nullptr;  ///< set it (from a signal handler, say) to end the take early
  std::function<void(const RecordProgress&)> progress;  ///< called about ten times a second
  bool discard = false;  ///< checksums every frame but stores no images: for measuring
  /// Every stored frame of the camera `serial` with the CRC-32 of its pixels; called from the
  /// cameras' writer threads at once.
  std::function<void(const std::string& serial, const io::RawRecordHeader&, std::uint32_t)>
      on_stored;
  LogFunction log;  ///< warnings, one line each; may be called from several threads at once
};

/// What one camera delivered. expected = good + incomplete + lost.
struct CameraRecord {
  std::string serial;
  std::int64_t expected = 0;    ///< triggers fired
  std::int64_t good = 0;        ///< whole frames stored
  std::int64_t incomplete = 0;  ///< frames stored with status 1: packets missing
  std::int64_t lost = 0;        ///< triggers without a stored frame
  std::int64_t dropped = 0;     ///< of those: arrived, but the disk was too slow
  std::int64_t realigned = 0;   ///< frames whose id had to be corrected by their timestamp
  std::int64_t strays = 0;      ///< frames that belong to no trigger or repeat one; not stored
  std::vector<std::int64_t> lost_triggers;
  std::uint64_t resent_packets = 0;
  std::uint64_t missing_packets = 0;
  std::uint64_t underruns = 0;
  double latency_mean_s = 0;  ///< edge to whole frame
  double latency_max_s = 0;
};

struct RecordResult {
  std::string state;    ///< complete or aborted
  std::string verdict;  ///< good, usable or repeat
  std::vector<std::string> reasons;
  std::int64_t triggers = 0;      ///< fired
  bool stopped = false;           ///< by options.stop
  double trigger_late_max_s = 0;  ///< largest delay of an edge against the schedule
  std::vector<CameraRecord> cameras;

  std::int64_t FramesExpected() const;
  std::int64_t FramesGood() const;
  std::int64_t FramesLost() const;  ///< expected minus good
};

/// Records a take: opens and configures every camera, arms, fires warm-up triggers until all
/// cameras answer, then fires triggers 1, 2, ... and stores each frame under its trigger. The take
/// is written in place, so what is on the disk at any moment is readable. Throws Error before the
/// first trigger (a camera is missing, in use or silent; the directory is not empty or not
/// writable; too little room) and leaves no take then. Afterwards failures such as a full disk end
/// the take: state aborted, verdict repeat.
RecordResult Record(const RigConfig& config, const RecordOptions& options);

}  // namespace sole::capture
