#include "model/model_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstring>

#include "core/error.h"
#include "io/npz.h"
#include "model/constraints.h"
#include "model/contact_network.h"
#include "model/released_model.h"

namespace sole::model {
namespace {

constexpr const char* kFormat = "sole-foot-model";
constexpr int kVersion = 1;

using Shape = std::vector<std::size_t>;

/// Values in the order of `shape` from a matrix given with rows = shape[0] and the rest flattened
/// by rows.
io::NpyArray RealArray(const Eigen::MatrixXd& matrix, const Shape& shape, bool single) {
  if (!single) return io::Reshaped(io::NpyFrom(matrix), shape);
  const Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> values =
      matrix.cast<float>();
  io::NpyArray array{"<f4", shape, {}};
  array.bytes.resize(static_cast<std::size_t>(values.size()) * sizeof(float));
  if (!array.bytes.empty()) std::memcpy(array.bytes.data(), values.data(), array.bytes.size());
  return array;
}

/// 3N x M (row 3 i + axis) <-> N x 3M (column axis * M + m): the same values in C order.
Eigen::MatrixXd Unstack(const Eigen::MatrixXd& stacked) {
  const Eigen::Index n = stacked.rows() / 3, m = stacked.cols();
  Eigen::MatrixXd flat(n, 3 * m);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index axis = 0; axis < 3; ++axis)
      flat.block(i, axis * m, 1, m) = stacked.row(3 * i + axis);
  }
  return flat;
}

Eigen::MatrixXd Stack(const Eigen::MatrixXd& flat) {
  const Eigen::Index m = flat.cols() / 3;
  Eigen::MatrixXd stacked(3 * flat.rows(), m);
  for (Eigen::Index i = 0; i < flat.rows(); ++i) {
    for (Eigen::Index axis = 0; axis < 3; ++axis)
      stacked.row(3 * i + axis) = flat.block(i, axis * m, 1, m);
  }
  return stacked;
}

std::size_t Size(Eigen::Index index) { return static_cast<std::size_t>(index); }

void PutSurface(io::Npz& npz, const std::string& prefix, const ModelSurface& surface,
                Eigen::Index features, bool single) {
  const std::size_t n = Size(surface.NumVertices());
  npz[prefix + "v_template"] = RealArray(surface.template_m, {n, 3}, single);
  npz[prefix + "f"] = io::NpyFrom(Eigen::MatrixXi(surface.triangles));
  npz[prefix + "weights"] = RealArray(surface.weights, {n, Size(surface.weights.cols())}, single);
  npz[prefix + "shapedirs"] =
      RealArray(Unstack(surface.shapedirs), {n, 3, Size(surface.shapedirs.cols())}, single);
  if (surface.posedirs.cols() > 0) {
    npz[prefix + "posedirs"] =
        RealArray(Unstack(surface.posedirs), {n, 3, Size(surface.posedirs.cols())}, single);
  } else if (prefix.empty()) {
    npz["posedirs"] = RealArray(Eigen::MatrixXd::Zero(surface.NumVertices(), 3 * features),
                                {n, 3, Size(features)}, single);
  }
}

void PutUpsampling(io::Npz& npz, const std::vector<UpsamplingRow>& upsampling, bool single) {
  std::size_t width = 1;
  for (const UpsamplingRow& row : upsampling) width = std::max(width, row.size());
  const auto rows = static_cast<Eigen::Index>(upsampling.size()),
             cols = static_cast<Eigen::Index>(width);
  Eigen::MatrixXi vertices = Eigen::MatrixXi::Zero(rows, cols);
  Eigen::MatrixXd weights = Eigen::MatrixXd::Zero(rows, cols);
  for (Eigen::Index i = 0; i < rows; ++i) {
    Eigen::Index at = 0;
    for (const auto& [vertex, weight] : upsampling[Size(i)]) {
      vertices(i, at) = vertex;
      weights(i, at++) = weight;
    }
  }
  npz["upsampling_vertex"] = io::NpyFrom(vertices);
  npz["upsampling_weight"] = RealArray(weights, {upsampling.size(), width}, single);
}

