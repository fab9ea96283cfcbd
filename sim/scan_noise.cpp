#include "sim/scan_noise.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string_view>

#include <nlohmann/json.hpp>

#include "core/error.h"
#include "io/atomic_file.h"

namespace sole::embedded {
std::string_view scan_noise_json();
}

namespace sole::sim {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kFormat = "sole-scan-noise";
constexpr int kVersion = 1;

/// Reads numbers of one object and says where one is wrong.
class Reader {
 public:
  Reader(const Json& object, std::string where) : object_(object), where_(std::move(where)) {
    Require(object_.is_object(), where_ + ": an object is expected");
  }
  const Json& Member(const std::string& key) const {
    Require(object_.contains(key), where_ + ": key '" + key + "' is missing");
    return object_.at(key);
  }
  std::string Where(const std::string& key) const { return where_ + ": key '" + key + "'"; }

  double Number(const std::string& key, double low, double high) const {
    return Checked(Member(key), key, low, high);
  }
  template <std::size_t N>
  std::array<double, N> List(const std::string& key, double low, double high) const {
    return ListOf<N>(Member(key), key, low, high);
  }
  template <std::size_t N, std::size_t M>
  std::array<std::array<double, M>, N> Table(const std::string& key, double low,
                                             double high) const {
    const Json& rows = Member(key);
    Require(rows.is_array() && rows.size() == N,
            Where(key) + " must have " + std::to_string(N) + " rows");
    std::array<std::array<double, M>, N> table{};
    for (std::size_t i = 0; i < N; ++i) table[i] = ListOf<M>(rows[i], key, low, high);
    return table;
  }
  double Checked(const Json& value, const std::string& key, double low, double high) const {
    Require(value.is_number(), Where(key) + " must be a number");
    const double number = value.get<double>();
    Require(number >= low && number <= high,
            Where(key) + " is " + value.dump() + ", beyond its bounds");
    return number;
  }

 private:
  template <std::size_t N>
  std::array<double, N> ListOf(const Json& values, const std::string& key, double low,
                               double high) const {
    Require(values.is_array() && values.size() == N,
            Where(key) + " must have " + std::to_string(N) + " numbers");
    std::array<double, N> list{};
    for (std::size_t i = 0; i < N; ++i) list[i] = Checked(values[i], key, low, high);
    return list;
  }

  const Json& object_;
  std::string where_;
};

constexpr double kLongest_m = 0.1;  // of any distance in the file

Json SideJson(const SideNoise& side) {
  Json components = Json::array();
  for (const NoiseComponent& c : side.components)
    components.push_back({{"length_m", c.length_m}, {"share", c.share}});
  return {{"sd_m", side.sd_m},
          {"sd_of_edge", side.sd_of_edge},
          {"sd_of_pairs", side.sd_of_pairs},
          {"components", components},
          {"pair_bias_m", side.pair_bias_m},
          {"mean_m", side.mean_m},
          {"stated_sigma_m", side.stated_sigma_m},
          {"normal_rad", side.normal_rad},
          {"completeness", side.completeness},
          {"outlier_share", side.outlier_share},
          {"outlier_m", side.outlier_m}};
}

SideNoise SideFrom(const Reader& reader) {
  SideNoise side;
  side.sd_m = reader.List<kIncidenceBins>("sd_m", 0, kLongest_m);
  side.sd_of_edge = reader.List<kEdgeBins>("sd_of_edge", 0, 100);
  side.sd_of_pairs = reader.List<kPairBins>("sd_of_pairs", 0, 100);
  double sum = 0;
  const Json& components = reader.Member("components");
  Require(components.is_array() && components.size() <= 16,
          reader.Where("components") + " must be a list of at most 16");
  for (const Json& value : components) {
    const Reader component(value, reader.Where("components"));
    side.components.push_back(
        {component.Number("length_m", 0, kLongest_m), component.Number("share", 0, 1)});
    sum += side.components.back().share;
  }
  Require(std::abs(sum - 1) < 1e-3, reader.Where("components") + ": the shares do not sum to 1");
  side.pair_bias_m = reader.Number("pair_bias_m", 0, kLongest_m);
  side.mean_m = reader.List<kIncidenceBins>("mean_m", -kLongest_m, kLongest_m);
  side.stated_sigma_m = reader.List<kIncidenceBins>("stated_sigma_m", 0, kLongest_m);
  side.normal_rad = reader.List<kIncidenceBins>("normal_rad", 0, 1);
  side.completeness = reader.Table<kIncidenceBins, kEdgeBins>("completeness", 0, 1);
  side.outlier_share = reader.List<kEdgeBins>("outlier_share", 0, 1);
  side.outlier_m = reader.Number("outlier_m", 0, kLongest_m);
  return side;
}

}  // namespace

std::size_t IncidenceBin(const ScanView& view) {
  const double degrees = static_cast<double>(view.incidence_rad) * 180 / std::numbers::pi;
  return std::min(static_cast<std::size_t>(degrees / 10), kIncidenceBins - 1);
}
std::size_t EdgeBin(const ScanView& view) {
  return std::min(static_cast<std::size_t>(view.edge_m / 0.0015f), kEdgeBins - 1);
}
std::size_t PairBin(const ScanView& view) {
  return std::min<std::size_t>(view.pairs, kPairBins) - 1;
}

double ScanNoise::Sd(const ScanView& view) const {
  const SideNoise& side = Side(view);
  return side.sd_m[IncidenceBin(view)] * side.sd_of_edge[EdgeBin(view)] *
         side.sd_of_pairs[PairBin(view)];
}

const ScanNoise& DefaultScanNoise() {
  static const ScanNoise noise =
      ParseScanNoise(std::string(embedded::scan_noise_json()), "scan_noise.json");
  return noise;
}

std::string FormatScanNoise(const ScanNoise& noise) {
  const Json json = {{"format", kFormat},
                     {"version", kVersion},
                     {"units",
                      "metres, radians; lists by incidence of 10 degrees, by 1.5 mm from "
                      "the edge of what is seen, by 1, 2, 3 and more pairs"},
                     {"measured_on", noise.measured_on},
                     {"voxel_m", noise.voxel_m},
                     {"hole_length_m", noise.hole_length_m},
                     {"glass", SideJson(noise.glass)},
                     {"air", SideJson(noise.air)}};
  return json.dump(1) + "\n";
}

ScanNoise ParseScanNoise(const std::string& text, const std::string& where) {
  const Json json = Json::parse(text, nullptr, false);
  Require(!json.is_discarded(), where + " is not valid JSON");
  const Reader reader(json, where);
  Require(reader.Member("format") == kFormat,
          where + " is no scan noise file: its format is not '" + kFormat + "'");
  Require(reader.Member("version") == kVersion, where + " has another version than " +
                                                    std::to_string(kVersion) +
                                                    ": measure it again with this program");
  ScanNoise noise;
  noise.voxel_m = reader.Number("voxel_m", 2e-4, 0.02);
  noise.hole_length_m = reader.Number("hole_length_m", 1e-4, kLongest_m);
  noise.glass = SideFrom({reader.Member("glass"), where + ": glass"});
  noise.air = SideFrom({reader.Member("air"), where + ": air"});
  const Json& text_of = reader.Member("measured_on");
  Require(text_of.is_string(), reader.Where("measured_on") + " must be text");
  noise.measured_on = text_of.get<std::string>();
  return noise;
}

ScanNoise ReadScanNoise(const std::filesystem::path& path) {
  return ParseScanNoise(io::ReadFile(path), path.string());
}

}  // namespace sole::sim
