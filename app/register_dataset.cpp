#include "app/register_dataset.h"

#include <algorithm>
#include <map>
#include <mutex>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "app/console.h"
#include "app/fit_labels.h"
#include "app/fit_sequences.h"
#include "app/registrations.h"
#include "app/scans.h"
#include "app/truth.h"

#include "core/error.h"
#include "io/atomic_file.h"
#include "io/npz.h"
#include "io/take.h"
#include "model/fit.h"

namespace sole::app {
namespace {

namespace fs = std::filesystem;
using Eigen::Index;
using nlohmann::json;

std::vector<PointCloud> CloudsOf(const io::Npz& person) {
  const std::vector<int> start = io::IntsFrom(person, "frame_start");
  const Eigen::MatrixXf points = io::MatrixFrom(person, "points_m").cast<float>();
  const Eigen::MatrixXf normals = io::MatrixFrom(person, "normals_127").cast<float>() / 127.0F;
  const Eigen::MatrixXf sigma = io::MatrixFrom(person, "sigma_m").cast<float>();
  Require(points.cols() == 3 && normals.cols() == 3 && normals.rows() == points.rows() &&
              sigma.rows() == points.rows() && !start.empty() && start.back() <= points.rows() &&
              start.front() >= 0 && std::is_sorted(start.begin(), start.end()),
          "its arrays of points do not fit together");
  for (const auto& [name, values] : {std::pair("points_m", &points), {"normals_127", &normals}, {"sigma_m", &sigma}}) {
    for (Index i = 0; i < values->rows(); ++i) {
      Require(values->row(i).allFinite(),
              fmt::format("row {} of its {} is no number: make the scans again, or leave the person out", i, name));
    }
  }
  std::vector<PointCloud> clouds(start.size() - 1);
  for (std::size_t f = 0; f < clouds.size(); ++f) {
    for (Index i = start[f]; i < start[f + 1]; ++i) {
      clouds[f].points_m.emplace_back(points.row(i));
      clouds[f].normals.emplace_back(normals.row(i).normalized());
      clouds[f].sigma_m.push_back(sigma(i));
    }
  }
  return clouds;
}

/// Adds frames of one fit; `ground` of every frame.
void AddFrames(const FitSequence& fit, const std::vector<FrameContact>& labels,
               SubjectRegistrations& to) {
  const auto before = to.sd_m.rows();
  const auto frames = static_cast<Index>(fit.frames.size());
  const Index n = fit.frames.at(0).vertices_m.rows();
  Require(before == 0 || to.NumVertices() == n,
          "the dataset's registrations are of a template of another size");
  to.sd_m.conservativeResize(before + frames, n);
  to.contact.conservativeResize(before + frames, n);
  to.probability.conservativeResize(before + frames, n);
  to.gap_m.conservativeResize(before + frames, n);
  to.translation_m.conservativeResize(before + frames, 3);
  for (Index f = 0; f < frames; ++f) {
    const FrameFit& frame = fit.frames[static_cast<std::size_t>(f)];
    const FrameContact& label = labels.at(static_cast<std::size_t>(f));
    to.verdict.push_back(frame.verdict);
    to.fine_m.push_back(frame.registration_fine_m.cast<float>());
    to.theta.push_back(frame.theta);
    to.translation_m.row(before + f) = frame.translation_m.transpose();
    to.sd_m.row(before + f) = frame.registration_sd_m.cast<float>().transpose();
    to.probability.row(before + f) = label.probability.cast<float>().transpose();
    to.gap_m.row(before + f) = label.gap_m.cast<float>().transpose();
    for (Index v = 0; v < n; ++v)
      to.contact(before + f, v) = label.contact.at(static_cast<std::size_t>(v));
  }
  to.beta = fit.beta;
}

Side SideOf(const FitSequence& fit) {
  for (const FrameFit& frame : fit.frames) {
    if (frame.found) return frame.side;
  }
  return Side::kRight;
}

Eigen::MatrixX3f Rows(const std::vector<Eigen::Vector3d>& points) {
  Eigen::MatrixX3f rows(static_cast<Index>(points.size()), 3);
  for (std::size_t i = 0; i < points.size(); ++i)
    rows.row(static_cast<Index>(i)) = points[i].cast<float>();
  return rows;
}

/// Where the template's points truly were, for scoring.
void AddTruth(const io::Npz& person, const io::Npz& topology, const ModelPair& models,
              SubjectRegistrations& to) {
  const Side side = io::StringFrom(person, "side") == "left" ? Side::kLeft : Side::kRight;
  const Eigen::MatrixXd triangles = io::MatrixFrom(topology, "triangles"),
                        vertices = io::MatrixFrom(person, "vertices_m");
  TriangleMesh mesh;
  for (Index t = 0; t < triangles.rows(); ++t) {
    mesh.triangles.emplace_back(triangles.row(t).cast<int>());
    if (side == Side::kLeft) std::swap(mesh.triangles.back()[1], mesh.triangles.back()[2]);
  }
  const model::FootModel& model = side == Side::kRight ? models.right : models.left;
  if (model.material.empty()) return;
  for (Index f = 0; f < vertices.rows(); ++f) {
    mesh.vertices.clear();
    for (Index v = 0; v + 2 < vertices.cols(); v += 3)
      mesh.vertices.emplace_back(vertices.row(f).segment<3>(v).transpose());
    to.true_m.push_back(Rows(MaterialPositions(model, mesh, side)));
  }
}

SubjectRegistrations RegisterPerson(const io::Npz& person, const io::Npz& topology,
                                    const std::string& name, const ModelPair& models) {
  SubjectRegistrations r;
  r.subject = name;
  r.split = SplitOfSubject(name);
  r.sex = io::StringFrom(person, "sex");
  r.motion = io::StringsFrom(person, "motion");
  r.sequence = io::IntsFrom(person, "sequence");
  const Eigen::MatrixXd time = io::MatrixFrom(person, "time_s");
  r.time_s.assign(time.data(), time.data() + time.size());
  const std::vector<PointCloud> clouds = CloudsOf(person);
  Require(clouds.size() == r.sequence.size() && clouds.size() == r.time_s.size() && !clouds.empty(),
          "its arrays do not agree about the number of frames");
  std::vector<std::int64_t> triggers;
  for (std::size_t f = 0; f < clouds.size(); ++f)
    triggers.push_back(static_cast<std::int64_t>(f) + 1);
  FitSequence fit = model::FitFrames(models.right, models.left, clouds, triggers);
  CurateFit(models, clouds, fit, false);  // one motion follows the other without a pause
  const std::vector<GroundPlane> ground(clouds.size());  // scans of a dataset stand on z = 0
  const std::vector<FrameContact> labels = LabelFit(models, fit, clouds, ground);
  r.side = SideOf(fit);
  AddFrames(fit, labels, r);
  AddTruth(person, topology, models, r);
  return r;
}

std::vector<fs::path> PeopleOf(const fs::path& dataset) {
  std::vector<fs::path> people;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(dataset / "people", error)) {
    const std::string name = entry.path().filename().string();
    if (entry.path().extension() == ".npz" && name[0] != '.') people.push_back(entry.path());
  }
  Require(!people.empty(), dataset.string() + " holds no scans in people/: make them with `sole sim scans --out " +
                               dataset.string() + "`");
  std::sort(people.begin(), people.end());
  return people;
}

std::size_t GoodFrames(const SubjectRegistrations& r) {
  return static_cast<std::size_t>(std::count(r.verdict.begin(), r.verdict.end(), "good"));
}

}  // namespace

