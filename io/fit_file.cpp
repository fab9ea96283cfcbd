// contact.npz and fit.npz.
#include <cmath>
#include <limits>

#include "core/error.h"
#include "io/npz.h"
#include "io/shown_internal.h"
#include "io/take.h"

namespace sole::io {

namespace fs = std::filesystem;

namespace {

using Eigen::Index;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr int kVersion = 1;

std::size_t Size(Index n) { return static_cast<std::size_t>(n); }
NpyArray Scalar(int value) { return Reshaped(NpyFrom(std::vector<int>{value}), {}); }

/// Runs `body` and puts the path in front of its errors.
template <typename Body>
auto Within(const fs::path& path, const Body& body) {
  try {
    return body();
  } catch (const Error& error) {
    const std::string what = error.what();
    throw Error(what.starts_with(path.string()) || what.starts_with("cannot ")
                    ? what
                    : path.string() + ": " + what);
  }
}

void CheckFormat(const Npz& npz, const std::string& format) {
  const std::string found = StringFrom(npz, "format");
  Require(found == format, "is a '" + Shown(found) + "' file, expected '" + format + "'");
  const std::vector<int> version = IntsFrom(npz, "version");
  Require(version == std::vector<int>{kVersion},
          "its format version is unknown: use the version of Sole that wrote it");
}

std::vector<std::int64_t> TriggersFrom(const Npz& npz) {
  Require(ShapeOf(npz, "frames").size() == 1, "array 'frames' must have one dimension");
  std::vector<std::int64_t> triggers;
  const Eigen::MatrixXd values = MatrixFrom(npz, "frames");
  for (const double value : values.reshaped()) {
    Require(value == std::floor(value) && std::abs(value) < 9e15,
            "array 'frames' must hold trigger numbers");
    triggers.push_back(static_cast<std::int64_t>(value));
  }
  return triggers;
}

/// A (F, ...) array as a matrix with a row per frame and `cols` columns (any number if negative).
Eigen::MatrixXd Rows(const Npz& npz, const std::string& name, std::size_t frames,
                     std::size_t dimensions, Index cols = -1) {
  const std::vector<std::size_t>& shape = ShapeOf(npz, name);
  const bool good =
      shape.size() == dimensions && shape[0] == frames && (dimensions < 3 || shape[2] == 3);
  Eigen::MatrixXd matrix = good ? MatrixFrom(npz, name) : Eigen::MatrixXd();
  Require(good && (cols < 0 || matrix.cols() == cols),
          "array '" + name + "' has the wrong shape for " + std::to_string(frames) + " frames");
  return matrix;
}

using RowMajorX3 = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

/// Row `frame` of a matrix of Rows() as points.
Eigen::MatrixX3d PointsOf(const Eigen::MatrixXd& rows, Index frame) {
  const Eigen::RowVectorXd row = rows.row(frame);
  return Eigen::Map<const RowMajorX3>(row.data(), row.size() / 3, 3);
}

/// Stacks one matrix per frame into (F, n, cols) (or (F, n) for cols = 1); frames without values
/// become NaN.
template <typename Get>
NpyArray Stack(const std::vector<FrameFit>& frames, const char* name, Index cols, const Get& get) {
  Index n = 0;
  for (const FrameFit& frame : frames) n = std::max<Index>(n, frame.found ? get(frame).rows() : 0);
  Eigen::MatrixXd stacked =
      Eigen::MatrixXd::Constant(static_cast<Index>(frames.size()), n * cols, kNan);
  for (std::size_t f = 0; f < frames.size(); ++f) {
    const auto& values = get(frames[f]);
    if (!frames[f].found || values.rows() == 0) continue;
    Require(values.rows() == n, std::string("frames differ in the size of ") + name);
    for (Index i = 0; i < n; ++i)
      stacked.row(static_cast<Index>(f)).segment(i * cols, cols) = values.row(i);
  }
  std::vector<std::size_t> shape{frames.size(), Size(n)};
  if (cols > 1) shape.push_back(Size(cols));
  return Reshaped(NpyFrom(stacked), shape);
}

void AddContact(Npz& npz, const ContactFile& file) {
  const std::size_t frames = file.contact.size();
  const Index n = frames == 0 ? 0 : static_cast<Index>(file.contact[0].contact.size());
  std::vector<std::uint8_t> bits, states;
  std::vector<double> slip, penetration;
  Eigen::MatrixXd probability(static_cast<Index>(frames), n), gap(static_cast<Index>(frames), n);
  for (std::size_t f = 0; f < frames; ++f) {
    const FrameContact& contact = file.contact[f];
    Require(static_cast<Index>(contact.contact.size()) == n && contact.probability.size() == n &&
                contact.gap_m.size() == n,
            "frames differ in their number of contact vertices");
    bits.insert(bits.end(), contact.contact.begin(), contact.contact.end());
    Require(contact.state.empty() || static_cast<Index>(contact.state.size()) == n,
            "frames differ in their number of contact vertices");
    for (const ContactState state : contact.state) states.push_back(static_cast<std::uint8_t>(state));
    slip.push_back(contact.slip_m);
    penetration.push_back(contact.penetration_m);
    probability.row(static_cast<Index>(f)) = contact.probability.transpose();
    gap.row(static_cast<Index>(f)) = contact.gap_m.transpose();
  }
  npz["contact"] = Reshaped(NpyFrom(bits), {frames, Size(n)});
  npz["probability"] = NpyFrom(probability);
  npz["gap_m"] = NpyFrom(gap);
  npz["slip_m"] = NpyFrom(slip);
  npz["penetration_m"] = NpyFrom(penetration);
  if (states.size() == bits.size()) npz["state"] = Reshaped(NpyFrom(states), {frames, Size(n)});
}

Side SideFrom(const std::string& text) {
  Require(text == "right" || text == "left",
          "array 'side' holds '" + Shown(text) + "', expected right or left");
  return text == "left" ? Side::kLeft : Side::kRight;
}

}  // namespace

void WriteContact(const fs::path& path, const ContactFile& file) {
  Within(path, [&] {
    const std::size_t frames = file.triggers.size();
    Require(file.ground.size() == frames && (file.contact.empty() || file.contact.size() == frames),
            "contact and ground need one entry per frame");
    Eigen::MatrixXd ground(static_cast<Index>(frames), 3);
    std::vector<double> sigma;
    std::vector<int> points;
    for (std::size_t f = 0; f < frames; ++f) {
      const GroundPlane& g = file.ground[f];
      ground.row(static_cast<Index>(f)) << g.offset_m, g.slope_x, g.slope_y;
      sigma.push_back(g.sigma_m);
      points.push_back(g.points);
    }
    Npz npz{{"format", NpyFrom(std::string("sole-contact"))},
            {"version", Scalar(kVersion)},
            {"units", NpyFrom(std::string("m; slopes in m per m; world frame"))},
            {"frames", NpyFrom(file.triggers)},
            {"ground", NpyFrom(ground)},
            {"ground_sigma_m", NpyFrom(sigma)},
            {"ground_points", NpyFrom(points)}};
    if (!file.contact.empty()) AddContact(npz, file);
    WriteNpz(path, npz);
  });
}

ContactFile ReadContact(const fs::path& path) {
  return Within(path, [&] {
    const Npz npz = ReadNpz(path);
    CheckFormat(npz, "sole-contact");
    ContactFile file;
    file.triggers = TriggersFrom(npz);
    const std::size_t frames = file.triggers.size();
    const Eigen::MatrixXd ground = Rows(npz, "ground", frames, 2, 3);
    const Eigen::MatrixXd sigma = Rows(npz, "ground_sigma_m", frames, 1);
    Rows(npz, "ground_points", frames, 1);
    const std::vector<int> points = IntsFrom(npz, "ground_points");
    for (std::size_t f = 0; f < frames; ++f) {
      const auto row = static_cast<Index>(f);
      file.ground.push_back(
          {ground(row, 0), ground(row, 1), ground(row, 2), sigma(row), points[f]});
    }
    if (!npz.contains("contact")) return file;
    const Eigen::MatrixXd gap = Rows(npz, "gap_m", frames, 2);
    const Eigen::MatrixXd bits = Rows(npz, "contact", frames, 2, gap.cols());
    const Eigen::MatrixXd probability = Rows(npz, "probability", frames, 2, gap.cols());
    // Files of earlier versions have none of these.
    const auto optional = [&](const char* name, std::size_t dimensions, Index cols) {
      return npz.contains(name) ? Rows(npz, name, frames, dimensions, cols) : Eigen::MatrixXd();
    };
    const Eigen::MatrixXd state = optional("state", 2, gap.cols());
    const Eigen::MatrixXd slip = optional("slip_m", 1, -1), penetration = optional("penetration_m", 1, -1);
    for (Index f = 0; f < static_cast<Index>(frames); ++f) {
      FrameContact contact{{}, probability.row(f).transpose(), gap.row(f).transpose()};
      for (Index i = 0; i < gap.cols(); ++i) contact.contact.push_back(bits(f, i) != 0 ? 1 : 0);
      for (Index i = 0; i < state.cols(); ++i) {
        Require(state(f, i) <= 2, "array 'state' must hold 0, 1 or 2");
        contact.state.push_back(static_cast<ContactState>(state(f, i)));
      }
      if (slip.size() > 0) contact.slip_m = slip(f);
      if (penetration.size() > 0) contact.penetration_m = penetration(f);
      file.contact.push_back(std::move(contact));
    }
    return file;
  });
}

void WriteFit(const fs::path& path, const FitSequence& fit) {
  Within(path, [&] {
    std::vector<std::int64_t> triggers;
    std::vector<std::uint8_t> found;
    std::vector<double> residual;
    std::vector<std::string> side, verdict;
    Eigen::MatrixXd translation(static_cast<Index>(fit.frames.size()), 3);
    for (const FrameFit& frame : fit.frames) {
      const auto row = static_cast<Index>(triggers.size());
      triggers.push_back(frame.trigger);
      found.push_back(frame.found ? 1 : 0);
      residual.push_back(frame.found ? frame.residual_m : kNan);
      side.push_back(frame.side == Side::kLeft ? "left" : "right");
      verdict.push_back(frame.verdict);
      translation.row(row) = frame.found ? Eigen::RowVector3d(frame.translation_m.transpose())
                                         : Eigen::RowVector3d::Constant(kNan);
    }
    const auto stack = [&](const char* name, auto member) {
      return Stack(fit.frames, name, 3,
                   [member](const FrameFit& f) -> const Eigen::MatrixX3d& { return f.*member; });
    };
    const auto stack_scalars = [&](const char* name, auto member) {
      return Stack(fit.frames, name, 1,
                   [member](const FrameFit& f) -> const Eigen::VectorXd& { return f.*member; });
    };
    Npz npz{{"format", NpyFrom(std::string("sole-fit"))},
            {"version", Scalar(kVersion)},
            {"units", NpyFrom(std::string("m, rad; world frame"))},
            {"frames", NpyFrom(triggers)},
            {"found", NpyFrom(found)},
            {"side", NpyFrom(side)},
            {"verdict", NpyFrom(verdict)},
            {"residual_m", NpyFrom(residual)},
            {"beta", Reshaped(NpyFrom(fit.beta), {Size(fit.beta.size())})},
            {"beta_sd", Reshaped(NpyFrom(fit.beta_sd), {Size(fit.beta_sd.size())})},
            {"translation_m", NpyFrom(translation)},
            {"theta", stack("theta", &FrameFit::theta)},
            {"theta_sd", stack("theta_sd", &FrameFit::theta_sd)},
            {"vertices_m", stack("vertices_m", &FrameFit::vertices_m)},
            {"registration_m", stack("registration_m", &FrameFit::registration_m)},
            {"registration_fine_m", stack("registration_fine_m", &FrameFit::registration_fine_m)},
            {"registration_sd_m", stack_scalars("registration_sd_m", &FrameFit::registration_sd_m)},
            {"vertex_sd_m", stack_scalars("vertex_sd_m", &FrameFit::vertex_sd_m)}};
    NpyArray contact = stack_scalars("contact", &FrameFit::contact);
    if (contact.shape[1] > 0) npz["contact"] = std::move(contact);
    WriteNpz(path, npz);
  });
}

FitSequence ReadFit(const fs::path& path) {
  return Within(path, [&] {
    const Npz npz = ReadNpz(path);
    CheckFormat(npz, "sole-fit");
    const std::vector<std::int64_t> triggers = TriggersFrom(npz);
    const std::size_t frames = triggers.size();
    FitSequence fit;
    fit.beta = MatrixFrom(npz, "beta").reshaped();
    fit.beta_sd = MatrixFrom(npz, "beta_sd").reshaped();
    const Eigen::MatrixXd found = Rows(npz, "found", frames, 1),
                          residual = Rows(npz, "residual_m", frames, 1);
    const Eigen::MatrixXd translation = Rows(npz, "translation_m", frames, 2, 3);
    const Eigen::MatrixXd theta = Rows(npz, "theta", frames, 3),
                          theta_sd = Rows(npz, "theta_sd", frames, 3);
    const Eigen::MatrixXd vertices = Rows(npz, "vertices_m", frames, 3);
    const Eigen::MatrixXd registration = Rows(npz, "registration_m", frames, 3);
    const Eigen::MatrixXd fine = Rows(npz, "registration_fine_m", frames, 3);
    const Eigen::MatrixXd vertex_sd = Rows(npz, "vertex_sd_m", frames, 2);
    const Eigen::MatrixXd registration_sd = Rows(npz, "registration_sd_m", frames, 2);
    const Eigen::MatrixXd contact =
        npz.contains("contact") ? Rows(npz, "contact", frames, 2, vertex_sd.cols()) : Eigen::MatrixXd();
    const std::vector<std::string> side = StringsFrom(npz, "side"),
                                   verdict = StringsFrom(npz, "verdict");
    Require(side.size() == frames && verdict.size() == frames,
            "arrays 'side' and 'verdict' need one text per frame");
    for (std::size_t f = 0; f < frames; ++f) {
      const auto row = static_cast<Index>(f);
      FrameFit frame;
      frame.trigger = triggers[f];
      frame.found = found(row) != 0;
      frame.side = SideFrom(side[f]);
      frame.theta = PointsOf(theta, row);
      frame.translation_m = translation.row(row).transpose();
      if (contact.size() > 0 && contact.row(row).allFinite()) frame.contact = contact.row(row).transpose();
      frame.vertices_m = PointsOf(vertices, row);
      frame.registration_m = PointsOf(registration, row);
      frame.registration_fine_m = PointsOf(fine, row);
      frame.theta_sd = PointsOf(theta_sd, row);
      frame.vertex_sd_m = vertex_sd.row(row).transpose();
      frame.registration_sd_m = registration_sd.row(row).transpose();
      frame.residual_m = residual(row);
      frame.verdict = verdict[f];
      fit.frames.push_back(std::move(frame));
    }
    return fit;
  });
}

}  // namespace sole::io
