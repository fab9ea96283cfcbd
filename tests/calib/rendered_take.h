#pragma once

#include <cstdint>
#include <optional>

#include "core/frame_set.h"
#include "sim/renderer.h"
#include "sim/scene.h"
#include "sim/true_rig.h"
#include "tests/calib/synthetic_rig.h"

namespace sole::calib::testing_support {

/// A calibration take that is rendered as it is read.
class RenderedTake : public FrameSource {
 public:
  RenderedTake(const RigConfig& config, int poses, std::uint64_t seed)
      : config_(config),
        renderer_(config, sim::DrawTrueRig(config, seed)),
        poses_(sim::CalibrationPoses(poses, config.target.edge_m, seed)) {}

  std::optional<FrameSet> Next() override {
    if (next_ >= poses_.size()) return {};
    sim::Scene scene;
    scene.world_from_target = poses_[next_++];
    scene.exposure = ExposureKind::kTexture;
    const sim::PreparedScene prepared = renderer_.Prepare(scene);
    FrameSet frame;
    frame.trigger = static_cast<std::int64_t>(next_);
    for (std::size_t c = 0; c < config_.cameras.size(); ++c) {
      frame.images.push_back(renderer_.Render(prepared, static_cast<int>(c), 100 * next_ + c));
    }
    return frame;
  }

  /// What was rendered, for the tests' own projection TruePixel.
  SyntheticRig Truth() const {
    SyntheticRig truth;
    truth.config = config_;
    truth.thickness_m = renderer_.Rig().plate.thickness_m;
    truth.index = renderer_.Rig().plate.index;
    for (const sim::TrueCamera& camera : renderer_.Rig().cameras) {
      truth.cam_from_world.push_back(camera.cam_from_world);
      truth.lens.emplace_back();
      truth.lens.back() << camera.fx, camera.fy, camera.cx, camera.cy, camera.k1, camera.k2,
          camera.p1, camera.p2;
    }
    truth.world_from_body = poses_;
    return truth;
  }

 private:
  RigConfig config_;
  sim::Renderer renderer_;
  std::vector<Rigid3> poses_;
  std::size_t next_ = 0;
};

}  // namespace sole::calib::testing_support
