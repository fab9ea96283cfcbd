#include <gtest/gtest.h>

#include <Eigen/Core>
#include <limits>

#include "model/kernels_internal.h"

namespace sole::model {
namespace {

template <class Scalar>
void ExpectProduct(Eigen::Index rows, Eigen::Index columns, Eigen::Index inner, double tolerance) {
  using Matrix = Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>;
  Matrix a = Matrix::Random(rows + 2, inner), b = Matrix::Random(inner + 1, columns),
         c = Matrix::Random(rows + 3, columns);
  if (inner > 4) b.row(2).setZero();
  Matrix wanted = c;
  wanted.topRows(rows) += a.topRows(rows) * b.topRows(inner);
  AddProduct<Scalar>(
      {rows, columns, inner, a.data(), rows + 2, b.data(), inner + 1, c.data(), rows + 3});
  EXPECT_LT((c - wanted).cwiseAbs().maxCoeff(), tolerance)
      << rows << " x " << columns << " x " << inner;
}

/// Each factor once from single precision; the double one is garbage then, so that it must not be
/// read.
void ExpectSingleProduct(Eigen::Index rows, Eigen::Index columns, Eigen::Index inner) {
  Eigen::MatrixXf a = Eigen::MatrixXf::Random(rows + 2, inner),
                  b = Eigen::MatrixXf::Random(inner + 1, columns);
  if (inner > 4) b.row(2).setZero();
  const Eigen::MatrixXd full_a = a.cast<double>(), full_b = b.cast<double>(),
                        start = Eigen::MatrixXd::Random(rows + 3, columns);
  Eigen::MatrixXd wanted = start;
  wanted.topRows(rows) += full_a.topRows(rows) * full_b.topRows(inner);
  const auto none = std::numeric_limits<double>::quiet_NaN();
  for (const bool left : {true, false}) {
    const Eigen::MatrixXd read_a = left ? Eigen::MatrixXd::Constant(rows + 2, inner, none) : full_a,
                          read_b =
                              left ? full_b : Eigen::MatrixXd::Constant(inner + 1, columns, none);
    Eigen::MatrixXd c = start;
    AddProduct<double>({rows, columns, inner, read_a.data(), rows + 2, read_b.data(), inner + 1,
                        c.data(), rows + 3, left ? a.data() : nullptr, left ? nullptr : b.data()});
    EXPECT_LT((c - wanted).cwiseAbs().maxCoeff(), 1e-14)
        << rows << " x " << columns << " x " << inner << (left ? ", left" : ", right");
  }
}

TEST(AddProduct, ReadsEitherFactorInSinglePrecision) {
  for (const Eigen::Index rows : {1, 3, 15, 16, 17, 32, 45}) {
    for (const Eigen::Index columns : {1, 2, 7, 8, 13}) {
      for (const Eigen::Index inner : {1, 7, 8, 9, 20}) ExpectSingleProduct(rows, columns, inner);
    }
  }
}

TEST(AddProduct, AgreesWithEigenForOddSizesAndStrides) {
  for (const Eigen::Index rows : {1, 3, 15, 16, 17, 32, 45, 70}) {
    for (const Eigen::Index columns : {1, 2, 7, 8, 13}) {
      for (const Eigen::Index inner : {0, 1, 7, 8, 9, 20}) {
        ExpectProduct<double>(rows, columns, inner, 1e-14);
        ExpectProduct<float>(rows, columns, inner, 1e-5);
      }
    }
  }
}

}  // namespace
}  // namespace sole::model
