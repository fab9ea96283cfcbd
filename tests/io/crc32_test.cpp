#include <zlib.h>

#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "io/bytes_internal.h"

namespace sole::io {
namespace {

TEST(Crc32, HasTheStandardsCheckValue) { EXPECT_EQ(Crc32("123456789", 9), 0xcbf43926U); }

TEST(Crc32, EqualsZlibForEveryLengthPlaceAndStart) {
  std::mt19937 random(5);
  std::vector<std::uint8_t> bytes(700);
  for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random());
  for (std::size_t size = 0; size <= 650; ++size) {
    const std::size_t at = random() % 32;
    const std::uint32_t start = static_cast<std::uint32_t>(size % 3 == 0 ? 0 : random());
    EXPECT_EQ(Crc32(&bytes[at], size, start), crc32_z(start, &bytes[at], size)) << size;
  }
}

TEST(Crc32, GoesOnFromEarlierPieces) {
  std::vector<std::uint8_t> bytes(1000, 0xa5);
  const std::uint32_t first = Crc32(bytes.data(), 333);
  EXPECT_EQ(Crc32(&bytes[333], 667, first), Crc32(bytes.data(), 1000));
}

}  // namespace
}  // namespace sole::io
