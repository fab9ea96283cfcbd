// `sole model ...`: looks into model files of any family, converts, evaluates and cuts them.
#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "app/commands.h"
#include "app/console.h"
#include "core/error.h"
#include "io/npz.h"
#include "model/constraints.h"
#include "model/forward_batch.h"
#include "model/model_file.h"
#include "model/released_model.h"
#include "model/separate.h"

namespace sole::app {
namespace {

struct Arguments {
  std::string file, out, joints, pose, betas, translation, contact, vertices, side, licence;
  bool single = false, fine = false;
};

using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// One row per foot; a single row stands for all `count` feet (0: any number).
Eigen::MatrixXd ReadRows(const std::string& path, Eigen::Index count) {
  io::NpyArray array = io::ReadNpy(path);
  if (array.shape.size() == 1) array.shape.insert(array.shape.begin(), 1);
  const Eigen::MatrixXd rows = io::MatrixFrom({{path, array}}, path);
  Require(count == 0 || rows.rows() == count || rows.rows() == 1,
          fmt::format("{}: holds {} rows, the poses are {}", path, rows.rows(), count));
  Require(rows.allFinite(), path + ": holds values that are not finite numbers");
  if (count > 0 && rows.rows() == 1) return rows.replicate(count, 1);
  return rows;
}

/// Pose values of every foot: (n, K, 3), (n, 3K), or flat as the model's file has them.
std::vector<model::ModelParameters> ReadParameters(const Arguments& a, const model::FootModel& model) {
  const Eigen::MatrixXd pose = ReadRows(a.pose, 0);
  const Eigen::Index n = pose.rows(), k = model.NumJoints();
  const bool per_joint = io::ReadNpy(a.pose).shape.size() == 3;
  const Eigen::Index wanted = per_joint ? 3 * k : model::NumPoseValues(model);
  Require(pose.cols() == wanted,
          fmt::format("{}: holds {} pose values a foot, the model has {}", a.pose, pose.cols(), wanted));
  const Eigen::MatrixXd betas = ReadRows(a.betas, n);
  Require(betas.cols() <= model.NumBetas(), fmt::format("{}: holds {} shape coefficients a foot, the model has {}", a.betas,
                                                        betas.cols(), model.NumBetas()));
  const Eigen::MatrixXd moves = a.translation.empty() ? Eigen::MatrixXd::Zero(n, 3) : ReadRows(a.translation, n);
  Require(moves.cols() == 3, fmt::format("{}: holds {} columns, expected 3", a.translation, moves.cols()));
  const Eigen::MatrixXd contact = a.contact.empty() ? Eigen::MatrixXd(n, 0) : ReadRows(a.contact, n);
  Require(a.contact.empty() || contact.cols() == model.NumVertices(),
          fmt::format("{}: holds contact of {} vertices, the model has {}", a.contact, contact.cols(), model.NumVertices()));
  std::vector<model::ModelParameters> feet(static_cast<std::size_t>(n));
  for (Eigen::Index i = 0; i < n; ++i) {
    const RowMatrix row = pose.row(i);
    feet[static_cast<std::size_t>(i)] = {
        per_joint ? Eigen::MatrixX3d(Eigen::Map<const RowMatrix>(row.data(), k, 3)) : model::ThetaFrom(model, row.transpose()),
        betas.row(i), moves.row(i), contact.row(i)};
  }
  return feet;
}

/// n rows of `count` points as (n, count, 3).
void WritePoints(const std::string& path, const RowMatrix& rows, Eigen::Index count) {
  io::WriteNpy(path, io::Reshaped(io::NpyFrom(rows), {static_cast<std::size_t>(rows.rows()), static_cast<std::size_t>(count), 3}));
}

void PoseCommand(const Arguments& a) {
  const model::FootModel model = model::LoadAnyModel(a.file);
  const auto variant = a.fine ? model::Variant::kFine : model::Variant::kCoarse;
  const std::vector<model::ModelParameters> feet = ReadParameters(a, model);
  const auto n = static_cast<Eigen::Index>(feet.size());
  const Eigen::Index vertices = model::SurfaceOf(model, variant).NumVertices(), joints = model.NumJoints();
  RowMatrix posed(n, 3 * vertices), centres(n, 3 * joints);
  const auto evaluate = [&](const auto& batch) {
    posed = batch.vertices_m.transpose().template cast<double>();
    centres = batch.joints_m.transpose().template cast<double>();
  };
  if (a.single)
    evaluate(model::ForwardBatch(model::PrepareBatch<float>(model, variant), feet));
  else
    evaluate(model::ForwardBatch(model::PrepareBatch<double>(model, variant), feet));
  WritePoints(a.out, posed, vertices);
  if (!a.joints.empty()) WritePoints(a.joints, centres, joints);
}

model::SaveModelOptions SaveOptions(const Arguments& a) { return {.single_precision = a.single}; }

void ConvertCommand(const Arguments& a) {
  model::FootModel model = model::LoadAnyModel(a.file);
  if (!a.side.empty()) model.side = a.side == "left" ? Side::kLeft : Side::kRight;
  if (!a.licence.empty()) model.licence = a.licence;
  model::SaveModel(a.out, model, SaveOptions(a));
}

void SeparateCommand(const Arguments& a) {
  const model::FootModel model = model::LoadAnyModel(a.file);
  const std::vector<int> vertices = io::IntsFrom({{a.vertices, io::ReadNpy(a.vertices)}}, a.vertices);
  const model::SeparatedPart part = model::SeparatePart(model, vertices);
  model::SaveModel(a.out, part.model, SaveOptions(a));
  fmt::print("joints kept   {} of {}: {}\n", part.joints.size(), model.NumJoints(), fmt::join(part.joints, ", "));
  fmt::print("joint error   {:.3g} mm a standard deviation of shape\n", 1000 * part.joint_error_m);
}

}  // namespace

void AddModelCommands(CLI::App& app, CommonOptions& common, int& status) {
  const auto a = std::make_shared<Arguments>();
  CLI::App* model = app.add_subcommand("model", "Foot models, ours and released SUPR, STAR, SMPL, MANO and FLAME files");
  model->require_subcommand(1);
  const auto add = [&](const std::string& name, const std::string& description, const std::string& example,
                       const std::function<void()>& body) {
    CLI::App* command = model->add_subcommand(name, description);
    command->footer("Example: sole model " + example);
    command->add_option(name == "info" || name == "convert" ? "FILE" : "MODEL", a->file, "Model file of any family")->required();
    command->callback([body, &common, &status] {
      const ThreadCap cap(common.threads);
      body();
      status = 0;
    });
    return command;
  };

  add("info", "Prints family, sizes, joints and licence", "info models/sole-foot.npz",
      [a] { fmt::print("{}\n", fmt::join(model::DescribeModel(model::LoadAnyModel(a->file)), "\n")); });

  CLI::App* convert = add("convert", "Writes any model as ours, which numpy opens directly",
                          "convert supr_right_foot.npy --out supr-right-foot.npz", [a] { ConvertCommand(*a); });
  convert->add_option("--out", a->out, "Model file to write")->required();
  convert->add_option("--side", a->side, "Which foot it is; default: as the file says, else right")
      ->check(CLI::IsMember({"left", "right"}));
  convert->add_option("--licence", a->licence, "Terms of use to note in the file");
  convert->add_flag("--single", a->single, "float32 in place of float64");

  CLI::App* pose = add("pose", "Vertices and joints of a batch of poses",
                       "pose models/sole-foot.npz --pose P.npy --betas B.npy --out V.npy", [a] { PoseCommand(*a); });
  pose->add_option("--pose", a->pose, "(n, K, 3) axis-angle, rad; or (n, P) flat values, which hinges need fewer of")->required();
  pose->add_option("--betas", a->betas, "(n, B) shape coefficients; one row serves all")->required();
  pose->add_option("--trans", a->translation, "(n, 3) translations, m");
  pose->add_option("--contact", a->contact, "(n, N) contact of the vertices, 0 to 1");
  pose->add_option("--out", a->out, "Vertices to write, (n, N, 3), m")->required();
  pose->add_option("--joints", a->joints, "Posed joints to write, (n, K, 3), m");
  pose->add_flag("--fine", a->fine, "Vertices of the fine variant");
  pose->add_flag("--single", a->single, "Evaluates in float32, right to 0.001 mm");

  CLI::App* separate = add("separate", "Cuts a body part out of a model, with the joints that move it",
                           "separate supr.npy --vertices foot-vertices.npy --out foot.npz", [a] { SeparateCommand(*a); });
  separate->add_option("--vertices", a->vertices, "Numbers of its vertices")->required();
  separate->add_option("--out", a->out, "Model file to write")->required();
  separate->add_flag("--single", a->single, "float32 in place of float64");
}

}  // namespace sole::app
