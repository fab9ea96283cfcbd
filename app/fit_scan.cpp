#include "app/fit_scan.h"

#include <algorithm>
#include <limits>
#include <vector>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "app/console.h"
#include "app/fit_placing.h"
#include "app/fit_scan_input.h"
#include "contact/flat_patches.h"
#include "core/error.h"
#include "io/atomic_file.h"
#include "io/glb.h"
#include "io/mesh_file.h"
#include "io/take.h"
#include "model/fit.h"
#include "model/forward.h"

namespace sole::app {
namespace {

namespace fs = std::filesystem;

/// A sole that a program filled fills its outline; skin pressed on a floor leaves the arch and the toes' gaps free.
constexpr double kFilled = 0.75;
constexpr double kFloorCosine = 0.9;       ///< between a floor's normal and the foot's up
constexpr double kFreeHeight_m = 0.02;     ///< of a foot without a floor: the fit knows no glass there
constexpr double kPointSigma_m = 0.0003;   ///< of a scan that says nothing about its noise

PointCloud Without(const PointCloud& scan, const std::vector<bool>& left_out) {
  PointCloud rest;
  for (std::size_t i = 0; i < scan.Size(); ++i) {
    if (left_out[i]) continue;
    rest.points_m.push_back(scan.points_m[i]);
    if (!scan.normals.empty()) rest.normals.push_back(scan.normals[i]);
  }
  return rest;
}

/// Flat patches of a scan and what of it is skin.
struct Skin {
  PointCloud cloud;
  std::vector<contact::FlatPatch> patches;
  std::size_t left_out = 0;
};

Skin SkinOf(const PointCloud& scan, bool floor) {
  Skin skin;
  skin.patches = contact::FindFlatPatches(scan);
  std::vector<bool> left_out(scan.Size(), false);
  for (const contact::FlatPatch& patch : skin.patches) {
    if (patch.filled < kFilled && !floor) continue;
    for (const std::size_t i : patch.points) left_out[i] = true;
  }
  skin.cloud = Without(scan, left_out);
  skin.left_out = scan.Size() - skin.cloud.Size();
  return skin;
}

/// The largest patch that the foot could stand on.
const contact::FlatPatch* FloorOf(const Skin& skin, const Eigen::Matrix3d& level_from_scan) {
  for (const contact::FlatPatch& patch : skin.patches) {
    if ((level_from_scan * patch.normal).z() > kFloorCosine) return &patch;
  }
  return nullptr;
}

/// Moves a fit to another frame. The root's deviations hold for turns about other axes: the largest stands for all.
void Move(const model::FootModel& model, const Eigen::VectorXd& beta, const Rigid3& to, FrameFit& frame) {
  const Eigen::Matrix3d turn = to.rotation.toRotationMatrix();
  for (Eigen::MatrixX3d* points : {&frame.vertices_m, &frame.registration_m, &frame.registration_fine_m})
    *points = ((*points * turn.transpose()).rowwise() + to.translation.transpose()).eval();
  // Forward turns about the root joint.
  const Eigen::Vector3d joint = model::RestJoints(model, beta).row(0).transpose();
  frame.translation_m = to * Eigen::Vector3d(joint + frame.translation_m) - joint;
  const Eigen::Vector3d root = frame.theta.row(0).transpose();
  Eigen::Matrix3d rotation = turn;
  if (root.norm() > 0) rotation *= Eigen::AngleAxisd(root.norm(), root.normalized()).toRotationMatrix();
  const Eigen::AngleAxisd moved(rotation);
  frame.theta.row(0) = moved.angle() * moved.axis().transpose();
  frame.theta_sd.row(0).setConstant(frame.theta_sd.row(0).maxCoeff());
}

TriangleMesh RegisteredSurface(const model::FootModel& model, const FrameFit& frame) {
  const bool fine = frame.registration_fine_m.rows() > 0;
  return model::MeshOf(model, fine ? model::Variant::kFine : model::Variant::kCoarse,
                       fine ? frame.registration_fine_m : frame.registration_m);
}

Rigid3 RigidOf(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation) {
  return {Eigen::Quaterniond(rotation), translation};
}

}  // namespace

ScanFit FitScan(const io::ScanFile& file, const std::string& name, const ModelPair& models,
                const ScanFitOptions& options) {
  const ScanPoints scan = PointsOfScan(file, name, options.unit_m);
  ScanFit result;
  result.unit_m = scan.unit_m;
  const Skin skin = SkinOf(scan.cloud, options.floor);
  result.flat_points = skin.left_out;
  std::vector<Eigen::Vector3d> hints;
  for (const contact::FlatPatch& patch : skin.patches) hints.push_back(patch.normal);
  Placing placing = FindPlacing(skin.cloud, models, options.up, hints);
  Require(placing.cost < 2, fmt::format("{}: {} points are left without flat patches: no foot is found in them", name,
                                        skin.cloud.Size()));
  const contact::FlatPatch* floor = FloorOf(skin, placing.level_from_scan);
  Require(floor || !options.floor,
          fmt::format("{}: no floor is found below the foot: leave --floor out, or check --units and --up", name));
  double height = 0;  // of the frame's z = 0 over the scan's middle, along up
  if (floor) {
    result.floor = true;
    placing.level_from_scan =
        Eigen::Quaterniond::FromTwoVectors(placing.level_from_scan * floor->normal, Eigen::Vector3d::UnitZ())
            .toRotationMatrix() *
        placing.level_from_scan;
    height = (placing.level_from_scan * floor->point).z();
  }
  PointCloud foot = TurnedFoot(skin.cloud, placing.level_from_scan);
  if (!floor) {
    height = std::numeric_limits<double>::infinity();
    for (const Eigen::Vector3f& p : foot.points_m) height = std::min<double>(height, p.z());
    height -= kFreeHeight_m;
  }
  for (Eigen::Vector3f& p : foot.points_m) p.z() -= static_cast<float>(height);
  foot.sigma_m.assign(foot.Size(), static_cast<float>(kPointSigma_m));
  result.points = foot.Size();

  result.fit = model::FitFrames(models.right, models.left, std::span(&foot, 1), std::vector<std::int64_t>{1});
  FrameFit& frame = result.fit.frames.front();
  Require(frame.found, name + ": " + frame.verdict);
  const model::FootModel& model = frame.side == Side::kRight ? models.right : models.left;
  GroundPlane ground;
  if (!floor) ground.offset_m = RegisteredSurface(model, frame).vertices.empty() ? 0 : frame.registration_fine_m.col(2).minCoeff();
  ground.sigma_m = kPointSigma_m;
  result.measures = model::MeasureFrame(model, frame, ground);
  result.level_from_scan = RigidOf(placing.level_from_scan,
                                   -placing.level_from_scan * scan.middle_m -
                                       Eigen::Vector3d(0, 0, height + ground.offset_m));
  const Rigid3 scan_from_level =
      RigidOf(placing.level_from_scan, -placing.level_from_scan * scan.middle_m - Eigen::Vector3d(0, 0, height)).Inverse();
  Move(model, result.fit.beta, scan_from_level, frame);
  return result;
}

nlohmann::json RunFitScan(const fs::path& path, const ModelPair& models, const ScanFitOptions& options,
                          const fs::path& out) {
  const ScanFit result = FitScan(io::ReadScanFile(path), path.string(), models, options);
  const FrameFit& frame = result.fit.frames.front();
  const fs::path folder = out.empty() ? path.parent_path() : out;
  if (!folder.empty()) io::MakeDirectory(folder);
  const std::string stem = path.stem().string() + "-fit";
  TriangleMesh surface =
      RegisteredSurface(frame.side == Side::kRight ? models.right : models.left, frame);
  io::MeshAnimation standing{surface.triangles, {Eigen::MatrixX3d(surface.vertices.size(), 3)}, 10, {}};
  for (std::size_t v = 0; v < surface.vertices.size(); ++v) {
    standing.frames[0].row(static_cast<Eigen::Index>(v)) = (result.level_from_scan * surface.vertices[v]).transpose();
    surface.vertices[v] /= result.unit_m;
  }
  const std::string unit = result.unit_m == 1 ? "metres" : "millimetres";
  io::WritePly(folder / (stem + ".ply"), surface, unit + ", frame of the fitted scan");
  io::WriteGlb(folder / (stem + ".glb"), standing);
  io::WriteFit(folder / (stem + ".npz"), result.fit);
  nlohmann::json measures = nlohmann::json::object();
  for (const model::FootMeasure& m : result.measures) {
    measures[m.name + "_mm"] = 1e3 * m.value_m;
    measures[m.name + "_sd_mm"] = 1e3 * m.sd_m;
  }
  if (frame.verdict != "good") Log(fmt::format("{}: {}", path.string(), frame.verdict));
  return {{"fit", (folder / (stem + ".npz")).string()},
          {"mesh", (folder / (stem + ".ply")).string()},
          {"glb", (folder / (stem + ".glb")).string()},
          {"units", result.unit_m == 1 ? "m" : "mm"},
          {"side", frame.side == Side::kLeft ? "left" : "right"},
          {"verdict", frame.verdict},
          {"floor", result.floor},
          {"points", result.points},
          {"flat_points_left_out", result.flat_points},
          {"residual_mm", 1e3 * frame.residual_m},
          {"measures", measures}};
}

}  // namespace sole::app
