#pragma once

#include <Eigen/Core>
#include <string>
#include <utility>
#include <vector>

#include "core/fit_sequence.h"
#include "core/mesh.h"
#include "model/pose_space.h"

namespace sole::model {

/// Feature map of the pose correctives.
enum class Family {
  kSupr,  ///< 4K values: (x, y, z, w - 1) of every joint's quaternion, root included
  kStar,  ///< 4(K - 1) + 1: the same without the root, then the second shape coefficient
  kSmpl,  ///< 9(K - 1): vec(R - I) by rows, root left out
};

/// One sampling of the skin. N vertices, K joints, B shape coefficients, P pose features. Blend
/// shapes are stored with one row per coordinate: row 3 i + axis belongs to vertex i.
struct ModelSurface {
  Eigen::MatrixX3d template_m;  ///< N x 3, rest pose
  Eigen::MatrixX3i triangles;   ///< counter-clockwise seen from outside
  Eigen::MatrixXd weights;      ///< N x K, rows sum to 1
  Eigen::MatrixXd shapedirs;    ///< 3N x B, metres per standard deviation
  Eigen::MatrixXd
      posedirs;  ///< 3N x P, metres; zero columns of P where the model has no correctives

  Eigen::Index NumVertices() const { return template_m.rows(); }
};

/// Fully connected layer y = weight * x + bias.
struct NetworkLayer {
  Eigen::MatrixXd weight;  ///< outputs x inputs
  Eigen::VectorXd bias;
};

/// Named place on the skin.
struct Landmark {
  std::string name;
  int vertex = -1;  ///< of the coarse surface
};

/// Axes that a joint turns about, unit vectors, right-handed. None: any axis, its row of theta is an
/// axis-angle vector. One (hinge): the row's first value is the angle. Two (double hinge): the first
/// two values are the angles, rotation = that about axes[0] times that about axes[1], and the pose
/// feature is the product of the two features (x, y, z, w - 1) as quaternions.
struct JointConstraint {
  std::vector<Eigen::Vector3d> axes;
};

/// Sparse row of the upsampling matrix: coarse vertices and their weights (sum 1).
using UpsamplingRow = std::vector<std::pair<int, double>>;

/// Quantities that follow from the others; Prepare fills them.
struct DerivedModelData {
  Eigen::MatrixX3d joints_m;        ///< K x 3, joints of the template
  Eigen::MatrixXd joint_shapedirs;  ///< 3K x B, their change with shape
  /// Non-zero skinning influences of vertex i: entries start[i] .. start[i + 1] of joint and
  /// weight.
  struct Influences {
    std::vector<int> start;
    std::vector<int> joint;
    std::vector<double> weight;
  };
  Influences coarse, fine;
  /// Whether joint j's pose features correct vertex i (element i K + j).
  std::vector<unsigned char> coarse_corrected, fine_corrected;
  /// The same values in single precision, read in place of the double ones where that loses
  /// nothing, as in models read from files that store them so; empty where it would.
  struct SingleSurface {
    Eigen::MatrixXf shapedirs, posedirs;
  };
  SingleSurface coarse_single, fine_single;
  std::vector<Eigen::MatrixXf> network_single;  ///< weights, one a layer
};

/// Articulated model of one foot (SUPR / STAR / SMPL family); plain data. The coarse surface
/// carries contact bits and the network, the fine one the same joints and shape coefficients.
/// Right-handed rotations.
struct FootModel {
  Family family = Family::kSupr;
  Side side = Side::kRight;
  std::string licence;
  std::vector<int>
      parents;  ///< K; the root is joint 0 with parent -1, parents come before children
  std::vector<std::string> joint_names;  ///< K, or empty
  std::vector<JointConstraint> constraints;  ///< K, or empty where every joint turns freely
  /// K x 3: place of theta(j, i) in a flat vector of pose values, -1 for none; no rows: 3 j + i.
  Eigen::MatrixX3i pose_index;
  ModelSurface coarse;
  ModelSurface
      fine;  ///< no vertices where the model has no fine variant; the first N are the coarse ones
  std::vector<UpsamplingRow>
      upsampling;  ///< one row per fine vertex; the first N rows are the identity
  /// K x N (weights of coarse vertices) or 3K x (3N + 1) (affine in the stacked shaped vertices).
  Eigen::MatrixXd joint_regressor;
  Eigen::MatrixXd activations;  ///< N x K of the correctives, or empty (already within posedirs)
  std::vector<NetworkLayer> network;  ///< contact-conditioned network, no layers = zero offsets
  PoseSpace pose_space;  ///< how the training poses are distributed; may be empty
  std::vector<Landmark> landmarks;
  std::vector<SurfacePoint>
      material;         ///< per coarse vertex, on the simulator's reference foot; or empty
  int mirror_axis = 0;  ///< coordinate that changes its sign between left and right
  DerivedModelData derived;

  Eigen::Index NumVertices() const { return coarse.NumVertices(); }
  Eigen::Index NumJoints() const { return static_cast<Eigen::Index>(parents.size()); }
  Eigen::Index NumBetas() const { return coarse.shapedirs.cols(); }
  bool HasFine() const { return fine.NumVertices() > 0; }
};

/// Checks every size against the others and fills `derived`. To be called after changing a model's
/// data and before evaluating it. Throws Error saying which quantity does not fit which.
void Prepare(FootModel& model);

/// Which surface of a model.
enum class Variant { kCoarse, kFine };

const ModelSurface& SurfaceOf(const FootModel& model, Variant variant);
const DerivedModelData::Influences& InfluencesOf(const FootModel& model, Variant variant);
const DerivedModelData::SingleSurface& SingleSurfaceOf(const FootModel& model, Variant variant);

/// Template of a variant as a mesh.
TriangleMesh TemplateMesh(const FootModel& model, Variant variant);

/// Mesh with the model's triangles and the given vertices (N x 3 of that variant).
TriangleMesh MeshOf(const FootModel& model, Variant variant, const Eigen::MatrixX3d& vertices_m);

}  // namespace sole::model
