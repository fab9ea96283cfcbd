#include "io/colmap_database.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sqlite3.h>

#include <cstring>
#include <filesystem>

#include "tests/support/error_matcher.h"
#include "tests/support/temp_dir.h"

namespace sole::io {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing_support::ErrorOf;
using testing_support::TempDir;

/// Values of a query, row after row; blobs as hexadecimal digits.
std::vector<std::string> Query(const std::filesystem::path& path, const std::string& sql) {
  sqlite3* database = nullptr;
  EXPECT_EQ(sqlite3_open_v2(path.c_str(), &database, SQLITE_OPEN_READONLY, nullptr), SQLITE_OK);
  std::vector<std::string> values;
  const auto add = [](void* list, int count, char** texts, char**) {
    for (int i = 0; i < count; ++i) static_cast<std::vector<std::string>*>(list)->emplace_back(texts[i] ? texts[i] : "NULL");
    return 0;
  };
  EXPECT_EQ(sqlite3_exec(database, sql.c_str(), add, &values, nullptr), SQLITE_OK) << sqlite3_errmsg(database);
  sqlite3_close(database);
  return values;
}

template <typename T>
std::string Hex(const std::vector<T>& values) {
  std::string hex(2 * sizeof(T) * values.size(), '0');
  const auto* bytes = reinterpret_cast<const unsigned char*>(values.data());
  for (std::size_t i = 0; i < hex.size(); ++i) hex[i] = "0123456789ABCDEF"[i % 2 == 0 ? bytes[i / 2] >> 4 : bytes[i / 2] & 15];
  return hex;
}

ColmapModel SomeProblem() {
  ColmapModel model;
  Camera camera;
  camera.width = 640;
  camera.height = 480;
  camera.intrinsics << 800, 801, 319.5, 239.5, -0.1, 0.2, 0.001, 0.002, 0;
  model.cameras = {camera, camera};
  model.images = {{"one/1.png", 0, {}, {{{1, 2}, 7}, {{3, 4}, 5}, {{5, 6}, -1}}},
                  {"two/1.png", 1, {}, {{{7, 8}, 5}, {{9, 10}, 6}, {{11, 12}, 7}}},
                  {"two/2.png", 1, {}, {{{13, 14}, 7}, {{15, 16}, -1}}}};
  return model;
}

TEST(ColmapDatabase, HoldsCamerasKeypointsAndMatches) {
  const TempDir folder;
  const auto path = folder / "database.db";
  WriteColmapDatabase(path, SomeProblem(), 2);
  EXPECT_THAT(Query(path, "SELECT camera_id, model, width, height, hex(params), prior_focal_length FROM cameras WHERE camera_id = 2"),
              ElementsAre("2", "4", "640", "480", Hex<double>({800, 801, 320, 240, -0.1, 0.2, 0.001, 0.002}), "1"));
  EXPECT_THAT(Query(path, "SELECT image_id, name, camera_id FROM images ORDER BY image_id"),
              ElementsAre("1", "one/1.png", "1", "2", "two/1.png", "2", "3", "two/2.png", "2"));
  EXPECT_THAT(Query(path, "SELECT rows, cols, hex(data) FROM keypoints WHERE image_id = 1"),
              ElementsAre("3", "2", Hex<float>({1.5, 2.5, 3.5, 4.5, 5.5, 6.5})));
  // Images 1 and 2 share points 5 and 7; image 3 shares one point with each, too few.
  const std::string pair = std::to_string(1LL * 2147483647 + 2);
  EXPECT_THAT(Query(path, "SELECT pair_id, rows, cols, hex(data), config FROM two_view_geometries"),
              ElementsAre(pair, "2", "2", Hex<std::uint32_t>({1, 0, 0, 2}), "2"));
  EXPECT_THAT(Query(path, "SELECT pair_id, rows, cols, hex(data) FROM matches"),
              ElementsAre(pair, "2", "2", Hex<std::uint32_t>({1, 0, 0, 2})));
  WriteColmapDatabase(path, SomeProblem(), 1);  // replaces the old one
  EXPECT_THAT(Query(path, "SELECT count(*) FROM matches"), ElementsAre("3"));
}

TEST(ColmapDatabase, SaysWhatIsWrongAndLeavesNothing) {
  const TempDir folder;
  const auto error_of = [&](const ColmapModel& model, const std::string& name = "database.db") {
    return ErrorOf([&] { WriteColmapDatabase(folder / name, model); });
  };
  ColmapModel model = SomeProblem();
  EXPECT_THAT(error_of(model, "none/database.db"), HasSubstr("cannot write"));
  model.images[2].name = "one/1.png";
  EXPECT_THAT(error_of(model), HasSubstr("image one/1.png is there twice"));
  model.images[2] = {"two/2.png", 2, {}, {}};
  EXPECT_THAT(error_of(model), HasSubstr("two/2.png is of a camera"));
  model.cameras[1].intrinsics[8] = 0.1;
  EXPECT_THAT(error_of(model), HasSubstr("has a k3"));
  EXPECT_TRUE(std::filesystem::is_empty(folder.Path()));
}

}  // namespace
}  // namespace sole::io
