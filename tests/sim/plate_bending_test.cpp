#include "sim/plate_bending.h"

#include <cmath>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "core/error.h"

namespace sole::sim {
namespace {

double Rigidity(const PlateModel& plate) {
  return plate.young_pa * std::pow(plate.thickness_m, 3) / (12 * (1 - plate.poisson * plate.poisson));
}

/// Deflection at the middle for a force there, as alpha in w = alpha P a^2 / D.
double CentralAlpha(double ratio) {
  const PlateModel plate{.size_x_m = 0.4, .size_y_m = 0.4 * ratio};
  const std::vector<PlateLoad> load = {{0, 0, 700}};
  return BendPlate(plate, load).At(0, 0) * Rigidity(plate) / (700 * 0.4 * 0.4);
}

TEST(BendPlate, ForceInTheMiddleGivesTimoshenkosTable) {
  // Timoshenko and Woinowsky-Krieger, table 23.
  EXPECT_NEAR(CentralAlpha(1.0), 0.01160, 3e-5);
  EXPECT_NEAR(CentralAlpha(1.2), 0.01353, 3e-5);
  EXPECT_NEAR(CentralAlpha(2.0), 0.01651, 3e-5);
}

TEST(BendPlate, UniformLoadGivesTimoshenkosTable) {
  // w = 0.00406 q a^4 / D of a square plate, 0.00564 for b = 1.2 a (table 8).
  for (const auto& [ratio, alpha] : {std::pair{1.0, 0.00406}, std::pair{1.2, 0.00564}}) {
    const PlateModel plate{.size_x_m = 0.5, .size_y_m = 0.5 * ratio, .thickness_m = 0.012};
    constexpr int kCells = 60;
    const double pressure_pa = 3000, cell = plate.size_x_m * plate.size_y_m / (kCells * kCells);
    std::vector<PlateLoad> loads;
    for (int i = 0; i < kCells * kCells; ++i) {
      loads.push_back({((i % kCells + 0.5) / kCells - 0.5) * plate.size_x_m, ((i / kCells + 0.5) / kCells - 0.5) * plate.size_y_m,
                       pressure_pa * cell});
    }
    EXPECT_NEAR(BendPlate(plate, loads).At(0, 0) * Rigidity(plate) / (pressure_pa * std::pow(0.5, 4)), alpha, 2e-5);
  }
}

TEST(BendPlate, OneHalfWaveOfLoadGivesTheExactSine) {
  // q = q0 sin(pi x / a) sin(pi y / b) bends to w0 times the same sines, w0 = q0 / (pi^4 D (1/a^2 + 1/b^2)^2).
  const PlateModel plate;
  constexpr int kCells = 80;
  const double a = plate.size_x_m, b = plate.size_y_m, pi = std::numbers::pi, q0 = 5000;
  std::vector<PlateLoad> loads;
  for (int i = 0; i < kCells * kCells; ++i) {
    const double x = (i % kCells + 0.5) / kCells, y = (i / kCells + 0.5) / kCells;
    loads.push_back({(x - 0.5) * a, (y - 0.5) * b, q0 * std::sin(pi * x) * std::sin(pi * y) * a * b / (kCells * kCells)});
  }
  const PlateSag sag = BendPlate(plate, loads);
  const double w0 = q0 / (std::pow(pi, 4) * Rigidity(plate) * std::pow(1 / (a * a) + 1 / (b * b), 2));
  for (const double x : {-0.15, 0.0, 0.083}) {
    for (const double y : {-0.2, 0.0131, 0.19}) {
      EXPECT_NEAR(sag.At(x, y), w0 * std::cos(pi * x / a) * std::cos(pi * y / b), 1.5e-3 * w0);
    }
  }
}

TEST(BendPlate, IsReciprocalHasStillEdgesAndAddsUp) {
  const PlateModel plate;
  const PlateLoad one{0.05, -0.11, 300}, two{-0.12, 0.07, 300};
  const PlateSag by_one = BendPlate(plate, std::vector{one}), by_two = BendPlate(plate, std::vector{two});
  EXPECT_NEAR(by_one.At(two.x_m, two.y_m), by_two.At(one.x_m, one.y_m), 1e-7);  // Maxwell and Betti
  EXPECT_NEAR(by_one.At(0.2, 0.1), 0, 1e-15);
  EXPECT_EQ(by_one.At(0.21, 0), 0);
  EXPECT_NEAR(BendPlate(plate, std::vector{one, two}).At(0.01, 0.02), by_one.At(0.01, 0.02) + by_two.At(0.01, 0.02), 1e-12);
  EXPECT_EQ(PlateSag{}.At(0, 0), 0);
  EXPECT_THROW(BendPlate({.thickness_m = 0}, {}), Error);
}

TEST(BendPlate, DefaultPlateGivesWayByATenthOfAMillimetreUnderAPerson) {
  const double middle = BendPlate({}, std::vector<PlateLoad>{{0, 0, 75 * 9.81}}).At(0, 0);
  EXPECT_GT(middle, 5e-5);
  EXPECT_LT(middle, 2e-4);
}

}  // namespace
}  // namespace sole::sim
