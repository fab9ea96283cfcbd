#pragma once

#include <cstdint>
#include <map>
#include <vector>

namespace sole::capture {

/// By how many triggers each camera's images lag behind the others' (0: in step), from how much
/// each of its images differs from the one before (CameraMonitor::Motion): what moves, moves for
/// all cameras at once. Needs three cameras, eight triggers and movement that varies; where those
/// are missing, or nothing is certain, the answer is 0.
std::vector<int> ImageShifts(const std::vector<std::map<std::int64_t, double>>& motion);

}  // namespace sole::capture
