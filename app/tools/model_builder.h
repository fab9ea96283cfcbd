#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "app/tools/template_mesh.h"
#include "model/foot_model.h"

namespace sole::tools {

struct BuilderOptions {
  TemplateOptions mesh;
  std::uint64_t first_seed = 400;
  int shape_people = 300;  ///< seeds first_seed ... : rest shapes
  int motion_people = 24;  ///< the first of them are posed as well
  int poses = 10;          ///< of each
  int betas = 15;
  int skinning_rounds = 2;  ///< of pose estimation and weights in turn
  bool correctives = true;  ///< learn linear pose correctives
  /// No people at all: the mean foot with invented proportions and its bones' shares as weights, to
  /// begin registrations with (scripts/train).
  bool mean_foot = false;
};

/// Progress in words, one line a stage.
using BuilderLog = std::function<void(const std::string&)>;

/// Makes the articulated model of a right foot from simulated people.
model::FootModel BuildFootModel(const BuilderOptions& options, const BuilderLog& log);

}  // namespace sole::tools
