#pragma once

#include <string>
#include <vector>

#include "capture/rig_check.h"
#include "core/rig_config.h"

namespace sole::capture {

struct RigDraftOptions {
  std::vector<std::string> serials;  ///< only these cameras, in this order; empty: all, by serial
};

struct RigDraft {
  RigConfig config;
  std::vector<RigFinding> findings;  ///< per camera what it is, or why it was left out; what to edit
};

/// A rig file to begin with from the cameras that answer discovery: serials, sensor sizes, exposure
/// and gain as they are set now, neighbours by serial as pairs, and a trigger that all of them have.
/// Where cameras stand cannot be found out: positions are placeholders below the plate. Throws Error
/// if no camera is found or a named one is missing.
RigDraft DraftRig(const RigDraftOptions& options = {});

}  // namespace sole::capture