void PutMaterial(io::Npz& npz, const std::vector<SurfacePoint>& material) {
  std::vector<int> triangles;
  Eigen::MatrixXd barycentric(static_cast<Eigen::Index>(material.size()), 3);
  for (std::size_t i = 0; i < material.size(); ++i) {
    triangles.push_back(material[i].triangle);
    barycentric.row(static_cast<Eigen::Index>(i)) = material[i].barycentric;
  }
  npz["material_triangle"] = io::NpyFrom(triangles);
  npz["material_barycentric"] = RealArray(barycentric, {material.size(), 3}, false);
}

void PutSkeleton(io::Npz& npz, const FootModel& model, bool single) {
  Eigen::MatrixXi tree(2, model.NumJoints());
  for (Eigen::Index j = 0; j < model.NumJoints(); ++j)
    tree.col(j) << model.parents[Size(j)], static_cast<int>(j);
  npz["kintree_table"] = io::NpyFrom(tree);
  npz["J_regressor"] =
      RealArray(model.joint_regressor,
                {Size(model.joint_regressor.rows()), Size(model.joint_regressor.cols())}, single);
  npz["joint_names"] = io::NpyFrom(model.joint_names);
  std::vector<int> vertices;
  std::vector<std::string> names;
  for (const Landmark& landmark : model.landmarks) {
    vertices.push_back(landmark.vertex);
    names.push_back(landmark.name);
  }
  npz["landmarks"] = io::NpyFrom(vertices);
  npz["landmark_names"] = io::NpyFrom(names);
}

void PutConstraints(io::Npz& npz, const FootModel& model) {
  if (model.pose_index.rows() > 0)
    npz["pose_index"] = io::NpyFrom(Eigen::MatrixXi(model.pose_index));
  if (model.constraints.empty()) return;
  Eigen::MatrixXd axes = Eigen::MatrixXd::Zero(model.NumJoints(), 6);
  for (Eigen::Index j = 0; j < axes.rows(); ++j) {
    Eigen::Index at = 0;
    for (const Eigen::Vector3d& axis : model.constraints[Size(j)].axes)
      axes.block<1, 3>(j, 3 * at++) = axis.transpose();
  }
  npz["hinge_axes"] = RealArray(axes, {Size(axes.rows()), 2, 3}, false);
}

void PutPoseSpace(io::Npz& npz, const PoseSpace& space, bool single) {
  if (space.Empty()) return;
  const std::size_t p = Size(space.mean.size()), c = Size(space.components.cols()),
                    g = Size(space.weights.size());
  npz["pose_mean"] = RealArray(space.mean, {p}, single);
  npz["pose_components"] = RealArray(space.components, {p, c}, single);
  npz["pose_variances"] = RealArray(space.variances, {p}, single);
  npz["pose_mixture_weights"] = RealArray(space.weights, {g}, single);
  npz["pose_mixture_means"] = RealArray(space.means, {g, c}, single);
  npz["pose_mixture_covariances"] = RealArray(space.covariances, {g, c, c}, single);
}

/// Shape of an array, after checking its number of dimensions.
const Shape& Dimensions(const io::Npz& npz, const std::string& name, std::size_t dimensions) {
  const Shape& shape = io::ShapeOf(npz, name);
  Require(shape.size() == dimensions,
          fmt::format("'{}' has {} dimensions, expected {}", name, shape.size(), dimensions));
  return shape;
}

Eigen::MatrixXd Table(const io::Npz& npz, const std::string& name) {
  Dimensions(npz, name, 2);
  return io::MatrixFrom(npz, name);
}

Eigen::MatrixXd Points(const io::Npz& npz, const std::string& name) {
  const Shape& shape = Dimensions(npz, name, 2);
  Require(shape[1] == 3, fmt::format("'{}' has {} columns, expected 3", name, shape[1]));
  return io::MatrixFrom(npz, name);
}

/// (N, 3, M) as 3N x M.
Eigen::MatrixXd BlendShapes(const io::Npz& npz, const std::string& name) {
  const Shape& shape = Dimensions(npz, name, 3);
  Require(shape[1] == 3,
          fmt::format("'{}' has {} coordinates a vertex, expected 3", name, shape[1]));
  return Stack(io::MatrixFrom(npz, name));
}

Eigen::MatrixXi Integers(const io::Npz& npz, const std::string& name) {
  const Eigen::MatrixXd values = Table(npz, name);
  Require(values.size() == 0 ||
              (values.array() == values.array().round() && values.array().abs() < 2e9).all(),
          fmt::format("'{}' holds values that are not indices", name));
  return values.cast<int>();
}

