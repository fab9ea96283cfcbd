#include "model/forward.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <vector>

#include "core/error.h"
#include "random_model.h"

namespace sole::model {
namespace {

using testing::RandomModel;
using testing::RandomParameters;

struct Mat4 {
  double at[4][4] = {};
};

Mat4 Product(const Mat4& a, const Mat4& b) {
  Mat4 c;
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 4; ++j)
      for (int k = 0; k < 4; ++k) c.at[i][j] += a.at[i][k] * b.at[k][j];
  return c;
}

/// Quaternion x, y, z, w of an axis-angle vector.
std::vector<double> Quaternion(const double* t) {
  const double angle = std::sqrt(t[0] * t[0] + t[1] * t[1] + t[2] * t[2]);
  const double s = angle > 0 ? std::sin(angle / 2) / angle : 0.5;
  return {s * t[0], s * t[1], s * t[2], std::cos(angle / 2)};
}

/// Rotation matrix of a unit quaternion (another route than the library's).
Mat4 Rotation(const double* t) {
  const std::vector<double> q = Quaternion(t);
  const double x = q[0], y = q[1], z = q[2], w = q[3];
  return {{{1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), 0},
           {2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), 0},
           {2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), 0},
           {0, 0, 0, 1}}};
}

struct Reference {
  std::vector<std::vector<double>> vertices, joints;
};

/// Loops straight from the formulas, with homogeneous 4 x 4 matrices.
Reference Evaluate(const FootModel& m, const ModelParameters& p, Variant variant) {
  const ModelSurface& s = variant == Variant::kCoarse ? m.coarse : m.fine;
  const int n = static_cast<int>(m.coarse.template_m.rows()),
            k = static_cast<int>(m.parents.size()), b = static_cast<int>(p.beta.size());
  const int count = static_cast<int>(s.template_m.rows());
  std::vector<std::vector<double>> theta;
  for (int j = 0; j < k; ++j) theta.push_back({p.theta(j, 0), p.theta(j, 1), p.theta(j, 2)});
  std::vector<double> features, quaternions;
  for (int j = 0; j < k; ++j) {
    std::vector<double> q = Quaternion(theta[static_cast<std::size_t>(j)].data());
    q[3] -= 1;
    quaternions.insert(quaternions.end(), q.begin(), q.end());
    if (m.family == Family::kSupr || (m.family == Family::kStar && j > 0))
      features.insert(features.end(), q.begin(), q.end());
    if (m.family == Family::kSmpl && j > 0) {
      const Mat4 r = Rotation(theta[static_cast<std::size_t>(j)].data());
      for (int a = 0; a < 3; ++a)
        for (int c = 0; c < 3; ++c) features.push_back(r.at[a][c] - (a == c));
    }
  }
  if (m.family == Family::kStar) features.push_back(p.beta[1]);
  std::vector<double> net = quaternions;
  net.push_back(p.beta[0]);
  net.push_back(p.beta[1]);
  for (int i = 0; i < n; ++i) net.push_back(p.contact[i]);
  for (std::size_t l = 0; l < m.network.size(); ++l) {
    std::vector<double> out;
    for (int r = 0; r < m.network[l].weight.rows(); ++r) {
      double v = m.network[l].bias[r];
      for (std::size_t c = 0; c < net.size(); ++c)
        v += m.network[l].weight(r, static_cast<int>(c)) * net[c];
      out.push_back(l + 1 < m.network.size() && v < 0 ? 0.1 * v : v);
    }
    net = out;
  }
  auto shaped = [&](const ModelSurface& surface, int i, int a) {
    double v = surface.template_m(i, a);
    for (int c = 0; c < b; ++c) v += surface.shapedirs(3 * i + a, c) * p.beta[c];
    return v;
  };
  std::vector<std::vector<double>> rest(static_cast<std::size_t>(k), std::vector<double>(3, 0.0));
  for (int j = 0; j < k; ++j)
    for (int a = 0; a < 3; ++a) {
      double& value = rest[static_cast<std::size_t>(j)][static_cast<std::size_t>(a)];
      if (m.joint_regressor.rows() == k) {
        for (int i = 0; i < n; ++i) value += m.joint_regressor(j, i) * shaped(m.coarse, i, a);
      } else {
        value = m.joint_regressor(3 * j + a, 3 * n);
        for (int i = 0; i < n; ++i)
          for (int c = 0; c < 3; ++c)
            value += m.joint_regressor(3 * j + a, 3 * i + c) * shaped(m.coarse, i, c);
      }
    }
  std::vector<Mat4> global;
  Reference reference;
  for (std::size_t j = 0; j < static_cast<std::size_t>(k); ++j) {
    Mat4 local = Rotation(theta[j].data());
    const int parent = m.parents[j];
    for (std::size_t a = 0; a < 3; ++a)
      local.at[a][3] = rest[j][a] - (parent < 0 ? 0 : rest[static_cast<std::size_t>(parent)][a]);
    global.push_back(parent < 0 ? local : Product(global[static_cast<std::size_t>(parent)], local));
    std::vector<double> joint;
    for (int a = 0; a < 3; ++a) joint.push_back(global[j].at[a][3] + p.translation_m[a]);
    reference.joints.push_back(joint);
  }
  for (int i = 0; i < count; ++i) {
    double v[4] = {0, 0, 0, 1};
    for (int a = 0; a < 3; ++a) {
      v[a] = shaped(s, i, a);
      for (std::size_t f = 0; f < features.size(); ++f)
        v[a] += s.posedirs(3 * i + a, static_cast<int>(f)) * features[f];
      if (m.network.empty()) continue;
      if (variant == Variant::kCoarse)
        v[a] += net[static_cast<std::size_t>(3 * i + a)];
      else
        for (const auto& [vertex, weight] : m.upsampling[static_cast<std::size_t>(i)])
          v[a] += weight * net[static_cast<std::size_t>(3 * vertex + a)];
    }
    std::vector<double> posed{p.translation_m[0], p.translation_m[1], p.translation_m[2]};
    for (std::size_t j = 0; j < static_cast<std::size_t>(k); ++j) {
      for (std::size_t a = 0; a < 3; ++a) {
        double moved = global[j].at[a][3];
        for (std::size_t c = 0; c < 3; ++c) moved += global[j].at[a][c] * (v[c] - rest[j][c]);
        posed[a] += s.weights(i, static_cast<int>(j)) * moved;
      }
    }
    reference.vertices.push_back(posed);
  }
  return reference;
}

