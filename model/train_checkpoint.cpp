#include "model/train_checkpoint.h"

#include <cstdint>
#include <vector>

#include "core/error.h"
#include "io/npz.h"

namespace sole::model {
namespace {

constexpr char kFormat[] = "sole-network-training";
constexpr double kVersion = 1;

Eigen::VectorXf FloatsFrom(const io::Npz& npz, const std::string& name) {
  return io::MatrixFrom(npz, name).reshaped().cast<float>();
}

std::vector<double> NumbersFrom(const io::Npz& npz, const std::string& name) {
  const Eigen::MatrixXd read = io::MatrixFrom(npz, name);
  return {read.data(), read.data() + read.size()};
}

}  // namespace

void SaveNetworkTraining(const std::filesystem::path& path, const NetworkTraining& t,
                         const std::string& origin) {
  std::vector<std::int64_t> widths(t.network.widths.begin(), t.network.widths.end());
  io::WriteNpz(path,
               {{"format", io::NpyFrom(std::string(kFormat))},
                {"version", io::NpyFrom(std::vector<int>{1})},
                {"origin", io::NpyFrom(origin)},
                {"widths", io::NpyFrom(widths)},
                {"parameters", io::NpyFrom(t.network.parameters.cast<double>())},
                {"first_moment", io::NpyFrom(t.first_moment.cast<double>())},
                {"second_moment", io::NpyFrom(t.second_moment.cast<double>())},
                {"best", io::NpyFrom(t.best.cast<double>())},
                {"input_mean", io::NpyFrom(t.input_mean)},
                {"input_scale", io::NpyFrom(t.input_scale)},
                {"train_mm", io::NpyFrom(t.train_mm)},
                {"validation_mm", io::NpyFrom(t.validation_mm)},
                {"state", io::NpyFrom(std::vector<double>{
                              t.value_scale_m, static_cast<double>(t.steps),
                              static_cast<double>(t.epoch), static_cast<double>(t.since_best),
                              static_cast<double>(t.since_lowered), t.rate, t.best_mm,
                              t.finished ? 1.0 : 0.0})}});
}

NetworkTraining LoadNetworkTraining(const std::filesystem::path& path, const std::string& origin) {
  const io::Npz npz = io::ReadNpz(path);
  try {
    Require(io::StringFrom(npz, "format") == kFormat &&
                io::MatrixFrom(npz, "version").size() == 1 &&
                io::MatrixFrom(npz, "version")(0, 0) == kVersion,
            "not a training that this version goes on with");
    Require(io::StringFrom(npz, "origin") == origin,
            "made with another configuration or other data: remove it to begin anew");
    NetworkTraining t;
    for (const double width : NumbersFrom(npz, "widths")) {
      Require(width >= 1 && width <= 1e6, "damaged: a layer's width");
      t.network.widths.push_back(static_cast<Eigen::Index>(width));
    }
    t.network.parameters = FloatsFrom(npz, "parameters");
    t.first_moment = FloatsFrom(npz, "first_moment");
    t.second_moment = FloatsFrom(npz, "second_moment");
    t.best = FloatsFrom(npz, "best");
    t.input_mean = io::MatrixFrom(npz, "input_mean").reshaped();
    t.input_scale = io::MatrixFrom(npz, "input_scale").reshaped();
    t.train_mm = NumbersFrom(npz, "train_mm");
    t.validation_mm = NumbersFrom(npz, "validation_mm");
    const std::vector<double> state = NumbersFrom(npz, "state");
    Require(t.network.widths.size() >= 2 && state.size() == 8, "damaged: sizes");
    const Eigen::Index count = NumParameters(t.network.widths);
    Require(t.network.parameters.size() == count && t.first_moment.size() == count &&
                t.second_moment.size() == count && t.best.size() == count &&
                t.input_mean.size() == t.network.widths[0] &&
                t.input_scale.size() == t.network.widths[0] &&
                t.train_mm.size() == t.validation_mm.size(),
            "damaged: sizes do not fit each other");
    t.value_scale_m = state[0];
    t.steps = static_cast<std::int64_t>(state[1]);
    t.epoch = static_cast<int>(state[2]);
    t.since_best = static_cast<int>(state[3]);
    t.since_lowered = static_cast<int>(state[4]);
    t.rate = state[5];
    t.best_mm = state[6];
    t.finished = state[7] != 0;
    return t;
  } catch (const Error& error) {
    throw Error(path.string() + ": " + error.what());
  }
}

}  // namespace sole::model
