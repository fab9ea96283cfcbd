#include "model/released_model.h"

#include <fmt/format.h>

#include <cmath>
#include <cstddef>
#include <vector>

#include "core/error.h"
#include "io/npz.h"
#include "io/pickle.h"
#include "model/model_file.h"
#include "model/pose_features.h"

namespace sole::model {
namespace {

constexpr const char* kUnknownLicence =
    "not stated in the file: the terms under which its makers released it hold";

void RequireKeys(const io::Npz& npz) {
  for (const char* key :
       {"v_template", "f", "kintree_table", "weights", "shapedirs", "posedirs", "J_regressor"}) {
    Require(npz.contains(key),
            fmt::format("it is no model that Sole knows: it has no array '{}'", key));
  }
}

/// A table of `columns` columns; 0 = any number.
Eigen::MatrixXd Table(const io::Npz& npz, const std::string& name, std::size_t columns) {
  const std::vector<std::size_t>& shape = io::ShapeOf(npz, name);
  Require(
      shape.size() == 2 && (columns == 0 || shape[1] == columns),
      fmt::format("'{}' has shape ({}), expected two dimensions{}", name, fmt::join(shape, ", "),
                  columns == 0 ? "" : fmt::format(" and {} columns", columns)));
  return io::MatrixFrom(npz, name);
}

/// Values that must be whole numbers that an int can hold.
Eigen::MatrixXi Indices(const Eigen::MatrixXd& values, const char* name) {
  Require(values.size() == 0 ||
              (values.array().abs() < 2e9 && values.array() == values.array().round()).all(),
          fmt::format("'{}' holds values that are no indices", name));
  return values.cast<int>();
}

/// (N, 3, M) or (3N, M) as 3N x M.
Eigen::MatrixXd BlendShapes(const io::Npz& npz, const std::string& name, Eigen::Index vertices) {
  const auto n = static_cast<std::size_t>(vertices);
  const std::vector<std::size_t>& shape = io::ShapeOf(npz, name);
  const bool cube = shape.size() == 3 && shape[0] == n && shape[1] == 3;
  const bool flat = shape.size() == 2 && shape[0] == 3 * n;
  Require(cube || flat, fmt::format("'{}' has shape ({}), expected ({}, 3, any)", name,
                                    fmt::join(shape, ", "), n));
  return io::MatrixFrom({{name, io::Reshaped(npz.at(name), {3 * n, shape.back()})}}, name);
}

/// Parents from the table's rows: parent's id, own id.
std::vector<int> Parents(const io::Npz& npz) {
  const Eigen::MatrixXd table = Table(npz, "kintree_table", 0);
  Require(table.rows() == 2 && table.cols() > 0,
          fmt::format("'kintree_table' is {} x {}, expected 2 x K", table.rows(), table.cols()));
  std::vector<int> parents = {-1};
  for (Eigen::Index j = 1; j < table.cols(); ++j) {
    int parent = -1;
    for (Eigen::Index i = 0; i < j; ++i) {
      if (table(1, i) == table(0, j)) parent = static_cast<int>(i);
    }
    Require(parent >= 0, fmt::format("'kintree_table' gives joint {} no parent before it", j));
    parents.push_back(parent);
  }
  return parents;
}

Family FamilyOf(const FootModel& model) {
  const Eigen::Index k = model.NumJoints(), features = model.coarse.posedirs.cols();
  const bool affine = model.joint_regressor.cols() == 3 * model.NumVertices() + 1;
  for (const Family family : {Family::kSupr, Family::kStar, Family::kSmpl}) {
    const bool supr = family == Family::kSupr;
    if (NumPoseFeatures(family, k) == features && (supr || !affine)) return family;
  }
  throw Error(
      fmt::format("'posedirs' has {} features, which for {} joints is none of SUPR ({}), STAR ({}) "
                  "and SMPL ({})",
                  features, k, NumPoseFeatures(Family::kSupr, k), NumPoseFeatures(Family::kStar, k),
                  NumPoseFeatures(Family::kSmpl, k)));
}

/// The tree's constraints as a SUPR file states them.
class AxisMeta {
 public:
  explicit AxisMeta(const io::Npz& npz) : npz_(npz) {
    const std::vector<std::size_t> shape = io::ShapeOf(npz, "axis_meta/axis");
    Require(!shape.empty() && shape.back() == 3, "'axis_meta/axis' holds no vectors");
    const std::size_t count = npz.at("axis_meta/axis").Count() / 3;
    const Eigen::MatrixXd all =
        io::MatrixFrom({{"axis", io::Reshaped(npz.at("axis_meta/axis"), {count, 3})}}, "axis");
    for (const int i : Ints("axis_indx")) {
      Require(i >= 0 && i < all.rows(), "'axis_meta/axis_indx' names no axis");
      axes_.push_back(all.row(i));
    }
  }

