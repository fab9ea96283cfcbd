#pragma once

#include <optional>

#include <nlohmann/json.hpp>

#include "app/truth.h"
#include "core/fit_sequence.h"
#include "io/take.h"
#include "model/foot_model.h"

namespace sole::app {

/// A mean that is null until something was added.
struct Mean {
  double sum = 0;
  std::size_t count = 0;
  void Add(double value) { sum += value, ++count; }
  nlohmann::json Value(double scale = 1) const {
    return count ? nlohmann::json(scale * sum / static_cast<double>(count)) : nlohmann::json(nullptr);
  }
};

/// Sections "contact" and "fit" of summary.json (docs/formats.md) but for the times. Figures that need what is absent are null:
/// without a file all of them, without the template's material points (`model`) those of labels, v2v and registered points.
nlohmann::json ScoreContact(const std::optional<io::ContactFile>& file, const std::optional<model::FootModel>& model,
                            const TakeTruth& truth);
nlohmann::json ScoreFit(const std::optional<FitSequence>& fit, const std::optional<model::FootModel>& model, const TakeTruth& truth);

}  // namespace sole::app
