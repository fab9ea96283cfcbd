#include <algorithm>
#include <cmath>
#include <limits>

#include "core/error.h"
#include "sim/tracer_internal.h"

namespace sole::sim {
namespace {

constexpr float kFar = std::numeric_limits<float>::infinity();

RTCRay ToEmbree(const LightRay& ray, double from_m, float to_m, float time) {
  RTCRay r{};
  r.org_x = static_cast<float>(ray.origin.x());
  r.org_y = static_cast<float>(ray.origin.y());
  r.org_z = static_cast<float>(ray.origin.z());
  r.dir_x = static_cast<float>(ray.direction.x());
  r.dir_y = static_cast<float>(ray.direction.y());
  r.dir_z = static_cast<float>(ray.direction.z());
  r.tnear = static_cast<float>(from_m);
  r.tfar = to_m;
  r.time = time;
  r.mask = 0xffffffffU;
  return r;
}

RTCGeometry MakeGeometry(RTCDevice device, const TriangleMesh& mesh,
                         const std::vector<Eigen::Vector3d>& shifts) {
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  const unsigned steps = shifts.empty() ? 1 : 2;
  rtcSetGeometryTimeStepCount(geometry, steps);
  for (unsigned step = 0; step < steps; ++step) {
    auto* vertices = static_cast<float*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, step, RTC_FORMAT_FLOAT3,
                                3 * sizeof(float), mesh.vertices.size()));
    for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
      Eigen::Vector3d point = mesh.vertices[v];
      if (!shifts.empty()) point += step == 0 ? Eigen::Vector3d(-shifts[v]) : shifts[v];
      for (int i = 0; i < 3; ++i) *vertices++ = static_cast<float>(point[i]);
    }
  }
  auto* indices = static_cast<unsigned*>(
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                              3 * sizeof(unsigned), mesh.triangles.size()));
  for (const Eigen::Vector3i& t : mesh.triangles) {
    for (int i = 0; i < 3; ++i) *indices++ = static_cast<unsigned>(t[i]);
  }
  rtcCommitGeometry(geometry);
  return geometry;
}

}  // namespace

SceneTracer::SceneTracer(const Scene& scene, double cube_edge_m,
                         const std::vector<std::vector<Eigen::Vector3d>>& shifts)
    : cube_half_m_(0.5 * cube_edge_m) {
  if (scene.world_from_target) cube_from_world_ = scene.world_from_target->Inverse();
  if (scene.meshes.empty()) return;
  device_ = rtcNewDevice(nullptr);
  Require(device_ != nullptr, "renderer: Embree cannot start on this machine");
  scene_ = rtcNewScene(device_);
  rtcSetSceneFlags(scene_, RTC_SCENE_FLAG_ROBUST);
  for (std::size_t i = 0; i < scene.meshes.size(); ++i) {
    RTCGeometry geometry = MakeGeometry(
        device_, scene.meshes[i].mesh, i < shifts.size() ? shifts[i] : std::vector<Eigen::Vector3d>());
    rtcAttachGeometry(scene_, geometry);
    rtcReleaseGeometry(geometry);
  }
  rtcCommitScene(scene_);
}

SceneTracer::~SceneTracer() {
  if (scene_ != nullptr) rtcReleaseScene(scene_);
  if (device_ != nullptr) rtcReleaseDevice(device_);
}

SceneHit SceneTracer::HitCube(const LightRay& ray, double from_m) const {
  SceneHit hit;
  const Eigen::Vector3d o = *cube_from_world_ * ray.origin;
  const Eigen::Vector3d d = cube_from_world_->rotation * ray.direction;
  double enter = -std::numeric_limits<double>::infinity(), leave = -enter;
  int face = -1;
  for (int axis = 0; axis < 3; ++axis) {
    if (d[axis] == 0.0) {
      if (std::abs(o[axis]) > cube_half_m_) return hit;
      continue;
    }
    const double side = d[axis] > 0 ? -cube_half_m_ : cube_half_m_;  // the face it enters by
    const double t0 = (side - o[axis]) / d[axis], t1 = (-side - o[axis]) / d[axis];
    if (t0 > enter) {
      enter = t0;
      face = 2 * axis + (d[axis] > 0 ? 0 : 1);
    }
    leave = std::min(leave, t1);
  }
  if (enter > leave || enter < from_m) return hit;
  hit.kind = SceneHit::Kind::kCube;
  hit.distance_m = enter;
  hit.face = face;
  hit.in_body = o + enter * d;
  return hit;
}

SceneHit SceneTracer::Nearest(const LightRay& ray, double from_m, float time) const {
  SceneHit hit;
  if (cube_from_world_) hit = HitCube(ray, from_m);
  if (scene_ == nullptr) return hit;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCRayHit query{};
  const bool cube = hit.kind != SceneHit::Kind::kNone;
  query.ray = ToEmbree(ray, from_m, cube ? static_cast<float>(hit.distance_m) : kFar, time);
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(scene_, &context, &query);
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return hit;
  hit.kind = SceneHit::Kind::kMesh;
  hit.distance_m = static_cast<double>(query.ray.tfar);
  hit.mesh = static_cast<int>(query.hit.geomID);
  hit.triangle = static_cast<int>(query.hit.primID);
  hit.b1 = query.hit.u;
  hit.b2 = query.hit.v;
  return hit;
}

std::array<SceneHit, 4> SceneTracer::NearestOfFour(const std::array<LightRay, 4>& rays) const {
  std::array<SceneHit, 4> hits;
  if (scene_ == nullptr || cube_from_world_) {
    for (std::size_t i = 0; i < 4; ++i) hits[i] = Nearest(rays[i]);
    return hits;
  }
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  alignas(16) RTCRayHit4 query{};
  alignas(16) const int valid[4] = {-1, -1, -1, -1};
  for (std::size_t i = 0; i < 4; ++i) {
    const RTCRay ray = ToEmbree(rays[i], 0, kFar, 0.5f);
    query.ray.org_x[i] = ray.org_x;
    query.ray.org_y[i] = ray.org_y;
    query.ray.org_z[i] = ray.org_z;
    query.ray.dir_x[i] = ray.dir_x;
    query.ray.dir_y[i] = ray.dir_y;
    query.ray.dir_z[i] = ray.dir_z;
    query.ray.tfar[i] = ray.tfar;
    query.ray.time[i] = ray.time;
    query.ray.mask[i] = ray.mask;
    query.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
  }
  rtcIntersect4(valid, scene_, &context, &query);
  for (std::size_t i = 0; i < 4; ++i) {
    if (query.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID) continue;
    hits[i].kind = SceneHit::Kind::kMesh;
    hits[i].distance_m = static_cast<double>(query.ray.tfar[i]);
    hits[i].mesh = static_cast<int>(query.hit.geomID[i]);
    hits[i].triangle = static_cast<int>(query.hit.primID[i]);
    hits[i].b1 = query.hit.u[i];
    hits[i].b2 = query.hit.v[i];
  }
  return hits;
}

bool SceneTracer::Blocked(const LightRay& ray, double from_m, double to_m, float time) const {
  if (cube_from_world_) {
    const SceneHit hit = HitCube(ray, from_m);
    if (hit.kind != SceneHit::Kind::kNone && hit.distance_m < to_m) return true;
  }
  if (scene_ == nullptr) return false;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCRay query = ToEmbree(ray, from_m, static_cast<float>(to_m), time);
  rtcOccluded1(scene_, &context, &query);
  return query.tfar < 0;
}

}  // namespace sole::sim
