#pragma once

#include <filesystem>
#include <string>

#include <nlohmann/json.hpp>

namespace sole::app {

/// Statistics of a dataset of registrations: subjects by split, sex and side, frames by motion and
/// verdict, how much of the feet was seen, share of touching vertices; where the truth is known
/// also how far registered vertices are from their true places and how right the labels are.
nlohmann::json DatasetInfo(const std::filesystem::path& dataset);

/// The same as lines for the terminal.
std::string FormatDatasetInfo(const nlohmann::json& info);

}  // namespace sole::app
