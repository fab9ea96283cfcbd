#include "sim/gige/udp_socket.h"

#include <cerrno>
#include <cstring>

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include "core/error.h"

namespace sole::sim {
namespace {

sockaddr_in Native(const Endpoint& endpoint) {
  sockaddr_in native{};
  native.sin_family = AF_INET;
  native.sin_addr.s_addr = htonl(endpoint.address);
  native.sin_port = htons(endpoint.port);
  return native;
}

Endpoint FromNative(const sockaddr_in& native) {
  return {ntohl(native.sin_addr.s_addr), ntohs(native.sin_port)};
}

}  // namespace

std::string ToString(const Endpoint& endpoint) {
  return fmt::format("{}.{}.{}.{}:{}", endpoint.address >> 24, (endpoint.address >> 16) & 255,
                     (endpoint.address >> 8) & 255, endpoint.address & 255, endpoint.port);
}

UdpSocket::UdpSocket(const Endpoint& endpoint, const std::string& purpose, bool shared) {
  descriptor_ = socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (descriptor_ < 0)
    throw Error(fmt::format("cannot make a UDP socket for {}: {}", purpose, std::strerror(errno)));
  const int yes = 1;
  if (shared) {
    setsockopt(descriptor_, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    setsockopt(descriptor_, SOL_SOCKET, SO_REUSEPORT, &yes, sizeof yes);
  }
  const int buffer_bytes = 4 << 20;  // The kernel cuts it to what it allows.
  setsockopt(descriptor_, SOL_SOCKET, SO_SNDBUF, &buffer_bytes, sizeof buffer_bytes);
  setsockopt(descriptor_, SOL_SOCKET, SO_RCVBUF, &buffer_bytes, sizeof buffer_bytes);
  const sockaddr_in native = Native(endpoint);
  if (bind(descriptor_, reinterpret_cast<const sockaddr*>(&native), sizeof native) != 0) {
    const int error = errno;
    close(descriptor_);
    throw Error(fmt::format("cannot use UDP {} for {}: {}; is another simulated rig running?",
                            ToString(endpoint), purpose, std::strerror(error)));
  }
}

UdpSocket::~UdpSocket() { close(descriptor_); }

Endpoint UdpSocket::Local() const {
  sockaddr_in native{};
  socklen_t size = sizeof native;
  getsockname(descriptor_, reinterpret_cast<sockaddr*>(&native), &size);
  return FromNative(native);
}

std::optional<std::span<std::uint8_t>> UdpSocket::Receive(std::span<std::uint8_t> buffer,
                                                          Endpoint* from) {
  sockaddr_in native{};
  socklen_t size = sizeof native;
  const ssize_t count = recvfrom(descriptor_, buffer.data(), buffer.size(), 0,
                                 reinterpret_cast<sockaddr*>(&native), &size);
  if (count < 0) return {};
  *from = FromNative(native);
  return buffer.first(static_cast<std::size_t>(count));
}

void UdpSocket::Send(std::span<const std::uint8_t> bytes, const Endpoint& to) {
  const sockaddr_in native = Native(to);
  // A lost answer is repeated by the client, as on any network.
  (void)!sendto(descriptor_, bytes.data(), bytes.size(), 0,
                reinterpret_cast<const sockaddr*>(&native), sizeof native);
}

}  // namespace sole::sim
