#include "model/curation.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "model/forward.h"
#include "model/model_file.h"
#include "tests/support/meshes.h"

namespace sole::model {
namespace {

using testing::HasSubstr;

const FootModel& ShippedModel() {
  static const FootModel model = LoadModel(SOLE_MODEL_FILE);
  return model;
}

/// A resting foot, registered without error.
FrameFit PerfectFrame() {
  const FootModel& model = ShippedModel();
  const ModelParameters rest = RestParameters(model);
  FrameFit frame;
  frame.found = true;
  frame.verdict = "good";
  frame.theta = rest.theta;
  frame.vertices_m = Forward(model, rest).vertices_m;
  frame.registration_m = frame.vertices_m;
  frame.registration_fine_m = Forward(model, rest, Variant::kFine).vertices_m;
  return frame;
}

PointCloud ScanOf(const FrameFit& frame) {
  return testing_support::SampleMesh(MeshOf(ShippedModel(), Variant::kFine, frame.registration_fine_m), 15000, 5e-5, 3);
}

RegistrationQuality Assess(const FrameFit& frame, const PointCloud& scan, const FrameFit* before = nullptr) {
  return AssessRegistration(ShippedModel(), RestParameters(ShippedModel()).beta, frame, scan, before);
}

TEST(AssessRegistration, OfAWholeFootIsGood) {
  const FrameFit frame = PerfectFrame();
  const RegistrationQuality quality = Assess(frame, ScanOf(frame), &frame);
  EXPECT_LT(quality.residual_m, 1e-4);
  EXPECT_GT(quality.explained, 0.99);
  EXPECT_GT(quality.coverage, 0.95);
  EXPECT_LT(quality.stretch, 1e-9);
  EXPECT_LT(quality.turned_rad, 1e-6);
  EXPECT_LT(quality.deformed_m, 1e-9);
  EXPECT_EQ(CurationVerdict(quality), "good");
}

TEST(AssessRegistration, SaysHowFarTheScanIs) {
  FrameFit frame = PerfectFrame();
  const PointCloud scan = ScanOf(frame);
  // Swollen by 1 mm.
  const TriangleMesh mesh = MeshOf(ShippedModel(), Variant::kFine, frame.registration_fine_m);
  const std::vector<Eigen::Vector3d> normals = VertexNormals(mesh);
  for (std::size_t v = 0; v < normals.size(); ++v)
    frame.registration_fine_m.row(static_cast<Eigen::Index>(v)) += 0.001 * normals[v].transpose();
  const RegistrationQuality quality = Assess(frame, scan);
  EXPECT_NEAR(quality.residual_m, 0.001, 1e-4);
  EXPECT_THAT(CurationVerdict(quality), HasSubstr("mm from the scan, at most 0.40 mm"));
}

TEST(AssessRegistration, CountsWhatTheScanShows) {
  const FrameFit frame = PerfectFrame();
  const PointCloud whole = ScanOf(frame);
  PointCloud toes;
  const double front = frame.vertices_m.col(1).maxCoeff();
  for (std::size_t i = 0; i < whole.Size(); ++i) {
    if (whole.points_m[i].y() > front - 0.05) toes.points_m.push_back(whole.points_m[i]);
  }
  const RegistrationQuality quality = Assess(frame, toes);
  EXPECT_GT(quality.coverage, 0.05);
  EXPECT_LT(quality.coverage, 0.3);
  EXPECT_THAT(CurationVerdict(quality), HasSubstr("poor coverage"));
  // Most of another scan lies elsewhere.
  PointCloud elsewhere = whole;
  for (Eigen::Vector3f& p : elsewhere.points_m) p.y() += 0.15F;
  EXPECT_THAT(CurationVerdict(Assess(frame, elsewhere)), HasSubstr("of the scan explained"));
}

TEST(AssessRegistration, TrustsNoVagueModelWhereTheScanIsMissing) {
  FrameFit frame = PerfectFrame();
  const PointCloud whole = ScanOf(frame);
  PointCloud half;
  for (std::size_t i = 0; i < whole.Size(); ++i) {
    if (whole.points_m[i].y() > 0.12F) continue;
    half.points_m.push_back(whole.points_m[i]);
    half.normals.push_back(whole.normals[i]);
  }
  frame.vertex_sd_m = Eigen::VectorXd::Constant(frame.vertices_m.rows(), 0.0003);
  EXPECT_EQ(CurationVerdict(Assess(frame, half)), "good");
  frame.vertex_sd_m.setConstant(0.001);
  const RegistrationQuality quality = Assess(frame, half);
  EXPECT_NEAR(quality.unsure_m, 0.001 * (1 - quality.coverage), 1e-12);
  EXPECT_THAT(CurationVerdict(quality), HasSubstr("unsure: "));
  EXPECT_THAT(CurationVerdict(quality), HasSubstr("1.0 mm off"));
  EXPECT_EQ(CurationVerdict(Assess(frame, whole)), "good");
}

TEST(AssessRegistration, NamesAToeThatTheScanDoesNotHold) {
  FrameFit frame = PerfectFrame();
  const PointCloud scan = ScanOf(frame);
  frame.vertex_sd_m = Eigen::VectorXd::Constant(frame.vertices_m.rows(), 0.0003);
  const FootModel& model = ShippedModel();
  const auto toe = std::find(model.joint_names.begin(), model.joint_names.end(), "toe3_ip") - model.joint_names.begin();
  for (Eigen::Index v = 0; v < frame.vertex_sd_m.size(); ++v) {
    Eigen::Index joint = 0;
    model.coarse.weights.row(v).maxCoeff(&joint);
    if (joint == toe) frame.vertex_sd_m[v] = 0.004;
  }
  const RegistrationQuality quality = Assess(frame, scan);
  EXPECT_NEAR(quality.vague_m, 0.004, 1e-12);
  EXPECT_THAT(CurationVerdict(quality), HasSubstr("unsure: the scan hardly shows toe3_ip, known to 4.0 mm"));
}

TEST(AssessRegistration, NamesAJointThatNoFootBendsLikeThis) {
  FrameFit frame = PerfectFrame();
  const PointCloud scan = ScanOf(frame);
  frame.theta(4, 2) = 2.4;
  const RegistrationQuality quality = Assess(frame, scan);
  EXPECT_NEAR(quality.bent, 8, 1e-9);  // this model has no pose space: 0.3 rad a joint
  EXPECT_THAT(CurationVerdict(quality), HasSubstr("no pose of a foot: " + ShippedModel().joint_names[4] + " is bent 8 deviations"));
}

TEST(AssessRegistration, SeesStretchAndJumps) {
  const FrameFit frame = PerfectFrame();
  const PointCloud scan = ScanOf(frame);
  FrameFit wrinkled = frame;
  for (Eigen::Index v = 0; v < wrinkled.registration_fine_m.rows(); ++v)
    wrinkled.registration_fine_m.row(v).y() += (v % 2 == 0 ? 0.0015 : -0.0015);
  EXPECT_GT(Assess(wrinkled, scan).stretch, 0.4);

  FrameFit turned = frame;
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(2.5, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  turned.registration_m = (frame.registration_m * turn.transpose()).eval();
  const RegistrationQuality jump = Assess(frame, scan, &turned);
  EXPECT_NEAR(jump.turned_rad, 2.5, 1e-6);
  EXPECT_LT(jump.deformed_m, 1e-9);
  EXPECT_THAT(CurationVerdict(jump), HasSubstr("jump: turned by 143 degrees"));

  FrameFit larger = frame;
  larger.registration_m *= 1.4;
  EXPECT_THAT(CurationVerdict(Assess(frame, scan, &larger)), HasSubstr("jump: deformed by"));
}

TEST(IntersectingEdges, CountsWhatGoesThroughAnotherPart) {
  TriangleMesh two = testing_support::Ellipsoid({0.03, 0.03, 0.03}, 12, 16);
  const auto count = static_cast<int>(two.vertices.size());
  const TriangleMesh one = two;
  const auto moved = [&](double by) {
    TriangleMesh both = one;
    for (const Eigen::Vector3d& v : one.vertices) both.vertices.emplace_back(v + Eigen::Vector3d(by, 0.0007, 0.0004));
    for (const Eigen::Vector3i& t : one.triangles) both.triangles.emplace_back(t.array() + count);
    return both;
  };
  EXPECT_EQ(IntersectingEdges(one), 0);
  EXPECT_EQ(IntersectingEdges(moved(0.061)), 0);
  EXPECT_GT(IntersectingEdges(moved(0.05)), 0.005);
  EXPECT_GT(IntersectingEdges(moved(0.03)), 0.02);
  EXPECT_EQ(IntersectingEdges({}), 0);
}

}  // namespace
}  // namespace sole::model
