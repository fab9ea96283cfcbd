#include <gtest/gtest.h>

#include <Eigen/Core>

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
