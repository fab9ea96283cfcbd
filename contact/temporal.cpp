#include "contact/temporal.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "core/error.h"

namespace sole::contact {
namespace {

/// Probability that a vertex lands or leaves from each frame to the next.
std::vector<double> ChangesOf(const std::vector<FrameContact>& frames, const TemporalOptions& options) {
  std::vector<double> changes;
  for (std::size_t f = 0; f + 1 < frames.size(); ++f) {
    double changed = options.change * options.prior_vertices, touching = options.prior_vertices;
    for (Eigen::Index v = 0; v < frames[f].gap_m.size(); ++v) {
      if (std::isnan(frames[f].gap_m[v]) || std::isnan(frames[f + 1].gap_m[v])) continue;
      const double a = frames[f].probability[v], b = frames[f + 1].probability[v];
      changed += std::abs(a - b);
      touching += std::max(a, b);
    }
    changes.push_back(std::min(0.5, changed / touching));
  }
  return changes;
}

/// Probabilities that one vertex touches in every frame, given all of `observed`.
std::vector<double> Smoothed(const std::vector<double>& observed, const std::vector<double>& changes, double neighbours) {
  const std::size_t frames = observed.size();
  const auto step = [](double touching, double change) { return touching * (1 - change) + (1 - touching) * change; };
  const auto both = [](double a, double b) {
    const double touching = a * b, free = (1 - a) * (1 - b);
    return touching / (touching + free);
  };
  // Never quite 0 or 1: two frames that contradict each other must not leave 0 / 0.
  const auto at = [&](std::size_t f) { return std::clamp(observed[f], 1e-6, 1 - 1e-6); };
  const auto from = [&](std::size_t f) {
    const double touching = std::pow(at(f), neighbours), free = std::pow(1 - at(f), neighbours);
    return touching / (touching + free);
  };
  std::vector<double> before(frames, 0.5), after(frames, 0.5);
  for (std::size_t f = 1; f < frames; ++f) before[f] = step(both(before[f - 1], from(f - 1)), changes[f - 1]);
  for (std::size_t f = frames; f-- > 1;) after[f - 1] = step(both(after[f], from(f)), changes[f - 1]);
  std::vector<double> result(frames);
  for (std::size_t f = 0; f < frames; ++f) result[f] = both(both(before[f], at(f)), after[f]);
  return result;
}

}  // namespace

void SmoothLabels(std::vector<FrameContact>& frames, const TemporalOptions& options) {
  if (frames.empty()) return;
  Require(options.change > 0 && options.change < 0.5 && options.prior_vertices > 0 && options.neighbours >= 0 &&
              options.neighbours <= 1 && options.confident > 0.5 && options.sure >= 0.5,
          "contact: change must lie between 0 and 0.5, neighbours between 0 and 1, prior_vertices above 0, confident and sure above 0.5");
  const Eigen::Index n = frames[0].probability.size();
  for (FrameContact& frame : frames) {
    Require(frame.probability.size() == n && frame.gap_m.size() == n,
            "contact: frames of " + std::to_string(n) + " and of " +
                std::to_string(frame.probability.size()) + " vertices");
    frame.state.assign(static_cast<std::size_t>(n), ContactState::kFree);
  }
  const std::vector<double> changes = ChangesOf(frames, options);
  std::vector<double> observed(frames.size());
  for (Eigen::Index v = 0; v < n; ++v) {
    for (std::size_t f = 0; f < frames.size(); ++f) {
      observed[f] = std::isnan(frames[f].gap_m[v]) ? 0.5 : frames[f].probability[v];
    }
    const std::vector<double> smoothed = Smoothed(observed, changes, options.neighbours);
    for (std::size_t f = 0; f < frames.size(); ++f) {
      FrameContact& frame = frames[f];
      const auto i = static_cast<std::size_t>(v);
      if (std::isnan(frame.gap_m[v])) continue;
      const bool confident = std::max(observed[f], 1 - observed[f]) >= options.confident;
      if (!confident) {
        frame.probability[v] = smoothed[f];
        frame.contact[i] = smoothed[f] > 0.5;
      }
      const double p = frame.probability[v];
      frame.state[i] = std::max(p, 1 - p) < options.sure ? ContactState::kUncertain
                       : frame.contact[i]                ? ContactState::kContact
                                                         : ContactState::kFree;
    }
  }
}

void MeasureSlip(const std::vector<Eigen::MatrixX3d>& vertices_m, std::vector<FrameContact>& frames) {
  Require(vertices_m.size() == frames.size(), "contact: vertices and labels need one entry per frame");
  for (std::size_t f = 0; f < frames.size(); ++f) {
    FrameContact& frame = frames[f];
    Require(vertices_m[f].rows() == frame.gap_m.size(), "contact: vertices and labels differ in number");
    double slip = 0, depth = 0;
    int held = 0, touching = 0;
    for (Eigen::Index v = 0; v < frame.gap_m.size(); ++v) {
      const auto i = static_cast<std::size_t>(v);
      if (!frame.contact[i]) continue;
      depth += std::max(0.0, -frame.gap_m[v]);
      ++touching;
      if (f == 0 || !frames[f - 1].contact[i]) continue;
      slip += (vertices_m[f].row(v).head<2>() - vertices_m[f - 1].row(v).head<2>()).norm();
      ++held;
    }
    constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
    frame.slip_m = held ? slip / held : kNone;
    frame.penetration_m = touching ? depth / touching : kNone;
  }
}

}  // namespace sole::contact
