#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/fit_sequence.h"
#include "core/frame_set.h"
#include "core/point_cloud.h"
#include "core/rig_config.h"

namespace sole::io {

/// take.json
struct TakeInfo {
  int format_version = 1;
  std::string name;
  std::string subject;  ///< pseudonym
  std::string consent;  ///< what the subject agreed to, in the lab's words; may be empty
  std::string notes;
  std::string created;   ///< ISO 8601, UTC
  std::string software;  ///< Sole's version
  std::string rig_hash;
  std::string state = "recording";  ///< recording, complete, recovered or aborted
  std::string verdict;              ///< good, usable or repeat; empty while recording
  std::vector<std::string> reasons;
};

/// One line of triggers.csv; times in seconds relative to the first scheduled trigger.
struct TriggerRecord {
  std::int64_t trigger = 0;
  ExposureKind kind = ExposureKind::kSpeckle;
  double scheduled_s = 0;
  double actual_s = 0;
  double exposure_start_s = 0;
  double exposure_end_s = 0;
};

/// Paths inside a take directory.
struct TakePaths {
  std::filesystem::path root;
  std::filesystem::path Info() const { return root / "take.json"; }
  std::filesystem::path RigFile() const { return root / "rig.toml"; }
  std::filesystem::path Triggers() const { return root / "triggers.csv"; }
  std::filesystem::path Raw(const std::string& serial) const {
    return root / "cameras" / (serial + ".raw");
  }
  std::filesystem::path Archive(const std::string& serial) const {
    return root / "cameras" / (serial + ".mkv");
  }
  std::filesystem::path TruthMesh(std::int64_t trigger) const;  ///< truth/mesh/000001.ply
  /// truth/maps/SERIAL/000001.npz
  std::filesystem::path TruthMaps(const std::string& serial, std::int64_t trigger) const;
  std::filesystem::path Truth() const { return root / "truth" / "truth.npz"; }
  std::filesystem::path TruthRig() const { return root / "truth" / "rig.json"; }
  std::filesystem::path Scan(std::int64_t trigger) const;      ///< scans/000001.ply
  std::filesystem::path Platform(std::int64_t trigger) const;  ///< scans/platform/000001.ply
  std::filesystem::path ScanMesh(std::int64_t trigger) const;  ///< scans/mesh/000001.ply
  std::filesystem::path ReconstructionStats() const { return root / "scans" / "stats.json"; }
  std::filesystem::path Contact() const { return root / "contact.npz"; }
  std::filesystem::path Fit() const { return root / "fit.npz"; }
  std::filesystem::path Measurements() const { return root / "measurements.csv"; }
  std::filesystem::path Exports() const { return root / "exports"; }
};

TakeInfo ReadTakeInfo(const TakePaths& take);
void WriteTakeInfo(const TakePaths& take, const TakeInfo& info);
std::vector<TriggerRecord> ReadTriggers(const TakePaths& take);
void WriteTriggers(const TakePaths& take, const std::vector<TriggerRecord>& triggers);

/// A recorded take as a source of frame sets, trigger by trigger. Opening checks that take.json is
/// of a known version and state, that the rig file is readable and that every camera of the rig has
/// a readable file; throws Error naming what is missing. A torn last record is dropped (its image
/// is absent), and so is one whose pixels do not match their checksum, which is told to `warn`.
class TakeReader : public FrameSource {
 public:
  /// `warn` gets one line for every damaged image that is read, from any thread that reads.
  explicit TakeReader(const std::filesystem::path& directory,
                      std::function<void(const std::string&)> warn = {});
  ~TakeReader() override;

  const TakeInfo& Info() const;
  const RigConfig& Config() const;
  const std::vector<TriggerRecord>& Triggers() const;
  std::optional<FrameSet> Next() override;
  /// Random access by index into Triggers(); safe to call from several threads.
  FrameSet Read(std::size_t index) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// contact.npz and fit.npz (docs/formats.md). contact.npz holds the ground of every frame, and
/// after fitting the labels.
struct ContactFile {
  std::vector<std::int64_t> triggers;
  std::vector<GroundPlane> ground;
  std::vector<FrameContact> contact;  ///< empty before fitting
};
void WriteContact(const std::filesystem::path& path, const ContactFile& file);
ContactFile ReadContact(const std::filesystem::path& path);
void WriteFit(const std::filesystem::path& path, const FitSequence& fit);
FitSequence ReadFit(const std::filesystem::path& path);

/// One line of measurements.csv: frame (trigger), name, value, unit, uncertainty (same unit),
/// definition version.
struct Measurement {
  std::int64_t frame = 0;
  std::string name;
  double value = 0;
  std::string unit;
  double uncertainty = 0;
  int definition_version = 1;
};
void WriteMeasurements(const std::filesystem::path& path,
                       const std::vector<Measurement>& measurements);
std::vector<Measurement> ReadMeasurements(const std::filesystem::path& path);

}  // namespace sole::io
