#pragma once

#include <filesystem>
#include <string>

#include "core/rig_config.h"

namespace sole::io {

/// Reads a rig file (TOML; docs/formats.md). Unknown keys, wrong types and impossible values throw
/// Error with file, line and column. Missing keys take the defaults of RigConfig.
RigConfig ReadRigFile(const std::filesystem::path& path);
/// The same from text; `name` stands for the path in messages.
RigConfig ParseRig(const std::string& toml, const std::string& name);
/// Text of a rig file that ReadRigFile reads back to the same configuration.
std::string FormatRig(const RigConfig& config);
void WriteRigFile(const std::filesystem::path& path, const RigConfig& config);

}  // namespace sole::io
