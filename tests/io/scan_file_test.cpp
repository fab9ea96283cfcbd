#include "io/scan_file.h"

#include <cstring>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/atomic_file.h"
#include "io/mesh_file.h"
#include "tests/support/error_matcher.h"
#include "tests/support/meshes.h"
#include "tests/support/temp_dir.h"

namespace sole::io {
namespace {

using testing::HasSubstr;
using testing_support::ErrorOf;
using testing_support::TempDir;

/// The surface as a soup of corners, so that files of other vertex orders compare.
std::vector<Eigen::Vector3f> Corners(const TriangleMesh& mesh, double scale) {
  std::vector<Eigen::Vector3f> corners;
  for (const Eigen::Vector3i& t : mesh.triangles) {
    for (int k = 0; k < 3; ++k)
      corners.push_back((scale * mesh.vertices[static_cast<std::size_t>(t[k])]).cast<float>());
  }
  return corners;
}

TEST(ReadScanFile, EveryFormatGivesTheSameSurface) {
  const TempDir dir;
  const TriangleMesh mesh = testing_support::Ellipsoid({0.05, 0.12, 0.04}, 8, 12);
  WritePly(dir / "a.ply", mesh);
  WriteObj(dir / "a.OBJ", mesh);
  WriteStl(dir / "a.stl", mesh);  // millimetres
  EXPECT_EQ(Corners(ReadScanFile(dir / "a.ply").mesh, 1), Corners(mesh, 1));
  EXPECT_EQ(Corners(ReadScanFile(dir / "a.OBJ").mesh, 1), Corners(mesh, 1));
  const ScanFile stl = ReadScanFile(dir / "a.stl");
  EXPECT_EQ(Corners(stl.mesh, 1), Corners(mesh, 1000));
  EXPECT_EQ(stl.mesh.vertices.size(), mesh.vertices.size());  // welded
}

TEST(ReadScanFile, ObjOfOtherPrograms) {
  const TempDir dir;
  WriteStringAtomically(dir / "a.obj",
                        "# a quad\r\nmtllib x.mtl\r\no foot\r\nv 0 0 0 0.5 0.5 0.5\r\nv +1 0 0\r\nvn 0 0 1\r\nvt 0 0\r\n"
                        "v 1 1e0 0\r\nv 0 1 -2.5\r\nusemtl skin\r\nf 1/1/1 2//1 3/1 -1\r\n");
  const ScanFile scan = ReadScanFile(dir / "a.obj");
  ASSERT_EQ(scan.mesh.vertices.size(), 4U);
  EXPECT_EQ(scan.mesh.vertices[3], Eigen::Vector3d(0, 1, -2.5));
  EXPECT_EQ(scan.mesh.triangles, (std::vector<Eigen::Vector3i>{{0, 1, 2}, {0, 2, 3}}));
  EXPECT_TRUE(scan.normals.empty());
}

TEST(ReadScanFile, PointsAloneKeepTheirNormals) {
  const TempDir dir;
  PointCloud cloud;
  cloud.points_m = {{1, 2, 3}, {4, 5, 6}};
  cloud.normals = {{0, 0, 1}, {0, -1, 0}};
  WritePly(dir / "a.ply", cloud);
  WriteStringAtomically(dir / "a.obj", "v 1 2 3\nvn 0 0 1\nv 4 5 6\nvn 0 -1 0\n");
  for (const char* name : {"a.ply", "a.obj"}) {
    const ScanFile scan = ReadScanFile(dir / name);
    EXPECT_TRUE(scan.mesh.triangles.empty());
    EXPECT_EQ(scan.mesh.vertices, (std::vector<Eigen::Vector3d>{{1, 2, 3}, {4, 5, 6}}));
    EXPECT_EQ(scan.normals, (std::vector<Eigen::Vector3d>{{0, 0, 1}, {0, -1, 0}}));
  }
}

TEST(ReadScanFile, TextStlAndBinaryStlThatBeginsWithSolid) {
  const TempDir dir;
  WriteStringAtomically(dir / "text.stl",
                        "solid foot\nfacet normal 0 0 1\n outer loop\n  vertex 0 0 0\n  vertex 1 0 0\n  vertex 0 1 0\n"
                        " endloop\nendfacet\nfacet normal 0 0 1\n outer loop\n  vertex 1 0 0\n  vertex 1 1 0\n"
                        "  vertex 0 1 0\n endloop\nendfacet\nendsolid foot\n");
  const ScanFile text = ReadScanFile(dir / "text.stl");
  EXPECT_EQ(text.mesh.vertices.size(), 4U);
  EXPECT_EQ(text.mesh.triangles.size(), 2U);
  WriteStl(dir / "binary.stl", text.mesh);
  std::string bytes = ReadFile(dir / "binary.stl");
  bytes.replace(0, 5, "solid");
  WriteStringAtomically(dir / "binary.stl", bytes);
  EXPECT_EQ(Corners(ReadScanFile(dir / "binary.stl").mesh, 1), Corners(text.mesh, 1000));
}

TEST(ReadScanFile, NamesWhatIsWrong) {
  const TempDir dir;
  const auto reading = [&](const char* name, const std::string& text) {
    WriteStringAtomically(dir / name, text);
    return ErrorOf([&] { ReadScanFile(dir / name); });
  };
  EXPECT_THAT(reading("a.fbx", "x"), HasSubstr("a.fbx: scans are read from .ply, .obj and .stl files"));
  EXPECT_THAT(reading("a.obj", "# nothing\n"), HasSubstr("a.obj: holds no vertices"));
  EXPECT_THAT(reading("a.obj", "v 0 0 0\nv 1 x 0\n"), HasSubstr("a.obj:2: 'x' is not a number"));
  EXPECT_THAT(reading("a.obj", "v 0 0\n"), HasSubstr("a.obj:1: '' is not a number"));
  EXPECT_THAT(reading("a.obj", "v 0 0 0\nf 1 1 2\n"), HasSubstr("a.obj:2: a face names vertex 2 of 1"));
  EXPECT_THAT(reading("a.obj", "v 0 0 0\nf 1 -2 1\n"), HasSubstr("names vertex -2 of 1"));
  EXPECT_THAT(reading("a.obj", "v 0 0 0\nf 1 a 1\n"), HasSubstr("'a' is no corner of a face"));
  EXPECT_THAT(reading("a.stl", "short"), HasSubstr("shorter than the header"));
  EXPECT_THAT(reading("a.stl", std::string(80, ' ') + "\xff\xff\xff\x7f" + std::string(50, '\0')),
              HasSubstr("claims 2147483647 triangles, more than the file can hold"));
  EXPECT_THAT(reading("a.stl", "solid\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nendloop\n"),
              HasSubstr("a.stl:5: a triangle has 2 corners"));
  EXPECT_THAT(ErrorOf([&] { ReadScanFile(dir / "none.stl"); }), HasSubstr("none.stl"));
}

}  // namespace
}  // namespace sole::io
