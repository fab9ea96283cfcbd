#include "io/image_folder.h"

#include <algorithm>
#include <cctype>
#include <set>
#include <tuple>

#include "core/error.h"

namespace sole::io {
namespace {

namespace fs = std::filesystem;

bool IsPicture(const fs::path& path) {
  std::string extension = path.extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  static const std::set<std::string> known{".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".pgm"};
  return known.contains(extension);
}

struct Picture {
  std::string camera;
  int number;
  fs::path path;
};

/// Camera and number from "left01"; the number is what digits the name ends with.
Picture Parse(const fs::path& path, const std::string& folder_camera) {
  const std::string stem = path.stem().string();
  std::size_t first = stem.size();
  while (first > 0 && std::isdigit(static_cast<unsigned char>(stem[first - 1]))) --first;
  Require(first < stem.size() && stem.size() - first <= 9,
          path.string() + ": the name must end with the number of the picture, such as 07.png");
  const std::string camera = folder_camera.empty() ? stem.substr(0, first) : folder_camera;
  Require(!camera.empty(),
          path.string() + ": which camera? Name pictures CAMERA/NUMBER.png or CAMERANUMBER.png");
  return {camera, std::stoi(stem.substr(first)), path};
}

}  // namespace

ImageFolder ListImageFolder(const fs::path& folder) {
  std::error_code error;
  Require(fs::is_directory(folder, error), folder.string() + ": is not a folder");
  std::vector<Picture> pictures;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    if (entry.is_regular_file() && IsPicture(entry.path())) {
      pictures.push_back(Parse(entry.path(), ""));
    } else if (entry.is_directory()) {
      for (const fs::directory_entry& inner : fs::directory_iterator(entry.path())) {
        if (inner.is_regular_file() && IsPicture(inner.path()))
          pictures.push_back(Parse(inner.path(), entry.path().filename().string()));
      }
    }
  }
  Require(!pictures.empty(), folder.string() + ": holds no pictures CAMERA/NUMBER.png");
  std::set<std::string> cameras;
  std::set<int> numbers;
  for (const Picture& p : pictures) {
    cameras.insert(p.camera);
    numbers.insert(p.number);
  }
  ImageFolder result{{cameras.begin(), cameras.end()}, {numbers.begin(), numbers.end()}, {}};
  result.files.assign(result.numbers.size(), std::vector<fs::path>(result.cameras.size()));
  for (const Picture& p : pictures) {
    const auto row = std::lower_bound(result.numbers.begin(), result.numbers.end(), p.number) -
                     result.numbers.begin();
    const auto column = std::lower_bound(result.cameras.begin(), result.cameras.end(), p.camera) -
                        result.cameras.begin();
    fs::path& place = result.files[static_cast<std::size_t>(row)][static_cast<std::size_t>(column)];
    Require(place.empty(), p.path.string() + " and " + place.string() +
                               " are the same camera's picture of one number");
    place = p.path;
  }
  return result;
}

}  // namespace sole::io
