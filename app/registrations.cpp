#include "app/registrations.h"

#include <algorithm>
#include <charconv>

#include <fmt/format.h>

#include "app/scans.h"
#include "core/error.h"
#include "io/atomic_file.h"
#include "io/npz.h"

namespace sole::app {
namespace {

namespace fs = std::filesystem;
using Eigen::Index;

constexpr const char* kFormat = "sole-registrations";
constexpr int kVersion = 1;

template <class Matrix>
io::NpyArray StackPoints(const std::vector<Matrix>& frames) {
  using Scalar = typename Matrix::Scalar;
  const std::size_t n = frames.empty() ? 0 : static_cast<std::size_t>(frames[0].rows());
  std::vector<Scalar> values;
  values.reserve(3 * n * frames.size());
  for (const Matrix& points : frames) {
    Require(static_cast<std::size_t>(points.rows()) == n, "registrations: frames differ in size");
    for (Index i = 0; i < points.rows(); ++i)
      values.insert(values.end(), {points(i, 0), points(i, 1), points(i, 2)});
  }
  return io::Reshaped(io::NpyFrom(values), {frames.size(), n, 3});
}

/// Array `name` of F rows (and `columns`, where that is not 0) of the given number of dimensions.
Eigen::MatrixXd Rows(const io::Npz& npz, const std::string& name, std::size_t frames,
                     std::size_t dimensions, Index columns = 0) {
  const std::vector<std::size_t>& shape = io::ShapeOf(npz, name);
  Eigen::MatrixXd rows = io::MatrixFrom(npz, name);
  Require(shape.size() == dimensions && shape[0] == frames &&
              (dimensions < 3 || shape[2] == 3) && (columns == 0 || rows.cols() == columns),
          fmt::format("array '{}' does not fit {} frames", name, frames));
  return rows;
}

template <class Matrix>
std::vector<Matrix> PointsOf(const Eigen::MatrixXd& rows) {
  std::vector<Matrix> frames;
  for (Index f = 0; f < rows.rows(); ++f) {
    const Eigen::RowVectorXd row = rows.row(f);
    frames.push_back(Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>>(
                         row.data(), row.size() / 3, 3)
                         .template cast<typename Matrix::Scalar>());
  }
  return frames;
}

SubjectRegistrations FromArrays(const io::Npz& npz) {
  Require(npz.contains("format") && io::StringFrom(npz, "format") == kFormat,
          "is no file of registrations");
  Require(io::IntsFrom(npz, "version") == std::vector<int>{kVersion},
          "has an unknown format version: use the version of Sole that wrote it");
  SubjectRegistrations r;
  r.subject = io::StringFrom(npz, "subject");
  r.sex = io::StringFrom(npz, "sex");
  r.split = io::StringFrom(npz, "split");
  r.side = io::StringFrom(npz, "side") == "left" ? Side::kLeft : Side::kRight;
  r.motion = io::StringsFrom(npz, "motion");
  r.sequence = io::IntsFrom(npz, "sequence");
  r.verdict = io::StringsFrom(npz, "verdict");
  const std::size_t f = r.sequence.size();
  for (const int s : r.sequence)
    Require(s >= 0 && static_cast<std::size_t>(s) < r.motion.size(),
            "array 'sequence' names a sequence that 'motion' lacks");
  Require(r.verdict.size() == f, "array 'verdict' does not fit the frames");
  const Eigen::MatrixXd time = Rows(npz, "time_s", f, 1, 1);
  r.time_s.assign(time.data(), time.data() + time.size());
  const Eigen::MatrixXd sd = Rows(npz, "registration_sd_m", f, 2);
  const Index n = sd.cols();
  r.sd_m = sd.cast<float>();
  r.contact = Rows(npz, "contact", f, 2, n).cast<std::uint8_t>();
  r.probability = Rows(npz, "probability", f, 2, n).cast<float>();
  r.gap_m = Rows(npz, "gap_m", f, 2, n).cast<float>();
  r.fine_m = PointsOf<Eigen::MatrixX3f>(Rows(npz, "registration_fine_m", f, 3));
  Require(r.fine_m.empty() || r.fine_m[0].rows() >= n,
          "array 'registration_fine_m' has fewer vertices than 'contact'");
  r.theta = PointsOf<Eigen::MatrixX3d>(Rows(npz, "theta", f, 3));
  r.translation_m = Rows(npz, "translation_m", f, 2, 3);
  r.beta = io::MatrixFrom(npz, "beta").reshaped();
  if (npz.contains("true_m"))
    r.true_m = PointsOf<Eigen::MatrixX3f>(Rows(npz, "true_m", f, 3, 3 * n));
  return r;
}

}  // namespace

std::string SplitOfSubject(const std::string& subject) {
  std::uint64_t number = 0;
  const char* const end = subject.data() + subject.size();
  const auto [stopped, error] = std::from_chars(subject.data(), end, number);
  if (error == std::errc() && stopped == end) return SplitOf(number);
  number = 0xCBF29CE484222325ULL;  // FNV-1a
  for (const char c : subject) number = (number ^ static_cast<unsigned char>(c)) * 0x100000001B3ULL;
  return SplitOf(number);
}

fs::path RegistrationsFile(const fs::path& dataset, const std::string& subject) {
  return dataset / "registrations" / (subject + ".npz");
}

std::vector<fs::path> ListRegistrations(const fs::path& dataset) {
  std::vector<fs::path> files;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(dataset / "registrations", error)) {
    const std::string name = entry.path().filename().string();
    if (entry.path().extension() == ".npz" && name[0] != '.') files.push_back(entry.path());
  }
  Require(!files.empty(),
          (dataset / "registrations").string() +
              " holds no registrations: make them with `sole fit " + dataset.string() +
              "` (scan datasets) or `sole dataset add " + dataset.string() + " TAKE...`");
  std::sort(files.begin(), files.end());
  return files;
}

