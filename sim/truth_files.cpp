#include "sim/truth_files.h"

#include <algorithm>
#include <cstring>

#include "core/error.h"
#include "io/atomic_file.h"
#include "io/mesh_file.h"
#include "io/npz.h"

namespace sole::sim {
namespace {

void Check(const TakeTruth& truth) {
  for (const TruthFrame& frame : truth.frames) {
    const std::string where = "truth of trigger " + std::to_string(frame.trigger) + ": ";
    const std::size_t vertices = truth.frames.front().mesh.vertices.size();
    Require(frame.mesh.vertices.size() == vertices,
            where + "the mesh has another number of vertices");
    Require(frame.contact.size() == vertices && frame.pressure_pa.size() == vertices &&
                frame.penetration_m.size() == vertices,
            where + "contact, pressure and penetration need one value per vertex");
    Require(frame.visible.size() == truth.pairs.size(),
            where + "visibility needs one row per pair");
    for (const std::vector<std::uint8_t>& row : frame.visible) {
      Require(row.size() == vertices, where + "visibility needs one value per vertex");
    }
    Require(frame.world_from_bone.size() == truth.bones.size(),
            where + "one motion per bone is needed");
  }
}

io::NpyArray Bytes(const TakeTruth& truth, const std::vector<std::uint8_t> TruthFrame::*member) {
  io::NpyArray array{"|u1", {truth.frames.size(), truth.frames.front().mesh.vertices.size()}, {}};
  for (const TruthFrame& frame : truth.frames) {
    const std::vector<std::uint8_t>& values = frame.*member;
    array.bytes.insert(array.bytes.end(), values.begin(), values.end());
  }
  return array;
}

io::NpyArray Floats(const TakeTruth& truth, const std::vector<double> TruthFrame::*member) {
  std::vector<float> values;
  for (const TruthFrame& frame : truth.frames) {
    for (const double value : frame.*member) values.push_back(static_cast<float>(value));
  }
  io::NpyArray array{"<f4",
                     {truth.frames.size(), truth.frames.front().mesh.vertices.size()},
                     std::vector<std::uint8_t>(values.size() * sizeof(float))};
  if (!values.empty()) std::memcpy(array.bytes.data(), values.data(), array.bytes.size());
  return array;
}

io::NpyArray Visible(const TakeTruth& truth) {
  io::NpyArray array{
      "|u1",
      {truth.frames.size(), truth.pairs.size(), truth.frames.front().mesh.vertices.size()},
      {}};
  for (const TruthFrame& frame : truth.frames) {
    for (const std::vector<std::uint8_t>& row : frame.visible) {
      array.bytes.insert(array.bytes.end(), row.begin(), row.end());
    }
  }
  return array;
}

/// The sagged glass of every frame, where there is one.
void AddSag(const TakeTruth& truth, io::Npz& npz) {
  const auto bent = std::find_if(truth.frames.begin(), truth.frames.end(),
                                 [](const TruthFrame& frame) { return !frame.plate_sag.down_m.empty(); });
  std::vector<double> middle;
  for (const TruthFrame& frame : truth.frames) middle.push_back(frame.plate_sag.At(0, 0));
  npz["plate_sag_m"] = io::NpyFrom(middle);
  if (bent == truth.frames.end()) return;
  const PlateSag& grid = bent->plate_sag;
  const std::size_t nodes = grid.down_m.size();
  io::NpyArray array{"<f4",
                     {truth.frames.size(), static_cast<std::size_t>(grid.nodes_y), static_cast<std::size_t>(grid.nodes_x)},
                     {}};
  std::vector<float> values;
  for (const TruthFrame& frame : truth.frames) {
    const std::vector<double>& down_m = frame.plate_sag.down_m;
    Require(down_m.empty() || down_m.size() == nodes,
            "truth of trigger " + std::to_string(frame.trigger) + ": the sag has another grid");
    for (std::size_t i = 0; i < nodes; ++i) values.push_back(down_m.empty() ? 0.0f : static_cast<float>(down_m[i]));
  }
  array.bytes.resize(values.size() * sizeof(float));
  std::memcpy(array.bytes.data(), values.data(), array.bytes.size());
  npz["plate_sag_grid_m"] = array;
  const auto along = [](double size_m, int count) {
    std::vector<double> at;
    for (int i = 0; i < count; ++i) at.push_back((static_cast<double>(i) / (count - 1) - 0.5) * size_m);
    return at;
  };
  npz["plate_sag_x_m"] = io::NpyFrom(along(grid.size_x_m, grid.nodes_x));
  npz["plate_sag_y_m"] = io::NpyFrom(along(grid.size_y_m, grid.nodes_y));
}

io::NpyArray BoneMotions(const TakeTruth& truth) {
  std::vector<double> values;
  for (const TruthFrame& frame : truth.frames) {
    for (const Rigid3& motion : frame.world_from_bone) {
      const Eigen::Quaterniond& q = motion.rotation;
      values.insert(values.end(), {q.w(), q.x(), q.y(), q.z()});
      for (int i = 0; i < 3; ++i) values.push_back(motion.translation[i]);
    }
  }
  return io::Reshaped(io::NpyFrom(values), {truth.frames.size(), truth.bones.size(), 7});
}

}  // namespace

void WriteTruth(const io::TakePaths& take, const TakeTruth& truth) {
  Require(!truth.frames.empty(), "truth of " + take.root.string() + ": no frames to write");
  Check(truth);
  io::MakeDirectory(take.TruthMesh(1).parent_path());
  std::vector<int> triggers;
  std::vector<double> load_n;
  for (const TruthFrame& frame : truth.frames) {
    io::WritePly(take.TruthMesh(frame.trigger), frame.mesh);
    triggers.push_back(static_cast<int>(frame.trigger));
    load_n.push_back(frame.load_n);
  }
  io::Npz npz;
  npz["format_version"] = io::Reshaped(io::NpyFrom(std::vector<int>{1}), {});
  npz["side"] = io::NpyFrom(std::string(truth.side == Side::kLeft ? "left" : "right"));
  npz["frames"] = io::NpyFrom(triggers);
  npz["contact"] = Bytes(truth, &TruthFrame::contact);
  npz["pressure_pa"] = Floats(truth, &TruthFrame::pressure_pa);
  npz["penetration_m"] = Floats(truth, &TruthFrame::penetration_m);
  npz["load_n"] = io::NpyFrom(load_n);
  AddSag(truth, npz);
  npz["pair"] = io::NpyFrom(truth.pairs);
  npz["visible"] = Visible(truth);
  if (!truth.bones.empty()) {
    npz["bone"] = io::NpyFrom(truth.bones);
    npz["world_from_bone"] = BoneMotions(truth);
  }
  for (const auto& [name, value] : truth.measures_mm) {
    npz["measure_" + name] = io::Reshaped(io::NpyFrom(std::vector<double>{value}), {});
  }
  io::WriteNpz(take.Truth(), npz);
}

}  // namespace sole::sim
