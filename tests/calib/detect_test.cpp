#include "calib/detect.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/calib/rendered_take.h"

namespace sole::calib {
namespace {

using testing_support::RenderedTake;
using testing_support::SyntheticRig;
using testing_support::TruePixel;

/// One rendered frame of full size, shared by the tests of this file.
class Detect : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    take_ = new RenderedTake(MakeDefaultRig(4), 2, 1);
    frame_ = new FrameSet(*take_->Next());
  }
  static void TearDownTestSuite() {
    delete frame_;
    delete take_;
  }
  static RenderedTake* take_;
  static FrameSet* frame_;
};
RenderedTake* Detect::take_ = nullptr;
FrameSet* Detect::frame_ = nullptr;

TEST_F(Detect, CornersLieWhereTheyWereRendered) {
  const SyntheticRig truth = take_->Truth();
  const DetectTarget target = TargetOf(truth.config);
  const auto corners = TargetCorners(target.body);
  const auto fiducials = FiducialCornerPoints(truth.config.plate);
  const auto views = DetectInFrame(*frame_, truth.config, target);
  double squares[2] = {0, 0}, normalised = 0;
  int count[2] = {0, 0};
  for (std::size_t c = 0; c < views.size(); ++c) {
    EXPECT_GE(views[c].target.size(), 8u) << "camera " << c;
    EXPECT_GE(views[c].fiducials.size(), 12u) << "camera " << c;
    for (const PointObservation& o : views[c].target) {
      const Eigen::Vector3d world =
          truth.world_from_body[0] * corners[static_cast<std::size_t>(o.point)];
      const Eigen::Vector2d error = o.pixel - TruePixel(truth, c, world);
      EXPECT_LT(error.norm(), 0.3) << "camera " << c << " corner " << o.point;
      squares[0] += error.squaredNorm();
      normalised += error.squaredNorm() / (o.sigma_px * o.sigma_px);
      ++count[0];
    }
    for (const PointObservation& o : views[c].fiducials) {
      const Eigen::Vector2d error =
          o.pixel - TruePixel(truth, c, fiducials[static_cast<std::size_t>(o.point)]);
      EXPECT_LT(error.norm(), 0.4) << "camera " << c << " fiducial corner " << o.point;
      squares[1] += error.squaredNorm();
      ++count[1];
    }
  }
  EXPECT_LT(std::sqrt(squares[0] / (2 * count[0])), 0.04);
  EXPECT_LT(std::sqrt(squares[1] / (2 * count[1])), 0.08);
  EXPECT_GT(std::sqrt(normalised / (2 * count[0])), 0.5);
  EXPECT_LT(std::sqrt(normalised / (2 * count[0])), 1.6);
}

TEST_F(Detect, MirroredFiducialsAreNotTakenForUpright) {
  const DetectTarget target = TargetOf(take_->Truth().config);
  EXPECT_GT(DetectInImage(*frame_->images[0], target, true).fiducials.size(), 20u);
  EXPECT_TRUE(DetectInImage(*frame_->images[0], target, false).fiducials.empty());
  EXPECT_TRUE(DetectInImage(*frame_->images[2], target, true).fiducials.empty());
}

TEST_F(Detect, AMirroredTargetIsRecognised) {
  const DetectTarget target = TargetOf(take_->Truth().config);
  for (const std::size_t c : {0, 2}) {  // from below and from above
    ImageU8 flipped = *frame_->images[c];
    for (int y = 0; y < flipped.height; ++y)
      std::reverse(&flipped.At(0, y), &flipped.At(0, y) + flipped.width);
    EXPECT_FALSE(DetectInImage(*frame_->images[c], target, c == 0).mirrored_target) << c;
    const ViewObservations view = DetectInImage(flipped, target, c == 0);
    EXPECT_TRUE(view.mirrored_target) << c;
    EXPECT_TRUE(view.target.empty()) << c;
  }
}

TEST_F(Detect, MarkersOfAnotherCubeAreIgnored) {
  DetectTarget other = TargetOf(take_->Truth().config);
  for (CharucoFace& face : other.body.faces) face.first_id += 100;
  for (Fiducial& fiducial : other.fiducials) fiducial.id += 20;
  const ViewObservations view = DetectInImage(*frame_->images[0], other, true);
  EXPECT_TRUE(view.target.empty());
  EXPECT_TRUE(view.fiducials.empty());
}

TEST_F(Detect, AMarkerInTheWrongPlaceIsRejected) {
  // Two ids of the face swapped on paper: their corners contradict the plane of the others.
  DetectTarget target = TargetOf(take_->Truth().config);
  target.fiducials[0].id = 201;
  target.fiducials[1].id = 200;
  const ViewObservations view = DetectInImage(*frame_->images[0], target, true);
  EXPECT_GT(view.fiducials.size(), 16u);
  for (const PointObservation& o : view.fiducials) EXPECT_GE(o.point, 8);
}

TEST_F(Detect, NothingIsFoundInAnEmptyOrAbsentImage) {
  const RigConfig config = take_->Truth().config;
  FrameSet frame;
  frame.images.resize(4);
  frame.images[1] = ImageU8(1624, 1236, 90);
  for (const ViewObservations& view : DetectInFrame(frame, config, TargetOf(config))) {
    EXPECT_TRUE(view.target.empty());
    EXPECT_TRUE(view.fiducials.empty());
  }
}

}  // namespace
}  // namespace sole::calib