  /// Sets constraints and pose_index; axes with their signs changed (see LoadAnyModel).
  void Apply(FootModel& model) const {
    const std::vector<int> order = Ints("reverse_indx");
    std::vector<Joint> joints;
    AddSpherical(joints);
    const std::vector<int> hinges = Ints("indx_hinge");
    for (std::size_t h = 0; h < hinges.size(); ++h)
      joints.push_back({Eigen::Vector3i(hinges[h], -1, -1), {{Axis("indx_hinge_axis", h)}}});
    AddDouble(joints);
    Require(order.size() == joints.size() && order.size() == model.parents.size(),
            fmt::format("'axis_meta' describes {} joints in an order of {}, the tree has {}",
                        joints.size(), order.size(), model.parents.size()));
    model.pose_index.resize(model.NumJoints(), 3);
    for (std::size_t j = 0; j < order.size(); ++j) {
      Require(order[j] >= 0 && static_cast<std::size_t>(order[j]) < joints.size(),
              "'axis_meta/reverse_indx' names no joint");
      const Joint& joint = joints[static_cast<std::size_t>(order[j])];
      const auto row = static_cast<Eigen::Index>(j);
      model.pose_index.row(row) = joint.index.transpose();
      model.constraints.push_back(joint.constraint);
      if (!joint.constraint.axes.empty()) model.coarse.posedirs.middleCols(4 * row, 3) *= -1;
    }
    CheckIndex(model.pose_index);
  }

 private:
  struct Joint {
    Eigen::Vector3i index;
    JointConstraint constraint;
  };

  std::vector<int> Ints(const std::string& name) const {
    return npz_.contains("axis_meta/" + name) ? io::IntsFrom(npz_, "axis_meta/" + name)
                                              : std::vector<int>{};
  }
  Eigen::Vector3d Axis(const std::string& list, std::size_t entry) const {
    const std::vector<int> which = Ints(list);
    Require(entry < which.size() && which[entry] >= 0 &&
                static_cast<std::size_t>(which[entry]) < axes_.size(),
            fmt::format("'axis_meta/{}' names no axis for hinge {}", list, entry));
    return -axes_[static_cast<std::size_t>(which[entry])];
  }
  void AddSpherical(std::vector<Joint>& joints) const {
    const std::vector<int> at = Ints("indx_spherical");
    Require(at.size() % 3 == 0, "'axis_meta/indx_spherical' holds no triples");
    for (std::size_t i = 0; i < at.size(); i += 3)
      joints.push_back({Eigen::Vector3i(at[i], at[i + 1], at[i + 2]), {}});
  }
  void AddDouble(std::vector<Joint>& joints) const {
    const std::vector<int> first = Ints("indx_double_hinge1"), second = Ints("indx_double_hinge2");
    Require(first.size() == second.size(), "'axis_meta' has double hinges of one axis");
    for (std::size_t h = 0; h < first.size(); ++h) {
      joints.push_back(
          {Eigen::Vector3i(first[h], second[h], -1),
           {{Axis("indx_double_hinge1_axis", h), Axis("indx_double_hinge2_axis", h)}}});
    }
  }
  void CheckIndex(const Eigen::MatrixX3i& index) const {
    const std::vector<int> given = Ints("num_pose");
    Require((index.array() >= -1 && index.array() < 3 * static_cast<int>(index.rows())).all(),
            "'axis_meta' places pose values beyond three a joint");
    const int count = index.maxCoeff() + 1;
    Require(given.size() == 1 && given[0] == count,
            fmt::format("'axis_meta/num_pose' is {}, its joints take {} pose values",
                        given.empty() ? 0 : given[0], count));
  }

  const io::Npz& npz_;
  std::vector<Eigen::Vector3d> axes_;
};

FootModel ModelFrom(const io::Npz& npz) {
  RequireKeys(npz);
  FootModel model;
  model.licence = kUnknownLicence;
  model.coarse.template_m = Table(npz, "v_template", 3);
  const Eigen::Index n = model.NumVertices();
  model.coarse.triangles = Indices(Table(npz, "f", 3), "f");
  model.parents = Parents(npz);
  model.coarse.weights = Table(npz, "weights", model.parents.size());
  model.coarse.shapedirs = BlendShapes(npz, "shapedirs", n);
  model.coarse.posedirs = BlendShapes(npz, "posedirs", n);
  model.joint_regressor = Table(npz, "J_regressor", 0);
  model.family = FamilyOf(model);
  if (npz.contains("axis_meta/axis")) AxisMeta(npz).Apply(model);
  Prepare(model);
  return model;
}

bool IsOurs(const io::Npz& npz) {
  const auto format = npz.find("format");
  return format != npz.end() && format->second.dtype.starts_with("<U");
}

}  // namespace

FootModel LoadAnyModel(const std::filesystem::path& path) {
  const io::Npz npz = io::ReadArrayDict(path);
  if (IsOurs(npz)) return LoadModel(path);
  try {
    return ModelFrom(npz);
  } catch (const Error& error) {
    throw Error(fmt::format("{}: {}", path.string(), error.what()));
  }
}

std::string ReleasedName(const FootModel& model) {
  if (model.family == Family::kSupr) return "SUPR";
  if (model.family == Family::kStar) return "STAR";
  switch (NumPoseFeatures(model.family, model.NumJoints())) {
    case 459:
      return "SMPL-H";
    case 486:
      return "SMPL-X";
    case 135:
      return "MANO";
    case 36:
      return "FLAME";
    default:
      return "SMPL";
  }
}

}  // namespace sole::model
