// Personal templates, joints and poses of synthetic people whose answers are known.
#include "model/train_person.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "model/contact_network.h"
#include "model/model_file.h"
#include "model/skeleton.h"
#include "model/train_joints.h"
#include "model/train_two_joints.h"
#include "random_model.h"

namespace sole::model {
namespace {

using testing::RandomMatrix;

FootModel Shipped() {
  FootModel foot = LoadModel(SOLE_MODEL_FILE);
  foot.coarse.posedirs.resize(0, 0);
  foot.fine.posedirs.resize(0, 0);
  foot.activations.resize(0, 0);
  foot.network.clear();
  Prepare(foot);
  return foot;
}

/// A person: the shipped model with other proportions, in poses of the air; the last frame stands,
/// its sole pressed flat.
struct Person {
  FootModel own;  ///< fine and coarse
  std::vector<TrainingFrame> frames;
  std::vector<ModelParameters> poses;
};

Person MakePerson(const FootModel& foot, unsigned seed, std::size_t frames) {
  std::mt19937_64 engine(seed);
  Person person{foot, {}, {}};
  const Eigen::VectorXd beta = RandomMatrix(engine, foot.NumBetas(), 1, 1);
  ModelParameters shape = RestParameters(foot);
  shape.beta = beta;
  person.own.fine.template_m = RestVertices(foot, shape, Variant::kFine);
  // A bump on the instep that no shape coefficient knows of.
  const Eigen::RowVector3d instep =
      (foot.derived.joints_m.row(2) + Eigen::RowVector3d(0, 0.03, 0.03));
  for (Eigen::Index i = 0; i < person.own.fine.NumVertices(); ++i) {
    const double away = (person.own.fine.template_m.row(i) - instep).squaredNorm();
    person.own.fine.template_m(i, 2) += 0.006 * std::exp(-away / (2 * 0.03 * 0.03));
  }
  person.own.coarse.template_m = person.own.fine.template_m.topRows(foot.NumVertices());
  Prepare(person.own);
  for (std::size_t f = 0; f < frames; ++f) {
    ModelParameters pose = RestParameters(foot);
    pose.theta.bottomRows(foot.NumJoints() - 1) =
        RandomMatrix(engine, foot.NumJoints() - 1, 3, 0.12);
    pose.translation_m = RandomMatrix(engine, 3, 1, 0.05);
    TrainingFrame frame;
    frame.vertices_m = Forward(person.own, pose, Variant::kFine).vertices_m;
    const Eigen::Index n = foot.NumVertices();
    frame.certainty = frame.free = Eigen::VectorXd::Ones(n);
    frame.contact = frame.probability = Eigen::VectorXd::Zero(n);
    if (f + 1 == frames) {
      const double ground = frame.vertices_m.col(2).minCoeff() + 0.004;
      frame.free = ((frame.vertices_m.col(2).head(n).array() - ground) / 0.003).cwiseMax(0).cwiseMin(1);
      frame.vertices_m.col(2) = frame.vertices_m.col(2).cwiseMax(ground);
    }
    person.frames.push_back(frame);
    person.poses.push_back(pose);
  }
  return person;
}

TEST(FitPerson, FindsTheRestShapeFromPosedRegistrations) {
  const FootModel foot = Shipped();
  const Person person = MakePerson(foot, 1, 6);
  const PersonalFit start = StartPerson(foot, person.frames);
  const PersonalFit fit = FitPerson(foot, person.frames, start);
  const double before =
      (start.rest_m - person.own.fine.template_m).rowwise().norm().mean();
  const double after = (fit.rest_m - person.own.fine.template_m).rowwise().norm().mean();
  // What the joints could turn away of the bump stays in pose and rest shape, both ways.
  EXPECT_LT(after, before);
  for (std::size_t f = 0; f + 1 < fit.distance_m.size(); ++f)
    EXPECT_LT(fit.distance_m[f], 0.4 * start.distance_m[f]);
  // The pressed sole is no part of the rest shape, and does not bend the toes.
  EXPECT_LT((fit.poses.back().theta - person.poses.back().theta).row(1).norm(), 0.03);
}

TEST(FitPerson, UnseenVerticesTakeTheModelsShape) {
  const FootModel foot = Shipped();
  Person person = MakePerson(foot, 2, 3);
  for (TrainingFrame& frame : person.frames) {
    frame.certainty.head(40).setZero();
    for (Eigen::Index i = 0; i < 40; ++i) frame.vertices_m.row(i).array() += 0.05;
  }
  const PersonalFit fit = FitPerson(foot, person.frames, StartPerson(foot, person.frames));
  EXPECT_LT((fit.rest_m - person.own.fine.template_m).topRows(40).rowwise().norm().maxCoeff(), 0.004);
}

TEST(FitPerson, LoadedRegistrationsSayLittleOfTheRestShape) {
  const FootModel foot = Shipped();
  Person person = MakePerson(foot, 7, 4);
  // Two of three feet stand: the glass touches ten vertices and widens all by 2 %.
  person.frames.pop_back();
  for (std::size_t f = 1; f < person.frames.size(); ++f) {
    Eigen::MatrixX3d& vertices = person.frames[f].vertices_m;
    const double middle = vertices.col(0).mean();
    vertices.col(0) = (vertices.col(0).array() - middle) * 1.02 + middle;
    person.frames[f].contact.head(10).setOnes();
  }
  const auto width_mm = [](const Eigen::MatrixX3d& rest) {
    return 1e3 * (rest.col(0).maxCoeff() - rest.col(0).minCoeff());
  };
  const auto fitted = [&](double loaded_weight) {
    const PersonalOptions options{.loaded_weight = loaded_weight};
    return width_mm(FitPerson(foot, person.frames, StartPerson(foot, person.frames, options), options)
                        .rest_m);
  };
  const double truth = width_mm(person.own.fine.template_m);
  EXPECT_GT(fitted(1) - truth, 2 * std::abs(fitted(0.1) - truth));
}

TEST(FitJoints, FindsCentresFromBendsAndKeepsThePriorWithoutThem) {
  const FootModel foot = Shipped();
  std::mt19937_64 engine(3);
  const FootModel coarse = CoarseOnly(foot);
  const Eigen::MatrixX3d rest = foot.fine.template_m, prior = foot.derived.joints_m;
  Eigen::MatrixX3d truth = prior;
  truth.row(1) += Eigen::RowVector3d(0.001, 0.004, -0.003);
  truth.row(3) += Eigen::RowVector3d(0, -0.002, 0.003);
  const FootModel own = PersonalModel(coarse, rest, truth), other = PersonalModel(coarse, rest, prior);
  std::vector<JointEvidence> evidence;
  for (int f = 0; f < 6; ++f) {
    ModelParameters pose = RestParameters(own);
    pose.theta.row(1) = RandomMatrix(engine, 1, 3, 0.4);
    pose.theta.row(3) = RandomMatrix(engine, 1, 3, 0.6);
    pose.theta.row(0) = RandomMatrix(engine, 1, 3, 0.3);
    evidence.push_back({Forward(own, pose).vertices_m, Forward(other, pose).vertices_m,
                        PoseSkeleton(other, pose.theta, {}).rotations,
                        Eigen::VectorXd::Ones(own.NumVertices())});
  }
  const Eigen::MatrixX3d found = FitJoints(other, evidence, prior, {.sigma_m = 1e-4, .prior_sd_m = 0.01});
  EXPECT_LT((found - truth).row(1).norm(), 2e-4);
  EXPECT_LT((found - truth).row(3).norm(), 2e-4);
  EXPECT_LT((found - prior).row(7).norm(), 1e-6);  // never bent: the prior's place
}

TEST(Unposed, IsTheInverseOfSkinning) {
  const FootModel foot = Shipped();
  const Person person = MakePerson(foot, 4, 1);
  ModelParameters pose = person.poses[0];
  const Eigen::MatrixX3d posed = Forward(person.own, pose, Variant::kFine).vertices_m;
  const Eigen::MatrixX3d rest = Unposed(posed, BoneMotions(person.own, pose), foot.fine.weights);
  EXPECT_LT((rest - person.own.fine.template_m).cwiseAbs().maxCoeff(), 1e-7);
}

TEST(PersonalModel, TellsTheNetworkTheShapeCoefficients) {
  const FootModel foot = testing::RandomModel(Family::kSupr, 5);
  ModelParameters parameters = testing::RandomParameters(foot, 6);
  const FootModel own = PersonalModel(
      CoarseOnly(foot), foot.coarse.template_m, foot.derived.joints_m, parameters.beta);
  ModelParameters shapeless = parameters;
  shapeless.beta.resize(0);
  const Eigen::VectorXd wanted = ContactOffsets(foot, Variant::kCoarse, parameters.theta,
                                                parameters.beta, parameters.contact);
  const Eigen::VectorXd got = ContactOffsets(own, Variant::kCoarse, shapeless.theta, shapeless.beta,
                                             shapeless.contact);
  EXPECT_LT((got - wanted).cwiseAbs().maxCoeff(), 1e-12);
}

TEST(TwoJointModel, MovesAsTheWholeWhereOnlyAnkleAndAllToesTurn) {
  const FootModel foot = Shipped(), two = TwoJointModel(foot);
  ASSERT_EQ(two.NumJoints(), 3);
  EXPECT_LT((two.fine.weights.rowwise().sum().array() - 1).abs().maxCoeff(), 1e-6);
  ModelParameters whole = RestParameters(foot), part = RestParameters(two);
  whole.theta.row(1) << 0.3, 0.1, -0.2;
  part.theta.row(1) = whole.theta.row(1);
  EXPECT_LT((Forward(foot, whole, Variant::kFine).vertices_m -
             Forward(two, part, Variant::kFine).vertices_m)
                .cwiseAbs()
                .maxCoeff(),
            1e-7);
  // The ball is the middle of the toes' joints.
  Eigen::RowVector3d middle = Eigen::RowVector3d::Zero();
  for (const Eigen::Index j : {3, 5, 7, 9, 11}) middle += foot.derived.joints_m.row(j) / 5;
  EXPECT_LT((two.derived.joints_m.row(2) - middle).norm(), 1e-7);
}

}  // namespace
}  // namespace sole::model
