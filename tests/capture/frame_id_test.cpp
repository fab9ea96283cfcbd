#include "capture/frame_id.h"

#include <gtest/gtest.h>

namespace sole::capture {
namespace {

TEST(FrameIdUnwrapper, CountsOnAcrossTheWrap) {
  FrameIdUnwrapper ids;
  std::int64_t previous = ids.Unwrap(65530);
  EXPECT_EQ(previous, 65530);
  for (const std::uint64_t id : {65531, 65532, 65533, 65534, 65535, 1, 2, 3}) {
    const std::int64_t next = ids.Unwrap(id);
    EXPECT_EQ(next, previous + 1) << "at id " << id;
    previous = next;
  }
}

TEST(FrameIdUnwrapper, CountsManyCycles) {
  FrameIdUnwrapper ids;
  for (std::int64_t i = 0; i < 5 * 65535; ++i) {
    ASSERT_EQ(ids.Unwrap(static_cast<std::uint64_t>(i % 65535 + 1)), i + 1);
  }
}

TEST(FrameIdUnwrapper, KeepsGapsAcrossTheWrap) {
  FrameIdUnwrapper ids;
  const std::int64_t first = ids.Unwrap(65534);
  EXPECT_EQ(ids.Unwrap(4), first + 5);  // 65535, 1, 2, 3 are missing
}

TEST(FrameIdUnwrapper, LateFrameGoesBackAndDoesNotMoveTheCount) {
  FrameIdUnwrapper ids;
  const std::int64_t newest = ids.Unwrap(65535) + 1;
  EXPECT_EQ(ids.Unwrap(1), newest);
  EXPECT_EQ(ids.Unwrap(65534), newest - 2);
  EXPECT_EQ(ids.Unwrap(1), newest);
  EXPECT_EQ(ids.Unwrap(2), newest + 1);
}

TEST(FrameIdUnwrapper, WideIdsPassUnchanged) {
  FrameIdUnwrapper ids;
  EXPECT_EQ(ids.Unwrap(65535), 65535);
  EXPECT_EQ(ids.Unwrap(65536), 65536);
  EXPECT_EQ(ids.Unwrap(70000), 70000);
}

}  // namespace
}  // namespace sole::capture
