#pragma once

#include <cstdint>
#include <vector>

#include "core/rigid3.h"
#include "sim/foot_shape.h"
#include "sim/skin_projection.h"
#include "sim/subject.h"

namespace sole::sim {

/// What Subject::shape holds: a right foot at rest, also for a left subject (mirrored on the way out).
struct SubjectShape {
  ShapeHandles handles;
  AnatomyTable table;
  std::vector<Eigen::Vector3d> rest;
};

/// What binds the reference mesh to the anatomy; computed once.
struct ReferenceBinding {
  std::vector<std::uint8_t> charts;
  std::vector<SkinKind> kinds;
  Eigen::MatrixXf shares;
  std::vector<std::vector<int>> neighbours;
};
const ReferenceBinding& Binding();

/// Brings carried vertices of the reference mesh to the skin of `foot` and smooths folds away.
void SettleOnSkin(const ImplicitFoot& foot, std::vector<Eigen::Vector3d>& vertices);

/// The mean foot changed by handles.
SubjectShape MakeShape(const ShapeHandles& handles);

/// Mirrors a point or a motion between right and left.
Eigen::Vector3d Mirrored(const Eigen::Vector3d& point);
Rigid3 Mirrored(const Rigid3& motion);

}  // namespace sole::sim
