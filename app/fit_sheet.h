#pragma once

#include <filesystem>
#include <span>

#include "app/fit_sequences.h"

namespace sole::app {

/// A contact sheet to look through: per foot and frame a small picture of the registered surface with the scan's points on
/// it, the frame's number and its verdict by the colour of its bar (green: good, red: not good, grey: no foot). Long takes
/// show evenly chosen frames, and every one that is not good as far as there is room. PNG, written atomically.
void WriteFitSheet(const std::filesystem::path& path, const ModelPair& models, std::span<const FootFit> feet);

}  // namespace sole::app
