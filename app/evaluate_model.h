#pragma once

#include <filesystem>
#include <string>

#include <nlohmann/json.hpp>

namespace sole::app {

struct EvaluateModelOptions {
  std::string split = "test";        ///< of the dataset, or `all`
  int per_subject = 24;              ///< registrations of a foot at most, evenly spread
  std::filesystem::path baseline = {};  ///< another model beside it; empty: none
  std::filesystem::path plots = {};  ///< HTML page with plots; empty: none
};

/// Protocol of the SUPR-Foot paper (section 5): pose, shape and translation are fitted to the
/// vertices of every good registration of held-out subjects, contact from the labels. The ablation
/// takes the model without network and correctives (`lbs`), without network (`linear`) and with the
/// networks told pose, pose and shape, and all (`full`); models that `sole train --ablation` left
/// beside MODEL (MODEL-lbs.npz, ...) are taken where they exist, figures without a model are null.
/// Keys: docs/formats.md, "sole evaluate MODEL". Throws Error where model and dataset do not fit.
nlohmann::json EvaluateModel(const std::filesystem::path& model,
                             const std::filesystem::path& dataset,
                             const EvaluateModelOptions& options = {});

/// The same as tables for the terminal.
std::string FormatModelEvaluation(const nlohmann::json& evaluation);

}  // namespace sole::app
