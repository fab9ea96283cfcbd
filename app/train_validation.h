#pragma once

#include <filesystem>
#include <map>
#include <string>

#include <nlohmann/json.hpp>

#include "model/foot_model.h"

namespace sole::app {

/// Scores models by name on the validation subjects of a dataset as `sole evaluate` does on the test
/// subjects (app/model_scores.h): {"contact_mm", "noncontact_mm"}, with the simulator's truth also
/// {"contact_truth_mm", "noncontact_truth_mm"}, and of the model "full" what its network does when
/// contact changes: {"free_mm", "flattening_share", "monotonic_share"}. Null where there is none.
nlohmann::json ValidateModels(const std::filesystem::path& dataset,
                              const std::map<std::string, model::FootModel>& models,
                              int per_subject = 12);

}  // namespace sole::app
