#include "sim/scan_noise.h"

#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/support/error_matcher.h"

namespace sole::sim {
namespace {

using nlohmann::json;
using testing::AllOf;
using testing::HasSubstr;
using testing_support::ErrorOf;

TEST(ScanNoise, ComesWithTheProgramAndMakesSense) {
  const ScanNoise& noise = DefaultScanNoise();
  for (const SideNoise* side : {&noise.glass, &noise.air}) {
    for (std::size_t i = 0; i < kIncidenceBins; ++i) {
      EXPECT_GT(side->sd_m[i], 1e-6);
      EXPECT_LT(side->sd_m[i], 3e-4);
      EXPECT_LT(std::abs(side->mean_m[i]), 1e-4);
    }
    EXPECT_GT(side->completeness[1].back(), 0.8) << "well inside, looked at straight";
    EXPECT_GE(side->completeness[1].back(), side->completeness[1].front());
  }
}

TEST(ScanNoise, FileKeepsEveryNumber) {
  ScanNoise noise = DefaultScanNoise();
  noise.glass.sd_m[3] = 0.000123456789;
  noise.air.completeness[6][2] = 0.321;
  noise.air.components = {{0, 0.25}, {0.004, 0.75}};
  noise.measured_on = "two takes";
  const std::string text = FormatScanNoise(noise);
  const ScanNoise back = ParseScanNoise(text, "here");
  EXPECT_EQ(back.glass.sd_m, noise.glass.sd_m);
  EXPECT_EQ(back.air.completeness, noise.air.completeness);
  EXPECT_EQ(back.air.components[1].share, 0.75);
  EXPECT_EQ(FormatScanNoise(back), text);
}

TEST(ScanNoise, BadFilesAreRefusedWithTheKey) {
  const auto error_after = [](const std::function<void(json&)>& change) {
    json file = json::parse(FormatScanNoise(DefaultScanNoise()));
    change(file);
    return ErrorOf([&] { ParseScanNoise(file.dump(), "noise.json"); });
  };
  EXPECT_EQ(error_after([](json&) {}), "(no error was thrown)");
  EXPECT_THAT(error_after([](json& f) { f["air"].erase("sd_m"); }),
              AllOf(HasSubstr("noise.json: air"), HasSubstr("sd_m")));
  EXPECT_THAT(error_after([](json& f) { f["glass"]["sd_m"].push_back(1); }),
              HasSubstr("7 numbers"));
  EXPECT_THAT(error_after([](json& f) { f["glass"]["sd_m"][0] = -1e-5; }), HasSubstr("bounds"));
  EXPECT_THAT(error_after([](json& f) { f["glass"]["completeness"][2][1] = "x"; }),
              HasSubstr("completeness"));
  EXPECT_THAT(error_after([](json& f) { f["air"]["components"][0]["share"] = 0.123; }),
              HasSubstr("sum to 1"));
  EXPECT_THAT(error_after([](json& f) { f["version"] = 2; }), HasSubstr("version"));
  EXPECT_THAT(error_after([](json& f) { f["format"] = "other"; }), HasSubstr("no scan noise file"));
  EXPECT_THAT(error_after([](json& f) { f["voxel_m"] = 0; }), HasSubstr("voxel_m"));
  EXPECT_THAT(ErrorOf([] { ParseScanNoise("{", "noise.json"); }), HasSubstr("not valid JSON"));
  EXPECT_THAT(ErrorOf([] { ReadScanNoise("/nonexistent.json"); }), HasSubstr("/nonexistent.json"));
}

TEST(ScanNoise, ClassesReachToTheEnds) {
  EXPECT_EQ(IncidenceBin({.incidence_rad = 0.0f}), 0U);
  EXPECT_EQ(IncidenceBin({.incidence_rad = 0.36f}), 2U) << "20.6 degrees";
  EXPECT_EQ(IncidenceBin({.incidence_rad = 1.23f}), kIncidenceBins - 1);
  EXPECT_EQ(EdgeBin({.edge_m = 0.0016f}), 1U);
  EXPECT_EQ(EdgeBin({.edge_m = kMaxEdge_m}), kEdgeBins - 1);
  EXPECT_EQ(PairBin({.pairs = 1}), 0U);
  EXPECT_EQ(PairBin({.pairs = 9}), 2U);
}

}  // namespace
}  // namespace sole::sim
