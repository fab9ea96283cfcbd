#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "app/registrations.h"
#include "model/foot_model.h"

namespace sole::app {

/// One registration to score models on. A left foot is mirrored, so that models of the right foot
/// fit all of them.
struct Specimen {
  std::size_t subject = 0;       ///< index
  std::string motion;            ///< name of the sequence it is from
  Eigen::MatrixX3d coarse_m;     ///< N x 3
  Eigen::MatrixX3d fine_m;       ///< M x 3
  Eigen::VectorXd seen;          ///< N, 1 where the scan held the vertex, else 0
  Eigen::VectorXd contact;       ///< N, labels 0 or 1
  Eigen::MatrixX3d true_m;       ///< N x 3, or no rows
  bool touches = false;          ///< any contact
};

/// Good registrations of one split (or `all`), at most `per_subject` of each foot, evenly spread.
struct Specimens {
  std::vector<std::string> subjects;
  std::vector<Specimen> all;
};
Specimens ReadSpecimens(const std::filesystem::path& dataset, const std::string& split,
                        int per_subject);

/// How well a model explains one specimen: pose, shape and translation fitted to the vertices that
/// the scan held, contact from the labels. Lengths in metres.
struct SpecimenScore {
  Eigen::MatrixX3d theta;
  Eigen::VectorXd beta;
  double v2v_m = 0;            ///< mean over the seen vertices
  double touching_v2v_m = 0;   ///< over those of them that touch; NaN without
  double true_v2v_m = 0;       ///< fitted to true places, all vertices; NaN without truth
  double square_m2 = 0;        ///< mean squared distance over the seen vertices
  double surface_m = 0;        ///< mean distance of seen registered vertices to the model's surface
};

/// Scores of all specimens, in their order, on all threads. `betas`: shape coefficients used (-1:
/// all). Throws Error where the model's vertices are not the dataset's.
std::vector<SpecimenScore> ScoreModel(const model::FootModel& model, const Specimens& specimens,
                                      int betas = -1);

/// Mean over specimens, standard deviation over them, and the 95 % interval of the mean over
/// subjects (bootstrap over subjects, deterministic). NaN values are left out; all NaN without any.
struct Spread {
  double mean = 0, sd = 0, low = 0, high = 0;
  int count = 0;
};
Spread SpreadOf(const Specimens& specimens, const std::vector<double>& values);

/// What a model's network does when contact changes, over specimens that touch (lengths in metres).
struct ContactResponse {
  double free_m = 0;      ///< mean offset of touching vertices with contact set to zero everywhere
  double share = 0;       ///< of the flattening that it explains: 1 - |r| with / |r| without network
  double monotonic = 0;   ///< share of touching vertices that rise steadily as contact fades in
  int specimens = 0;
};
ContactResponse MeasureContactResponse(const model::FootModel& model, const Specimens& specimens,
                                       const std::vector<SpecimenScore>& scores);

}  // namespace sole::app
