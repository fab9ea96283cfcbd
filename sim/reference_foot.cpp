#include "sim/reference_foot.h"

#include <cmath>
#include <string_view>
#include <utility>

#include "sim/implicit_foot.h"
#include "sim/reference_codec.h"

namespace sole::embedded {
std::string_view reference_foot_bin();
}

namespace sole::sim {

const TriangleMesh& ReferenceFoot() {
  static const TriangleMesh mesh = DecodeReference(embedded::reference_foot_bin());
  return mesh;
}

const std::vector<Eigen::Vector3i>& FootTriangles(Side side) {
  static const std::vector<Eigen::Vector3i> left = [] {
    std::vector<Eigen::Vector3i> turned = ReferenceFoot().triangles;
    for (Eigen::Vector3i& t : turned) std::swap(t[1], t[2]);
    return turned;
  }();
  return side == Side::kLeft ? left : ReferenceFoot().triangles;
}

SurfacePoint OnSide(const SurfacePoint& point_on_right, Side side) {
  SurfacePoint point = point_on_right;
  if (side == Side::kLeft) std::swap(point.barycentric[1], point.barycentric[2]);
  return point;
}

const std::vector<FootMaterial>& FootMaterials() {
  static const std::vector<FootMaterial> materials = [] {
    const ImplicitFoot foot(MeanAdultTable());
    std::vector<FootMaterial> result;
    for (const Eigen::Vector3d& v : ReferenceFoot().vertices) {
      const bool cut = std::abs(v.z() - foot.Table().cut_point.z()) < 2 * kReferenceStep;
      result.push_back(cut ? FootMaterial::kCut : foot.OnNail(v) ? FootMaterial::kNail : FootMaterial::kSkin);
    }
    return result;
  }();
  return materials;
}

}  // namespace sole::sim
