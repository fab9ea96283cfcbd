#include "core/fault.h"

#include <algorithm>
#include <charconv>
#include <sstream>
#include <vector>

#include "core/error.h"

namespace sole {
namespace {

using enum FaultScope;

constexpr FaultKind kKinds[] = {
    {"lost-packets", kCamera, "", 0.01, 0, 0.99, 1},
    {"late-frames", kCamera, "ms", 50, 0, 10000, 1},
    {"skipped-id", kCamera, "", 1, 1, 1000, 3},
    {"repeated-id", kCamera, "", 1, 1, 1000, 3},
    {"dead-link", kCamera, "s", 1, 0, 3600, 3},
    {"reboot", kCamera, "s", 2, 0, 3600, 3},
    {"desync", kCamera, "", 1, 1, 16, 1},
    {"clock-drift", kCamera, "ppm", 100, -100000, 100000, 1},
    {"hot-pixels", kCamera, "", 0.001, 0, 1, 1},
    {"fog", kCamera, "", 0.5, 0, 1, 1},
    {"bumped-camera", kCamera, "mm", 1, 0, 1000, 1},
    {"bumped-camera", kCamera, "deg", 0.2, 0, 90, 1},
    {"projector-off", kRig, "", 1, 1, 64, 1},
    {"missing-trigger", kCamera, "", 1, 1, 1000000, 3},
    {"double-trigger", kCamera, "ms", 10, 0.01, 1000, 3},
    {"lights-on", kRig, "", 1.6, 0, 100, 1},
};

std::string Shown(double value) {
  std::ostringstream text;
  text << value;
  return text.str();
}

std::string AllNames() {
  std::string names;
  for (const FaultKind& kind : kKinds) {
    const std::string name = kind.name;
    if (names.ends_with(name)) continue;
    names += (names.empty() ? "" : ", ") + name;
  }
  return names;
}

const FaultKind& Find(const std::string& name, const std::string& unit) {
  const FaultKind* first = nullptr;
  std::string units;
  for (const FaultKind& kind : kKinds) {
    if (name != kind.name) continue;
    if (first == nullptr) first = &kind;
    if (unit == kind.unit) return kind;
    units += (units.empty() ? "" : " or ") + std::string(kind.unit);
  }
  Require(first != nullptr, "there is no fault '" + name + "'; use one of " + AllNames());
  Require(unit.empty(), "fault " + name + ": unknown unit '" + unit + "'; " +
                            (units.empty() ? "give a plain number" : "use " + units));
  return *first;
}

template <typename Number>
Number Parse(const std::string& text, const std::string& whole, std::string* rest) {
  Number value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  *rest = std::string(end, text.data() + text.size());
  Require(error == std::errc{}, "fault '" + whole + "': '" + text +
                                    "' is no number; write NAME[:CAMERA[:AMOUNT]][@TRIGGER]");
  return value;
}

}  // namespace

std::span<const FaultKind> FaultKinds() { return kKinds; }

FaultConfig MakeFault(const std::string& name, const std::string& camera,
                      std::optional<double> amount, const std::string& unit,
                      std::optional<std::int64_t> trigger) {
  const FaultKind& kind = Find(name, unit);
  Require(kind.scope == kCamera || camera.empty(),
          "fault " + name + " acts on the whole rig; leave out the camera");
  const FaultConfig fault{name, camera, trigger.value_or(kind.trigger),
                          amount.value_or(kind.amount), kind.unit};
  Require(fault.amount >= kind.low && fault.amount <= kind.high,
          "fault " + name + ": amount " + Shown(fault.amount) + fault.unit + " must be " +
              Shown(kind.low) + " to " + Shown(kind.high));
  Require(fault.trigger >= 1, "fault " + name + ": triggers are numbered from 1");
  return fault;
}

FaultConfig ParseFault(const std::string& text) {
  std::string rest = text, unit;
  std::optional<std::int64_t> trigger;
  std::optional<double> amount;
  if (const std::size_t at = rest.rfind('@'); at != std::string::npos) {
    std::string junk;
    trigger = Parse<std::int64_t>(rest.substr(at + 1), text, &junk);
    Require(junk.empty(), "fault '" + text + "': the trigger is a whole number");
    rest.resize(at);
  }
  std::vector<std::string> parts;
  for (std::istringstream stream(rest); std::getline(stream, rest, ':');) parts.push_back(rest);
  parts.resize(std::max<std::size_t>(parts.size(), 1));
  Require(parts.size() <= 3, "fault '" + text + "': write NAME[:CAMERA[:AMOUNT]][@TRIGGER]");
  if (parts.size() == 3) amount = Parse<double>(parts[2], text, &unit);
  return MakeFault(parts[0], parts.size() > 1 ? parts[1] : "", amount, unit, trigger);
}

}  // namespace sole
