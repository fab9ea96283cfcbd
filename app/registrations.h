#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/fit_sequence.h"

namespace sole::app {

/// Everything that is known of one subject's feet after `sole fit`: the unit of training and
/// evaluation (docs/formats.md, registrations). F frames, N coarse vertices, M fine ones (the first
/// N of which are the coarse ones), K joints, B shape coefficients. World frame, metres; a left
/// foot is as it was registered.
struct SubjectRegistrations {
  std::string subject;  ///< pseudonym; a simulated person's number in six digits
  std::string sex;      ///< `female`, `male` or empty
  std::string split;    ///< `train`, `validation` or `test`
  Side side = Side::kRight;
  std::vector<std::string> motion;  ///< of each sequence
  std::vector<int> sequence;        ///< F, which sequence a frame belongs to
  std::vector<double> time_s;       ///< F, time within it
  std::vector<std::string> verdict; ///< F, `good` or why not
  std::vector<Eigen::MatrixX3f> fine_m;  ///< F free registrations, M x 3; NaN without a foot
  Eigen::MatrixXf sd_m;                  ///< F x N, along the normal; large where nothing was seen
  Eigen::Matrix<std::uint8_t, Eigen::Dynamic, Eigen::Dynamic> contact;  ///< F x N
  Eigen::MatrixXf probability, gap_m;                                   ///< F x N
  std::vector<Eigen::MatrixX3d> theta;  ///< F, K x 3; pose of the model that registered
  Eigen::MatrixX3d translation_m;       ///< F x 3, of the same
  Eigen::VectorXd beta;                 ///< B, of the same
  /// F, N x 3: true places of the material points; empty where they are not known. For scoring only.
  std::vector<Eigen::MatrixX3f> true_m;

  std::size_t NumFrames() const { return sequence.size(); }
  Eigen::Index NumVertices() const { return sd_m.cols(); }
};

/// "train", "validation" or "test" (8 : 1 : 1) by the subject's name alone, so that no subject is
/// in two of them. Names that are numbers are split as `sole sim scans` splits its people.
std::string SplitOfSubject(const std::string& subject);

/// DATASET/registrations/SUBJECT.npz.
std::filesystem::path RegistrationsFile(const std::filesystem::path& dataset,
                                        const std::string& subject);

/// The subjects' files of a dataset in the order of their names; none is an Error that says which
/// command makes them.
std::vector<std::filesystem::path> ListRegistrations(const std::filesystem::path& dataset);

/// Throw Error with the path where a file is missing, damaged or its arrays do not fit together.
SubjectRegistrations ReadRegistrations(const std::filesystem::path& path);
void WriteRegistrations(const std::filesystem::path& path,
                        const SubjectRegistrations& registrations);

}  // namespace sole::app
