#include "model/model_file.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>

#include "core/error.h"
#include "io/npz.h"
#include "model/forward.h"
#include "random_model.h"

namespace sole::model {
namespace {

using ::testing::HasSubstr;
using testing::RandomModel;
using testing::RandomParameters;

class ModelFile : public ::testing::Test {
 protected:
  void SetUp() override {
    const std::string name = ::testing::UnitTest::GetInstance()->current_test_info()->name();
    folder_ = std::filesystem::temp_directory_path() /
              fmt::format("sole_model_file_{}_{}", name, ::getpid());
    std::filesystem::create_directories(folder_);
    path_ = folder_ / "model.npz";
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string ErrorOfLoading() const {
    try {
      LoadModel(path_);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }

  std::filesystem::path folder_, path_;
};

TEST_F(ModelFile, RoundTripInDoubleKeepsEverything) {
  for (const Family family : {Family::kSupr, Family::kStar, Family::kSmpl}) {
    FootModel model = RandomModel(family, 51, family == Family::kStar);
    model.side = Side::kLeft;
    model.mirror_axis = 2;
    model.activations = Eigen::MatrixXd::Constant(12, 5, 0.5);
    SaveModel(path_, model, {.single_precision = false});
    const FootModel read = LoadModel(path_);
    const ModelParameters parameters = RandomParameters(model, 52);
    for (const Variant variant : {Variant::kCoarse, Variant::kFine}) {
      EXPECT_EQ(Forward(read, parameters, variant).vertices_m,
                Forward(model, parameters, variant).vertices_m);
    }
    EXPECT_EQ(read.family, family);
    EXPECT_EQ(read.side, Side::kLeft);
    EXPECT_EQ(read.mirror_axis, 2);
    EXPECT_EQ(read.licence, model.licence);
    EXPECT_EQ(read.joint_names, model.joint_names);
    EXPECT_EQ(read.fine.triangles, model.fine.triangles);
    EXPECT_EQ(read.upsampling, model.upsampling);
    EXPECT_EQ(read.activations, model.activations);
    ASSERT_EQ(read.landmarks.size(), 2U);
    EXPECT_EQ(read.landmarks[1].name, "toe");
    EXPECT_EQ(read.landmarks[1].vertex, 7);
    ASSERT_EQ(read.material.size(), 12U);
    EXPECT_EQ(read.material[5].triangle, 5);
    EXPECT_EQ(read.material[5].barycentric, Eigen::Vector3d(0.5, 0.25, 0.25));
  }
}

TEST_F(ModelFile, SinglePrecisionIsAsExactAsFloat) {
  const FootModel model = RandomModel(Family::kSupr, 53);
  SaveModel(path_, model);
  EXPECT_EQ(io::ReadNpz(path_).at("shapedirs").dtype, "<f4");
  const ModelParameters parameters = RandomParameters(model, 54);
  EXPECT_LT(
      (Forward(LoadModel(path_), parameters).vertices_m - Forward(model, parameters).vertices_m)
          .cwiseAbs()
          .maxCoeff(),
      1e-6);
}

TEST_F(ModelFile, LayoutIsThatOfTheReleasedModels) {
  const FootModel model = RandomModel(Family::kSupr, 55);
  SaveModel(path_, model, {.single_precision = false});
  const io::Npz npz = io::ReadNpz(path_);
  EXPECT_EQ(io::ShapeOf(npz, "shapedirs"), (std::vector<std::size_t>{12, 3, 4}));
  EXPECT_EQ(io::ShapeOf(npz, "posedirs"), (std::vector<std::size_t>{12, 3, 20}));
  EXPECT_EQ(io::ShapeOf(npz, "kintree_table"), (std::vector<std::size_t>{2, 5}));
  // shapedirs[2, 1, 3] in C order.
  EXPECT_EQ(io::MatrixFrom(npz, "shapedirs")(2, 1 * 4 + 3), model.coarse.shapedirs(3 * 2 + 1, 3));
}

TEST_F(ModelFile, ZeroCorrectivesAreWrittenAndDroppedOnReading) {
  FootModel model = RandomModel(Family::kSupr, 56);
  model.coarse.posedirs.resize(0, 0);
  model.fine.posedirs.resize(0, 0);
  SaveModel(path_, model);
  EXPECT_EQ(io::ShapeOf(io::ReadNpz(path_), "posedirs"), (std::vector<std::size_t>{12, 3, 20}));
  EXPECT_EQ(LoadModel(path_).coarse.posedirs.cols(), 0);
}

TEST_F(ModelFile, EveryMissingKeyIsNamed) {
  SaveModel(path_, RandomModel(Family::kSupr, 57));
  const io::Npz whole = io::ReadNpz(path_);
  for (const std::string key :
       {"version", "family", "side", "licence", "mirror", "v_template", "f", "weights", "shapedirs",
        "posedirs", "kintree_table", "J_regressor", "joint_names", "landmarks", "fine_weights",
        "fine_shapedirs", "upsampling_weight", "network_bias_1", "material_barycentric"}) {
    io::Npz damaged = whole;
    damaged.erase(key);
    io::WriteNpz(path_, damaged);
    EXPECT_THAT(ErrorOfLoading(), HasSubstr(key));
    EXPECT_THAT(ErrorOfLoading(), HasSubstr(path_.string()));
  }
}

TEST_F(ModelFile, EverySizeIsCheckedAgainstTheOthers) {
  SaveModel(path_, RandomModel(Family::kSupr, 58));
  const io::Npz whole = io::ReadNpz(path_);
  for (const std::string key :
       {"v_template", "f", "weights", "shapedirs", "posedirs", "kintree_table", "J_regressor",
        "joint_names", "landmarks", "fine_v_template", "fine_weights", "fine_shapedirs",
        "fine_posedirs", "upsampling_vertex", "upsampling_weight", "network_weight_0",
        "network_weight_1", "network_bias_2", "material_triangle"}) {
    io::Npz damaged = whole;
    io::NpyArray& array = damaged.at(key);
    // Drop the last row (triangles: an index too large instead).
    if (key == "f") {
      array = io::NpyFrom(Eigen::MatrixXi::Constant(3, 3, 12).eval());
    } else {
      array.bytes.resize(array.bytes.size() / array.shape[0] * (array.shape[0] - 1));
      --array.shape[0];
    }
    io::WriteNpz(path_, damaged);
    EXPECT_NE(ErrorOfLoading(), "") << key;
  }
}

TEST_F(ModelFile, RefusesOtherFormatsAndVersions) {
  SaveModel(path_, RandomModel(Family::kSupr, 59));
  io::Npz npz = io::ReadNpz(path_);
  npz["version"] = io::NpyFrom(std::vector<int>{2});
  io::WriteNpz(path_, npz);
  EXPECT_THAT(ErrorOfLoading(), HasSubstr("version 2"));
  io::WriteNpz(path_, {{"points", io::NpyFrom(std::vector<int>{1})}});
  EXPECT_THAT(ErrorOfLoading(), HasSubstr("not a Sole foot model"));
  path_ = folder_ / "absent.npz";
  EXPECT_THAT(ErrorOfLoading(), HasSubstr("absent.npz"));
}

TEST(DescribeModel, NamesFamilySizesJointsAndLicence) {
  std::string text;
  for (const std::string& line : DescribeModel(RandomModel(Family::kStar, 60))) text += line + "\n";
  for (const char* part : {"star", "12", "20", "root, a, b, c, d", "none", "right"})
    EXPECT_THAT(text, HasSubstr(part));
}

}  // namespace
}  // namespace sole::model
