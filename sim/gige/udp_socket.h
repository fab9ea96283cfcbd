#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

namespace sole::sim {

/// An IPv4 address and port, both in host order.
struct Endpoint {
  std::uint32_t address = 0;
  std::uint16_t port = 0;
  bool operator==(const Endpoint&) const = default;
};

/// "127.0.0.1:3956".
std::string ToString(const Endpoint& endpoint);

/// A non-blocking UDP socket bound to one endpoint; owns the descriptor.
class UdpSocket {
 public:
  /// Throws Error naming `purpose` and the endpoint. With `shared`, several sockets may hold the
  /// endpoint (each receives every broadcast).
  UdpSocket(const Endpoint& endpoint, const std::string& purpose, bool shared = false);
  ~UdpSocket();
  UdpSocket(const UdpSocket&) = delete;
  UdpSocket& operator=(const UdpSocket&) = delete;

  int Descriptor() const { return descriptor_; }
  Endpoint Local() const;
  /// Copies the next waiting datagram into `buffer` (cut to its size) and returns its part; empty
  /// if none waits.
  std::optional<std::span<std::uint8_t>> Receive(std::span<std::uint8_t> buffer, Endpoint* from);
  void Send(std::span<const std::uint8_t> bytes, const Endpoint& to);

 private:
  int descriptor_ = -1;
};

}  // namespace sole::sim
