#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "model/pose_space.h"
#include "model/skinning_fit.h"
#include "model/train_correctives.h"
#include "model/train_network.h"
#include "model/train_person.h"

namespace sole::app {

/// Everything that `sole train --config` may say (docs/formats.md, training configuration).
struct TrainConfig {
  std::string joints = "all";  ///< "all" of the template, or "two": ankle and ball below the shank
  std::string sex = "all";     ///< or `female` or `male`: whose registrations count
  int seed = 1;

  int minimum_frames = 2;       ///< people with fewer good registrations are left out
  double seen_sd_m = 0.001;     ///< a vertex of this standard deviation counts half
  double pressed_gap_m = 5e-4;  ///< up to here a vertex counts as on the glass for the linear model,
  double free_gap_m = 3e-3;     ///< from here on as free

  model::PersonalOptions person;
  int skinning_rounds = 2;
  model::SkinningFitOptions skinning{.prior_samples = 50};
  model::CorrectiveOptions correctives;
  int betas = 15;
  int shape_rank = 200;  ///< directions that the incremental PCA keeps

  std::string network = "full";  ///< or "none"
  int network_rounds = 2;        ///< of poses and network in turn
  int latent = 16;
  model::NetworkTrainingOptions training;

  model::PoseSpaceOptions pose_space;
};

TrainConfig ReadTrainConfig(const std::filesystem::path& path);
/// From text; `name` stands for the path in messages.
TrainConfig ParseTrainConfig(const std::string& toml, const std::string& name);
/// TOML that reads back to the same configuration: what a training's checkpoints belong to.
std::string FormatTrainConfig(const TrainConfig& config);

}  // namespace sole::app
