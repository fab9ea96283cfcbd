#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "app/stages.h"
#include "core/fit_sequence.h"
#include "core/point_cloud.h"
#include "model/fit.h"

namespace sole::app {

/// Scans of one take, in order of time.
struct TakeClouds {
  std::vector<PointCloud> clouds;
  std::vector<std::int64_t> triggers;
  model::ContactLabeller label_contact = {};  ///< for models whose network is told contact
};

/// One foot of one take.
struct FootFit {
  FitSequence fit;                 ///< every frame of the take
  std::vector<PointCloud> clouds;  ///< what of each frame's scan is this foot's
};

/// Tells the feet of every take apart, follows each, decides its side, fits and curates it. Feet of one side share their
/// shape over all takes, which therefore must be one person's. Per take, the foot with most scan points first; at least one,
/// even if no frame shows any. `log` gets a line for everything that is taken for no foot.
std::vector<std::vector<FootFit>> FitTakes(std::span<const TakeClouds> takes, const ModelPair& models,
                                           const std::function<void(int, int)>& progress = {},
                                           const std::function<void(const std::string&)>& log = {});

/// Replaces verdicts `good` of a fit where the registration's own figures object (model/curation.h). Without `in_time` the frames
/// do not follow each other and no jump between them is sought.
void CurateFit(const ModelPair& models, std::span<const PointCloud> clouds, FitSequence& fit, bool in_time = true);

}  // namespace sole::app
