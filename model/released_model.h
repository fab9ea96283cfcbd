#pragma once

#include <filesystem>
#include <string>

#include "model/foot_model.h"

namespace sole::model {

/// Any model file that Sole reads, told apart by content: ours (see LoadModel), SUPR, STAR, SMPL,
/// SMPL-H, SMPL-X, MANO and FLAME as released (.npy with a pickled dictionary, .npz, pickle).
///
/// Hinges of released SUPR files turn by the negative angle while their pose feature takes the
/// positive one; here axes and correctives have their signs changed, so that the same pose values
/// give the same vertices with right-handed rotations. Throws Error with the path where the file is
/// of no such kind or damaged.
FootModel LoadAnyModel(const std::filesystem::path& path);

/// "SUPR", "STAR", "SMPL", "SMPL-H", "SMPL-X", "MANO" or "FLAME", from the number of features.
std::string ReleasedName(const FootModel& model);

}  // namespace sole::model