ModelSurface GetSurface(const io::Npz& npz, const std::string& prefix) {
  ModelSurface surface;
  surface.template_m = Points(npz, prefix + "v_template");
  Require(surface.NumVertices() > 0, fmt::format("'{}v_template' is empty", prefix));
  surface.triangles = Points(npz, prefix + "f").cast<int>();
  surface.weights = Table(npz, prefix + "weights");
  surface.shapedirs = BlendShapes(npz, prefix + "shapedirs");
  if (prefix.empty() || npz.contains(prefix + "posedirs")) {
    surface.posedirs = BlendShapes(npz, prefix + "posedirs");
  }
  return surface;
}

std::vector<UpsamplingRow> GetUpsampling(const io::Npz& npz) {
  const Eigen::MatrixXi vertices = Integers(npz, "upsampling_vertex");
  const Eigen::MatrixXd weights = Table(npz, "upsampling_weight");
  Require(vertices.rows() == weights.rows() && vertices.cols() == weights.cols(),
          "'upsampling_vertex' and 'upsampling_weight' differ in size");
  std::vector<UpsamplingRow> upsampling(Size(vertices.rows()));
  for (Eigen::Index i = 0; i < vertices.rows(); ++i) {
    for (Eigen::Index c = 0; c < vertices.cols(); ++c) {
      if (weights(i, c) != 0) upsampling[Size(i)].emplace_back(vertices(i, c), weights(i, c));
    }
  }
  return upsampling;
}

std::vector<SurfacePoint> GetMaterial(const io::Npz& npz) {
  const std::vector<int> triangles = io::IntsFrom(npz, "material_triangle");
  const Eigen::MatrixXd barycentric = Points(npz, "material_barycentric");
  Require(static_cast<Eigen::Index>(triangles.size()) == barycentric.rows(),
          "'material_triangle' and 'material_barycentric' differ in size");
  std::vector<SurfacePoint> material;
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    material.push_back({triangles[i], barycentric.row(static_cast<Eigen::Index>(i))});
    const double sum = material.back().barycentric.sum();
    Require(
        triangles[i] >= 0 && std::abs(sum - 1) < 1e-6,
        fmt::format("material point {} lies on triangle {} with barycentrics that sum to {:.6g}", i,
                    triangles[i], sum));
  }
  return material;
}

std::vector<NetworkLayer> GetNetwork(const io::Npz& npz) {
  std::vector<NetworkLayer> layers;
  for (int l = 0; npz.contains(fmt::format("network_weight_{}", l)); ++l) {
    const Eigen::MatrixXd bias = io::MatrixFrom(npz, fmt::format("network_bias_{}", l));
    Require(bias.cols() == 1, fmt::format("'network_bias_{}' is not a vector", l));
    layers.push_back({Table(npz, fmt::format("network_weight_{}", l)), bias.col(0)});
  }
  return layers;
}

void GetSkeleton(const io::Npz& npz, FootModel& model) {
  const Eigen::MatrixXi tree = Integers(npz, "kintree_table");
  Require(tree.rows() == 2 && tree.cols() > 0,
          fmt::format("'kintree_table' is {} x {}, expected 2 x K", tree.rows(), tree.cols()));
  for (Eigen::Index j = 0; j < tree.cols(); ++j) {
    Require(tree(1, j) == j,
            fmt::format("'kintree_table' lists joint {} at place {}", tree(1, j), j));
    model.parents.push_back(tree(0, j));
  }
  model.joint_regressor = Table(npz, "J_regressor");
  model.joint_names = io::StringsFrom(npz, "joint_names");
  const std::vector<int> vertices = io::IntsFrom(npz, "landmarks");
  const std::vector<std::string> names = io::StringsFrom(npz, "landmark_names");
  Require(vertices.size() == names.size(), "'landmarks' and 'landmark_names' differ in size");
  for (std::size_t l = 0; l < names.size(); ++l) model.landmarks.push_back({names[l], vertices[l]});
}

