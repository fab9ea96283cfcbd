#pragma once

#include <span>
#include <vector>

#include "model/foot_model.h"

namespace sole::model {

/// A body part cut out of a model.
struct SeparatedPart {
  FootModel model;
  std::vector<int> vertices;  ///< of the part: vertex of the whole
  std::vector<int> joints;    ///< of the part: joint of the whole
  double joint_error_m = 0;   ///< largest change of a joint's place for any |beta_i| = 1
};

/// Cuts out the coarse vertices `vertices` (SUPR, equations 4 and 5). A joint is kept where it has
/// a weight, an activation or a non-zero corrective on them; its parent is its nearest kept
/// ancestor. The nearest common ancestor of the kept joints is kept as the root, in STAR and SMPL
/// models the root itself. With the joints that were left out at rest the part's vertices are those
/// of the whole. The joint regressor is the smallest affine one that gives the whole's joints for
/// every shape. Network and fine variant are left out. Throws Error where a vertex is not there or
/// named twice.
SeparatedPart SeparatePart(const FootModel& model, std::span<const int> vertices);

}  // namespace sole::model
