#pragma once

#include <vector>

#include "model/foot_model.h"

namespace sole::model {

/// Interpolation from the first `num_coarse` vertices of a mesh to all of them: the discrete
/// harmonic function (cotangent weights, negative ones left out) that takes the given values there.
/// It follows the surface, so nothing leaks from toe to toe. Each row keeps its `max_entries`
/// largest weights, all positive, and sums to 1; the first rows are the identity.
std::vector<UpsamplingRow> HarmonicUpsampling(const TriangleMesh& mesh, int num_coarse,
                                              int max_entries = 6);

}  // namespace sole::model
