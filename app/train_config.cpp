#include "app/train_config.h"

#include <limits>
#include <type_traits>
#include <variant>
#include <vector>

#include <fmt/format.h>

#include "core/error.h"
#include "io/config_file.h"

namespace sole::app {
namespace {

/// One key: where it stands and what it sets.
struct Key {
  const char* table;
  const char* name;
  std::variant<int*, double*, bool*, std::string*> value;
  double low = 0, high = 0;
  std::vector<const char*> words = {};
};

/// The list that reading and writing share.
std::vector<Key> Keys(TrainConfig& c) {
  constexpr double kInt = std::numeric_limits<int>::max();
  return {
      {"", "joints", &c.joints, 0, 0, {"all", "two"}},
      {"", "sex", &c.sex, 0, 0, {"all", "female", "male"}},
      {"", "seed", &c.seed, 1, kInt},
      {"data", "minimum_frames", &c.minimum_frames, 1, 1000},
      {"data", "seen_sd_m", &c.seen_sd_m, 1e-5, 1},
      {"data", "pressed_gap_m", &c.pressed_gap_m, 0, 0.05},
      {"data", "free_gap_m", &c.free_gap_m, 1e-5, 0.05},
      {"poses", "rounds", &c.person.rounds, 1, 20},
      {"poses", "sigma_m", &c.person.sigma_m, 1e-5, 0.1},
      {"poses", "theta_sd_rad", &c.person.theta_sd_rad, 1e-3, 100},
      {"poses", "pressed_weight", &c.person.pressed_weight, 0, 1},
      {"poses", "prior_frames", &c.person.prior_frames, 1e-6, 1000},
      {"poses", "near_rest_rad", &c.person.near_rest_rad, 1e-3, 100},
      {"poses", "loaded_weight", &c.person.loaded_weight, 1e-3, 1},
      {"poses", "joint_sd_m", &c.person.joint_sd_m, 1e-6, 1},
      {"poses", "joint_sigma_m", &c.person.joint_sigma_m, 1e-6, 1},
      {"skinning", "rounds", &c.skinning_rounds, 1, 10},
      {"skinning", "influences", &c.skinning.max_influences, 1, 4},
      {"skinning", "prior_m", &c.skinning.prior_weight_m, 1e-6, 1},
      {"skinning", "prior_samples", &c.skinning.prior_samples, 0, 1e6},
      {"correctives", "reach_m", &c.correctives.reach_m, 0.001, 0.06},
      {"correctives", "max_share", &c.correctives.max_share, 0.001, 1},
      {"correctives", "sparsity", &c.correctives.sparsity, 1e-9, 1e3},
      {"correctives", "ridge", &c.correctives.ridge, 0, 1e3},
      {"shape", "betas", &c.betas, 2, 100},
      {"shape", "rank", &c.shape_rank, 2, 2000},
      {"network", "kind", &c.network, 0, 0, {"full", "none"}},
      {"network", "rounds", &c.network_rounds, 1, 5},
      {"network", "latent", &c.latent, 1, 1024},
      {"network", "batch", &c.training.batch, 1, 4096},
      {"network", "epochs", &c.training.epochs, 1, 100000},
      {"network", "patience", &c.training.patience, 1, 100000},
      {"network", "plateau", &c.training.plateau, 1, 100000},
      {"network", "rate", &c.training.rate, 1e-8, 1},
      {"network", "rate_decay", &c.training.rate_decay, 0.01, 1},
      {"network", "weight_decay", &c.training.weight_decay, 0, 10},
      {"network", "soft_share", &c.training.soft_share, 0, 1},
      {"network", "scaled_share", &c.training.scaled_share, 0, 1},
      {"network", "pose_noise_rad", &c.training.pose_noise_rad, 0, 1},
      {"network", "root", &c.training.root},
      {"pose_space", "gaussians", &c.pose_space.gaussians, 1, 100},
      {"pose_space", "floor_rad", &c.pose_space.floor_rad, 1e-4, 1},
  };
}

TrainConfig Read(io::ConfigFile& file, const std::string& name) {
  TrainConfig config;
  for (const Key& key : Keys(config)) {
    std::visit(
        [&](auto* value) {
          using Type = std::remove_pointer_t<decltype(value)>;
          if constexpr (std::is_same_v<Type, int>) {
            file.Read(key.table, key.name, *value, static_cast<int>(key.low),
                      static_cast<int>(key.high));
          } else if constexpr (std::is_same_v<Type, double>) {
            file.Read(key.table, key.name, *value, key.low, key.high);
          } else if constexpr (std::is_same_v<Type, bool>) {
            file.Read(key.table, key.name, *value);
          } else {
            file.Read(key.table, key.name, *value, key.words);
          }
        },
        key.value);
  }
  int components = static_cast<int>(config.pose_space.components);
  file.Read("pose_space", "components", components, 1, 1000);
  config.pose_space.components = components;
  file.Finish();
  Require(config.training.soft_share + config.training.scaled_share <= 1,
          name + ": [network] soft_share and scaled_share together are more than 1");
  Require(config.free_gap_m > config.pressed_gap_m,
          name + ": [data] free_gap_m must be above pressed_gap_m");
  Require(config.shape_rank >= config.betas, name + ": [shape] rank must not be below betas");
  config.training.seed = config.pose_space.seed = static_cast<std::uint64_t>(config.seed);
  config.training.hidden[4] = config.latent;
  return config;
}

}  // namespace

TrainConfig ReadTrainConfig(const std::filesystem::path& path) {
  io::ConfigFile file(path);
  return Read(file, path.string());
}

TrainConfig ParseTrainConfig(const std::string& toml, const std::string& name) {
  io::ConfigFile file(toml, name);
  return Read(file, name);
}

std::string FormatTrainConfig(const TrainConfig& config) {
  TrainConfig copy = config;
  std::string text, table;
  for (const Key& key : Keys(copy)) {
    if (key.table != table) {
      table = key.table;
      text += fmt::format("\n[{}]\n", table);
    }
    text += std::visit(
        [&](auto* value) {
          using Type = std::remove_pointer_t<decltype(value)>;
          if constexpr (std::is_same_v<Type, std::string>)
            return fmt::format("{} = \"{}\"\n", key.name, *value);
          else
            return fmt::format("{} = {}\n", key.name, *value);
        },
        key.value);
  }
  return text + fmt::format("components = {}\n", copy.pose_space.components);
}

}  // namespace sole::app
