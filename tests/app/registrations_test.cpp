// Datasets of registrations: the file, `sole fit DATASET`, `sole dataset add` and `info`.
#include "app/registrations.h"

#include <cmath>
#include <cstdint>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "app/dataset_info.h"
#include "app/register_dataset.h"
#include "app/scans.h"
#include "io/atomic_file.h"
#include "io/npz.h"
#include "io/take.h"
#include "tests/support/error_matcher.h"
#include "tests/support/temp_dir.h"

namespace sole::app {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing_support::ErrorOf;
using testing_support::TempDir;

SubjectRegistrations Example() {
  SubjectRegistrations r;
  r.subject = "S017";
  r.sex = "female";
  r.split = "train";
  r.side = Side::kLeft;
  r.motion = {"walk", "air"};
  r.sequence = {0, 1};
  r.time_s = {0.25, 1.5};
  r.verdict = {"good", "no foot: 12 scan points"};
  const float nan = std::numeric_limits<float>::quiet_NaN();
  Eigen::MatrixX3f fine(3, 3);
  fine << 1, 2, 3, 4, 5, 6, 7, 8, 9;
  r.fine_m = {fine, Eigen::MatrixX3f::Constant(3, 3, nan)};
  r.sd_m.resize(2, 2);
  r.sd_m << 0.125F, 0.25F, 0.5F, 1;
  r.contact.resize(2, 2);
  r.contact << 1, 0, 0, 1;
  r.probability = r.sd_m * 0.5F;
  r.gap_m = -r.sd_m;
  r.theta = {Eigen::MatrixX3d::Random(4, 3), Eigen::MatrixX3d::Random(4, 3)};
  r.translation_m = Eigen::MatrixX3d::Random(2, 3);
  r.beta = Eigen::VectorXd::Random(5);
  r.true_m = {fine.topRows(2) * 2, fine.bottomRows(2)};
  return r;
}

TEST(Registrations, ReadBackAsWritten) {
  const TempDir directory;
  const fs::path path = directory / "S017.npz";
  const SubjectRegistrations wrote = Example();
  WriteRegistrations(path, wrote);
  const SubjectRegistrations read = ReadRegistrations(path);
  EXPECT_EQ(read.subject, "S017");
  EXPECT_EQ(read.sex, "female");
  EXPECT_EQ(read.split, "train");
  EXPECT_EQ(read.side, Side::kLeft);
  EXPECT_EQ(read.motion, wrote.motion);
  EXPECT_EQ(read.sequence, wrote.sequence);
  EXPECT_EQ(read.time_s, wrote.time_s);
  EXPECT_EQ(read.verdict, wrote.verdict);
  EXPECT_EQ(read.fine_m[0], wrote.fine_m[0]);
  EXPECT_TRUE(read.fine_m[1].array().isNaN().all());
  EXPECT_EQ(read.sd_m, wrote.sd_m);
  EXPECT_EQ(read.contact, wrote.contact);
  EXPECT_EQ(read.probability, wrote.probability);
  EXPECT_EQ(read.gap_m, wrote.gap_m);
  EXPECT_EQ(read.theta[1], wrote.theta[1]);
  EXPECT_EQ(read.translation_m, wrote.translation_m);
  EXPECT_EQ(read.beta, wrote.beta);
  EXPECT_EQ(read.true_m[0], wrote.true_m[0]);
  EXPECT_EQ(read.true_m[1], wrote.true_m[1]);
}

TEST(Registrations, FilesThatDoNotFitTogetherAreRefused) {
  const TempDir directory;
  const fs::path path = directory / "a.npz";
  WriteRegistrations(path, Example());
  const io::Npz good = io::ReadNpz(path);
  const auto error_with = [&](const std::string& key, const io::NpyArray& array) {
    io::Npz npz = good;
    npz[key] = array;
    io::WriteNpz(path, npz);
    return ErrorOf([&] { ReadRegistrations(path); });
  };
  EXPECT_THAT(error_with("format", io::NpyFrom(std::string("sole-fit"))),
              HasSubstr("a.npz: is no file of registrations"));
  EXPECT_THAT(error_with("sequence", io::NpyFrom(std::vector<int>{0, 2})), HasSubstr("'sequence'"));
  EXPECT_THAT(error_with("time_s", io::NpyFrom(std::vector<double>{0})), HasSubstr("'time_s'"));
  EXPECT_THAT(error_with("contact", io::NpyFrom(Eigen::MatrixXi::Zero(2, 3))),
              HasSubstr("'contact'"));
  EXPECT_THAT(error_with("registration_fine_m",
                         io::Reshaped(io::NpyFrom(std::vector<float>(6)), {2, 1, 3})),
              HasSubstr("'registration_fine_m'"));
}

TEST(Registrations, TheSplitGoesByTheNameAloneAndIsThatOfTheScans) {
  int counts[3] = {0, 0, 0};
  for (int i = 0; i < 2000; ++i) {
    const std::string split = SplitOfSubject("S" + std::to_string(i));
    EXPECT_EQ(split, SplitOfSubject("S" + std::to_string(i)));
    ++counts[split == "train" ? 0 : split == "validation" ? 1 : 2];
  }
  EXPECT_NEAR(counts[0], 1600, 80);
  EXPECT_NEAR(counts[1], 200, 60);
  EXPECT_NEAR(counts[2], 200, 60);
  EXPECT_EQ(SplitOfSubject("000041"), SplitOf(41));
}

TEST(RegisterDataset, FitsTheCloudsAndCompletesWhatWasInterrupted) {
  const TempDir directory;
  const fs::path set = directory / "set";
  EXPECT_THAT(ErrorOf([&] { ListRegistrations(set); }), HasSubstr("sole fit"));
  MakeScanDataset(set, {.people = 1, .frames = 2, .seed = 35});
  const ModelPair models = LoadModelPair(DefaultModelPath());
  EXPECT_EQ(RegisterDataset(set, models)["people_registered"], 1);
  const SubjectRegistrations r = ReadRegistrations(RegistrationsFile(set, "000035"));
  EXPECT_EQ(r.subject, "000035");
  EXPECT_EQ(r.split, SplitOf(35));
  ASSERT_EQ(r.NumFrames(), 2U);
  const io::Npz person = io::ReadNpz(set / "people" / "000035.npz");
  EXPECT_EQ(r.side == Side::kLeft ? "left" : "right", io::StringFrom(person, "side"));
  for (std::size_t f = 0; f < 2; ++f) {
    EXPECT_EQ(r.verdict[f], "good");
    const Eigen::MatrixX3f apart = r.fine_m[f].topRows(r.NumVertices()) - r.true_m[f];
    EXPECT_LT(apart.rowwise().norm().mean(), 0.0015F);
  }
  EXPECT_EQ(RegisterDataset(set, models)["people_registered"], 0);
  const nlohmann::json info = DatasetInfo(set);
  EXPECT_EQ(info["feet"], 1);
  EXPECT_EQ(info["frames_good"], 2);
  EXPECT_LT(info["truth"]["distance_mm"], 1.5);
  EXPECT_GT(info["vertices_seen"], 0.7);
  EXPECT_THAT(FormatDatasetInfo(info), HasSubstr("feet: 1"));
}

TEST(RegisterDataset, CuratesAndRefusesPointsThatAreNoNumbers) {
  const TempDir directory;
  const fs::path set = directory / "set", file = set / "people" / "000035.npz";
  MakeScanDataset(set, {.people = 1, .frames = 2, .seed = 35});
  const ModelPair models = LoadModelPair(DefaultModelPath());
  io::Npz person = io::ReadNpz(file);
  const Eigen::MatrixXf points = io::MatrixFrom(person, "points_m").cast<float>();
  const std::vector<int> start = io::IntsFrom(person, "frame_start");
  Eigen::MatrixXf broken = points;
  broken(7, 1) = std::numeric_limits<float>::quiet_NaN();
  person["points_m"] = io::NpyFrom(broken);
  io::WriteNpz(file, person);
  const std::string line = ErrorOf([&] { RegisterDataset(set, models); });
  EXPECT_THAT(line, HasSubstr(file.string()));
  EXPECT_THAT(line, HasSubstr("row 7 of its points_m"));
  EXPECT_FALSE(fs::exists(RegistrationsFile(set, "000035")));

  // All points of the second frame where its first 400 are: most of the foot is missing.
  Eigen::MatrixXf patch = points;
  Eigen::MatrixXf normals = io::MatrixFrom(person, "normals_127").cast<float>();
  for (int i = start[1]; i < start[2]; ++i) {
    patch.row(i) = points.row(start[1] + (i - start[1]) % 400);
    normals.row(i) = Eigen::MatrixXf(normals.row(start[1] + (i - start[1]) % 400));
  }
  person["points_m"] = io::NpyFrom(patch);
  person["normals_127"] = io::NpyFrom(normals);
  io::WriteNpz(file, person);
  RegisterDataset(set, models);
  const SubjectRegistrations r = ReadRegistrations(RegistrationsFile(set, "000035"));
  EXPECT_EQ(r.verdict[0], "good");
  EXPECT_NE(r.verdict[1], "good");
}

/// A fitted take of two frames, in the second of which there is no foot.
void WriteFittedTake(const fs::path& directory, const std::string& name,
                     const model::FootModel& model) {
  const io::TakePaths take{directory};
  io::MakeDirectory(directory);
  io::TakeInfo info;
  info.name = name;
  info.subject = "S017";
  info.state = "complete";
  io::WriteTakeInfo(take, info);
  io::WriteTriggers(take, {{1, ExposureKind::kSpeckle, 0.5, 0.5, 0.5, 0.504},
                           {2, ExposureKind::kSpeckle, 0.75, 0.75, 0.75, 0.754}});
  FitSequence fit;
  fit.beta = fit.beta_sd = Eigen::VectorXd::Zero(model.NumBetas());
  const Eigen::Index n = model.NumVertices();
  FrameFit frame;
  frame.trigger = 1;
  frame.found = true;
  frame.side = Side::kLeft;
  frame.verdict = "good";
  frame.theta = frame.theta_sd = Eigen::MatrixX3d::Zero(model.NumJoints(), 3);
  frame.vertices_m = frame.registration_m = model.coarse.template_m;
  frame.registration_fine_m = model.fine.template_m;
  frame.registration_sd_m = frame.vertex_sd_m = Eigen::VectorXd::Constant(n, 1e-5);
  fit.frames = {frame, frame};
  fit.frames[1].trigger = 2;
  fit.frames[1].found = false;
  fit.frames[1].verdict = "no foot: 0 scan points";
  io::WriteFit(take.Fit(), fit);
  FrameContact label{std::vector<std::uint8_t>(static_cast<std::size_t>(n), 1),
                     Eigen::VectorXd::Ones(n), Eigen::VectorXd::Zero(n)};
  io::WriteContact(take.Contact(), {{1, 2}, {GroundPlane{}, GroundPlane{}}, {label, label}});
}

TEST(AddTake, CollectsTheTakesOfAFootOnce) {
  const TempDir directory;
  const ModelPair models = LoadModelPair(DefaultModelPath());
  WriteFittedTake(directory / "walk", "walk", models.left);
  WriteFittedTake(directory / "stand", "stand", models.left);
  const fs::path set = directory / "set";
  EXPECT_EQ(AddTake(set, directory / "walk", models)["frames"], 2);
  const nlohmann::json account = AddTake(set, directory / "stand", models);
  EXPECT_EQ(account["frames"], 4);
  EXPECT_EQ(account["good"], 2);
  EXPECT_EQ(account["split"], SplitOfSubject("S017"));
  EXPECT_THAT(ErrorOf([&] { AddTake(set, directory / "walk", models); }),
              HasSubstr("has take 'walk' already"));
  const SubjectRegistrations r = ReadRegistrations(RegistrationsFile(set, "S017-left"));
  EXPECT_EQ(r.motion, (std::vector<std::string>{"walk", "stand"}));
  EXPECT_EQ(r.sequence, (std::vector<int>{0, 0, 1, 1}));
  EXPECT_EQ(r.time_s, (std::vector<double>{0.5, 0.75, 0.5, 0.75}));
  EXPECT_TRUE(r.true_m.empty());
  EXPECT_TRUE(r.fine_m[3].array().isNaN().all());
  EXPECT_EQ(r.contact.row(2).cast<int>().sum(), r.NumVertices());
  fs::remove(directory / "stand" / "fit.npz");
  EXPECT_THAT(ErrorOf([&] { AddTake(set, directory / "stand", models); }), HasSubstr("sole fit"));
}

}  // namespace
}  // namespace sole::app
