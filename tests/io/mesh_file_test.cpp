#include "io/mesh_file.h"

#include <cstring>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/atomic_file.h"
#include "tests/support/error_matcher.h"
#include "tests/support/temp_dir.h"

namespace sole::io {
namespace {

using testing::HasSubstr;
using testing_support::ErrorOf;
using testing_support::TempDir;

TriangleMesh Tetrahedron() {
  return {{{0, 0, 0}, {0.1, 0, 0}, {0, 0.2, 0}, {0, 0, 0.3}},
          {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}}};
}

TEST(PlyCloud, RoundTripsEveryProperty) {
  const TempDir dir;
  PointCloud cloud;
  for (int i = 0; i < 100; ++i) {
    cloud.points_m.emplace_back(Eigen::Vector3f::Random());
    cloud.normals.emplace_back(Eigen::Vector3f::Random().normalized());
    cloud.sigma_m.push_back(1e-5F * static_cast<float>(i));
    cloud.intensity.push_back(static_cast<float>(i));
    cloud.pair.push_back(static_cast<std::uint8_t>(i * 2));
  }
  WritePly(dir / "a.ply", cloud);
  const PointCloud read = ReadPlyCloud(dir / "a.ply");
  EXPECT_EQ(read.points_m, cloud.points_m);
  EXPECT_EQ(read.normals, cloud.normals);
  EXPECT_EQ(read.sigma_m, cloud.sigma_m);
  EXPECT_EQ(read.intensity, cloud.intensity);
  EXPECT_EQ(read.pair, cloud.pair);
}

TEST(PlyCloud, AbsentPropertiesStayAbsent) {
  const TempDir dir;
  PointCloud cloud;
  cloud.points_m = {{1, 2, 3}, {4, 5, 6}};
  cloud.pair = {7, 8};
  WritePly(dir / "a.ply", cloud);
  const PointCloud read = ReadPlyCloud(dir / "a.ply");
  EXPECT_EQ(read.points_m, cloud.points_m);
  EXPECT_EQ(read.pair, cloud.pair);
  EXPECT_TRUE(read.normals.empty());
  EXPECT_TRUE(read.sigma_m.empty());
  WritePly(dir / "b.ply", PointCloud{});
  EXPECT_EQ(ReadPlyCloud(dir / "b.ply").Size(), 0U);
}

TEST(PlyMesh, RoundTripsToFloatPrecision) {
  const TempDir dir;
  WritePly(dir / "a.ply", Tetrahedron());
  const TriangleMesh read = ReadPlyMesh(dir / "a.ply");
  EXPECT_EQ(read.triangles, Tetrahedron().triangles);
  ASSERT_EQ(read.vertices.size(), 4U);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(read.vertices[i].cast<float>(), Tetrahedron().vertices[i].cast<float>());
  }
}

TEST(ReadPlyMesh, ReadsAsciiOfOtherProgramsAndSplitsQuads) {
  const TempDir dir;
  WriteStringAtomically(
      dir / "a.ply",
      "ply\r\nformat ascii 1.0\r\ncomment made by hand\r\nelement vertex 4\r\n"
      "property uchar red\r\nproperty double x\r\nproperty double y\r\nproperty double z\r\n"
      "element edge 1\r\nproperty int a\r\nproperty int b\r\n"
      "element face 1\r\nproperty list uchar uint vertex_index\r\nproperty float "
      "quality\r\nend_header\r\n"
      "255 0 0 0\r\n0 1e0 0 0\r\n1 1 1 -0.5\r\n2 0 1 0\r\n3 4\r\n4 0 1 2 3 0.5\r\n");
  const TriangleMesh mesh = ReadPlyMesh(dir / "a.ply");
  ASSERT_EQ(mesh.vertices.size(), 4U);
  EXPECT_EQ(mesh.vertices[2], Eigen::Vector3d(1, 1, -0.5));
  EXPECT_EQ(mesh.triangles, (std::vector<Eigen::Vector3i>{{0, 1, 2}, {0, 2, 3}}));
}

TEST(ReadPlyCloud, ReadsBigEndian) {
  const TempDir dir;
  WriteStringAtomically(
      dir / "a.ply",
      std::string("ply\nformat binary_big_endian 1.0\nelement vertex 1\nproperty float x\n"
                  "property short y\nproperty uchar z\nend_header\n") +
          std::string("\x3f\xc0\x00\x00\xff\xfe\x07", 7));
  EXPECT_EQ(ReadPlyCloud(dir / "a.ply").points_m.at(0), Eigen::Vector3f(1.5F, -2, 7));
}

