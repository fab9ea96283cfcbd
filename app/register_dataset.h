#pragma once

#include <atomic>
#include <filesystem>
#include <functional>

#include <nlohmann/json.hpp>

#include "app/stages.h"

namespace sole::app {

struct RegisterOptions {
  const std::atomic<bool>* stop = nullptr;  ///< set to end early; what is finished stays
};

/// Registers every person of a scan dataset (`sole sim scans`) to the template of `models`, as
/// `sole fit` does with a take, people in parallel, and writes a file of registrations for each.
/// People who have one already are left out, so the call completes what was interrupted. The
/// clouds alone are fitted; the true places of the material points are copied beside the result.
/// Returns people, people_registered, frames, good, seconds. `done` hears how many people are
/// there. Throws Error where the dataset is damaged or incomplete.
nlohmann::json RegisterDataset(const std::filesystem::path& dataset, const ModelPair& models,
                               const RegisterOptions& options = {},
                               const std::function<void(int, int)>& done = {});

/// Adds a fitted take to a dataset of registrations (made if it does not exist) under its subject's
/// pseudonym and side. A foot may have several takes; each is added once, as a sequence. Simulated
/// takes bring their truth along, for scoring. Returns subject, split, takes, frames and good ones
/// of the foot.
nlohmann::json AddTake(const std::filesystem::path& dataset, const std::filesystem::path& take,
                       const ModelPair& models);

}  // namespace sole::app