json RegisterDataset(const fs::path& dataset, const ModelPair& models,
                     const RegisterOptions& options,
                     const std::function<void(int, int)>& done) {
  const std::vector<fs::path> people = PeopleOf(dataset);
  const io::Npz topology = io::ReadNpz(dataset / "topology.npz");
  io::MakeDirectory(dataset / "registrations");
  const Stopwatch watch;
  std::mutex mutex;
  int finished = 0, registered = 0;
  std::size_t frames = 0, good = 0;
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, people.size(), 1),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t p = range.begin(); p < range.end(); ++p) {
          if (options.stop != nullptr && *options.stop) return;
          const std::string name = people[p].stem().string();
          const fs::path path = RegistrationsFile(dataset, name);
          std::size_t its_frames = 0, its_good = 0;
          const bool there = fs::exists(path);
          if (!there) {
            SubjectRegistrations r;
            try {
              r = RegisterPerson(io::ReadNpz(people[p]), topology, name, models);
            } catch (const Error& error) {
              const std::string what = error.what();
              throw Error(what.starts_with(people[p].string()) ? what
                                                               : people[p].string() + ": " + what);
            }
            WriteRegistrations(path, r);
            its_frames = r.NumFrames();
            its_good = GoodFrames(r);
          }
          const std::lock_guard<std::mutex> lock(mutex);
          registered += !there;
          frames += its_frames;
          good += its_good;
          if (done) done(++finished, static_cast<int>(people.size()));
        }
      },
      tbb::simple_partitioner());
  Require(options.stop == nullptr || !*options.stop,
          fmt::format("stopped: {} of {} people are registered in {}; the same command goes on",
                      finished, people.size(), dataset.string()));
  return {{"people", people.size()},
          {"people_registered", registered},
          {"frames", frames},
          {"good", good},
          {"seconds", watch.Seconds()}};
}

