#pragma once

#include <vector>

#include "core/fit_sequence.h"

namespace sole::contact {

struct TemporalOptions {
  double change = 0.1;      ///< probability that a vertex lands or leaves from one frame to the next, as far as the two frames'
                            ///< labels do not tell: counts as much as `prior_vertices` touching ones do
  double prior_vertices = 10;
  double neighbours = 0.1;  ///< of the log odds of every other frame that count, 0 to 1: what is wrong in one frame is mostly wrong
                            ///< in the next one, too, so that frames are no independent witnesses
  double confident = 0.95;  ///< a frame's own label of this probability, or its complement, never moves
  double sure = 0.8;        ///< a label less probable than this is uncertain
};

/// Makes labels of a take (LabelContact, in order of time) agree with those before and after: every vertex is a hidden
/// Markov model of two states, free and touching, observed with its probability in each frame (`neighbours`). How likely it changes between two
/// frames is the share of the touching vertices that do, at most one half: a foot that rolls over the plate in a few frames says
/// little about the next one, a standing one much. Where the frame's own
/// label was not confident, probability and bit become those of the states given all frames (forward-backward), and
/// FrameContact::state tells what is left uncertain. Frames without labels for a vertex (NaN gap) say nothing
/// and stay free. Throws Error where frames have different numbers of vertices.
void SmoothLabels(std::vector<FrameContact>& frames, const TemporalOptions& options = {});

/// How far touching vertices moved along the glass since the frame before (`slip_m`, mean over the vertices that touch
/// in both; NaN: none) and how far touching ones lie under it (`penetration_m`, mean; NaN: none touch).
/// `vertices_m`: registered vertices of every frame, N x 3, world frame.
void MeasureSlip(const std::vector<Eigen::MatrixX3d>& vertices_m, std::vector<FrameContact>& frames);

}  // namespace sole::contact