void ExpectSame(const Eigen::MatrixX3d& actual, const std::vector<std::vector<double>>& wanted) {
  ASSERT_EQ(actual.rows(), static_cast<Eigen::Index>(wanted.size()));
  for (Eigen::Index i = 0; i < actual.rows(); ++i) {
    for (int a = 0; a < 3; ++a) {
      EXPECT_NEAR(actual(i, a), wanted[static_cast<std::size_t>(i)][static_cast<std::size_t>(a)],
                  1e-12)
          << "point " << i;
    }
  }
}

TEST(Forward, AgreesWithTheFormulasInPlainLoopsForEveryFamily) {
  for (const Family family : {Family::kSupr, Family::kStar, Family::kSmpl}) {
    for (const bool affine : {false, true}) {
      for (const Variant variant : {Variant::kCoarse, Variant::kFine}) {
        const FootModel model = RandomModel(family, 3, affine);
        const ModelParameters parameters = RandomParameters(model, 4);
        const PosedFoot foot = Forward(model, parameters, variant);
        const Reference reference = Evaluate(model, parameters, variant);
        ExpectSame(foot.vertices_m, reference.vertices);
        ExpectSame(foot.joints_m, reference.joints);
      }
    }
  }
}

TEST(Forward, RestPoseWithoutNetworkIsTheTemplate) {
  const FootModel model = RandomModel(Family::kSupr, 5, false, false);
  const PosedFoot foot = Forward(model, RestParameters(model), Variant::kFine);
  EXPECT_LT((foot.vertices_m - model.fine.template_m).cwiseAbs().maxCoeff(), 1e-15);
  EXPECT_LT((foot.joints_m - RestJoints(model, Eigen::VectorXd::Zero(4))).cwiseAbs().maxCoeff(),
            1e-15);
}

