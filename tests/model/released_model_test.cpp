// Damage below the checksums: arrays of a released file replaced, cut and reshaped. Values are
// compared in foreign_models.py.
#include "model/released_model.h"

#include <gtest/gtest.h>

#include <random>

#include "core/error.h"
#include "io/npz.h"
#include "model/forward.h"
#include "random_model.h"
#include "tests/support/temp_dir.h"

namespace sole::model {
namespace {

using testing::RandomModel;
using testing::RandomParameters;
using testing_support::TempDir;

/// A SUPR file with a hinge, as npz.
io::Npz ReleasedArrays() {
  const FootModel model = RandomModel(Family::kSupr, 51, true, false);
  Eigen::MatrixXi tree(2, 5);
  tree << -1, 0, 1, 1, 0, 0, 1, 2, 3, 4;
  const auto cube = [](const Eigen::MatrixXd& stacked) {
    return io::Reshaped(io::NpyFrom(stacked), {12, 3, static_cast<std::size_t>(stacked.cols())});
  };
  return {{"v_template", io::NpyFrom(Eigen::MatrixXd(model.coarse.template_m))},
          {"f", io::NpyFrom(Eigen::MatrixXi(model.coarse.triangles))},
          {"kintree_table", io::NpyFrom(tree)},
          {"weights", io::NpyFrom(model.coarse.weights)},
          {"shapedirs", cube(model.coarse.shapedirs)},
          {"posedirs", cube(model.coarse.posedirs)},
          {"J_regressor", io::NpyFrom(model.joint_regressor)},
          {"axis_meta/axis", io::Reshaped(io::NpyFrom(std::vector<double>{0, 0, 1}), {1, 1, 3})},
          {"axis_meta/axis_indx", io::NpyFrom(std::vector<int>{0})},
          {"axis_meta/num_pose", io::NpyFrom(std::vector<int>{13})},
          {"axis_meta/indx_spherical",
           io::NpyFrom(std::vector<int>{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11})},
          {"axis_meta/indx_hinge", io::NpyFrom(std::vector<int>{12})},
          {"axis_meta/indx_hinge_axis", io::NpyFrom(std::vector<int>{0})},
          {"axis_meta/reverse_indx", io::NpyFrom(std::vector<int>{0, 1, 4, 2, 3})}};
}

TEST(LoadAnyModel, GivesTheFamilyAndTheHinge) {
  const TempDir dir;
  io::WriteNpz(dir / "m.npz", ReleasedArrays());
  const FootModel model = LoadAnyModel(dir / "m.npz");
  EXPECT_EQ(ReleasedName(model), "SUPR");
  ASSERT_EQ(model.constraints.size(), 5U);
  ASSERT_EQ(model.constraints[2].axes.size(), 1U);
  EXPECT_EQ(model.constraints[2].axes[0], Eigen::Vector3d(0, 0, -1));  // turned right-handed
  EXPECT_EQ(model.pose_index.row(2), Eigen::RowVector3i(12, -1, -1));
  EXPECT_EQ(model.pose_index.row(3), Eigen::RowVector3i(6, 7, 8));
}

TEST(LoadAnyModel, DamagedArraysEndInAnErrorOrAModel) {
  const TempDir dir;
  const std::filesystem::path path = dir / "m.npz";
  const io::Npz whole = ReleasedArrays();
  std::mt19937_64 random(52);
  int accepted = 0;
  for (int round = 0; round < 300; ++round) {
    io::Npz damaged = whole;
    const auto victim =
        std::next(damaged.begin(), static_cast<std::ptrdiff_t>(random() % damaged.size()));
    io::NpyArray& array = victim->second;
    switch (random() % 6) {
      case 0:
        damaged.erase(victim);
        break;
      case 1:
        array = io::NpyFrom(std::vector<double>{1e300, -7, 2.5});
        break;
      case 2:
        array = io::NpyFrom(std::string("left"));
        break;
      case 3:
        array.shape.insert(array.shape.begin(), 1);
        break;
      case 4:
        if (array.shape.size() > 1) std::swap(array.shape.front(), array.shape.back());
        break;
      default:
        array.bytes[random() % array.bytes.size()] = static_cast<std::uint8_t>(random() & 0xff);
    }
    io::WriteNpz(path, damaged);
    try {
      const FootModel model = LoadAnyModel(path);
      ++accepted;
      EXPECT_EQ(Forward(model, RandomParameters(model, 53)).vertices_m.rows(), 12);
    } catch (const Error& error) {
      const std::string what = error.what();
      EXPECT_NE(what.find("m.npz"), std::string::npos) << what;
      EXPECT_EQ(what.find('\n'), std::string::npos) << what;
    }
  }
  EXPECT_GT(accepted, 10);
}

}  // namespace
}  // namespace sole::model
