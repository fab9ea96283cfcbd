#pragma once

#include <memory>
#include <vector>

#include "capture/recorder.h"
#include "core/image.h"

namespace sole::app {

/// A plain page on 127.0.0.1 with the newest picture of every camera and the take's counters:
/// / (HTML), /status.json, /camera/N.jpg (N from 0, rig order). Only this computer can open it.
class ViewServer {
 public:
  /// `port` 0 takes a free one. Throws Error if the port is in use.
  explicit ViewServer(int port);
  ~ViewServer();
  ViewServer(const ViewServer&) = delete;
  ViewServer& operator=(const ViewServer&) = delete;

  int Port() const;
  void Show(const capture::RecordProgress& progress);
  void Show(const std::vector<ImageU8>& pictures);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace sole::app
