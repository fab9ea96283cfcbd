#pragma once

#include <string>
#include <vector>

namespace sole::capture {

/// A camera that answered discovery.
struct FoundCamera {
  std::string id;  ///< opens exactly this device
  std::string serial;
  std::string vendor;
  std::string model;
  std::string address;
  std::string protocol;
};

/// Asks every network interface for cameras and waits about a second for answers. Sorted by serial.
std::vector<FoundCamera> ListCameras();

/// "SIM0001 at 127.0.0.11, SIM0002 at 127.0.0.12", or "none".
std::string Describe(const std::vector<FoundCamera>& cameras);

}  // namespace sole::capture
