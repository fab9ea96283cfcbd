#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "model/foot_model.h"

namespace sole::model {

struct SaveModelOptions {
  bool single_precision = true;  ///< reals as float32; otherwise float64
};

/// Our model format: one .npz that numpy opens directly. Keys (N, K, B, P, F as in foot_model.h; *
/// = optional): format "sole-foot-model", version 1, family, side, units, licence, v_template
/// (N,3), f (T,3), kintree_table (2,K: parent, joint), weights (N,K), shapedirs (N,3,B), posedirs
/// (N,3,P), J_regressor (K,N) or (3K,3N+1), joint_names (K), landmarks (vertex) and landmark_names,
/// mirror (axis), A* (N,K), network_weight_0*, network_bias_0* ..., fine_v_template*, fine_f*,
/// fine_weights*, fine_shapedirs*, fine_posedirs* (F rows), upsampling_vertex*, upsampling_weight*
/// (F,m), material_triangle* (N), material_barycentric* (N,3), hinge_axes* (K,2,3: zero where a
/// joint has fewer than two), pose_index* (K,3), pose_mean*, pose_components*, pose_variances*,
/// pose_mixture_weights*, pose_mixture_means*, pose_mixture_covariances* (see PoseSpace). Throws Error with the path where the
/// file is not such a model or a size does not fit the others.
FootModel LoadModel(const std::filesystem::path& path);

/// Writes atomically. Throws Error where the file cannot be written or the model is not consistent.
void SaveModel(const std::filesystem::path& path, const FootModel& model,
               const SaveModelOptions& options = {});

/// What `sole model info` prints, one fact a line: family, sizes, joints, licence.
std::vector<std::string> DescribeModel(const FootModel& model);

/// "supr", "star" or "smpl".
std::string FamilyName(Family family);

}  // namespace sole::model
