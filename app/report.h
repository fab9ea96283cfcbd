#pragma once

#include <filesystem>

#include <nlohmann/json.hpp>

#include "app/stages.h"

namespace sole::app {

/// Writes one self-contained HTML page on a processed simulated take: the cameras' images, the scan coloured by
/// its error and the registered foot of the frame that touches the glass most, and the table of figures.
void WriteReport(const std::filesystem::path& path, const std::filesystem::path& take, const ModelPair& models,
                 const nlohmann::json& summary);

}  // namespace sole::app
