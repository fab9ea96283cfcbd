#pragma once

#include <atomic>
#include <filesystem>

#include <nlohmann/json.hpp>

#include "app/train_config.h"

namespace sole::app {

struct TrainOptions {
  TrainConfig config;
  std::filesystem::path model_template;  ///< topology, tree, landmarks, material, priors
  bool ablation = false;  ///< also write the models with less in them
  bool truth = false;     ///< train on the simulator's vertices: the upper bound
  const std::atomic<bool>* stop = nullptr;
};

/// Trains a model from a dataset's registrations (model.md, section 4) and writes it to `out`, next
/// to it OUT-training.html and .json, and with `ablation` OUT-lbs.npz, OUT-linear.npz,
/// OUT-f_theta.npz and OUT-f_theta_beta.npz. Every step leaves a file in OUT.training/; the same call
/// goes on after an interruption and ends with the same bytes. Returns what the .json holds. Throws
/// Error also where `stop` was set.
nlohmann::json TrainModel(const std::filesystem::path& dataset, const std::filesystem::path& out,
                          const TrainOptions& options);

}  // namespace sole::app