json AddTake(const fs::path& dataset, const fs::path& directory, const ModelPair& models) {
  const io::TakePaths take{directory};
  const io::TakeInfo info = io::ReadTakeInfo(take);
  Require(!info.subject.empty(), take.Info().string() + " names no subject: it cannot be split by subject");
  Require(fs::exists(take.Fit()),
          take.Fit().string() + " is missing: run `sole fit " + directory.string() + "` first");
  const FitSequence fit = io::ReadFit(take.Fit());
  const io::ContactFile contact = io::ReadContact(take.Contact());
  Require(!fit.frames.empty() && contact.contact.size() == fit.frames.size(),
          take.Contact().string() + " has no labels of this fit: run `sole fit " +
              directory.string() + "` again");
  const Side side = SideOf(fit);
  const std::string foot = info.subject + (side == Side::kLeft ? "-left" : "-right");
  const fs::path path = RegistrationsFile(dataset, foot);
  SubjectRegistrations r;
  if (fs::exists(path)) r = ReadRegistrations(path);
  const std::string name = info.name.empty() ? directory.filename().string() : info.name;
  Require(std::find(r.motion.begin(), r.motion.end(), name) == r.motion.end(),
          fmt::format("{} has take '{}' already", path.string(), name));
  r.subject = info.subject;
  r.split = SplitOfSubject(info.subject);
  r.side = side;
  r.motion.push_back(name);
  std::map<std::int64_t, double> times;
  for (const io::TriggerRecord& trigger : io::ReadTriggers(take))
    times[trigger.trigger] = trigger.actual_s;
  for (const FrameFit& frame : fit.frames) {
    r.sequence.push_back(static_cast<int>(r.motion.size()) - 1);
    r.time_s.push_back(times.contains(frame.trigger) ? times.at(frame.trigger) : 0);
  }
  const bool truth_so_far = r.true_m.size() == r.fine_m.size();
  AddFrames(fit, contact.contact, r);
  if (truth_so_far && fs::exists(take.Truth())) {
    const TakeTruth truth = ReadTruth(directory);
    const model::FootModel& model = side == Side::kRight ? models.right : models.left;
    for (const FrameTruth& frame : truth.frames)
      r.true_m.push_back(Rows(MaterialPositions(model, frame.mesh, truth.side)));
  }
  if (r.true_m.size() != r.fine_m.size()) r.true_m.clear();
  io::MakeDirectory(path.parent_path());
  WriteRegistrations(path, r);
  return {{"subject", r.subject},
          {"split", r.split},
          {"takes", r.motion.size()},
          {"frames", r.NumFrames()},
          {"good", GoodFrames(r)}};
}

}  // namespace sole::app
