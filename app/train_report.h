#pragma once

#include <filesystem>
#include <map>
#include <string>

#include <nlohmann/json.hpp>

#include "app/train_networks.h"

namespace sole::app {

/// One self-contained page on a training: learning curves as SVG, validation table, explained
/// variance of shape and pose.
void WriteTrainReport(const std::filesystem::path& path, const nlohmann::json& account,
                      const std::map<std::string, LearningCurve>& curves);

}  // namespace sole::app