void GetConstraints(const io::Npz& npz, FootModel& model) {
  if (npz.contains("pose_index")) {
    const Eigen::MatrixXi index = Integers(npz, "pose_index");
    Require(index.cols() == 3, "'pose_index' has not three columns");
    model.pose_index = index;
  }
  if (!npz.contains("hinge_axes")) return;
  const Shape& shape = Dimensions(npz, "hinge_axes", 3);
  Require(shape[1] == 2 && shape[2] == 3, "'hinge_axes' has a shape other than (K, 2, 3)");
  const Eigen::MatrixXd axes = io::MatrixFrom(npz, "hinge_axes");
  model.constraints.resize(shape[0]);
  for (Eigen::Index j = 0; j < axes.rows(); ++j) {
    for (const Eigen::Index first : {0, 3}) {
      const Eigen::Vector3d axis = axes.block<1, 3>(j, first);
      if (!axis.isZero(0)) model.constraints[Size(j)].axes.push_back(axis);
    }
  }
}

PoseSpace GetPoseSpace(const io::Npz& npz) {
  PoseSpace space;
  if (!npz.contains("pose_mean")) return space;
  Dimensions(npz, "pose_mean", 1);
  Dimensions(npz, "pose_variances", 1);
  Dimensions(npz, "pose_mixture_weights", 1);
  const Shape& shape = Dimensions(npz, "pose_mixture_covariances", 3);
  Require(shape[1] == shape[2], "'pose_mixture_covariances' holds no square matrices");
  space.mean = io::MatrixFrom(npz, "pose_mean").col(0);
  space.components = Table(npz, "pose_components");
  space.variances = io::MatrixFrom(npz, "pose_variances").col(0);
  space.weights = io::MatrixFrom(npz, "pose_mixture_weights").col(0);
  space.means = Table(npz, "pose_mixture_means");
  space.covariances = io::MatrixFrom(npz, "pose_mixture_covariances");
  return space;
}

Family FamilyFrom(const std::string& name) {
  for (const Family family : {Family::kSupr, Family::kStar, Family::kSmpl}) {
    if (FamilyName(family) == name) return family;
  }
  throw Error(fmt::format("family '{}' is unknown, expected supr, star or smpl", name));
}

Side SideFrom(const std::string& name) {
  Require(name == "right" || name == "left",
          fmt::format("side '{}' is unknown, expected right or left", name));
  return name == "right" ? Side::kRight : Side::kLeft;
}

FootModel ModelFrom(const io::Npz& npz) {
  Require(npz.contains("format") && io::StringFrom(npz, "format") == kFormat,
          "it is not a Sole foot model");
  const std::vector<int> version = io::IntsFrom(npz, "version");
  Require(version.size() == 1 && version[0] == kVersion,
          fmt::format("it has format version {}, this program reads {}",
                      version.empty() ? 0 : version[0], kVersion));
  FootModel model;
  model.family = FamilyFrom(io::StringFrom(npz, "family"));
  model.side = SideFrom(io::StringFrom(npz, "side"));
  model.licence = io::StringFrom(npz, "licence");
  const std::vector<int> mirror = io::IntsFrom(npz, "mirror");
  Require(mirror.size() == 1, "'mirror' is not one number");
  model.mirror_axis = mirror[0];
  GetSkeleton(npz, model);
  GetConstraints(npz, model);
  model.coarse = GetSurface(npz, "");
  if (npz.contains("fine_v_template")) model.fine = GetSurface(npz, "fine_");
  if (npz.contains("upsampling_vertex")) model.upsampling = GetUpsampling(npz);
  if (npz.contains("A")) model.activations = Table(npz, "A");
  if (npz.contains("material_triangle")) model.material = GetMaterial(npz);
  model.network = GetNetwork(npz);
  model.pose_space = GetPoseSpace(npz);
  Prepare(model);
  // Correctives that are all zero cost time and nothing else.
  if ((model.coarse.posedirs.array() == 0).all() && (model.fine.posedirs.array() == 0).all()) {
    model.coarse.posedirs.resize(0, 0);
    model.fine.posedirs.resize(0, 0);
  }
  return model;
}

}  // namespace

namespace {

std::string DescribeNetwork(const FootModel& model) {
  const std::optional<NetworkKind> kind = KindOfNetwork(model);
  if (!kind) return "none";
  return fmt::format("{} layers, {} inputs: {}", model.network.size(),
                     model.network.front().weight.cols(),
                     *kind == NetworkKind::kPose        ? "pose"
                     : *kind == NetworkKind::kPoseShape ? "pose and shape"
                                                        : "pose, shape and contact");
}

}  // namespace

std::string FamilyName(Family family) {
  switch (family) {
    case Family::kSupr:
      return "supr";
    case Family::kStar:
      return "star";
    case Family::kSmpl:
      return "smpl";
  }
  return "";
}

