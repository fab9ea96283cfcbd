#include "io/config_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/error_matcher.h"

namespace sole::io {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing_support::ErrorOf;

struct Values {
  int count = 1;
  double rate = 0.5;
  bool on = false;
  std::string kind = "a";
};

Values Read(const std::string& toml) {
  ConfigFile file(toml, "c.toml");
  Values values;
  constexpr const char* kWords[] = {"a", "b"};
  file.Read("", "count", values.count, 1, 10);
  file.Read("network", "rate", values.rate, 0, 1);
  file.Read("network", "on", values.on);
  file.Read("network", "kind", values.kind, kWords);
  file.Finish();
  return values;
}

TEST(ConfigFile, AbsentKeysKeepTheirValues) {
  const Values none = Read("");
  EXPECT_EQ(none.count, 1);
  EXPECT_EQ(none.rate, 0.5);
  const Values some = Read("count = 3\n[network]\non = true\nkind = \"b\"\nrate = 1\n");
  EXPECT_EQ(some.count, 3);
  EXPECT_EQ(some.rate, 1);
  EXPECT_TRUE(some.on);
  EXPECT_EQ(some.kind, "b");
}

TEST(ConfigFile, ErrorsNameTheirPlace) {
  EXPECT_THAT(ErrorOf([] { Read("count = 11"); }), AllOf(HasSubstr("c.toml:1:9"), HasSubstr("1 to 10")));
  EXPECT_THAT(ErrorOf([] { Read("[network]\nrote = 1"); }),
              AllOf(HasSubstr("c.toml:2:1"), HasSubstr("did you mean rate?")));
  EXPECT_THAT(ErrorOf([] { Read("\n[netwrk]\nrate = 1"); }),
              AllOf(HasSubstr("c.toml:2"), HasSubstr("did you mean network?")));
  EXPECT_THAT(ErrorOf([] { Read("[network]\nkind = \"c\""); }),
              AllOf(HasSubstr("c.toml:2:8"), HasSubstr("a, b")));
  EXPECT_THAT(ErrorOf([] { Read("count = "); }), HasSubstr("c.toml:1:"));
}

}  // namespace
}  // namespace sole::io
