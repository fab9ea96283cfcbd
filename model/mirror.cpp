#include "model/mirror.h"

#include "model/pose_features.h"

namespace sole::model {
namespace {

void MirrorRows(int axis, Eigen::Ref<Eigen::MatrixXd> stacked) {
  for (Eigen::Index row = axis; row < stacked.rows(); row += 3) stacked.row(row) *= -1;
}

/// A rotation vector seen in the mirror.
Eigen::Vector3d MirroredTurn(const Eigen::Vector3d& turn, int axis) {
  Eigen::Vector3d mirrored = -turn;
  mirrored[axis] = turn[axis];
  return mirrored;
}

/// Sign of each pose feature under mirroring: rotation vectors are axial, they keep the mirrored
/// axis and change the other two.
Eigen::VectorXd FeatureSigns(Family family, Eigen::Index joints, int axis) {
  Eigen::VectorXd signs = Eigen::VectorXd::Ones(NumPoseFeatures(family, joints));
  if (family == Family::kSmpl) {
    for (Eigen::Index f = 0; f < signs.size(); ++f) {
      const Eigen::Index entry = f % 9;
      if ((entry / 3 == axis) != (entry % 3 == axis)) signs[f] = -1;
    }
    return signs;
  }
  const Eigen::Index quaternions = family == Family::kSupr ? joints : joints - 1;
  for (Eigen::Index f = 0; f < 4 * quaternions; ++f) {
    if (f % 4 < 3 && f % 4 != axis) signs[f] = -1;
  }
  return signs;
}

void MirrorSurface(ModelSurface& surface, Family family, Eigen::Index joints, int axis) {
  surface.template_m.col(axis) *= -1;
  surface.triangles.col(1).swap(surface.triangles.col(2));
  MirrorRows(axis, surface.shapedirs);
  if (surface.posedirs.cols() == 0) return;
  MirrorRows(axis, surface.posedirs);
  surface.posedirs = surface.posedirs * FeatureSigns(family, joints, axis).asDiagonal();
}

}  // namespace

FootModel MirrorModel(const FootModel& model) {
  FootModel mirrored = model;
  const int axis = model.mirror_axis;
  const Eigen::Index joints = model.NumJoints(), n = model.NumVertices();
  mirrored.side = model.side == Side::kRight ? Side::kLeft : Side::kRight;
  MirrorSurface(mirrored.coarse, model.family, joints, axis);
  if (model.HasFine()) MirrorSurface(mirrored.fine, model.family, joints, axis);
  if (model.joint_regressor.cols() == 3 * n + 1) {
    MirrorRows(axis, mirrored.joint_regressor);
    for (Eigen::Index column = axis; column < 3 * n; column += 3)
      mirrored.joint_regressor.col(column) *= -1;
  }
  for (JointConstraint& constraint : mirrored.constraints) {
    for (Eigen::Vector3d& turn : constraint.axes) turn = MirroredTurn(turn, axis);
  }
  if (!model.network.empty()) {
    const Eigen::VectorXd signs = FeatureSigns(Family::kSupr, joints, axis);
    NetworkLayer& first = mirrored.network.front();
    first.weight.leftCols(signs.size()) =
        (first.weight.leftCols(signs.size()) * signs.asDiagonal()).eval();
    MirrorRows(axis, mirrored.network.back().weight);
    for (Eigen::Index row = axis; row < 3 * n; row += 3) mirrored.network.back().bias[row] *= -1;
  }
  PoseSpace& poses = mirrored.pose_space;
  for (Eigen::Index value = 0; value < poses.mean.size(); ++value) {
    if (value % 3 == axis) continue;
    poses.mean[value] *= -1;
    poses.components.row(value) *= -1;
  }
  Prepare(mirrored);
  return mirrored;
}

ModelParameters MirrorParameters(const FootModel& model, const ModelParameters& parameters) {
  ModelParameters mirrored = parameters;
  for (Eigen::Index j = 0; j < mirrored.theta.rows(); ++j) {
    const auto at = static_cast<std::size_t>(j);
    const bool hinge = at < model.constraints.size() && !model.constraints[at].axes.empty();
    if (!hinge) mirrored.theta.row(j) = MirroredTurn(mirrored.theta.row(j), model.mirror_axis);
  }
  mirrored.translation_m[model.mirror_axis] *= -1;
  return mirrored;
}

}  // namespace sole::model
