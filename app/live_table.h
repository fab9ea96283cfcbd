#pragma once

#include <memory>
#include <string>

#include "capture/recorder.h"

namespace sole::app {

/// The take's state as text: one line on the whole, on a terminal followed by one line per camera.
std::string FormatStatus(const capture::RecordProgress& progress, bool cameras);

/// Shows a take while it is recorded on stderr: a table that stays in place on a terminal, otherwise
/// a plain line every two seconds and whenever the phase or a camera's silence changes.
class LiveTable {
 public:
  LiveTable();
  ~LiveTable();
  LiveTable(const LiveTable&) = delete;
  LiveTable& operator=(const LiveTable&) = delete;
  void Show(const capture::RecordProgress& progress);
  /// A line of text that does not tear the table.
  void Say(const std::string& line);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace sole::app
