#include "app/evaluate_fit.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "contact/label.h"
#include "model/surface_query.h"

namespace sole::app {
namespace {

using nlohmann::json;

constexpr double kUnclear_m = 0.00005;  // gaps that differ less from kContactGap_m are neither contact nor none
constexpr double kNear_m = 0.003;

/// Labels against truth.
struct Labels {
  std::size_t both = 0, said = 0, touching = 0;
  void Add(double gap_m, bool label) {
    const bool is = gap_m < contact::kContactGap_m;
    both += is && label;
    said += label;
    touching += is;
  }
  json F1() const { return said + touching > 0 ? json(2.0 * double(both) / double(said + touching)) : json(nullptr); }
};

const FrameTruth* TruthOf(const TakeTruth& truth, std::int64_t trigger) {
  const auto frame =
      std::find_if(truth.frames.begin(), truth.frames.end(), [&](const FrameTruth& t) { return t.trigger == trigger; });
  return frame == truth.frames.end() ? nullptr : &*frame;
}

/// Mean distance of vertices (N x 3) from the material points they stand for.
double MeanDistance(const Eigen::MatrixX3d& vertices_m, const std::vector<Eigen::Vector3d>& places) {
  double sum = 0;
  for (std::size_t v = 0; v < places.size(); ++v)
    sum += (vertices_m.row(static_cast<Eigen::Index>(v)).transpose() - places[v]).norm();
  return sum / static_cast<double>(places.size());
}

/// How far an estimated ground lies above the true, sagged glass in the middle of the true contact (of the plate, without any).
double HeightOverGlass(const FrameTruth& truth, const GroundPlane& ground) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  int touching = 0;
  for (const Eigen::Vector3d& v : truth.mesh.vertices) {
    if (truth.Gap(v) < contact::kContactGap_m) sum += v, ++touching;
  }
  const Eigen::Vector3d middle = sum / std::max(touching, 1);
  return ground.offset_m + ground.slope_x * middle.x() + ground.slope_y * middle.y() + truth.sag.At(middle.x(), middle.y());
}

}  // namespace

json ScoreContact(const std::optional<io::ContactFile>& found, const std::optional<model::FootModel>& model, const TakeTruth& truth) {
  json section{{"precision", nullptr}, {"recall", nullptr}, {"f1", nullptr}, {"f1_clear", nullptr}, {"near_free", nullptr}, {"plane_offset_mm", nullptr}, {"plane_tilt_deg", nullptr}};
  if (!found) return section;
  const io::ContactFile& file = *found;
  Mean offset, tilt;
  Labels all, clear;
  std::size_t near_free = 0, near_labelled_free = 0;
  for (std::size_t f = 0; f < file.triggers.size(); ++f) {
    tilt.Add(std::atan(std::hypot(file.ground[f].slope_x, file.ground[f].slope_y)) * 180 / M_PI);
    const FrameTruth* frame = TruthOf(truth, file.triggers[f]);
    if (!frame) continue;
    offset.Add(std::abs(HeightOverGlass(*frame, file.ground[f])));
    if (!model || model->material.empty() || file.contact.empty()) continue;
    const std::vector<Eigen::Vector3d> positions = MaterialPositions(*model, frame->mesh, truth.side);
    if (positions.size() != file.contact[f].contact.size()) continue;
    for (std::size_t v = 0; v < positions.size(); ++v) {
      const double gap = frame->Gap(positions[v]);
      const bool said = file.contact[f].contact[v] != 0;
      all.Add(gap, said);
      if (std::abs(gap - contact::kContactGap_m) > kUnclear_m) clear.Add(gap, said);
      if (gap < contact::kContactGap_m + kUnclear_m || gap > kNear_m) continue;
      ++near_free;
      near_labelled_free += !said;
    }
  }
  section["plane_offset_mm"] = offset.Value(1e3);
  section["plane_tilt_deg"] = tilt.Value();
  if (all.said > 0) section["precision"] = double(all.both) / double(all.said);
  if (all.touching > 0) section["recall"] = double(all.both) / double(all.touching);
  section["f1"] = all.F1();
  section["f1_clear"] = clear.F1();
  if (near_free > 0) section["near_free"] = double(near_labelled_free) / double(near_free);
  return section;
}

json ScoreFit(const std::optional<FitSequence>& fit, const std::optional<model::FootModel>& model, const TakeTruth& truth) {
  json section{{"v2v_contact_mm", nullptr}, {"v2v_noncontact_mm", nullptr}, {"v2v_frames_p95_mm", nullptr},
               {"registered_contact_mm", nullptr}, {"registered_noncontact_mm", nullptr}, {"surface_mean_mm", nullptr},
               {"seconds_per_frame", nullptr}};
  if (!fit) return section;
  Mean fitted[2], registered[2], surface;  // free, touching
  std::vector<double> frames;
  for (const FrameFit& frame : fit->frames) {
    const FrameTruth* true_frame = TruthOf(truth, frame.trigger);
    if (!frame.found || !true_frame) continue;
    const model::SurfaceQuery query(true_frame->mesh);
    for (Eigen::Index v = 0; v < frame.vertices_m.rows(); ++v) {
      if (const auto hit = query.Closest(frame.vertices_m.row(v).transpose(), 0.1)) surface.Add(hit->distance_m);
    }
    if (!model || model->material.empty()) continue;
    const std::vector<Eigen::Vector3d> places = MaterialPositions(*model, true_frame->mesh, truth.side);
    const auto count = static_cast<Eigen::Index>(places.size());
    if (count != frame.vertices_m.rows()) continue;
    const bool touches = std::any_of(places.begin(), places.end(), [&](const Eigen::Vector3d& p) {
      return true_frame->Gap(p) < contact::kContactGap_m;
    });
    frames.push_back(MeanDistance(frame.vertices_m, places));
    fitted[touches].Add(frames.back());
    if (frame.registration_m.rows() == count) registered[touches].Add(MeanDistance(frame.registration_m, places));
  }
  section["v2v_contact_mm"] = fitted[1].Value(1e3);
  section["v2v_noncontact_mm"] = fitted[0].Value(1e3);
  section["registered_contact_mm"] = registered[1].Value(1e3);
  section["registered_noncontact_mm"] = registered[0].Value(1e3);
  section["surface_mean_mm"] = surface.Value(1e3);
  if (!frames.empty()) {
    // Nearest rank.
    const auto at = frames.begin() + static_cast<std::ptrdiff_t>(std::ceil(0.95 * static_cast<double>(frames.size()))) - 1;
    std::nth_element(frames.begin(), at, frames.end());
    section["v2v_frames_p95_mm"] = 1e3 * *at;
  }
  return section;
}

}  // namespace sole::app
