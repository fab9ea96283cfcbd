#pragma once

#include <arv.h>

#include <memory>
#include <string>
#include <vector>

#include "capture/camera.h"
#include "core/error.h"

namespace sole::capture {

struct ObjectUnref {
  void operator()(void* object) const { g_object_unref(object); }
};
template <typename T>
using GObjectPtr = std::unique_ptr<T, ObjectUnref>;

/// Owns the GError that an Aravis call may set: `GErrorGuard error; f(..., error.Out());`.
class GErrorGuard {
 public:
  GErrorGuard() = default;
  ~GErrorGuard() { g_clear_error(&error_); }
  GErrorGuard(const GErrorGuard&) = delete;
  GErrorGuard& operator=(const GErrorGuard&) = delete;
  GError** Out() {
    g_clear_error(&error_);
    return &error_;
  }
  bool Failed() const { return error_ != nullptr; }
  std::string Message() const { return error_ == nullptr ? "no reason given" : error_->message; }
  /// Throws Error "`what`: reason" if the call failed.
  void Check(const std::string& what) const { Require(!Failed(), what + ": " + Message()); }

 private:
  GError* error_ = nullptr;
};

std::vector<CameraSetting> WriteSettings(ArvCamera* camera, const CameraConfig& config,
                                         const TriggerInput& trigger);

}  // namespace sole::capture
