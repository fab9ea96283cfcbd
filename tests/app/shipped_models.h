#pragma once

#include "app/stages.h"

namespace sole::app {

/// Both sides of the model file SOLE_MODEL_FILE, loaded once.
inline const ModelPair& Models() {
  static const ModelPair models = LoadModelPair(SOLE_MODEL_FILE);
  return models;
}

}  // namespace sole::app
