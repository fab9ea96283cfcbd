// GigE Vision action commands (GVCP ACTION_CMD), which Aravis 0.8.26 does not send.
#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>

#include "capture/trigger.h"
#include "core/error.h"

namespace sole::capture {
namespace {

constexpr std::uint16_t kGvcpPort = 3956;
constexpr std::size_t kCommandSize = 20;

void Store32(std::array<std::uint8_t, kCommandSize>& bytes, std::size_t at, std::uint32_t value) {
  for (std::size_t i = 0; i < 4; ++i)
    bytes[at + i] = static_cast<std::uint8_t>(value >> (24 - 8 * i));
}

/// A UDP socket that may broadcast; bound to `local`, so that datagrams leave there.
int OpenSocket(std::uint32_t local) {
  const int descriptor = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (descriptor < 0) return -1;
  const int on = 1;
  setsockopt(descriptor, SOL_SOCKET, SO_BROADCAST, &on, sizeof on);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = local;
  if (bind(descriptor, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0)
    return descriptor;
  close(descriptor);
  return -1;
}

class ActionTrigger : public Trigger {
 public:
  explicit ActionTrigger(const ActionTriggerOptions& options) : options_(options) {
    destination_.sin_family = AF_INET;
    destination_.sin_port = htons(kGvcpPort);
    Require(inet_pton(AF_INET, options.address.c_str(), &destination_.sin_addr) == 1,
            "trigger action_address '" + options.address +
                "' is no IPv4 address: use 255.255.255.255 or the broadcast address of the "
                "cameras' network");
    if (destination_.sin_addr.s_addr == INADDR_BROADCAST) {
      OpenOnEveryInterface();
    } else if (const int descriptor = OpenSocket(htonl(INADDR_ANY)); descriptor >= 0) {
      sockets_.push_back(descriptor);
    }
    Require(!sockets_.empty(), std::string("no socket for action commands: ") +
                                   std::strerror(errno) + ": is a network interface up?");
  }
  ~ActionTrigger() override {
    for (const int descriptor : sockets_) close(descriptor);
  }
  ActionTrigger(const ActionTrigger&) = delete;
  ActionTrigger& operator=(const ActionTrigger&) = delete;

  void Emit(const TriggerEdge&) override {
    std::array<std::uint8_t, kCommandSize> bytes{0x42, 0x00, 0x01, 0x00, 0x00, 0x0C};
    if (++request_ == 0) ++request_;  // 0 is no request
    bytes[6] = static_cast<std::uint8_t>(request_ >> 8);
    bytes[7] = static_cast<std::uint8_t>(request_);
    Store32(bytes, 8, options_.device_key);
    Store32(bytes, 12, options_.group_key);
    Store32(bytes, 16, options_.group_mask);
    bool sent = false;
    for (const int descriptor : sockets_) {
      sent = sendto(descriptor, bytes.data(), bytes.size(), 0,
                    reinterpret_cast<const sockaddr*>(&destination_),
                    sizeof destination_) == static_cast<ssize_t>(bytes.size()) ||
             sent;
    }
    Require(sent, "cannot send an action command to " + options_.address + ": " +
                      std::strerror(errno));
  }
  std::string CameraSource() const override { return "Action1"; }

 private:
  void OpenOnEveryInterface() {
    ifaddrs* list = nullptr;
    if (getifaddrs(&list) != 0) return;
    for (const ifaddrs* item = list; item != nullptr; item = item->ifa_next) {
      if (item->ifa_addr == nullptr || item->ifa_addr->sa_family != AF_INET) continue;
      if ((item->ifa_flags & IFF_UP) == 0) continue;
      const auto* address = reinterpret_cast<const sockaddr_in*>(item->ifa_addr);
      if (const int descriptor = OpenSocket(address->sin_addr.s_addr); descriptor >= 0)
        sockets_.push_back(descriptor);
    }
    freeifaddrs(list);
  }

  ActionTriggerOptions options_;
  sockaddr_in destination_{};
  std::vector<int> sockets_;
  std::uint16_t request_ = 0;
};

}  // namespace

std::unique_ptr<Trigger> MakeActionTrigger(const ActionTriggerOptions& options) {
  return std::make_unique<ActionTrigger>(options);
}

}  // namespace sole::capture
