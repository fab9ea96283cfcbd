#pragma once

#include <filesystem>
#include <string>

#include "model/train_network.h"

namespace sole::model {

/// A network's training as an .npz, exactly: going on from what was read gives the bytes of a training
/// that was never interrupted. `origin` says what it was trained on and how.
void SaveNetworkTraining(const std::filesystem::path& path, const NetworkTraining& training,
                         const std::string& origin);

/// Throws Error where the file is no such training, is damaged, or is of another `origin`.
NetworkTraining LoadNetworkTraining(const std::filesystem::path& path, const std::string& origin);

}  // namespace sole::model
