/// Makes models/sole-foot.npz, the articulated foot model that Sole ships, from simulated people:
///
///   build/release/app/tools/sole_make_model --out models/sole-foot.npz
///
/// Deterministic; subject seeds 400 to 699 train it, 800 to 849 are kept for --evaluate, the
/// judgement seeds (1001 and above) are never drawn. See docs/model.md.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <string>

#include "app/tools/model_builder.h"
#include "app/tools/model_evaluation.h"
#include "core/error.h"
#include "io/mesh_file.h"
#include "model/model_file.h"

int main(int argc, char** argv) {
  CLI::App program("Makes the shipped foot model from simulated people");
  sole::tools::BuilderOptions options;
  std::string out = "models/sole-foot.npz", meshes, check;
  int evaluate = 0;
  bool no_correctives = false;
  program.add_option("--out", out, "Model file to write")->capture_default_str();
  program.add_option("--people", options.shape_people, "Shape subjects")
      ->check(CLI::Range(20, 400))
      ->capture_default_str();
  program.add_option("--movers", options.motion_people, "Motion subjects")
      ->check(CLI::Range(2, 400))
      ->capture_default_str();
  program.add_option("--poses", options.poses, "Poses of each motion subject")
      ->check(CLI::Range(2, 100))
      ->capture_default_str();
  program.add_option("--betas", options.betas, "Shape coefficients")
      ->check(CLI::Range(2, 100))
      ->capture_default_str();
  program.add_flag("--no-correctives", no_correctives, "Leave the pose correctives zero");
  program.add_flag("--mean-foot", options.mean_foot,
                   "Of the mean foot alone, to begin registrations with; nobody is drawn");
  program.add_option("--evaluate", evaluate, "Held-out subjects to fit afterwards")
      ->check(CLI::Range(0, 50));
  program.add_option("--check", check, "Only evaluate this model file");
  program.add_option("--meshes", meshes, "Prefix of PLY files of both template surfaces");
  CLI11_PARSE(program, argc, argv);
  options.correctives = !no_correctives;
  const auto begin = std::chrono::steady_clock::now();
  const auto log = [&](const std::string& line) {
    const double seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    fmt::print(stderr, "{:6.1f} s  {}\n", seconds, line);
  };
  try {
    if (check.empty()) {
      sole::model::SaveModel(out, sole::tools::BuildFootModel(options, log));
      check = out;
    }
    const sole::model::FootModel foot = sole::model::LoadModel(check);
    for (const std::string& line : sole::model::DescribeModel(foot)) fmt::print("{}\n", line);
    if (!meshes.empty()) {
      sole::io::WritePly(meshes + "coarse.ply", TemplateMesh(foot, sole::model::Variant::kCoarse));
      sole::io::WritePly(meshes + "fine.ply", TemplateMesh(foot, sole::model::Variant::kFine));
    }
    if (evaluate > 0) {
      for (const std::string& line : sole::tools::EvaluateOnHeldOutPeople(foot, evaluate))
        fmt::print("{}\n", line);
    }
  } catch (const sole::Error& error) {
    fmt::print(stderr, "sole_make_model: {}\n", error.what());
    return 1;
  }
  return 0;
}
