// sole train on a small dataset of synthetic registrations: people of the shipped model's shape space
// whose soles are pressed flat where they touch.
#include "app/train.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <random>

#include <fmt/format.h>

#include "app/registrations.h"
#include "app/stages.h"
#include "io/atomic_file.h"
#include "model/model_file.h"
#include "tests/support/error_matcher.h"
#include "tests/support/temp_dir.h"

namespace sole::app {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using Eigen::Index;
using testing_support::ErrorOf;

/// Numbers of people who train, who validate, and one who is kept for tests.
constexpr int kPeople[] = {1, 3, 4, 5, 6, 7, 8, 9, 15, 32, 2};
constexpr int kFrames = 8;

SubjectRegistrations MakePerson(const model::FootModel& foot, int number) {
  std::mt19937_64 engine(static_cast<unsigned>(number));
  std::normal_distribution<double> normal(0, 1);
  const Index n = foot.NumVertices();
  SubjectRegistrations r;
  r.subject = fmt::format("{:06}", number);
  r.sex = number % 2 ? "female" : "male";
  r.split = SplitOfSubject(r.subject);
  r.side = number % 3 == 0 ? Side::kLeft : Side::kRight;
  r.motion = {"stand", "air"};
  r.sd_m = Eigen::MatrixXf::Constant(kFrames, n, 1e-4F);
  r.contact.setZero(kFrames, n);
  r.probability = Eigen::MatrixXf::Zero(kFrames, n);
  r.gap_m = Eigen::MatrixXf::Constant(kFrames, n, 0.02F);
  r.translation_m = Eigen::MatrixX3d::Zero(kFrames, 3);
  r.beta = Eigen::VectorXd::Zero(foot.NumBetas());
  model::ModelParameters pose = RestParameters(foot);
  for (double& beta : pose.beta.head<3>()) beta = normal(engine);
  for (int f = 0; f < kFrames; ++f) {
    const bool stands = f < kFrames / 2;
    for (Index j = 1; j < foot.NumJoints(); ++j) {
      for (int axis = 0; axis < 3; ++axis) pose.theta(j, axis) = (stands ? 0.02 : 0.08) * normal(engine);
    }
    Eigen::MatrixX3d vertices = Forward(foot, pose, model::Variant::kFine).vertices_m;
    const double ground = vertices.col(2).minCoeff() + (stands ? 0.004 : -0.03);
    vertices.col(2) = vertices.col(2).cwiseMax(ground).array() - ground;
    r.gap_m.row(f) = vertices.col(2).head(n).cast<float>();
    for (Index i = 0; i < n; ++i) {
      r.contact(f, i) = vertices(i, 2) < 1e-4 ? 1 : 0;
      r.probability(f, i) = r.contact(f, i) ? 0.9F : 0.1F * std::exp(-1e3F * r.gap_m(f, i));
    }
    for (Index i = 0; i < vertices.rows(); ++i) {
      for (int axis = 0; axis < 3; ++axis) vertices(i, axis) += 1e-4 * normal(engine);
    }
    if (r.side == Side::kLeft) vertices.col(0) *= -1;
    r.fine_m.push_back(vertices.cast<float>());
    r.true_m.push_back(r.fine_m.back().topRows(n));
    r.theta.push_back(pose.theta);
    r.sequence.push_back(stands ? 0 : 1);
    r.time_s.push_back(f);
    r.verdict.push_back("good");
  }
  return r;
}

constexpr const char* kConfig =
    "[poses]\nrounds = 1\n[skinning]\nrounds = 1\n[shape]\nbetas = 4\n"
    "[network]\nepochs = 60\nrate = 0.003\n";

class Train : public ::testing::Test {
 protected:
  Train() {
    const model::FootModel foot = model::LoadModel(DefaultTemplatePath());
    fs::create_directories(dataset_ / "registrations");
    for (const int number : kPeople) {
      const SubjectRegistrations r = MakePerson(foot, number);
      WriteRegistrations(RegistrationsFile(dataset_, r.subject), r);
    }
    options_.config = ParseTrainConfig(kConfig, "c.toml");
    options_.model_template = DefaultTemplatePath();
  }

