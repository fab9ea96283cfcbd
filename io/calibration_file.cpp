#include "io/calibration_file.h"

#include <array>

#include "io/atomic_file.h"
#include "io/json_internal.h"
#include "io/shown_internal.h"

namespace sole::io {
namespace {

constexpr int kVersion = 3;
constexpr std::array kIntrinsicNames{"fx_px", "fy_px", "cx_px", "cy_px", "k1",
                                     "k2",    "p1",    "p2",    "k3"};
static_assert(kIntrinsicNames.size() == kNumIntrinsics);

Json NumbersToJson(const auto& values) {
  Json list = Json::array();
  for (const double value : values) list.push_back(NumberOrNull(value));
  return list;
}

std::vector<double> NumbersFrom(const Json& json, const char* key, const std::string& where,
                                std::size_t count) {
  const Json& list = Member(json, key, where);
  Require(list.is_array() && list.size() == count,
          where + ": key '" + key + "' must be a list of " + std::to_string(count) + " numbers");
  std::vector<double> values;
  for (const Json& value : list) {
    Require(value.is_number() && std::isfinite(value.get<double>()),
            where + ": key '" + key + "' must hold finite numbers only");
    values.push_back(value.get<double>());
  }
  return values;
}

const Json& ListFrom(const Json& json, const char* key, const std::string& where) {
  const Json& list = Member(json, key, where);
  Require(list.is_array(), where + ": key '" + key + "' must be a list");
  return list;
}

Json CameraToJson(const Camera& camera) {
  const Eigen::Quaterniond& q = camera.cam_from_world.rotation;
  Json intrinsics;
  for (std::size_t i = 0; i < kIntrinsicNames.size(); ++i) {
    intrinsics[kIntrinsicNames[i]] = camera.intrinsics[static_cast<Eigen::Index>(i)];
  }
  return {{"serial", camera.serial},
          {"width", camera.width},
          {"height", camera.height},
          {"intrinsics", intrinsics},
          {"cam_from_world",
           {{"rotation_wxyz", NumbersToJson(std::array{q.w(), q.x(), q.y(), q.z()})},
            {"translation_m", NumbersToJson(camera.cam_from_world.translation)}}}};
}

Camera CameraFromJson(const Json& json, const std::string& where) {
  Camera camera;
  camera.serial = Get<std::string>(json, "serial", where);
  camera.width = Get<int>(json, "width", where);
  camera.height = Get<int>(json, "height", where);
  Require(camera.width > 0 && camera.height > 0, where + ": width and height must be positive");
  const Json& intrinsics = Member(json, "intrinsics", where);
  for (std::size_t i = 0; i < kIntrinsicNames.size(); ++i) {
    camera.intrinsics[static_cast<Eigen::Index>(i)] =
        Get<double>(intrinsics, kIntrinsicNames[i], where);
  }
  Require(camera.intrinsics.allFinite() && camera.intrinsics[0] > 0 && camera.intrinsics[1] > 0,
          where + ": fx_px and fy_px must be positive");
  const Json& pose = Member(json, "cam_from_world", where);
  const std::vector<double> q = NumbersFrom(pose, "rotation_wxyz", where, 4),
                            t = NumbersFrom(pose, "translation_m", where, 3);
  camera.cam_from_world = {Eigen::Quaterniond(q[0], q[1], q[2], q[3]),
                           Eigen::Vector3d(t[0], t[1], t[2])};
  Require(std::abs(camera.cam_from_world.rotation.norm() - 1) < 1e-6,
          where + ": rotation_wxyz must have unit length");
  return camera;
}

Json StatsToJson(const CalibrationStats& stats) {
  return {{"reprojection_rms_px", NumberOrNull(stats.reprojection_rms_px)},
          {"camera_rms_px", NumbersToJson(stats.camera_rms_px)},
          {"camera_corners", stats.camera_corners},
          {"heldout_rms_air_mm", NumberOrNull(stats.heldout_rms_air_mm)},
          {"heldout_rms_glass_mm", NumberOrNull(stats.heldout_rms_glass_mm)},
          {"heldout_rms_across_mm", NumberOrNull(stats.heldout_rms_across_mm)},
          {"heldout_max_mm", NumberOrNull(stats.heldout_max_mm)},
          {"heldout_points", stats.heldout_points},
          {"heldout_rejected", stats.heldout_rejected},
          {"ground_rms_mm", NumberOrNull(stats.ground_rms_mm)},
          {"poses_used", stats.poses_used},
          {"poses_heldout", stats.poses_heldout},
          {"pair_offset_mm", NumbersToJson(stats.pair_offset_mm)},
          {"pair_epipolar_px", NumbersToJson(stats.pair_epipolar_px)},
          {"failures", stats.failures}};
}

/// A list of numbers, null standing for NaN.
std::vector<double> FiguresFrom(const Json& json, const char* key, const std::string& where) {
  std::vector<double> values;
  for (const Json& value : ListFrom(json, key, where)) {
    Require(value.is_number() || value.is_null(),
            where + ": key '" + key + "' must hold numbers");
    values.push_back(value.is_null() ? std::numeric_limits<double>::quiet_NaN()
                                     : value.get<double>());
  }
  return values;
}

CalibrationStats StatsFromJson(const Json& json, const std::string& where, int version) {
  CalibrationStats stats;
  stats.reprojection_rms_px = GetOrNan(json, "reprojection_rms_px", where);
  stats.camera_rms_px = FiguresFrom(json, "camera_rms_px", where);
  for (const Json& value : ListFrom(json, "camera_corners", where)) {
    Require(value.is_number_integer(), where + ": key 'camera_corners' must hold integers");
    stats.camera_corners.push_back(value.get<int>());
  }
  stats.heldout_rms_air_mm = GetOrNan(json, "heldout_rms_air_mm", where);
  stats.heldout_rms_glass_mm = GetOrNan(json, "heldout_rms_glass_mm", where);
  stats.heldout_max_mm = GetOrNan(json, "heldout_max_mm", where);
  stats.ground_rms_mm = GetOrNan(json, "ground_rms_mm", where);
  stats.poses_used = Get<int>(json, "poses_used", where);
  stats.poses_heldout = Get<int>(json, "poses_heldout", where);
  if (version < 2) return stats;  // version 1 knew no more
  stats.heldout_rms_across_mm = GetOrNan(json, "heldout_rms_across_mm", where);
  stats.heldout_points = Get<int>(json, "heldout_points", where);
  stats.heldout_rejected = Get<int>(json, "heldout_rejected", where);
  stats.pair_offset_mm = FiguresFrom(json, "pair_offset_mm", where);
  stats.pair_epipolar_px = FiguresFrom(json, "pair_epipolar_px", where);
  for (const Json& value : ListFrom(json, "failures", where)) {
    Require(value.is_string(), where + ": key 'failures' must hold texts");
    stats.failures.push_back(value.get<std::string>());
  }
  return stats;
}

Json GroundToJson(const GroundSurface& ground) {
  Json marks = Json::array();
  for (const GroundMark& mark : ground.marks) {
    marks.push_back(
        {{"id", mark.id}, {"point_m", NumbersToJson(mark.point_m)}, {"sigma_m", mark.sigma_m}});
  }
  return {{"created", ground.created},
          {"plane",
           {{"offset_m", ground.plane.offset_m},
            {"slope_x", ground.plane.slope_x},
            {"slope_y", ground.plane.slope_y}}},
          {"grid",
           {{"first_node_m", NumbersToJson(ground.first_node_m)},
            {"spacing_m", ground.spacing_m},
            {"nodes_x", ground.nodes_x},
            {"nodes_y", ground.nodes_y},
            {"residual_m", NumbersToJson(ground.residual_m)},
            {"sigma_m", NumbersToJson(ground.sigma_m)}}},
          {"marks", marks},
          {"rms_m", ground.rms_m},
          {"points", ground.points},
          {"sheet_thickness_m", ground.sheet_thickness_m}};
}

double FiniteFrom(const Json& json, const char* key, const std::string& where) {
  const double value = Get<double>(json, key, where);
  Require(std::isfinite(value), where + ": key '" + key + "' must be finite");
  return value;
}

GroundSurface GroundFromJson(const Json& json, const std::string& where) {
  constexpr int kMostNodes = 10000;  // along one side
  GroundSurface ground;
  ground.created = Get<std::string>(json, "created", where);
  const Json& plane = Member(json, "plane", where);
  ground.plane = {FiniteFrom(plane, "offset_m", where), FiniteFrom(plane, "slope_x", where),
                  FiniteFrom(plane, "slope_y", where)};
  const Json& grid = Member(json, "grid", where);
  const std::vector<double> first = NumbersFrom(grid, "first_node_m", where, 2);
  ground.first_node_m = {first[0], first[1]};
  ground.spacing_m = FiniteFrom(grid, "spacing_m", where);
  ground.nodes_x = Get<int>(grid, "nodes_x", where);
  ground.nodes_y = Get<int>(grid, "nodes_y", where);
  const bool none = ground.nodes_x == 0 && ground.nodes_y == 0;
  Require(none || (ground.nodes_x >= 2 && ground.nodes_y >= 2 && ground.nodes_x <= kMostNodes &&
                   ground.nodes_y <= kMostNodes && ground.spacing_m > 0),
          where + ": grid needs a spacing_m above 0 and two nodes or more each way");
  const auto nodes =
      static_cast<std::size_t>(ground.nodes_x) * static_cast<std::size_t>(ground.nodes_y);
  ground.residual_m = NumbersFrom(grid, "residual_m", where, nodes);
  ground.sigma_m = NumbersFrom(grid, "sigma_m", where, nodes);
  for (const Json& entry : ListFrom(json, "marks", where)) {
    const std::vector<double> point = NumbersFrom(entry, "point_m", where, 3);
    ground.marks.push_back({Get<int>(entry, "id", where), {point[0], point[1], point[2]},
                            FiniteFrom(entry, "sigma_m", where)});
  }
  ground.rms_m = FiniteFrom(json, "rms_m", where);
  ground.points = Get<int>(json, "points", where);
  ground.sheet_thickness_m = FiniteFrom(json, "sheet_thickness_m", where);
  return ground;
}

Eigen::MatrixXd CovarianceFromJson(const Json& json, const std::string& where,
                                   std::size_t cameras) {
  const std::size_t size = ListFrom(json, "covariance", where).empty() ? 0 : 15 * cameras + 1;
  const std::vector<double> values = NumbersFrom(json, "covariance", where, size * size);
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const auto n = static_cast<Eigen::Index>(size);
  return Eigen::Map<const RowMajor>(values.data(), n, n);
}

Rig RigFromJson(const Json& json, const std::string& where) {
  Rig rig;
  rig.rig_hash = Get<std::string>(json, "rig_hash", where);
  for (const Json& camera : ListFrom(json, "cameras", where)) {
    rig.cameras.push_back(
        CameraFromJson(camera, where + ": camera " + std::to_string(rig.cameras.size())));
  }
  for (const Json& pair : ListFrom(json, "pairs", where)) {
    const std::string place = where + ": pair " + std::to_string(rig.pairs.size());
    rig.pairs.push_back({Get<std::string>(pair, "name", place), Get<int>(pair, "left", place),
                         Get<int>(pair, "right", place)});
    const auto count = static_cast<int>(rig.cameras.size());
    const StereoPair& p = rig.pairs.back();
    Require(p.left >= 0 && p.left < count && p.right >= 0 && p.right < count && p.left != p.right,
            place + ": left and right must be two different cameras of the list");
  }
  const Json& plate = Member(json, "plate", where);
  rig.plate = {Get<double>(plate, "thickness_m", where), Get<double>(plate, "index", where)};
  Require(rig.plate.thickness_m > 0 && rig.plate.thickness_m < 1 && rig.plate.index >= 1 &&
              rig.plate.index < 3,
          where + ": plate needs a thickness_m above 0 and an index of 1 to 3");
  return rig;
}

}  // namespace

void WriteCalibration(const std::filesystem::path& path, const Calibration& calibration) {
  const Rig& rig = calibration.rig;
  Json cameras = Json::array(), pairs = Json::array(), covariance = Json::array();
  for (const Camera& camera : rig.cameras) {
    Require(camera.intrinsics.allFinite() && camera.cam_from_world.rotation.coeffs().allFinite() &&
                camera.cam_from_world.translation.allFinite(),
            path.string() + ": camera '" + Shown(camera.serial) +
                "' has a value that is not finite: calibrate again");
    cameras.push_back(CameraToJson(camera));
  }
  for (const StereoPair& pair : rig.pairs)
    pairs.push_back({{"name", pair.name}, {"left", pair.left}, {"right", pair.right}});
  const auto size = static_cast<Eigen::Index>(15 * rig.cameras.size() + 1);
  const Eigen::MatrixXd& c = calibration.covariance;
  Require(c.allFinite() && (c.size() == 0 || (c.rows() == size && c.cols() == size)),
          path.string() + ": the covariance must be finite and " + std::to_string(size) + " x " +
              std::to_string(size));
  for (Eigen::Index i = 0; i < c.rows(); ++i) {
    for (Eigen::Index j = 0; j < c.cols(); ++j) covariance.push_back(c(i, j));
  }
  Json json{{"format", "sole-calibration"},
            {"version", kVersion},
            {"units", "m, rad, px; figures named _mm in mm"},
            {"created", calibration.created},
            {"rig_hash", rig.rig_hash},
            {"plate", {{"thickness_m", rig.plate.thickness_m}, {"index", rig.plate.index}}},
            {"cameras", cameras},
            {"pairs", pairs},
            {"stats", StatsToJson(calibration.stats)}};
  if (calibration.ground) json["ground"] = GroundToJson(*calibration.ground);
  std::string text = FormatJson(json);
  // The covariance is long: one line, not one number a line.
  text.erase(text.size() - 3);
  WriteStringAtomically(path, text + ",\n  \"covariance\": " + covariance.dump() + "\n}\n");
}

Calibration ReadCalibration(const std::filesystem::path& path) {
  const std::string where = path.string();
  const Json json = ParseJson(ReadFile(path), where);
  const std::string format = Get<std::string>(json, "format", where);
  Require(format == "sole-calibration",
          where + ": is a '" + Shown(format) + "' file, expected a calibration");
  const int version = Get<int>(json, "version", where);
  Require(version >= 1 && version <= kVersion,
          where + ": format version " + std::to_string(version) +
              " is unknown: use the version of Sole that wrote it or calibrate again");
  Calibration calibration;
  calibration.created = Get<std::string>(json, "created", where);
  calibration.rig = RigFromJson(json, where);
  calibration.stats = StatsFromJson(Member(json, "stats", where), where + ": stats", version);
  calibration.covariance = CovarianceFromJson(json, where, calibration.rig.cameras.size());
  if (json.contains("ground"))
    calibration.ground = GroundFromJson(json["ground"], where + ": ground");
  return calibration;
}

}  // namespace sole::io
