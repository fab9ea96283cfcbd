#include "model/surface_query.h"

#include <limits>
#include <vector>

#include <Eigen/Geometry>
#include <embree3/rtcore.h>
#include <tbb/task_arena.h>

#include "core/error.h"

namespace sole::model {
namespace {

/// One device for all queries: making it takes longer than building a foot's volumes. It is not asked
/// for a number of threads: Embree would cap TBB's for the whole program.
RTCDevice SharedDevice() {
  struct Holder {
    RTCDevice device = rtcNewDevice(nullptr);
    ~Holder() { rtcReleaseDevice(device); }  // scenes that outlive it hold it
  };
  static const Holder holder;
  return holder.device;
}

/// Around a triangle.
struct Box {
  Eigen::Array3d low, high;
};

/// Builds or refits; a thread that waits meanwhile does not begin with tasks of others.
void Commit(RTCScene scene) {
  tbb::this_task_arena::isolate([&] { rtcCommitScene(scene); });
}

}  // namespace

struct SurfaceQuery::State {
  TriangleMesh mesh;
  RTCScene scene = nullptr;
  RTCGeometry geometry = nullptr;  ///< the scene's
  float* places = nullptr;         ///< its vertices
  std::vector<Box> boxes;          ///< of every triangle

  void CopyPlaces() {
    float* place = places;
    for (const Eigen::Vector3d& v : mesh.vertices) {
      for (int k = 0; k < 3; ++k) *place++ = static_cast<float>(v[k]);
    }
    boxes.resize(mesh.triangles.size());
    for (std::size_t t = 0; t < boxes.size(); ++t) {
      const auto corner = [&](int k) { return mesh.vertices[static_cast<std::size_t>(mesh.triangles[t][k])].array(); };
      boxes[t] = {corner(0).min(corner(1)).min(corner(2)), corner(0).max(corner(1)).max(corner(2))};
    }
  }

  ~State() {
    if (scene) rtcReleaseScene(scene);
  }
};

namespace {

struct QueryState {
  const TriangleMesh* mesh;
  const std::vector<Box>* boxes;
  Eigen::Vector3d query;
  double best2;
  SurfacePoint point;
  Eigen::Vector3d position;
};

bool VisitTriangle(RTCPointQueryFunctionArguments* arguments) {
  auto& state = *static_cast<QueryState*>(arguments->userPtr);
  const auto index = static_cast<std::size_t>(arguments->primID);
  // Embree offers all triangles of a leaf of its tree, most of them too far away. The margin is that of rounding.
  const Box& box = (*state.boxes)[index];
  const Eigen::Array3d query = state.query.array();
  if ((box.low - query).max(query - box.high).max(0).square().sum() > state.best2 * (1 + 1e-12)) return false;
  const Eigen::Vector3i& t = state.mesh->triangles[index];
  const auto corner = [&](int i) -> const Eigen::Vector3d& {
    return state.mesh->vertices[static_cast<std::size_t>(t[i])];
  };
  const Eigen::Vector3d w = ClosestBarycentric(state.query, corner(0), corner(1), corner(2));
  const Eigen::Vector3d position = w[0] * corner(0) + w[1] * corner(1) + w[2] * corner(2);
  const double distance2 = (position - state.query).squaredNorm();
  // Ties (shared edges and vertices) go to the lower index, so that results do not depend on visiting order.
  const bool nearer = distance2 < state.best2 ||
                      (distance2 == state.best2 && static_cast<int>(index) < state.point.triangle);
  if (!nearer) return false;
  state.best2 = distance2;
  state.point = {static_cast<int>(index), w};
  state.position = position;
  // A little slack keeps equally near triangles in the search despite Embree's single precision.
  arguments->query->radius = static_cast<float>(std::sqrt(distance2) * 1.00001 + 1e-7);
  return true;
}

}  // namespace

SurfaceQuery::SurfaceQuery(const TriangleMesh& mesh) : state_(std::make_unique<State>()) {
  Require(!mesh.triangles.empty(), "surface query: the mesh has no triangles");
  for (const Eigen::Vector3i& t : mesh.triangles) {
    Require(t.minCoeff() >= 0 && t.maxCoeff() < static_cast<int>(mesh.vertices.size()),
            "surface query: a triangle refers to a vertex that does not exist");
  }
  state_->mesh = mesh;
  state_->scene = rtcNewScene(SharedDevice());
  rtcSetSceneFlags(state_->scene, RTC_SCENE_FLAG_ROBUST);  // no ray slips between two triangles
  const RTCGeometry geometry = rtcNewGeometry(SharedDevice(), RTC_GEOMETRY_TYPE_TRIANGLE);
  state_->geometry = geometry;
  state_->places = static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0,
                                                               RTC_FORMAT_FLOAT3, 3 * sizeof(float),
                                                               mesh.vertices.size()));
  state_->CopyPlaces();
  auto* indices = static_cast<unsigned*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0,
                                                                 RTC_FORMAT_UINT3, 3 * sizeof(unsigned),
                                                                 mesh.triangles.size()));
  for (const Eigen::Vector3i& t : mesh.triangles) {
    for (int k = 0; k < 3; ++k) *indices++ = static_cast<unsigned>(t[k]);
  }
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(state_->scene, geometry);
  rtcReleaseGeometry(geometry);
  Commit(state_->scene);
}

