#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "capture/trigger.h"
#include "core/error.h"
#include "core/trigger_bus.h"

namespace sole::capture {
namespace {

class SimulatedTrigger : public Trigger {
 public:
  explicit SimulatedTrigger(int bus_port)
      : port_(bus_port), socket_(socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    Require(socket_ >= 0,
            std::string("no socket for the simulated trigger: ") + std::strerror(errno));
    address_.sin_family = AF_INET;
    address_.sin_port = htons(static_cast<std::uint16_t>(bus_port));
    address_.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  }
  ~SimulatedTrigger() override { close(socket_); }
  SimulatedTrigger(const SimulatedTrigger&) = delete;
  SimulatedTrigger& operator=(const SimulatedTrigger&) = delete;

  void Emit(const TriggerEdge& edge) override {
    TriggerPulse pulse;
    pulse.sequence = edge.sequence;
    pulse.scheduled_ns =
        edge.actual_ns;  // a line knows no plan: cameras see the edge when it comes
    pulse.kind = edge.kind == ExposureKind::kTexture ? 1 : 0;
    const auto bytes = Encode(pulse);
    const ssize_t sent = sendto(socket_, bytes.data(), bytes.size(), 0,
                                reinterpret_cast<const sockaddr*>(&address_), sizeof address_);
    Require(sent == static_cast<ssize_t>(bytes.size()),
            "cannot send a pulse to the trigger bus 127.0.0.1:" + std::to_string(port_) + ": " +
                std::strerror(errno));
  }

 private:
  int port_;
  int socket_;
  sockaddr_in address_{};
};

}  // namespace

std::unique_ptr<Trigger> MakeSimulatedTrigger(int bus_port) {
  Require(bus_port > 0 && bus_port < 65536,
          "trigger bus_port " + std::to_string(bus_port) + " is not a UDP port: use 1 to 65535");
  return std::make_unique<SimulatedTrigger>(bus_port);
}

}  // namespace sole::capture
