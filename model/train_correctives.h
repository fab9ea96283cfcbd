#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "model/foot_model.h"

namespace sole::model {

/// Lengths of the shortest ways along a mesh's edges from the nearest of `sources`, m; infinity where
/// there is none. Never shorter than the way over the surface.
Eigen::VectorXd EdgeDistances(const TriangleMesh& mesh, std::span<const int> sources);

/// N x K: edge distance of each fine vertex from each joint's ring, the vertices that follow the
/// joint and what hangs on it by 30 to 70 %. Infinity for the root and for joints without a ring.
Eigen::MatrixXd RingDistances(const FootModel& foot);

struct CorrectiveOptions {
  double reach_m = 0.055;   ///< a joint corrects no vertex further from its ring
  double max_share = 0.30;  ///< of the correctives' values that may be other than zero
  double sparsity = 1e-3;   ///< first strength of the activations' L1 term, relative
  double ridge = 1e-3;      ///< of the strength that the features' own variance gives them
};

/// What samples say about the correctives, summed sample by sample. SUPR features: 4 a joint.
struct CorrectiveEvidence {
  std::vector<std::vector<int>> joints;   ///< per vertex: those within reach
  std::vector<Eigen::MatrixXd> products;  ///< per vertex, 4 a joint within reach, both ways
  std::vector<Eigen::MatrixXd> moments;   ///< per vertex, 4 a joint within reach x 3, m
  Eigen::VectorXd count;                  ///< per vertex
  Eigen::VectorXd squares;                ///< per vertex, of the offsets, m2
};
CorrectiveEvidence NoCorrectiveEvidence(const Eigen::MatrixXd& ring_distances_m,
                                        const CorrectiveOptions& options);

/// Adds rest-pose offsets (M x 3, m) that go with pose features (4K); `counts` as in AddEvidence.
void AddEvidence(const Eigen::MatrixX3d& offsets_m, const Eigen::VectorXd& features,
                 const Eigen::VectorXd& counts, CorrectiveEvidence& evidence);

struct Correctives {
  Eigen::MatrixXd posedirs;     ///< 3M x 4K
  Eigen::MatrixXd activations;  ///< M x K, 0 to 1: a joint corrects the vertices where it is above 0
  double share = 0;             ///< of posedirs other than zero, the larger of fine and coarse
  double sparsity = 0;          ///< the strength that it took
};

/// Sparse pose correctives with learned local activations. STAR's B_P = sum_j relu(A_j) o K_j with
/// terms |K|^2 and |A|_1 has for every vertex and joint only the product of both in it, and the two
/// terms together are least at a multiple of the product's norm: the activations are found as
/// group lasso, one group a vertex and joint, convex and without annealing. Groups further from the
/// joint's ring pay more (their activation would begin smaller: the reciprocal distance). The term
/// grows until the share keeps within its bound, on all vertices and on the first `num_coarse`; then
/// the groups that are left are fitted again without it. Activations are the groups' norms, the largest of a joint being 1.
Correctives SolveCorrectives(const CorrectiveEvidence& evidence,
                             const Eigen::MatrixXd& ring_distances_m, Eigen::Index num_coarse,
                             const CorrectiveOptions& options = {});

}  // namespace sole::model
