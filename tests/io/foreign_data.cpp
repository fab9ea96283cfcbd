// Helper of the foreign-reader tests: writes files for other programs to read, and prints what Sole
// reads from theirs. Not a test itself.
#include <cstdio>
#include <limits>
#include <string>

#include "core/error.h"
#include "io/glb.h"
#include "io/mesh_file.h"
#include "io/npz.h"
#include "io/take.h"

namespace sole::io {
namespace {

namespace fs = std::filesystem;

/// Values that Python computes the same way: k / 8 - 3, exact in float.
double Value(Eigen::Index k) { return static_cast<double>(k) / 8 - 3; }

void WriteArrays(const fs::path& folder) {
  Eigen::MatrixXd matrix(4, 6);
  for (Eigen::Index k = 0; k < 24; ++k) matrix(k / 6, k % 6) = Value(k);
  Eigen::MatrixXi integers(2, 3);
  integers << 1, -2, 3, -4, 5, std::numeric_limits<int>::max();
  WriteNpy(folder / "matrix.npy", NpyFrom(matrix));
  WriteNpz(folder / "arrays.npz",
           {{"matrix", NpyFrom(matrix)},
            {"cube", Reshaped(NpyFrom(matrix), {4, 2, 3})},
            {"integers", NpyFrom(integers)},
            {"long", NpyFrom(std::vector<std::int64_t>{1, -(std::int64_t{1} << 40)})},
            {"bits", NpyFrom(std::vector<std::uint8_t>(5000, 1))},
            {"nan", NpyFrom(std::vector<double>{std::numeric_limits<double>::quiet_NaN()})},
            {"empty", Reshaped(NpyFrom(std::vector<double>{}), {0, 3})},
            {"scalar", Reshaped(NpyFrom(std::vector<int>{7}), {})},
            {"text", NpyFrom(std::string("Größe \U0001F9B6"))},
            {"texts", NpyFrom(std::vector<std::string>{"right", "", "left"})}});
}

FitSequence SomeFit() {
  FitSequence fit;
  fit.beta = fit.beta_sd = Eigen::Vector3d(1, 2, 3);
  fit.frames.resize(2);
  FrameFit& frame = fit.frames[0];
  frame.trigger = 4;
  frame.found = true;
  frame.side = Side::kLeft;
  frame.verdict = "good";
  frame.theta = frame.theta_sd = Eigen::MatrixX3d::Constant(2, 3, 0.5);
  frame.vertices_m = frame.registration_m = Eigen::MatrixX3d::Zero(5, 3);
  frame.vertices_m(4, 1) = 0.25;
  frame.registration_fine_m = Eigen::MatrixX3d::Ones(9, 3);
  frame.vertex_sd_m = Eigen::VectorXd::Ones(5);
  fit.frames[1].trigger = 5;
  fit.frames[1].verdict = "no foot";
  return fit;
}

TriangleMesh SomeMesh() {
  return {{{0, 0, 0}, {0.125, 0, 0}, {0, 0.25, 0}, {0, 0, 0.5}},
          {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}}};
}

void WriteMeshes(const fs::path& folder) {
  WritePly(folder / "mesh.ply", SomeMesh());
  WriteObj(folder / "mesh.obj", SomeMesh());
  WriteStl(folder / "mesh.stl", SomeMesh());
  PointCloud cloud;
  for (int i = 0; i < 10; ++i) {
    const auto x = static_cast<float>(Value(i));
    cloud.points_m.emplace_back(x, 2 * x, -x);
    cloud.normals.emplace_back(0, 0, 1);
    cloud.sigma_m.push_back(0.5F);
    cloud.intensity.push_back(static_cast<float>(10 * i));
    cloud.pair.push_back(static_cast<std::uint8_t>(i));
  }
  WritePly(folder / "cloud.ply", cloud);
}

void WriteGlbs(const fs::path& folder) {
  MeshAnimation animation;
  const TriangleMesh mesh = SomeMesh();
  animation.triangles = mesh.triangles;
  Eigen::MatrixX3d frame(5, 3);  // vertex 4 belongs to no triangle
  for (Eigen::Index i = 0; i < 4; ++i)
    frame.row(i) = mesh.vertices[static_cast<std::size_t>(i)].transpose();
  frame.row(4) << 1, 2, 3;
  animation.frames = {frame};
  WriteGlb(folder / "still.glb", animation);
  for (int f = 1; f < 4; ++f) animation.frames.emplace_back(frame * (1 + 0.1 * f));
  WriteGlb(folder / "moving.glb", animation);
  animation.colours.assign(5, Eigen::Vector3f(0.25F, 0.5F, 1));
  WriteGlb(folder / "coloured.glb", animation);
}

/// One line per array: name, dtype, shape, values.
void PrintArrays(const Npz& npz) {
  for (const auto& [name, array] : npz) {
    std::printf("%s\t%s\t", name.c_str(), array.dtype.c_str());
    for (const std::size_t n : array.shape) std::printf("%zu ", n);
    std::printf("\t");
    if (array.dtype.starts_with("<U")) {
      for (const std::string& text : StringsFrom(npz, name)) std::printf("%s|", text.c_str());
    } else {
      const Eigen::MatrixXd matrix = MatrixFrom(npz, name);
      for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
        for (Eigen::Index j = 0; j < matrix.cols(); ++j) std::printf("%.17g ", matrix(i, j));
      }
    }
    std::printf("\n");
  }
}

void PrintMesh(const TriangleMesh& mesh) {
  for (const Eigen::Vector3d& v : mesh.vertices)
    std::printf("v %.17g %.17g %.17g\n", v.x(), v.y(), v.z());
  for (const Eigen::Vector3i& t : mesh.triangles) std::printf("f %d %d %d\n", t[0], t[1], t[2]);
}

}  // namespace

int Main(const std::string& action, const fs::path& path) {
  if (action == "write") {
    WriteArrays(path);
    WriteFit(path / "fit.npz", SomeFit());
    WriteMeshes(path);
    WriteGlbs(path);
  } else if (action == "print-npz") {
    PrintArrays(ReadNpz(path));
  } else if (action == "print-npy") {
    PrintArrays({{"array", ReadNpy(path)}});
  } else if (action == "print-ply") {
    PrintMesh(ReadPlyMesh(path));
  } else {
    return 2;
  }
  return 0;
}

}  // namespace sole::io

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  try {
    return sole::io::Main(argv[1], argv[2]);
  } catch (const sole::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
