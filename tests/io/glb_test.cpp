#include "io/glb.h"

#include <cmath>

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

// What the files hold is checked by a foreign reader: foreign_glb.py.

MeshAnimation Triangle() {
  MeshAnimation animation;
  animation.triangles = {{0, 1, 2}};
  animation.frames = {Eigen::Matrix3d::Identity(), 2 * Eigen::Matrix3d::Identity()};
  return animation;
}

TEST(WriteGlb, WritesTheSameBytesTwice) {
  const TempDir dir;
  WriteGlb(dir / "a.glb", Triangle());
  WriteGlb(dir / "b.glb", Triangle());
  EXPECT_EQ(ReadFile(dir / "a.glb"), ReadFile(dir / "b.glb"));
}

TEST(WriteGlb, RefusesWhatNoViewerCouldShow) {
  const TempDir dir;
  const auto writing = [&](auto change) {
    MeshAnimation animation = Triangle();
    change(animation);
    return ErrorOf([&] { WriteGlb(dir / "a.glb", animation); });
  };
  EXPECT_THAT(writing([](MeshAnimation& a) { a.frames.clear(); }),
              HasSubstr("a.glb: nothing to write"));
  EXPECT_THAT(writing([](MeshAnimation& a) { a.triangles.clear(); }),
              HasSubstr("a.glb: nothing to write"));
  EXPECT_THAT(writing([](MeshAnimation& a) { a.frames[1](0, 0) = std::nan(""); }),
              HasSubstr("not finite"));
  EXPECT_THAT(writing([](MeshAnimation& a) { a.frames[1].conservativeResize(2, 3); }),
              HasSubstr("frames differ"));
  EXPECT_THAT(writing([](MeshAnimation& a) { a.triangles[0][1] = 3; }),
              HasSubstr("does not exist"));
  EXPECT_THAT(writing([](MeshAnimation& a) { a.rate_hz = 0; }), HasSubstr("frame rate"));
  EXPECT_THAT(writing([](MeshAnimation& a) { a.colours.resize(2); }),
              HasSubstr("one colour per vertex"));
}

}  // namespace
}  // namespace sole::io
