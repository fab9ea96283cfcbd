#include "sim/anatomy_table.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <string_view>

#include <nlohmann/json.hpp>

#include "core/error.h"

namespace sole::embedded {
std::string_view foot_anatomy_json();
}

namespace sole::sim {
namespace {

using nlohmann::json;

constexpr double kRadFromDeg = std::numbers::pi / 180.0;

Eigen::Vector3d Vector(const json& value) {
  return {value.at(0).get<double>(), value.at(1).get<double>(), value.at(2).get<double>()};
}

/// "MTP 1" -> "mtp_1", "talocrural (ankle)" -> "talocrural".
std::string ShortJointName(const std::string& text) {
  std::string name;
  for (const char c : text) {
    if (c == '(' || c == ',') break;
    name += c == ' ' ? '_' : static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  while (!name.empty() && name.back() == '_') name.pop_back();
  const auto digit = std::find_if(text.begin(), text.end(), [](char c) { return c >= '1' && c <= '5'; });
  if (digit != text.end() && name.find(*digit) == std::string::npos) name += std::string("_") + *digit;
  return name;
}

Tissue TissueFrom(const std::string& name) {
  static const std::map<std::string, Tissue> kTissues = {
      {"bone cover", Tissue::kBoneCover}, {"heel pad", Tissue::kHeelPad}, {"ball pad", Tissue::kBallPad},
      {"toe pulp", Tissue::kToePulp},     {"tendon", Tissue::kTendon},    {"arch muscle", Tissue::kArchMuscle},
      {"web", Tissue::kWeb}};
  const auto found = kTissues.find(name);
  Require(found != kTissues.end(), "foot_anatomy.json: unknown tissue '" + name + "'");
  return found->second;
}

AnatomyBone BoneFrom(const json& value, const AnatomyTable& table) {
  AnatomyBone bone;
  bone.name = value.at("name");
  if (!value.at("parent").is_null()) bone.parent = BoneIndex(table, value.at("parent"));
  bone.proximal = Vector(value.at("proximal"));
  bone.distal = Vector(value.at("distal"));
  const json& joint = value.at("joint");
  bone.joint = ShortJointName(joint.at("name"));
  bone.joint_centre = Vector(joint.at("centre"));
  for (const json& axis : joint.at("axes")) {
    bone.axes.push_back({axis.at("name"), Vector(axis.at("axis")).normalized(),
                         axis.at("range_deg").at(0).get<double>() * kRadFromDeg,
                         axis.at("range_deg").at(1).get<double>() * kRadFromDeg});
  }
  return bone;
}

int GroupFrom(const std::string& name) {
  return name == "body" ? kBodyGroup : name.back() - '0';
}

Eigen::Matrix3d Axes(const json& value) {
  Eigen::Matrix3d axes;
  for (int j = 0; j < 3; ++j) axes.col(j) = Vector(value.at(static_cast<std::size_t>(j))).normalized();
  return axes;
}

FleshPrimitive PrimitiveFrom(const json& value, const AnatomyTable& table) {
  FleshPrimitive primitive;
  primitive.name = value.at("name");
  primitive.is_cone = value.at("kind") == "round_cone";
  primitive.group = GroupFrom(value.at("group"));
  primitive.tissue = TissueFrom(value.at("tissue"));
  primitive.k = value.at("k");
  primitive.bone_a = BoneIndex(table, value.at("bone_a"));
  primitive.bone_b = BoneIndex(table, value.at("bone_b"));
  if (primitive.is_cone) {
    primitive.a = Vector(value.at("a"));
    primitive.b = Vector(value.at("b"));
    primitive.radius_a = value.at("ra");
    primitive.radius_b = value.at("rb");
  } else {
    primitive.a = Vector(value.at("c"));
    primitive.half_axes = Axes(value.at("axes")) * Vector(value.at("r")).asDiagonal();
  }
  return primitive;
}

Nail NailFrom(const json& value, const AnatomyTable& table) {
  Nail nail;
  nail.bone = BoneIndex(table, value.at("bone"));
  nail.toe = value.at("name").get<std::string>().back() - '0';
  nail.centre = Vector(value.at("c"));
  nail.axes = Axes(value.at("axes"));
  nail.half_width = value.at("half_width");
  nail.half_length = value.at("half_length");
  nail.exponent = value.at("exponent");
  nail.plate_height = value.at("plate_height");
  nail.groove_depth = value.at("groove_depth");
  nail.groove_width = value.at("groove_width");
  return nail;
}

AnatomyTable Load() {
  const json root = json::parse(embedded::foot_anatomy_json());
  AnatomyTable table;
  for (const json& bone : root.at("bones")) table.bones.push_back(BoneFrom(bone, table));
  for (const json& value : root.at("primitives")) table.primitives.push_back(PrimitiveFrom(value, table));
  for (const json& value : root.at("nails")) table.nails.push_back(NailFrom(value, table));
  const json& blend = root.at("blend");
  table.k_body_toes = blend.at("k_body_toes");
  table.toe_clearance = blend.at("toe_clearance");
  table.cut_point.z() = blend.at("cut_z");
  return table;
}

}  // namespace

const AnatomyTable& MeanAdultTable() {
  static const AnatomyTable table = Load();
  return table;
}

int BoneIndex(const AnatomyTable& table, const std::string& name) {
  for (std::size_t i = 0; i < table.bones.size(); ++i) {
    if (table.bones[i].name == name) return static_cast<int>(i);
  }
  throw Error("unknown bone '" + name + "': use a name from sim/data/foot_anatomy.json");
}

}  // namespace sole::sim
