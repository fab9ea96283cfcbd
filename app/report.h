#pragma once

#include <filesystem>

#include <nlohmann/json.hpp>

#include "app/stages.h"

namespace sole::app {

/// Writes one self-contained HTML page on a processed simulated take: the cameras' images of the first frame, the scan
/// coloured by its error, the registered foot with its contact, and the table of figures.
void WriteReport(const std::filesystem::path& path, const std::filesystem::path& take, const ModelPair& models,
                 const nlohmann::json& summary);

}  // namespace sole::app
