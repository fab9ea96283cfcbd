#pragma once

#include <Eigen/Core>

#include "core/target.h"

namespace sole::sim {

/// Diffuse albedo of paper or etched white, and of ink.
inline constexpr float kWhiteAlbedo = 0.80f;
inline constexpr float kBlackAlbedo = 0.045f;
/// Albedo of the cube's bare top face.
inline constexpr float kBareAlbedo = 0.30f;
/// Width of the white zone around a fiducial, in marker cells (a marker is 7 cells wide).
inline constexpr double kQuietCells = 1.5;

/// True where marker `id` of the rig's dictionary (OpenCV DICT_5X5_250) is white; u right and v
/// down, 0 to 1 across the marker with its black border. False outside. Throws Error if the
/// dictionary has no such id.
bool MarkerIsWhite(int id, double u, double v);

/// Albedo of a ChArUco face at a point of the board frame (metres); white beyond the printed
/// squares.
float AlbedoOnBoard(const CharucoFace& face, double x, double y);

/// Albedo of a fiducial at a world point of the glass top, negative outside its etched patch.
float AlbedoOnFiducial(const Fiducial& fiducial, double x, double y);

/// Half the edge of a fiducial's etched patch, metres.
double FiducialPatchHalf(const Fiducial& fiducial);

}  // namespace sole::sim
