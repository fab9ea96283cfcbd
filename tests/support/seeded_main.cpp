#include <cstdlib>

#include <gtest/gtest.h>

namespace {

/// Reseeds the C engine before each test, so that no test depends on the order of the others.
class Reseeder : public testing::EmptyTestEventListener {
  void OnTestStart(const testing::TestInfo&) override { std::srand(1); }
};

}  // namespace

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  testing::UnitTest::GetInstance()->listeners().Append(new Reseeder);
  return RUN_ALL_TESTS();
}
