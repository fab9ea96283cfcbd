#include "app/fit_labels.h"

#include <fmt/format.h>

#include "contact/label.h"
#include "core/error.h"
#include "model/forward.h"

namespace sole::app {

FrameContact LabelFrame(const ModelPair& models, const Eigen::VectorXd& beta, const FrameFit& frame, const PointCloud& scan,
                        const GroundPlane& ground, const GroundSurface& calibrated) {
  const model::FootModel& model = frame.side == Side::kRight ? models.right : models.left;
  // A model that was not told contact is undeformed already.
  const Eigen::MatrixX3d undeformed =
      frame.found && frame.contact.size() > 0
          ? Eigen::MatrixX3d(model::Forward(model, {frame.theta, beta, frame.translation_m, {}}).vertices_m)
          : frame.vertices_m;
  return contact::LabelContact({frame.registration_m, frame.registration_sd_m, undeformed, scan}, ground, calibrated);
}

std::vector<FrameContact> LabelFit(const ModelPair& models, const FitSequence& fit, std::span<const PointCloud> clouds,
                                   std::span<const GroundPlane> ground, const GroundSurface& calibrated) {
  Require(clouds.size() == fit.frames.size() && ground.size() == fit.frames.size(),
          fmt::format("contact: {} scans and {} ground planes for {} frames", clouds.size(), ground.size(), fit.frames.size()));
  std::vector<FrameContact> labels;
  for (std::size_t f = 0; f < fit.frames.size(); ++f)
    labels.push_back(LabelFrame(models, fit.beta, fit.frames[f], clouds[f], ground[f], calibrated));
  return labels;
}

}  // namespace sole::app
