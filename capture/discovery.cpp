#include "capture/discovery.h"

#include <arv.h>

#include <algorithm>
#include <mutex>

namespace sole::capture {
namespace {

std::string Text(const char* text) { return text == nullptr ? "" : text; }

}  // namespace

std::vector<FoundCamera> ListCameras() {
  static std::mutex mutex;  // Aravis keeps one list for the whole process
  const std::lock_guard lock(mutex);
  arv_update_device_list();
  std::vector<FoundCamera> found;
  for (unsigned i = 0; i < arv_get_n_devices(); ++i) {
    found.push_back({Text(arv_get_device_id(i)), Text(arv_get_device_serial_nbr(i)),
                     Text(arv_get_device_vendor(i)), Text(arv_get_device_model(i)),
                     Text(arv_get_device_address(i)), Text(arv_get_device_protocol(i))});
  }
  std::sort(found.begin(), found.end(),
            [](const FoundCamera& a, const FoundCamera& b) { return a.serial < b.serial; });
  return found;
}

std::string Describe(const std::vector<FoundCamera>& cameras) {
  std::string text;
  for (const FoundCamera& camera : cameras) {
    text += (text.empty() ? "" : ", ") + camera.serial + " at " + camera.address;
  }
  return text.empty() ? "none" : text;
}

}  // namespace sole::capture
