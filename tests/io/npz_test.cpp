#include "io/npz.h"

#include <cmath>
#include <limits>

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
using Shape = std::vector<std::size_t>;

std::string NpyBytes(const std::string& dictionary, const std::string& data) {
  std::string header = dictionary + "\n";
  std::string file("\x93NUMPY\x01\x00", 8);
  file += static_cast<char>(header.size() & 0xff);
  file += static_cast<char>(header.size() >> 8);
  return file + header + data;
}

TEST(Npz, RoundTripsEveryKindOfArray) {
  const TempDir dir;
  const Eigen::MatrixXd matrix = Eigen::MatrixXd::Random(50, 3);
  Eigen::MatrixXd special(1, 3);
  special << std::numeric_limits<double>::infinity(), std::nan(""), -0.0;
  const Npz written{{"matrix", NpyFrom(matrix)},
                    {"cube", Reshaped(NpyFrom(matrix), {5, 10, 3})},
                    {"special", NpyFrom(special)},
                    {"ints", NpyFrom(std::vector<int>{-1, 0, 2000000000})},
                    {"bits", NpyFrom(std::vector<std::uint8_t>(1000, 1))},
                    {"text", NpyFrom(std::string("Größe 😀"))},
                    {"texts", NpyFrom(std::vector<std::string>{"a", "", "long one"})},
                    {"none", NpyFrom(std::vector<double>{})}};
  WriteNpz(dir / "a.npz", written);
  const Npz read = ReadNpz(dir / "a.npz");
  ASSERT_EQ(read.size(), written.size());
  for (const auto& [name, array] : written) {
    EXPECT_EQ(read.at(name).dtype, array.dtype) << name;
    EXPECT_EQ(read.at(name).shape, array.shape) << name;
    EXPECT_EQ(read.at(name).bytes, array.bytes) << name;
  }
  EXPECT_EQ(MatrixFrom(read, "matrix"), matrix);
  const Eigen::MatrixXd cube = MatrixFrom(read, "cube");
  ASSERT_EQ(cube.rows(), 5);
  ASSERT_EQ(cube.cols(), 30);
  EXPECT_EQ(cube(2, 7), matrix(22, 1));  // (2, 2, 1)
  EXPECT_EQ(StringFrom(read, "text"), "Größe 😀");
  EXPECT_EQ(StringsFrom(read, "texts"), (std::vector<std::string>{"a", "", "long one"}));
  EXPECT_EQ(IntsFrom(read, "ints"), (std::vector<int>{-1, 0, 2000000000}));
  EXPECT_EQ(ShapeOf(read, "text"), Shape{});
}

TEST(Npz, WritesTheSameBytesTwice) {
  const TempDir dir;
  const Npz npz{{"a", NpyFrom(std::vector<int>(1000, 3))}, {"b", NpyFrom(std::string("x"))}};
  WriteNpz(dir / "a.npz", npz);
  WriteNpz(dir / "b.npz", npz);
  EXPECT_EQ(ReadFile(dir / "a.npz"), ReadFile(dir / "b.npz"));
}

TEST(ReadNpy, TurnsFortranOrderAndBigEndianRound) {
  const TempDir dir;
  // [[1, 2, 3], [4, 5, 6]] as big-endian int16, columns first.
  const std::string data("\0\1\0\4\0\2\0\5\0\3\0\6", 12);
  WriteStringAtomically(
      dir / "a.npy", NpyBytes("{'descr': '>i2', 'fortran_order': True, 'shape': (2, 3), }", data));
  const NpyArray array = ReadNpy(dir / "a.npy");
  EXPECT_EQ(array.dtype, "<i2");
  Eigen::MatrixXd expected(2, 3);
  expected << 1, 2, 3, 4, 5, 6;
  EXPECT_EQ(MatrixFrom({{"a", array}}, "a"), expected);
}