TEST(Forward, TurningTheRootTurnsTheFootAboutTheRootJoint) {
  FootModel model = RandomModel(Family::kStar, 6, false, false);  // STAR has no root feature
  ModelParameters parameters = RandomParameters(model, 7);
  parameters.theta.row(0).setZero();
  const PosedFoot before = Forward(model, parameters);
  const Eigen::Vector3d turn(0.3, -1.1, 0.4);
  parameters.theta.row(0) = turn;
  const PosedFoot after = Forward(model, parameters);
  const Eigen::Matrix3d rotation =
      Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
  const Eigen::Vector3d centre = before.joints_m.row(0);
  for (Eigen::Index i = 0; i < before.vertices_m.rows(); ++i) {
    const Eigen::Vector3d wanted =
        rotation * (before.vertices_m.row(i).transpose() - centre) + centre;
    EXPECT_LT((wanted - after.vertices_m.row(i).transpose()).norm(), 1e-13);
  }
}

TEST(Forward, MissingShapeCoefficientsAndContactCountAsZero) {
  const FootModel model = RandomModel(Family::kSupr, 8);
  ModelParameters full = RandomParameters(model, 9);
  full.beta.tail(1).setZero();
  full.contact.setZero();
  ModelParameters brief = full;
  brief.beta = full.beta.head(3).eval();
  brief.contact.resize(0);
  EXPECT_EQ(Forward(model, full).vertices_m, Forward(model, brief).vertices_m);
}

TEST(Forward, RefusesParametersOfAnotherModel) {
  const FootModel model = RandomModel(Family::kSupr, 10);
  ModelParameters parameters = RandomParameters(model, 11);
  parameters.theta.conservativeResize(4, 3);
  EXPECT_THROW(Forward(model, parameters), Error);
  parameters = RandomParameters(model, 11);
  parameters.beta.conservativeResize(5);
  EXPECT_THROW(Forward(model, parameters), Error);
  parameters = RandomParameters(model, 11);
  parameters.contact.conservativeResize(3);
  EXPECT_THROW(Forward(model, parameters), Error);
}

TEST(Prepare, RefusesSizesThatDoNotFit) {
  const FootModel good = RandomModel(Family::kSupr, 12);
  FootModel bad = good;
  bad.parents[2] = 3;
  EXPECT_THROW(Prepare(bad), Error);
  bad = good;
  bad.coarse.weights(3, 1) += 0.5;
  EXPECT_THROW(Prepare(bad), Error);
  bad = good;
  bad.coarse.triangles(0, 0) = 12;
  EXPECT_THROW(Prepare(bad), Error);
  bad = good;
  bad.fine.posedirs.conservativeResize(60, 19);
  EXPECT_THROW(Prepare(bad), Error);
  bad = good;
  bad.joint_regressor.conservativeResize(4, 12);
  EXPECT_THROW(Prepare(bad), Error);
  bad = good;
  bad.network[1].bias.conservativeResize(3);
  EXPECT_THROW(Prepare(bad), Error);
}

TEST(RestJoints, MoveWithATranslatedTemplate) {
  FootModel model = RandomModel(Family::kSupr, 13);
  const Eigen::MatrixX3d before = RestJoints(model, Eigen::VectorXd::Zero(0));
  const Eigen::RowVector3d shift(0.1, -0.2, 0.3);
  model.coarse.template_m.rowwise() += shift;
  Prepare(model);
  EXPECT_LT(((RestJoints(model, Eigen::VectorXd::Zero(0)) - before).rowwise() - shift)
                .cwiseAbs()
                .maxCoeff(),
            1e-14);
}

}  // namespace
}  // namespace sole::model
