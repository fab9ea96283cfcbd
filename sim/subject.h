#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/fit_sequence.h"
#include "core/mesh.h"

namespace sole::sim {

enum class Sex { kFemale, kMale };

struct SubjectShape;

/// One foot of one person. Cheap to copy (the shape is shared and immutable).
struct Subject {
  std::uint64_t seed = 0;  ///< 0 for MeanSubject
  Side side = Side::kRight;
  Sex sex = Sex::kMale;
  double weight_kg = 75;
  double stature_m = 1.72;
  double age_years = 40;
  std::map<std::string, double> measures_mm;  ///< drawn, standing at half the weight; names as in MeasureFoot
  double hallux_valgus_rad = 0;
  bool second_toe_longest = false;
  double heel_pad_m = 0.017;                  ///< thickness of the unloaded heel pad
  double tissue_stiffness = 1;                ///< of the sole's soft tissue, relative
  std::shared_ptr<const SubjectShape> shape;  ///< opaque: geometry at rest
};

/// The reference foot as a person of 75 kg.
Subject MeanSubject(Side side = Side::kRight);

/// Whom DrawSubject draws.
enum class Population {
  kSurvey,  ///< adults as the survey has them
  kOther,   ///< other proportions (higher arch, broader ball, narrower heel, more hallux valgus) and stiffer soles: what a model
            ///< that was trained on kSurvey has not seen
};

/// Draws a person: sex, the nine foot measures, stature and weight from the survey's normals (rejecting
/// beyond the 99.9 % Mahalanobis radius), navicular height, toe pattern, hallux angle, age and heel pad, and solves the shape for
/// them. Same seed and side: same bits. Both sides of one seed are one person whose feet differ by a little. Without `side`
/// the seed decides. About a second.
Subject DrawSubject(std::uint64_t seed, std::optional<Side> side = {}, Population population = Population::kSurvey);

/// Sex of the person that DrawSubject draws, at no cost.
Sex SubjectSex(std::uint64_t seed);

/// The subject's unloaded foot in its foot frame (see ReferenceFoot; a left foot has x medial).
TriangleMesh SubjectRestMesh(const Subject& subject);

/// One degree of freedom, in the subject's rest pose and foot frame.
struct JointAxis {
  std::string name;         ///< key of FootPose::angles_rad: "<joint>.<motion>", e.g. "mtp_1.dorsiflexion"
  std::string bone;         ///< the bone that moves; with "midtarsal" navicular and cuboid both do
  std::string parent_bone;
  Eigen::Vector3d centre_m;
  Eigen::Vector3d axis;     ///< unit; positive angles are right-handed about it
  double min_rad = 0, max_rad = 0;
};

/// All degrees of freedom, parents before children, in a fixed order.
std::vector<JointAxis> JointAxes(const Subject& subject);

struct BoneInfo {
  std::string name;
  std::string parent;  ///< empty for the tibia
  Eigen::Vector3d proximal_m, distal_m;
  Eigen::Vector3d joint_centre_m;  ///< joint with the parent
};

/// The 28 bones in the rest pose and foot frame, in a fixed order, the tibia first.
std::vector<BoneInfo> Bones(const Subject& subject);

/// Share of each bone in each vertex's motion (vertices x bones, rows sum to 1), as the simulator's first guess
/// moves them before it projects them to the posed skin. In the order of Bones().
const Eigen::MatrixXf& BoneShares();

}  // namespace sole::sim
