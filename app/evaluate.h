#pragma once

#include <filesystem>
#include <optional>

#include <nlohmann/json.hpp>

#include "model/foot_model.h"

namespace sole::app {

/// Scores a processed simulated take against its truth (the definitions stand in docs/formats.md, "summary.json").
/// Sections and figures that were not computed are null. `model` gives the template's material points;
/// without them v2v and contact are null. Throws Error if the take has no truth.
nlohmann::json EvaluateTake(const std::filesystem::path& take, const std::optional<model::FootModel>& model);

/// The summary as a table for the terminal.
std::string FormatSummary(const nlohmann::json& summary);

/// Processor and number of cores, for example "AMD EPYC, 2 threads".
std::string MachineName();

}  // namespace sole::app