void SurfaceQuery::Move(const std::vector<Eigen::Vector3d>& vertices_m) {
  Require(vertices_m.size() == state_->mesh.vertices.size(), "surface query: another number of vertices");
  state_->mesh.vertices = vertices_m;
  state_->CopyPlaces();
  rtcSetSceneFlags(state_->scene, RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_DYNAMIC);
  rtcSetGeometryBuildQuality(state_->geometry, RTC_BUILD_QUALITY_REFIT);
  rtcUpdateGeometryBuffer(state_->geometry, RTC_BUFFER_TYPE_VERTEX, 0);
  rtcCommitGeometry(state_->geometry);
  Commit(state_->scene);
}

SurfaceQuery::~SurfaceQuery() = default;
SurfaceQuery::SurfaceQuery(SurfaceQuery&&) noexcept = default;
SurfaceQuery& SurfaceQuery::operator=(SurfaceQuery&&) noexcept = default;

std::optional<SurfaceQuery::Hit> SurfaceQuery::Closest(const Eigen::Vector3d& query, double radius_m) const {
  QueryState state{&state_->mesh, &state_->boxes, query, radius_m * radius_m, {std::numeric_limits<int>::max(), {}}, {}};
  RTCPointQuery point_query;
  point_query.x = static_cast<float>(query.x());
  point_query.y = static_cast<float>(query.y());
  point_query.z = static_cast<float>(query.z());
  point_query.radius = static_cast<float>(radius_m * 1.00001 + 1e-7);
  point_query.time = 0;
  RTCPointQueryContext context;
  rtcInitPointQueryContext(&context);
  rtcPointQuery(state_->scene, &point_query, &context, VisitTriangle, &state);
  if (state.point.triangle == std::numeric_limits<int>::max()) return {};
  return Hit{state.point, state.position, std::sqrt(state.best2)};
}

std::optional<SurfaceQuery::Hit> SurfaceQuery::FirstAlong(const Eigen::Vector3d& origin,
                                                          const Eigen::Vector3d& direction,
                                                          double reach_m) const {
  const Eigen::Vector3d along = direction.normalized();
  // Embree sees the ray from a little before its origin to a little beyond its end.
  const double slack = 1e-6 * (1 + origin.norm());
  RTCRayHit query{};
  query.ray.org_x = static_cast<float>(origin.x());
  query.ray.org_y = static_cast<float>(origin.y());
  query.ray.org_z = static_cast<float>(origin.z());
  query.ray.dir_x = static_cast<float>(along.x());
  query.ray.dir_y = static_cast<float>(along.y());
  query.ray.dir_z = static_cast<float>(along.z());
  query.ray.tfar = static_cast<float>(reach_m + slack);
  query.ray.mask = 0xffffffff;
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcIntersect1(state_->scene, &context, &query);
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return {};
  const Eigen::Vector3i& t = state_->mesh.triangles[query.hit.primID];
  const auto corner = [&](int i) -> const Eigen::Vector3d& {
    return state_->mesh.vertices[static_cast<std::size_t>(t[i])];
  };
  // Moeller and Trumbore, in double precision.
  const Eigen::Vector3d ab = corner(1) - corner(0), ac = corner(2) - corner(0);
  const Eigen::Vector3d to_origin = origin - corner(0), across = along.cross(ac);
  const double determinant = ab.dot(across);
  if (determinant == 0) return {};
  const double u = to_origin.dot(across) / determinant;
  const double v = along.dot(to_origin.cross(ab)) / determinant;
  const double distance = ac.dot(to_origin.cross(ab)) / determinant;
  if (!(distance >= 0 && distance <= reach_m)) return {};
  return Hit{{static_cast<int>(query.hit.primID), {1 - u - v, u, v}}, origin + distance * along,
             distance};
}

Eigen::Vector3d ClosestBarycentric(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                                   const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  // Regions of the triangle's plane (Ericson, Real-Time Collision Detection, 5.1.5).
  const Eigen::Vector3d ab = b - a, ac = c - a, ap = p - a;
  const double d1 = ab.dot(ap), d2 = ac.dot(ap);
  if (d1 <= 0 && d2 <= 0) return {1, 0, 0};
  const Eigen::Vector3d bp = p - b;
  const double d3 = ab.dot(bp), d4 = ac.dot(bp);
  if (d3 >= 0 && d4 <= d3) return {0, 1, 0};
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) {
    const double v = d1 / (d1 - d3);
    return {1 - v, v, 0};
  }
  const Eigen::Vector3d cp = p - c;
  const double d5 = ab.dot(cp), d6 = ac.dot(cp);
  if (d6 >= 0 && d5 <= d6) return {0, 0, 1};
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) {
    const double w = d2 / (d2 - d6);
    return {1 - w, 0, w};
  }
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    const double w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return {0, 1 - w, w};
  }
  const double sum = va + vb + vc;
  return {va / sum, vb / sum, vc / sum};
}

}  // namespace sole::model
