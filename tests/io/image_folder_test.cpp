#include "io/image_folder.h"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.h"
#include "tests/support/temp_dir.h"

namespace sole::io {
namespace {

namespace fs = std::filesystem;

void Touch(const fs::path& path) {
  fs::create_directories(path.parent_path());
  std::ofstream(path) << "x";
}

TEST(ListImageFolder, FindsCamerasByFolderAndByName) {
  testing_support::TempDir directory;
  for (const char* name : {"a/2.png", "a/10.png", "b/0002.JPG", "b/notes.txt"}) Touch(directory / name);
  const ImageFolder folders = ListImageFolder(directory / "");
  EXPECT_EQ(folders.cameras, (std::vector<std::string>{"a", "b"}));
  EXPECT_EQ(folders.numbers, (std::vector<int>{2, 10}));
  EXPECT_EQ(folders.files[0][1].filename(), "0002.JPG");
  EXPECT_TRUE(folders.files[1][1].empty());

  testing_support::TempDir flat;
  for (const char* name : {"left01.jpg", "right01.jpg", "left02.jpg"}) Touch(flat / name);
  const ImageFolder names = ListImageFolder(flat / "");
  EXPECT_EQ(names.cameras, (std::vector<std::string>{"left", "right"}));
  EXPECT_EQ(names.files[0][1].filename(), "right01.jpg");
}

TEST(ListImageFolder, SaysWhatItCannotUse) {
  testing_support::TempDir directory;
  EXPECT_THROW(ListImageFolder(directory / "none"), Error);
  EXPECT_THROW(ListImageFolder(directory / ""), Error);  // no pictures
  Touch(directory / "cam" / "picture.png");
  EXPECT_THROW(ListImageFolder(directory / ""), Error);  // no number
  fs::remove(directory / "cam" / "picture.png");
  Touch(directory / "cam" / "1.png");
  Touch(directory / "cam" / "01.png");
  EXPECT_THROW(ListImageFolder(directory / ""), Error);  // twice the same
}

}  // namespace
}  // namespace sole::io
