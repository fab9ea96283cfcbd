#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace sole::io {

/// One array of an .npy file: C order, little endian. `dtype` is numpy's: "<f8", "<f4", "<i4",
/// "<i8", "|u1",
/// "|b1" or "<U<n>" (strings of n UCS-4 characters).
struct NpyArray {
  std::string dtype;
  std::vector<std::size_t> shape;
  std::vector<std::uint8_t> bytes;

  std::size_t Count() const;  ///< product of shape
};

using Npz = std::map<std::string, NpyArray>;

/// Reads and writes .npy and .npz (stored or deflated). Reading checks magic, header, sizes against
/// the file, overflow and CRC, turns Fortran order and big endian into C order and little endian,
/// and refuses object arrays; throws Error with the path. Writing is atomic and deterministic (no
/// time stamps).
NpyArray ReadNpy(const std::filesystem::path& path);
Npz ReadNpz(const std::filesystem::path& path);
void WriteNpy(const std::filesystem::path& path, const NpyArray& array);
void WriteNpz(const std::filesystem::path& path, const Npz& arrays);

/// From Eigen and std types. Matrices become (rows, cols) arrays.
NpyArray NpyFrom(const Eigen::Ref<const Eigen::MatrixXd>& matrix);
NpyArray NpyFrom(const Eigen::Ref<const Eigen::MatrixXi>& matrix);
NpyArray NpyFrom(const Eigen::Ref<const Eigen::MatrixXf>& matrix);
NpyArray NpyFrom(const std::vector<double>& values);
NpyArray NpyFrom(const std::vector<float>& values);
NpyArray NpyFrom(const std::vector<int>& values);
NpyArray NpyFrom(const std::vector<std::int64_t>& values);
NpyArray NpyFrom(const std::vector<std::uint8_t>& values);
NpyArray NpyFrom(const std::string& text);                ///< 0-d string
NpyArray NpyFrom(const std::vector<std::string>& texts);  ///< 1-d strings
/// As above with another shape of the same count (for example (F, K, 3)). Throws Error if counts
/// differ.
NpyArray Reshaped(NpyArray array, std::vector<std::size_t> shape);

/// To Eigen and std types; any numeric dtype is converted. An array of more than two dimensions
/// becomes a matrix of shape[0] rows (all other dimensions flattened into columns); 1-d becomes one
/// column. Throws Error naming `name` if absent or not numeric.
Eigen::MatrixXd MatrixFrom(const Npz& npz, const std::string& name);
std::vector<int> IntsFrom(const Npz& npz, const std::string& name);
std::string StringFrom(const Npz& npz, const std::string& name);
std::vector<std::string> StringsFrom(const Npz& npz, const std::string& name);
/// Shape of an array; throws Error naming `name` if absent.
const std::vector<std::size_t>& ShapeOf(const Npz& npz, const std::string& name);

}  // namespace sole::io
