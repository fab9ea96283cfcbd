#include "app/evaluate_model.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <vector>

#include <fmt/format.h>

#include "app/console.h"
#include "app/line_plot.h"
#include "app/model_scores.h"
#include "core/error.h"
#include "io/atomic_file.h"
#include "model/contact_network.h"
#include "model/model_file.h"

namespace sole::app {
namespace {

namespace fs = std::filesystem;
using model::FootModel;
using model::NetworkKind;
using nlohmann::json;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// The steps of the ablation in the order of the paper's table.
constexpr const char* kSteps[] = {"lbs", "linear", "f_theta", "f_theta_beta", "full"};

fs::path Sibling(const fs::path& model, const std::string& step) {
  return model.parent_path() / (model.stem().string() + "-" + step + ".npz");
}

/// Model of one step: a file beside the model, or made of it by leaving parts out.
std::optional<FootModel> ModelOf(const fs::path& path, const FootModel& full,
                                 const std::string& step) {
  const auto kind = KindOfNetwork(full);
  if (step == "full")
    return kind == NetworkKind::kPoseShapeContact ? std::optional(full) : std::nullopt;
  if (fs::exists(Sibling(path, step))) return model::LoadModel(Sibling(path, step));
  if (step == "f_theta" && kind == NetworkKind::kPose) return full;
  if (step == "f_theta_beta" && kind == NetworkKind::kPoseShape) return full;
  if (step != "lbs" && step != "linear") return std::nullopt;
  FootModel part = full;
  part.network.clear();
  if (step == "lbs") {
    part.coarse.posedirs.setZero();
    part.fine.posedirs.setZero();
  }
  Prepare(part);
  return part;
}

json Millimetres(double metres) { return std::isnan(metres) ? json(nullptr) : json(1e3 * metres); }

/// One row of the table.
json RowOf(const Specimens& specimens, const std::vector<SpecimenScore>& scores) {
  json row;
  for (const bool touches : {true, false}) {
    const std::string name = touches ? "contact" : "noncontact";
    std::vector<double> v2v, truth, touching;
    for (std::size_t i = 0; i < scores.size(); ++i) {
      const bool counts = specimens.all[i].touches == touches;
      v2v.push_back(counts ? scores[i].v2v_m : kNan);
      truth.push_back(counts ? scores[i].true_v2v_m : kNan);
      touching.push_back(counts ? scores[i].touching_v2v_m : kNan);
    }
    const Spread spread = SpreadOf(specimens, v2v);
    row[name + "_mm"] = Millimetres(spread.mean);
    row[name + "_sd_mm"] = Millimetres(spread.sd);
    row[name + "_interval_mm"] = {Millimetres(spread.low), Millimetres(spread.high)};
    row[name + "_truth_mm"] = Millimetres(SpreadOf(specimens, truth).mean);
    if (touches) row["touching_mm"] = Millimetres(SpreadOf(specimens, touching).mean);
  }
  return row;
}

/// How much nearer each registration is than by the step before, compared foot by foot.
void AddGains(const Specimens& specimens, const std::vector<SpecimenScore>& before,
              const std::vector<SpecimenScore>& now, json& row) {
  for (const bool touches : {true, false}) {
    std::vector<double> gains;
    for (std::size_t i = 0; i < now.size(); ++i)
      gains.push_back(specimens.all[i].touches == touches ? before[i].v2v_m - now[i].v2v_m : kNan);
    const Spread gain = SpreadOf(specimens, gains);
    const std::string name = touches ? "contact" : "noncontact";
    row[name + "_gain_mm"] = Millimetres(gain.mean);
    row[name + "_gain_interval_mm"] = {Millimetres(gain.low), Millimetres(gain.high)};
  }
}

/// Mean distance of each motion, contact or not.
void AddMotions(const Specimens& specimens, const std::vector<SpecimenScore>& scores,
                const std::string& step, json& motions) {
  std::map<std::string, std::pair<double, int>> sums;
  for (std::size_t i = 0; i < scores.size(); ++i) {
    auto& [sum, count] = sums[specimens.all[i].motion];
    sum += scores[i].v2v_m;
    ++count;
  }
  for (const auto& [motion, sum] : sums) {
    motions[motion]["registrations"] = sum.second;
    motions[motion][step + "_mm"] = 1e3 * sum.first / sum.second;
  }
}

double MeanOf(const std::vector<SpecimenScore>& scores, double SpecimenScore::*member) {
  double sum = 0;
  for (const SpecimenScore& score : scores) sum += score.*member;
  return sum / static_cast<double>(scores.size());
}

/// Errors by number of shape components.
json Components(const FootModel& model, const Specimens& specimens) {
  json rows = json::array();
  double whole = 0;
  const auto last = static_cast<int>(model.NumBetas());
  for (const int betas : {0, 1, 2, 3, 5, 7, 10, 15, 20, 30, 50, 100}) {
    const int used = std::min(betas, last);
    const std::vector<SpecimenScore> scores = ScoreModel(model, specimens, used);
    const double square = MeanOf(scores, &SpecimenScore::square_m2);
    if (used == 0) whole = square;
    rows.push_back({{"components", used},
                    {"v2v_mm", 1e3 * MeanOf(scores, &SpecimenScore::v2v_m)},
                    {"surface_mm", 1e3 * MeanOf(scores, &SpecimenScore::surface_m)},
                    {"explained", 1 - square / whole}});
    if (used == last) break;
  }
  return rows;
}

/// Mean and standard deviation over subjects of each shape coefficient.
json Betas(const Specimens& specimens, const std::vector<SpecimenScore>& scores) {
  const Eigen::Index betas = scores[0].beta.size();
  Eigen::MatrixXd sums =
      Eigen::MatrixXd::Zero(betas, static_cast<Eigen::Index>(specimens.subjects.size()));
  Eigen::VectorXd counts = Eigen::VectorXd::Zero(sums.cols());
  for (std::size_t i = 0; i < scores.size(); ++i) {
    const auto s = static_cast<Eigen::Index>(specimens.all[i].subject);
    sums.col(s) += scores[i].beta;
    counts[s] += 1;
  }
  const Eigen::MatrixXd means = sums.array().rowwise() / counts.transpose().array();
  const Eigen::VectorXd mean = means.rowwise().mean();
  const double freedom = std::max<double>(1, static_cast<double>(means.cols()) - 1);
  const Eigen::VectorXd sd =
      ((means.colwise() - mean).rowwise().squaredNorm() / freedom).cwiseSqrt();
  return {{"mean", std::vector<double>(mean.data(), mean.data() + betas)},
          {"sd", std::vector<double>(sd.data(), sd.data() + betas)}};
}

json ResponseOf(const FootModel& model, const Specimens& specimens,
                const std::vector<SpecimenScore>& scores) {
  const ContactResponse response = MeasureContactResponse(model, specimens, scores);
  const auto number = [](double x) { return std::isnan(x) ? json(nullptr) : json(x); };
  return {{"registrations", response.specimens},
          {"free_mm", Millimetres(response.free_m)},
          {"flattening_share", number(response.share)},
          {"monotonic_share", number(response.monotonic)}};
}

void WritePlots(const fs::path& path, const json& evaluation) {
  LinePlot errors{"Held-out error by number of shape components", "components", "mm", {}};
  LinePlot explained{"Variance explained", "components", "share", {}};
  PlotLine v2v{"vertex to vertex", {}, {}}, surface{"to surface", {}, {}}, share{"", {}, {}};
  for (const json& row : evaluation["components"]) {
    for (PlotLine* line : {&v2v, &surface, &share})
      line->x.push_back(row["components"].get<double>());
    v2v.y.push_back(row["v2v_mm"]);
    surface.y.push_back(row["surface_mm"]);
    share.y.push_back(row["explained"]);
  }
  errors.lines = {v2v, surface};
  explained.lines = {share};
  const std::string page = fmt::format(
      "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>Model evaluation</title>"
      "<style>body{{font:15px sans-serif;margin:2em auto;max-width:60em}}pre{{font-size:13px}}"
      "</style><h1>Model evaluation</h1><pre>{}</pre>{}{}</html>\n",
      FormatModelEvaluation(evaluation), DrawLinePlot(errors), DrawLinePlot(explained));
  io::WriteStringAtomically(path, page);
}

}  // namespace

json EvaluateModel(const fs::path& path, const fs::path& dataset,
                   const EvaluateModelOptions& options) {
  const FootModel full = model::LoadModel(path);
  std::optional<FootModel> baseline;
  if (!options.baseline.empty()) baseline = model::LoadModel(options.baseline);
  const Specimens specimens = ReadSpecimens(dataset, options.split, options.per_subject);
  Progress progress("evaluate", static_cast<int>(std::size(kSteps)) + 2);
  int done = 0;
  json ablation, motions = json::object();
  std::vector<SpecimenScore> before;
  for (const char* step : kSteps) {
    ablation[step] = nullptr;
    if (const std::optional<FootModel> part = ModelOf(path, full, step)) {
      std::vector<SpecimenScore> now = ScoreModel(*part, specimens);
      ablation[step] = RowOf(specimens, now);
      AddMotions(specimens, now, step, motions);
      if (!before.empty()) AddGains(specimens, before, now, ablation[step]);
      before = std::move(now);
    }
    progress.Set(++done);
  }
  const std::vector<SpecimenScore> scores = ScoreModel(full, specimens);
  json result{{"model", path.string()},
              {"dataset", dataset.string()},
              {"split", options.split},
              {"subjects", specimens.subjects.size()},
              {"registrations", specimens.all.size()},
              {"ablation", ablation},
              {"baseline", nullptr},
              {"motions", motions},
              {"beta", Betas(specimens, scores)},
              {"contact_response", ResponseOf(full, specimens, scores)}};
  if (baseline) {
    result["baseline"] = RowOf(specimens, ScoreModel(*baseline, specimens));
    result["baseline"]["model"] = options.baseline.string();
  }
  progress.Set(++done);
  result["components"] = Components(full, specimens);
  progress.Set(++done);
  if (!options.plots.empty()) WritePlots(options.plots, result);
  return result;
}

std::string FormatModelEvaluation(const json& e) {
  std::string text = fmt::format(
      "{} registrations of {} subjects (split {}), distances of vertices in mm: mean +- sd "
      "[95 % of the mean]\n{:<16}{:<32}{:<32}{:>14}{:>22}\n",
      e["registrations"].get<int>(), e["subjects"].get<int>(), e["split"].get<std::string>(),
      "model", "no contact", "with contact", "touching ones", "to truth: no, with");
  const auto number = [](const json& value) {
    return value.is_number() ? fmt::format("{:.3f}", value.get<double>()) : std::string("-");
  };
  const auto add = [&](const std::string& name, const json& row) {
    if (row.is_null()) return;
    const auto cell = [&](const std::string& frames) {
      const json& interval = row[frames + "_interval_mm"];
      return fmt::format("{} +- {} [{}, {}]", number(row[frames + "_mm"]),
                         number(row[frames + "_sd_mm"]), number(interval[0]), number(interval[1]));
    };
    text += fmt::format("{:<16}{:<32}{:<32}{:>14}{:>22}\n", name, cell("noncontact"),
                        cell("contact"), number(row["touching_mm"]),
                        number(row["noncontact_truth_mm"]) + ", " +
                            number(row["contact_truth_mm"]));
  };
  for (const char* step : kSteps) add(step, e["ablation"][step]);
  add("baseline", e["baseline"]);
  text += "\nnearer than the step before, foot by foot, mm [95 %]\n";
  for (const char* step : kSteps) {
    const json& row = e["ablation"][step];
    if (row.is_null() || !row.contains("contact_gain_mm")) continue;
    const auto cell = [&](const std::string& frames) {
      const json& interval = row[frames + "_gain_interval_mm"];
      return fmt::format("{} [{}, {}]", number(row[frames + "_gain_mm"]), number(interval[0]),
                         number(interval[1]));
    };
    text += fmt::format("{:<16}{:<32}{:<32}\n", step, cell("noncontact"), cell("contact"));
  }
  // Takes have names of their own: too many for a table.
  if (e["motions"].size() <= 12) {
    text += fmt::format("\n{:<16}{:>14}", "motion, mm", "registrations");
    for (const char* step : kSteps) text += fmt::format("{:>14}", step);
    for (const auto& [motion, row] : e["motions"].items()) {
      text += fmt::format("\n{:<16}{:>14}", motion, row["registrations"].get<int>());
      for (const char* step : kSteps)
        text += fmt::format("{:>14}", number(row.value(std::string(step) + "_mm", json(nullptr))));
    }
    text += "\n";
  }
  text += "\ncomponents  v2v mm  surface mm  explained\n";
  for (const json& row : e["components"])
    text += fmt::format("{:>10}  {:>6.3f}  {:>10.3f}  {:>9.3f}\n", row["components"].get<int>(),
                        row["v2v_mm"].get<double>(), row["surface_mm"].get<double>(),
                        row["explained"].get<double>());
  const json& response = e["contact_response"];
  if (!response["free_mm"].is_null())
    text += fmt::format(
        "\ncontact network: {:.3f} mm without contact, explains {:.0f} % of the flattening, {:.0f} "
        "% of touching vertices move steadily as contact fades in\n",
        response["free_mm"].get<double>(), 100 * response["flattening_share"].get<double>(),
        100 * response["monotonic_share"].get<double>());
  return text;
}

}  // namespace sole::app
