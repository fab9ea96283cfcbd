// take.json, triggers.csv and measurements.csv, and where a take's files lie.
#include <array>
#include <cstdio>

#include <fmt/format.h>

#include "io/atomic_file.h"
#include "io/csv_internal.h"
#include "io/json_internal.h"
#include "io/shown_internal.h"
#include "io/take.h"

namespace sole::io {

namespace fs = std::filesystem;

namespace {

constexpr int kTakeVersion = 1;
constexpr std::array kStates{"recording", "complete", "recovered", "aborted"};
constexpr std::array kVerdicts{"", "good", "usable", "repeat"};
const std::vector<std::string> kTriggerColumns{
    "trigger", "kind", "scheduled_s", "actual_s", "exposure_start_s", "exposure_end_s"};
const std::vector<std::string> kMeasurementColumns{"frame", "name",        "value",
                                                   "unit",  "uncertainty", "definition_version"};

std::string NumberedPly(std::int64_t trigger) { return fmt::format("{:06}.ply", trigger); }

std::string Header(const std::vector<std::string>& columns) {
  return fmt::format("{}\n", fmt::join(columns, ","));
}

template <typename List>
void RequireOneOf(const std::string& value, const List& list, const char* key,
                  const std::string& where) {
  for (const char* known : list) {
    if (value == known) return;
  }
  throw Error(where + ": key '" + key + "' holds the unknown word '" + Shown(value) + "'");
}

}  // namespace

fs::path TakePaths::TruthMesh(std::int64_t trigger) const {
  return root / "truth" / "mesh" / NumberedPly(trigger);
}
fs::path TakePaths::TruthMaps(const std::string& serial, std::int64_t trigger) const {
  return root / "truth" / "maps" / serial / fmt::format("{:06}.npz", trigger);
}
fs::path TakePaths::Scan(std::int64_t trigger) const {
  return root / "scans" / NumberedPly(trigger);
}
fs::path TakePaths::Platform(std::int64_t trigger) const {
  return root / "scans" / "platform" / NumberedPly(trigger);
}
fs::path TakePaths::ScanMesh(std::int64_t trigger) const {
  return root / "scans" / "mesh" / NumberedPly(trigger);
}

TakeInfo ReadTakeInfo(const TakePaths& take) {
  const std::string where = take.Info().string();
  Require(fs::exists(take.Info()), where + " is missing: " + take.root.string() + " is not a take");
  const Json json = ParseJson(ReadFile(take.Info()), where);
  TakeInfo info;
  info.format_version = Get<int>(json, "format_version", where);
  Require(info.format_version == kTakeVersion,
          where + ": format version " + std::to_string(info.format_version) +
              " is unknown: use the version of Sole that recorded it");
  info.name = Get<std::string>(json, "name", where);
  info.subject = Get<std::string>(json, "subject", where);
  // Takes recorded before consent was asked for have no such key.
  if (json.contains("consent")) info.consent = Get<std::string>(json, "consent", where);
  info.notes = Get<std::string>(json, "notes", where);
  info.created = Get<std::string>(json, "created", where);
  info.software = Get<std::string>(json, "software", where);
  info.rig_hash = Get<std::string>(json, "rig_hash", where);
  info.state = Get<std::string>(json, "state", where);
  RequireOneOf(info.state, kStates, "state", where);
  info.verdict = Get<std::string>(json, "verdict", where);
  RequireOneOf(info.verdict, kVerdicts, "verdict", where);
  const Json& reasons = Member(json, "reasons", where);
  Require(reasons.is_array(), where + ": key 'reasons' must be a list of texts");
  for (const Json& reason : reasons) {
    Require(reason.is_string(), where + ": key 'reasons' must be a list of texts");
    info.reasons.push_back(reason.get<std::string>());
  }
  return info;
}

void WriteTakeInfo(const TakePaths& take, const TakeInfo& info) {
  const std::string where = take.Info().string();
  RequireOneOf(info.state, kStates, "state", where);
  RequireOneOf(info.verdict, kVerdicts, "verdict", where);
  const Json json{{"format", "sole-take"},     {"format_version", info.format_version},
                  {"units", "SI: m, s, rad"},  {"name", info.name},
                  {"subject", info.subject},   {"consent", info.consent},
                  {"notes", info.notes},
                  {"created", info.created},   {"software", info.software},
                  {"rig_hash", info.rig_hash}, {"state", info.state},
                  {"verdict", info.verdict},   {"reasons", info.reasons}};
  WriteStringAtomically(take.Info(), FormatJson(json));
}

std::vector<TriggerRecord> ReadTriggers(const TakePaths& take) {
  const CsvTable table =
      ParseCsv(ReadFile(take.Triggers()), kTriggerColumns, take.Triggers().string());
  std::vector<TriggerRecord> triggers;
  for (const CsvTable::Row& row : table.rows) {
    TriggerRecord record;
    record.trigger = table.Integer(row, 0);
    Require(record.trigger >= 1 && (triggers.empty() || record.trigger > triggers.back().trigger),
            table.Place(row, 0) + ": triggers count upwards from 1");
    try {
      record.kind = ExposureKindFromString(Shown(row.fields[1]));
    } catch (const Error& error) {
      throw Error(table.Place(row, 1) + ": " + error.what());
    }
    record.scheduled_s = table.Number(row, 2);
    record.actual_s = table.Number(row, 3);
    record.exposure_start_s = table.Number(row, 4);
    record.exposure_end_s = table.Number(row, 5);
    triggers.push_back(record);
  }
  return triggers;
}

void WriteTriggers(const TakePaths& take, const std::vector<TriggerRecord>& triggers) {
  std::string text = Header(kTriggerColumns);
  for (const TriggerRecord& t : triggers) {
    text += fmt::format("{},{},{},{},{},{}\n", t.trigger, ToString(t.kind), t.scheduled_s,
                        t.actual_s, t.exposure_start_s, t.exposure_end_s);
  }
  WriteStringAtomically(take.Triggers(), text);
}

void WriteMeasurements(const fs::path& path, const std::vector<Measurement>& measurements) {
  std::string text = Header(kMeasurementColumns);
  for (const Measurement& m : measurements) {
    text += fmt::format("{},{},{},{},{},{}\n", m.frame, CsvField(m.name), m.value, CsvField(m.unit),
                        m.uncertainty, m.definition_version);
  }
  WriteStringAtomically(path, text);
}

std::vector<Measurement> ReadMeasurements(const fs::path& path) {
  const CsvTable table = ParseCsv(ReadFile(path), kMeasurementColumns, path.string());
  std::vector<Measurement> measurements;
  for (const CsvTable::Row& row : table.rows) {
    const std::int64_t version = table.Integer(row, 5);
    Require(version >= 1 && version < 1000000, table.Place(row, 5) + ": must be 1 or more");
    measurements.push_back({table.Integer(row, 0), row.fields[1], table.Number(row, 2),
                            row.fields[3], table.Number(row, 4), static_cast<int>(version)});
  }
  return measurements;
}

}  // namespace sole::io
