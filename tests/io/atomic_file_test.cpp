#include "io/atomic_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/mesh_file.h"
#include "io/npz.h"
#include "tests/support/error_matcher.h"
#include "tests/support/file_size_limit.h"
#include "tests/support/temp_dir.h"

namespace sole::io {
namespace {

using testing::HasSubstr;
using testing_support::ErrorOf;
using testing_support::FileSizeLimit;
using testing_support::TempDir;

std::size_t FilesIn(const std::filesystem::path& folder) {
  return static_cast<std::size_t>(std::distance(std::filesystem::directory_iterator(folder),
                                                std::filesystem::directory_iterator()));
}

TEST(WriteAtomically, AFullDiskLeavesTheEarlierFileAndNothingElse) {
  const TempDir dir;
  WriteStringAtomically(dir / "a", "earlier");
  {
    const FileSizeLimit limit(1000);
    const std::string large(100000, 'x');
    EXPECT_THAT(ErrorOf([&] { WriteStringAtomically(dir / "a", large); }),
                HasSubstr("cannot write " + (dir / "a").string()));
    EXPECT_THAT(ErrorOf([&] {
                  WriteNpz(dir / "b.npz", {{"a", NpyFrom(Eigen::MatrixXd::Random(100, 100))}});
                }),
                HasSubstr("b.npz"));
    PointCloud cloud;
    cloud.points_m.resize(1000, Eigen::Vector3f::Zero());
    EXPECT_THAT(ErrorOf([&] { WritePly(dir / "c.ply", cloud); }), HasSubstr("c.ply"));
  }
  EXPECT_EQ(ReadFile(dir / "a"), "earlier");
  EXPECT_EQ(FilesIn(dir.Path()), 1U);
}

TEST(WriteAtomically, AnExceptionInTheWriterLeavesNothing) {
  const TempDir dir;
  EXPECT_EQ(ErrorOf([&] {
              WriteAtomically(dir / "a", [](const std::filesystem::path& temporary) {
                WriteStringAtomically(temporary, "half");
                throw Error("no more");
              });
            }),
            "no more");
  EXPECT_EQ(FilesIn(dir.Path()), 0U);
}

TEST(WriteAtomically, AFolderThatCannotBeWrittenIsNamed) {
  const TempDir dir;
  WriteStringAtomically(dir / "file", "x");
  const std::filesystem::path inside = dir / "file" / "a.txt";
  EXPECT_THAT(ErrorOf([&] { WriteStringAtomically(inside, "y"); }),
              HasSubstr("cannot write " + inside.string() + ": Not a directory"));
  EXPECT_THAT(ErrorOf([&] { WriteStringAtomically(dir / "absent" / "a.txt", "y"); }),
              HasSubstr("No such file or directory"));
  EXPECT_THAT(ErrorOf([&] { MakeDirectory(inside); }),
              HasSubstr("cannot create folder " + inside.string()));
  EXPECT_THAT(ErrorOf([&] { MakeDirectory(dir / "file"); }), HasSubstr("cannot create folder"));
}

TEST(ReadFile, SaysWhyItCannot) {
  const TempDir dir;
  EXPECT_THAT(ErrorOf([&] { ReadFile(dir / "none"); }),
              HasSubstr("none: No such file or directory"));
  EXPECT_THAT(ErrorOf([&] { ReadFile(dir.Path()); }), HasSubstr("it is a folder"));
  WriteStringAtomically(dir / "empty", "");
  EXPECT_EQ(ReadFile(dir / "empty"), "");
}

}  // namespace
}  // namespace sole::io
