#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

namespace sole {

/// What a fault acts on: cameras (one, or all if none is named) or the rig as a whole.
enum class FaultScope { kCamera, kRig };

/// One kind of fault the simulated rig can be told to produce (docs/faults.md).
struct FaultKind {
  const char* name;
  FaultScope scope;
  const char* unit;      ///< of the amount; empty for plain numbers
  double amount;         ///< if none is given
  double low, high;      ///< bounds of the amount; both belong to it
  std::int64_t trigger;  ///< at which it happens or begins, if none is given
};

/// Every kind. A name appears once per unit it can be told in; the first is the default.
std::span<const FaultKind> FaultKinds();

/// A fault of this rig: [[simulation.fault]] of the rig file, --fault on the command line.
struct FaultConfig {
  std::string name;
  std::string camera;        ///< serial; empty for every camera
  std::int64_t trigger = 1;  ///< number of the trigger at which it happens or begins
  double amount = 0;
  std::string unit;
};

/// What is left out takes the kind's defaults. Throws Error for an unknown name (listing all), a
/// camera where none belongs, an unknown unit, and amounts or triggers out of bounds.
FaultConfig MakeFault(const std::string& name, const std::string& camera = "",
                      std::optional<double> amount = {}, const std::string& unit = "",
                      std::optional<std::int64_t> trigger = {});

/// From NAME[:CAMERA[:AMOUNT[UNIT]]][@TRIGGER], such as "fog", "dead-link:CAM2:1.5@4" or
/// "bumped-camera:CAM3:0.2deg". Throws Error.
FaultConfig ParseFault(const std::string& text);

}  // namespace sole