TEST(ReadNpy, RefusesWhatItCannotMean) {
  const TempDir dir;
  const auto reading = [&](const std::string& bytes) {
    WriteStringAtomically(dir / "a.npy", bytes);
    return ErrorOf([&] { ReadNpy(dir / "a.npy"); });
  };
  const auto dictionary = [](const std::string& descr, const std::string& shape) {
    return "{'descr': " + descr + ", 'fortran_order': False, 'shape': " + shape + ", }";
  };
  EXPECT_THAT(reading(NpyBytes(dictionary("'|O'", "(1,)"), "12345678")),
              HasSubstr("a.npy: holds Python objects"));
  EXPECT_THAT(reading(NpyBytes(dictionary("[('x', '<f8')]", "(1,)"), "12345678")),
              HasSubstr("structured arrays"));
  EXPECT_THAT(reading(NpyBytes(dictionary("'<c16'", "(1,)"), "12345678")),
              HasSubstr("dtype '<c16' is not read"));
  EXPECT_THAT(reading(NpyBytes(dictionary("'<f8'", "(2,)"), "12345678")),
              HasSubstr("do not match its shape"));
  EXPECT_THAT(reading(NpyBytes(dictionary("'<f8'", "(4294967296, 4294967296)"), "")),
              HasSubstr("do not match its shape"));
  EXPECT_THAT(reading(NpyBytes(dictionary("'<f8'", "(0, 9000000000000000000)"), "")),
              HasSubstr("do not match its shape"));
  EXPECT_THAT(reading(NpyBytes(dictionary("'<U9999999999'", "(1,)"), "")),
              HasSubstr("is not read"));
  EXPECT_THAT(reading(NpyBytes(dictionary("'<f8'", "(-1,)"), "")), HasSubstr("damaged npy header"));
  EXPECT_THAT(reading("hello, this is not an array"), HasSubstr("is not an npy file"));
  EXPECT_THAT(ErrorOf([&] { ReadNpy(dir / "absent.npy"); }), HasSubstr("absent.npy: No such file"));
}

TEST(ReadNpz, FindsDamageByTheChecksum) {
  const TempDir dir;
  WriteNpz(dir / "a.npz", {{"noise", NpyFrom(Eigen::MatrixXd::Random(10, 10))}});
  std::string bytes = ReadFile(dir / "a.npz");
  bytes[bytes.size() / 2] ^= 1;
  WriteStringAtomically(dir / "a.npz", bytes);
  EXPECT_THAT(ErrorOf([&] { ReadNpz(dir / "a.npz"); }), HasSubstr("a.npz: entry 'noise.npy'"));
}

TEST(ReadNpz, RefusesAnEntryThatClaimsAnImpossibleSize) {
  const TempDir dir;
  WriteNpz(dir / "a.npz", {{"zeros", NpyFrom(std::vector<double>(1000, 0))}});
  std::string bytes = ReadFile(dir / "a.npz");
  const std::size_t central = bytes.find("PK\1\2");
  bytes.replace(central + 24, 4, "\xff\xff\xff\x7f");
  WriteStringAtomically(dir / "a.npz", bytes);
  EXPECT_THAT(ErrorOf([&] { ReadNpz(dir / "a.npz"); }), HasSubstr("claims an impossible size"));
}

TEST(MatrixFrom, NamesTheArray) {
  const Npz npz{{"text", NpyFrom(std::string("x"))}, {"half", NpyFrom(std::vector<double>{0.5})}};
  EXPECT_THAT(ErrorOf([&] { MatrixFrom(npz, "beta"); }), HasSubstr("array 'beta' is missing"));
  EXPECT_THAT(ErrorOf([&] { MatrixFrom(npz, "text"); }),
              HasSubstr("array 'text' has dtype <U1, expected numbers"));
  EXPECT_THAT(ErrorOf([&] { IntsFrom(npz, "half"); }), HasSubstr("array 'half' holds 0.5"));
  EXPECT_THAT(ErrorOf([&] { StringFrom(npz, "half"); }), HasSubstr("expected text"));
  EXPECT_THAT(ErrorOf([&] {
                Reshaped(NpyFrom(std::vector<double>{1, 2}), {3});
              }),
              HasSubstr("does not take a shape"));
}

}  // namespace
}  // namespace sole::io
