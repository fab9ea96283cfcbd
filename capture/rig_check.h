#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "capture/trigger.h"
#include "core/rig_config.h"

namespace sole::capture {

enum class Severity { kOk, kWarning, kError };

const char* ToString(Severity severity);

/// One thing that was looked at.
struct RigFinding {
  Severity severity = Severity::kOk;
  std::string camera;  ///< serial; empty for the rig as a whole
  std::string what;    ///< one line
  std::string mend;    ///< what to do; empty for kOk
};

struct RigCameraCheck {
  std::string serial;
  bool found = false;
  bool controlled = false;   ///< opened with control
  bool settings_ok = false;  ///< all written and read back
  int fired = 0;             ///< test triggers
  int answered = 0;          ///< whole frames that came back
  double latency_max_s = 0;  ///< edge to whole frame
  std::uint64_t resent_packets = 0;
  std::uint64_t missing_packets = 0;
};

struct RigCheckResult {
  std::vector<RigCameraCheck> cameras;  ///< rig order
  std::vector<RigFinding> findings;     ///< at least one per camera
  double disk_bytes_per_s = 0;          ///< measured; 0: not measured
  double needed_bytes_per_s = 0;        ///< by recording with this rig
  bool Ok() const;                      ///< no finding is an error
};

struct RigCheckOptions {
  int triggers = 10;           ///< test triggers after the warm-up
  std::filesystem::path disk;  ///< directory for takes, whose disk is measured; empty: none
  LogFunction log;
};

/// Opens every camera, writes and reads back its settings, fires warm-up and test triggers, measures
/// latency, loss and the disk, and says what is wrong. Problems of the rig are findings; throws Error only if `config` itself is
/// impossible.
RigCheckResult CheckRig(const RigConfig& config, const RigCheckOptions& options = {});

}  // namespace sole::capture