  testing_support::TempDir dir_;
  fs::path dataset_ = dir_ / "feet";
  TrainOptions options_;
};

TEST_F(Train, LearnsAModelWithoutReadingTestSubjectsAndGoesOnAfterAStop) {
  // What must not be opened cannot be read.
  io::WriteStringAtomically(RegistrationsFile(dataset_, "000002"), "kept for tests");
  options_.ablation = true;
  const nlohmann::json account = TrainModel(dataset_, dir_ / "a.npz", options_);
  EXPECT_EQ(account["train_frames"], 8 * kFrames);
  const nlohmann::json& table = account["validation"];
  // Of so few people little is learnt, but pressed soles are explained better with it.
  EXPECT_LT(table["full"]["contact_mm"].get<double>(),
            0.97 * table["linear"]["contact_mm"].get<double>());
  EXPECT_LT(table["full"]["free_mm"].get<double>(), 0.5);
  EXPECT_GT(table["full"]["flattening_share"].get<double>(), 0.2);
  const model::FootModel full = model::LoadModel(dir_ / "a.npz");
  EXPECT_EQ(KindOfNetwork(full), model::NetworkKind::kPoseShapeContact);
  EXPECT_FALSE(full.pose_space.Empty());
  EXPECT_EQ(full.NumBetas(), 4);
  EXPECT_LE((full.coarse.weights.array() > 0).rowwise().count().maxCoeff(), 4);
  EXPECT_LE((full.coarse.posedirs.array() != 0).cast<double>().mean(), 0.3);
  EXPECT_EQ(KindOfNetwork(model::LoadModel(dir_ / "a-f_theta.npz")), model::NetworkKind::kPose);
  EXPECT_EQ(KindOfNetwork(model::LoadModel(dir_ / "a-f_theta_beta.npz")),
            model::NetworkKind::kPoseShape);
  EXPECT_TRUE(model::LoadModel(dir_ / "a-linear.npz").network.empty());
  EXPECT_EQ(model::LoadModel(dir_ / "a-lbs.npz").coarse.posedirs.cols(), 0);
  EXPECT_THAT(io::ReadFile(dir_ / "a-training.html"), AllOf(HasSubstr("<svg"), HasSubstr("full")));

  // Stopped at the first chance, then with some steps taken away, it ends with the same bytes.
  std::atomic<bool> stop = true;
  options_.stop = &stop;
  EXPECT_THAT(ErrorOf([&] { TrainModel(dataset_, dir_ / "b.npz", options_); }),
              HasSubstr("the same command goes on"));
  EXPECT_FALSE(fs::exists(dir_ / "b.npz"));
  stop = false;
  fs::copy(dir_ / "a.training", dir_ / "b.training",
           fs::copy_options::recursive | fs::copy_options::overwrite_existing);
  for (const char* lost : {"correctives.npz", "network_full_2.npz", "poses_corrected/000004.npz"})
    ASSERT_TRUE(fs::remove(dir_ / "b.training" / lost)) << lost;
  TrainModel(dataset_, dir_ / "b.npz", options_);
  EXPECT_EQ(io::ReadFile(dir_ / "a.npz"), io::ReadFile(dir_ / "b.npz"));

  options_.config.seed = 2;
  EXPECT_THAT(ErrorOf([&] { TrainModel(dataset_, dir_ / "b.npz", options_); }),
              HasSubstr("another configuration"));
}

TEST_F(Train, TwoJointsTruthAndSexAreOptions) {
  options_.config = ParseTrainConfig(
      std::string("joints = \"two\"\nsex = \"female\"\n") + kConfig + "kind = \"none\"\n", "c.toml");
  options_.truth = true;
  const nlohmann::json account = TrainModel(dataset_, dir_ / "two.npz", options_);
  EXPECT_EQ(account["train_frames"], 5 * kFrames);  // 1, 3, 5, 7, 9
  const model::FootModel two = model::LoadModel(dir_ / "two.npz");
  EXPECT_EQ(two.NumJoints(), 3);
  EXPECT_TRUE(two.network.empty());
  EXPECT_GT(account["validation"]["linear"]["noncontact_mm"].get<double>(), 0.3);
}

TEST_F(Train, SaysWhatIsWrong) {
  EXPECT_THAT(ErrorOf([&] { TrainModel(dir_ / "none", dir_ / "a.npz", options_); }),
              HasSubstr("holds no registrations"));
  EXPECT_THAT(ErrorOf([&] { TrainModel(dataset_, dir_ / "a.model", options_); }),
              HasSubstr(".npz"));
  EXPECT_THAT(ErrorOf([] { ParseTrainConfig("[network]\nepoch = 3\n", "c.toml"); }),
              AllOf(HasSubstr("c.toml:2:1"), HasSubstr("did you mean epochs?")));
  const TrainConfig config = ParseTrainConfig(kConfig, "c.toml");
  EXPECT_EQ(FormatTrainConfig(ParseTrainConfig(FormatTrainConfig(config), "again")),
            FormatTrainConfig(config));
}

}  // namespace
}  // namespace sole::app
