#include "app/train_validation.h"

#include <cmath>
#include <limits>
#include <vector>

#include "app/console.h"
#include "app/model_scores.h"

namespace sole::app {
namespace {

using nlohmann::json;

json Number(double value) { return std::isfinite(value) ? json(value) : json(nullptr); }

json RowOf(const Specimens& specimens, const std::vector<SpecimenScore>& scores) {
  json row;
  for (const bool touches : {false, true}) {
    std::vector<double> v2v, truth;
    for (std::size_t i = 0; i < scores.size(); ++i) {
      const bool counts = specimens.all[i].touches == touches;
      v2v.push_back(counts ? scores[i].v2v_m : std::numeric_limits<double>::quiet_NaN());
      truth.push_back(counts ? scores[i].true_v2v_m : std::numeric_limits<double>::quiet_NaN());
    }
    const std::string name = touches ? "contact" : "noncontact";
    row[name + "_mm"] = Number(1e3 * SpreadOf(specimens, v2v).mean);
    row[name + "_truth_mm"] = Number(1e3 * SpreadOf(specimens, truth).mean);
  }
  return row;
}

}  // namespace

json ValidateModels(const std::filesystem::path& dataset,
                    const std::map<std::string, model::FootModel>& models, int per_subject) {
  const Specimens specimens = ReadSpecimens(dataset, "validation", per_subject);
  Progress progress("validation", static_cast<int>(models.size()));
  int done = 0;
  json table;
  for (const auto& [name, foot] : models) {
    const std::vector<SpecimenScore> scores = ScoreModel(foot, specimens);
    table[name] = RowOf(specimens, scores);
    if (name == "full") {
      const ContactResponse response = MeasureContactResponse(foot, specimens, scores);
      table[name]["free_mm"] = Number(1e3 * response.free_m);
      table[name]["flattening_share"] = Number(response.share);
      table[name]["monotonic_share"] = Number(response.monotonic);
    }
    progress.Set(++done);
  }
  return table;
}

}  // namespace sole::app