SubjectRegistrations ReadRegistrations(const fs::path& path) {
  const io::Npz npz = io::ReadNpz(path);
  try {
    return FromArrays(npz);
  } catch (const Error& error) {
    throw Error(path.string() + ": " + error.what());
  }
}

void WriteRegistrations(const fs::path& path, const SubjectRegistrations& r) {
  const std::size_t f = r.NumFrames(), n = static_cast<std::size_t>(r.NumVertices());
  std::vector<std::uint8_t> contact;
  for (Index i = 0; i < r.contact.rows(); ++i) {
    for (Index v = 0; v < r.contact.cols(); ++v) contact.push_back(r.contact(i, v));
  }
  io::Npz npz;
  npz["format"] = io::NpyFrom(std::string(kFormat));
  npz["version"] = io::Reshaped(io::NpyFrom(std::vector<int>{kVersion}), {});
  npz["units"] = io::NpyFrom(std::string("m, s, rad; world frame"));
  npz["subject"] = io::NpyFrom(r.subject);
  npz["sex"] = io::NpyFrom(r.sex);
  npz["split"] = io::NpyFrom(r.split);
  npz["side"] = io::NpyFrom(std::string(r.side == Side::kLeft ? "left" : "right"));
  npz["motion"] = io::NpyFrom(r.motion);
  npz["sequence"] = io::NpyFrom(r.sequence);
  npz["time_s"] = io::NpyFrom(r.time_s);
  npz["verdict"] = io::NpyFrom(r.verdict);
  npz["registration_fine_m"] = StackPoints(r.fine_m);
  npz["registration_sd_m"] = io::NpyFrom(r.sd_m);
  npz["contact"] = io::Reshaped(io::NpyFrom(contact), {f, n});
  npz["probability"] = io::NpyFrom(r.probability);
  npz["gap_m"] = io::NpyFrom(r.gap_m);
  npz["theta"] = StackPoints(r.theta);
  npz["translation_m"] = io::NpyFrom(r.translation_m);
  npz["beta"] = io::Reshaped(io::NpyFrom(r.beta), {static_cast<std::size_t>(r.beta.size())});
  if (!r.true_m.empty()) npz["true_m"] = StackPoints(r.true_m);
  io::WriteNpz(path, npz);
}

}  // namespace sole::app
