#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "capture/camera_monitor.h"
#include "capture/take_control.h"
#include "capture/take_finding.h"
#include "capture/trigger.h"
#include "core/frame_set.h"
#include "core/rig_config.h"
#include "io/raw_file.h"

namespace sole::capture {

/// One camera while a take is recorded.
struct CameraStatus {
  std::string serial;
  std::int64_t frames = 0;  ///< arrived, of the take
  std::int64_t lost = 0;    ///< triggers of the take whose frame is overdue
  std::uint64_t resent_packets = 0;
  double saturated = 0;  ///< share of the newest image
  double focus = 0;      ///< ImageSample::focus of the newest image
  int queued = 0;        ///< frames between network and disk
  double latency_s = 0;  ///< of the newest frame, edge to whole frame
  double sync_s = 0;     ///< its camera time against its edge
  bool silent = false;   ///< three triggers or more without a frame
  bool reconnecting = false;
  bool foot = false;
};

struct RecordProgress {
  TakePhase phase = TakePhase::kWaiting;
  std::int64_t fired = 0;        ///< triggers of the take so far
  std::int64_t triggers = 0;     ///< planned; 0: open end
  std::int64_t frames = 0;       ///< stored so far, all cameras
  double trigger_jitter_s = 0;   ///< largest lateness of the last 50 edges
  double disk_left_s = 0;        ///< recording time that fits onto the disk
  std::vector<CameraStatus> cameras;
};

enum class RecordEvent { kStart, kStop, kFault };

struct RecordOptions {
  std::filesystem::path directory;  ///< the take; must not exist or be empty
  std::string name;                 ///< empty: the directory's name
  std::string subject;              ///< pseudonym
  std::string consent;              ///< what the subject agreed to
  std::string notes;
  std::string software;  ///< Sole's version
  std::int64_t triggers = 100;  ///< from the start on; pre-roll comes on top; 0: no limit
  double seconds = 0;           ///< longest time from the start; 0: no limit
  std::vector<ExposureKind> cycle;  ///< instead of the rig file's exposures; empty: those
  StartOn start = StartOn::kAtOnce;
  bool stop_on_foot_off = false;
  std::function<bool()> key;  ///< asked often; true once for each hit: start or stop
  int warmup_attempts = 4;
  int queue_frames = 32;  ///< per camera, between network and disk
  double usable_loss =
      0.02;  ///< largest share of a camera's triggers that may lack a whole frame in a usable take
  const std::atomic<bool>* stop =
      nullptr;  ///< set it (from a signal handler, say) to end the take early
  std::function<void(const RecordProgress&)> progress;  ///< called about ten times a second
  /// The newest image of every camera, rig order, empty where there is none; about twice a second.
  std::function<void(const std::vector<ImageU8>&)> pictures;
  std::function<void(RecordEvent)> on_event;  ///< for the bell
  bool check_images = true;  ///< judges some images of the take at its end
  std::filesystem::path reference;  ///< an earlier good take of the rig to compare with; may be empty
  /// More checks on the take, which is complete but for its verdict.
  std::function<std::vector<TakeFinding>(const std::filesystem::path& take)> check;
  bool discard = false;  ///< checksums every frame but stores no images: for measuring
  /// Every stored frame of the camera `serial` with the CRC-32 of its pixels; called from the
  /// cameras' writer threads at once.
  std::function<void(const std::string& serial, const io::RawRecordHeader&, std::uint32_t)>
      on_stored;
  LogFunction log;  ///< warnings, one line each; may be called from several threads at once
};

/// A camera fell silent during the take.
struct CameraGap {
  std::int64_t after_trigger = 0;  ///< the newest trigger when its last frame came
  double seconds = 0;              ///< until it came back or the take ended
  bool ended = false;              ///< it came back
  bool reopened = false;           ///< with a new connection and all settings applied again
};

/// What one camera delivered. expected = good + incomplete + lost.
struct CameraRecord {
  std::string serial;
  std::int64_t expected = 0;    ///< triggers fired
  std::int64_t good = 0;        ///< whole frames stored
  std::int64_t incomplete = 0;  ///< frames stored with status 1: packets missing
  std::int64_t lost = 0;        ///< triggers without a stored frame
  std::int64_t dropped = 0;     ///< of those: arrived, but the disk was too slow
  std::int64_t realigned = 0;   ///< times that an id had to be corrected by the timestamp
  std::int64_t ids_behind = 0;  ///< ids that fell behind the triggers: pulses missed, ids repeated
  std::int64_t ids_ahead = 0;   ///< ids that ran ahead: ids skipped, pulses doubled
  std::int64_t strays = 0;      ///< frames that belong to no trigger or repeat one; not stored
  std::vector<std::int64_t> lost_triggers;
  std::uint64_t resent_packets = 0;
  double resent_share = 0;  ///< of the take's packets
  std::uint64_t missing_packets = 0;
  std::uint64_t underruns = 0;
  double latency_mean_s = 0;  ///< edge to whole frame
  double latency_max_s = 0;
  double latency_median_s = 0;
  double latency_warmup_s = 0;     ///< of the frame that answered the warm-up
  std::optional<ClockRate> clock;  ///< empty with too few frames
  int shift = 0;                   ///< triggers by which its images lag behind the other cameras'
  std::vector<CameraGap> gaps;
};

struct RecordResult {
  std::string state;    ///< complete or aborted
  std::string verdict;  ///< good, usable or repeat
  std::vector<std::string> reasons;
  std::int64_t triggers = 0;      ///< fired
  bool stopped = false;           ///< by options.stop, before its time
  double trigger_late_max_s = 0;  ///< largest delay of an edge against the schedule
  std::vector<std::int64_t> unexposed;  ///< triggers that the read-back line did not confirm
  std::vector<CameraRecord> cameras;

  std::int64_t FramesExpected() const;
  std::int64_t FramesGood() const;
  std::int64_t FramesLost() const;  ///< expected minus good
};

/// Records a take: opens and configures every camera, arms, fires warm-up triggers until all
/// cameras answer, then fires triggers 1, 2, ... and stores each frame under its trigger. With a
/// start by key or foot, triggers fire while it waits and the newest pre_roll_s of them become the
/// take's first. A camera that falls silent is brought back while the others go on. The take is
/// written in place, so what is on the disk at any moment is readable. Throws Error before the
/// first trigger (a camera is missing, in use or silent; the directory is not empty or not
/// writable; too little room) and leaves no take then. Afterwards failures such as a full disk end
/// the take: state aborted, verdict repeat.
RecordResult Record(const RigConfig& config, const RecordOptions& options);

}  // namespace sole::capture
