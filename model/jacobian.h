#pragma once

#include <Eigen/Core>
#include <functional>
#include <span>

#include "core/mesh.h"
#include "model/forward.h"

namespace sole::model {

/// Rows: 3 per point (x, y, z); row-major as Ceres wants it.
using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Columns of every Jacobian: theta joint by joint (3K), the given shape coefficients
/// (parameters.beta.size()), then the translation (3).
struct ParameterColumns {
  Eigen::Index theta = 0;
  Eigen::Index beta = 0;
  Eigen::Index translation = 0;
  Eigen::Index count = 0;
};
ParameterColumns ColumnsOf(const FootModel& model, const ModelParameters& parameters);

/// Points with their derivatives.
struct PointsJacobian {
  Eigen::MatrixX3d points_m;  ///< M x 3
  RowMatrix jacobian;         ///< 3M x columns
};

/// Vertices of a variant, all of them. The derivative includes correctives and the contact network
/// with respect to theta and beta; contact itself is held fixed
/// (see VertexContactJacobian).
PointsJacobian VertexJacobian(const FootModel& model, const ModelParameters& parameters,
                              Variant variant);

/// The vertices listed in `vertices` (indices of the variant), in that order.
PointsJacobian VertexJacobian(const FootModel& model, const ModelParameters& parameters,
                              Variant variant, std::span<const int> vertices);

/// Points of the variant's surface.
PointsJacobian SurfacePointJacobian(const FootModel& model, const ModelParameters& parameters,
                                    Variant variant, std::span<const SurfacePoint> points);

/// The same point by point, without a matrix for all of them: calls visit(m, position, rows), where
/// `rows` (3 x columns) holds point m's derivative until visit returns. Cost functions write what
/// they need of it straight into Ceres' blocks.
using PointVisitor =
    std::function<void(Eigen::Index m, const Eigen::Vector3d& position_m, const RowMatrix& rows)>;
void VisitSurfacePoints(const FootModel& model, const ModelParameters& parameters, Variant variant,
                        std::span<const SurfacePoint> points, const PointVisitor& visit);

/// Derivative with respect to the N contact values (soft contact; joints do not depend on it), 3
/// rows a vertex of the variant. Zero where the model has no network; empty contact is taken as zeros.
RowMatrix VertexContactJacobian(const FootModel& model, const ModelParameters& parameters,
                                Variant variant);

/// The same for points of the variant's surface.
RowMatrix SurfacePointContactJacobian(const FootModel& model, const ModelParameters& parameters,
                                      Variant variant, std::span<const SurfacePoint> points);

/// Posed joints, 3K rows.
PointsJacobian JointJacobian(const FootModel& model, const ModelParameters& parameters);

}  // namespace sole::model