FootModel LoadModel(const std::filesystem::path& path) {
  const io::Npz npz = io::ReadNpz(path);
  try {
    return ModelFrom(npz);
  } catch (const Error& error) {
    throw Error(fmt::format("{}: {}", path.string(), error.what()));
  }
}

void SaveModel(const std::filesystem::path& path, const FootModel& model,
               const SaveModelOptions& options) {
  FootModel checked = model;
  Prepare(checked);
  const bool single = options.single_precision;
  io::Npz npz;
  npz["format"] = io::NpyFrom(std::string(kFormat));
  npz["version"] = io::NpyFrom(std::vector<int>{kVersion});
  npz["family"] = io::NpyFrom(FamilyName(model.family));
  npz["side"] = io::NpyFrom(std::string(model.side == Side::kRight ? "right" : "left"));
  npz["units"] = io::NpyFrom(std::string("metres, radians"));
  npz["licence"] = io::NpyFrom(model.licence);
  npz["mirror"] = io::NpyFrom(std::vector<int>{model.mirror_axis});
  const Eigen::Index features = NumPoseFeatures(model.family, model.NumJoints());
  PutSkeleton(npz, model, single);
  PutConstraints(npz, model);
  PutSurface(npz, "", model.coarse, features, single);
  if (model.HasFine()) PutSurface(npz, "fine_", model.fine, features, single);
  if (!model.upsampling.empty()) PutUpsampling(npz, model.upsampling, single);
  if (!model.material.empty()) PutMaterial(npz, model.material);
  if (model.activations.size() > 0) {
    npz["A"] = RealArray(model.activations,
                         {Size(model.activations.rows()), Size(model.activations.cols())}, single);
  }
  for (std::size_t l = 0; l < model.network.size(); ++l) {
    const NetworkLayer& layer = model.network[l];
    npz[fmt::format("network_weight_{}", l)] =
        RealArray(layer.weight, {Size(layer.weight.rows()), Size(layer.weight.cols())}, single);
    npz[fmt::format("network_bias_{}", l)] =
        RealArray(layer.bias, {Size(layer.bias.size())}, single);
  }
  PutPoseSpace(npz, model.pose_space, single);
  io::WriteNpz(path, npz);
}

std::vector<std::string> DescribeModel(const FootModel& model) {
  std::string joints;
  for (const std::string& name : model.joint_names) joints += (joints.empty() ? "" : ", ") + name;
  const bool correctives = model.coarse.posedirs.cols() > 0;
  std::vector<std::string> lines = {
      fmt::format("family    {}, a {} model ({} pose features, correctives {})",
                  FamilyName(model.family), ReleasedName(model),
                  NumPoseFeatures(model.family, model.NumJoints()),
                  correctives ? "present" : "zero"),
      fmt::format("side      {}", model.side == Side::kRight ? "right" : "left"),
      fmt::format("vertices  {} ({} triangles)", model.NumVertices(),
                  model.coarse.triangles.rows())};
  if (model.HasFine())
    lines.push_back(fmt::format("fine      {} ({} triangles)", model.fine.NumVertices(),
                                model.fine.triangles.rows()));
  lines.push_back(
      fmt::format("joints    {}: {}", model.NumJoints(), joints.empty() ? "unnamed" : joints));
  if (!model.constraints.empty()) {
    std::array<int, 3> by_axes{};
    for (const JointConstraint& constraint : model.constraints) ++by_axes[constraint.axes.size()];
    lines.push_back(fmt::format("hinges    {} hinges, {} double hinges, {} free joints", by_axes[1],
                                by_axes[2], by_axes[0]));
  }
  lines.push_back(fmt::format("pose      {} values", NumPoseValues(model)));
  lines.push_back(fmt::format("shapes    {}", model.NumBetas()));
  lines.push_back("network   " + DescribeNetwork(model));
  if (!model.landmarks.empty()) {
    std::string names;
    for (const Landmark& landmark : model.landmarks)
      names += (names.empty() ? "" : ", ") + landmark.name;
    lines.push_back("landmarks " + names);
  }
  lines.push_back(fmt::format(
      "material  {}",
      model.material.empty() ? "none" : "a point of the simulator's reference foot per vertex"));
  lines.push_back(fmt::format("licence   {}", model.licence));
  return lines;
}

}  // namespace sole::model