TEST(ReadPly, NamesWhatIsWrong) {
  const TempDir dir;
  const std::string head = "ply\nformat ascii 1.0\nelement vertex ";
  const std::string xyz = "\nproperty float x\nproperty float y\nproperty float z\n";
  const std::string faces = "element face 1\nproperty list uchar int vertex_indices\n";
  const auto reading = [&](const std::string& text) {
    WriteStringAtomically(dir / "a.ply", text);
    return ErrorOf([&] { ReadPlyMesh(dir / "a.ply"); });
  };
  EXPECT_THAT(reading("obj"), HasSubstr("a.ply: is not a PLY file"));
  EXPECT_THAT(reading(head + "999999999999" + xyz + "end_header\n0 0 0\n"),
              HasSubstr("more than the file can hold"));
  EXPECT_THAT(reading(head + "2" + xyz + "end_header\n0 0 0\n"), HasSubstr("a.ply:"));
  EXPECT_THAT(reading(head + "1" + xyz + "end_header\n0 0 0\n"),
              HasSubstr("holds points but no faces"));
  EXPECT_THAT(reading(head + "1" + xyz + faces + "end_header\n0 0 0\n3 0 0 7\n"),
              HasSubstr("names vertex 7 of 1"));
  EXPECT_THAT(reading(head + "1" + xyz + faces + "end_header\n0 0 x\n3 0 0 0\n"),
              HasSubstr("not a number"));
  EXPECT_THAT(reading(head + "1" + xyz + faces + "end_header\n0 0 0\n99 0 0 0\n"),
              HasSubstr("longer than the file"));
  EXPECT_THAT(reading(head + "1\nproperty float64x x\n"),
              HasSubstr("a.ply:4: unknown PLY type 'float64x'"));
  EXPECT_THAT(reading(head + "1\nproperty float u\nend_header\n0\n"),
              HasSubstr("no vertices with x, y and z"));
  EXPECT_THAT(reading(head + "1" + xyz), HasSubstr("header has no end"));
}

TEST(WriteObj, CountsFromOneAndKeepsEveryDigit) {
  const TempDir dir;
  TriangleMesh mesh = Tetrahedron();
  mesh.vertices[3].z() = 1.0 / 3;
  WriteObj(dir / "a.obj", mesh);
  std::istringstream lines(ReadFile(dir / "a.obj"));
  std::string line, vertices, faces;
  while (std::getline(lines, line)) (line[0] == 'v' ? vertices : faces) += line + "|";
  EXPECT_THAT(vertices, HasSubstr("v 0 0 0.3333333333333333|"));
  EXPECT_THAT(faces, HasSubstr("f 1 3 2|f 1 2 4|f 1 4 3|f 2 3 4|"));
}

TEST(WriteStl, IsInMillimetresWithOutwardNormals) {
  const TempDir dir;
  WriteStl(dir / "a.stl", Tetrahedron());
  const std::string bytes = ReadFile(dir / "a.stl");
  ASSERT_EQ(bytes.size(), 84U + 4 * 50);
  EXPECT_FALSE(bytes.starts_with("solid"));  // that would mean ASCII
  float values[12];
  std::memcpy(values, &bytes[84], sizeof values);
  EXPECT_EQ(values[2], -1);   // first triangle faces down
  EXPECT_EQ(values[7], 200);  // its second corner is vertex 2
  EXPECT_EQ(values[9], 100);  // its third is vertex 1
}

TEST(WriteMesh, RefusesTrianglesOutOfRange) {
  const TempDir dir;
  TriangleMesh mesh = Tetrahedron();
  mesh.triangles[1][2] = 4;
  EXPECT_THAT(ErrorOf([&] { WritePly(dir / "a.ply", mesh); }),
              HasSubstr("a.ply: a triangle names a vertex"));
  EXPECT_THAT(ErrorOf([&] { WriteStl(dir / "a.stl", mesh); }), HasSubstr("a.stl"));
  EXPECT_THAT(ErrorOf([&] { WriteObj(dir / "a.obj", mesh); }), HasSubstr("a.obj"));
}

}  // namespace
}  // namespace sole::io
