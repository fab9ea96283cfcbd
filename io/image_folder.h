#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace sole::io {

/// Pictures of several cameras: FOLDER/CAMERA/NUMBER.png or, without subfolders, FOLDER/CAMERANUMBER.png
/// such as left01.jpg (any format that ReadImage knows). Pictures with one number belong together.
struct ImageFolder {
  std::vector<std::string> cameras;  ///< in alphabetical order
  std::vector<int> numbers;          ///< ascending, every number that occurs
  /// files[n][c]: of numbers[n] and cameras[c]; empty where there is none.
  std::vector<std::vector<std::filesystem::path>> files;
};

/// Throws Error if the folder cannot be read, holds no pictures, or two that have the same camera and
/// number. Files of other kinds are left alone.
ImageFolder ListImageFolder(const std::filesystem::path& folder);

}  // namespace sole::io
