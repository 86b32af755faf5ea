// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A UDP socket that never blocks, for adapters that decode and encode bytes: one call reads an
/// available datagram, one sends. IPv4, POSIX. Datagrams can be lost, doubled and reordered: the
/// protocol must number its messages.
#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>

#include "icat/core/error.hpp"

namespace icat {

/// See the file comment. Moves, does not copy. No call but the construction allocates or throws.
class UdpSocket {
 public:
  /// Sends to `address`:`port` and takes datagrams from there alone, at a port of its own that the
  /// system chooses.
  /// @param address in numbers, "192.168.2.2"
  /// @param port the other end's
  /// @throws std::invalid_argument on an address that is none, or with what the system says.
  static UdpSocket connect(const std::string& address, std::uint16_t port) {
    UdpSocket socket;
    const sockaddr_in to = name(address, port);
    if (::connect(socket.file_, generic(&to), sizeof to) != 0) failed("connect", address, port);
    socket.connected_ = true;
    return socket;
  }
  /// Takes datagrams from anyone at `address`:`port`, and sends to who sent the last one that was
  /// read; until one was, nothing is sent. Anyone who reaches the port can command: "127.0.0.1", or
  /// a network of your own.
  /// @param address in numbers, of this machine; "0.0.0.0" is all of them
  /// @param port 0: the system chooses, `port` says which.
  /// @throws std::invalid_argument on an address that is none, or with what the system says.
  static UdpSocket listen(const std::string& address, std::uint16_t port) {
    UdpSocket socket;
    const sockaddr_in at = name(address, port);
    if (::bind(socket.file_, generic(&at), sizeof at) != 0) failed("bind", address, port);
    return socket;
  }
  ~UdpSocket() {
    if (file_ >= 0) ::close(file_);
  }
  /// `other` is closed, and of no more use.
  UdpSocket(UdpSocket&& other) noexcept
      : file_(other.file_), connected_(other.connected_), known_(other.known_), peer_(other.peer_) {
    other.file_ = -1;
  }
  UdpSocket(const UdpSocket&) = delete;
  UdpSocket& operator=(const UdpSocket&) = delete;

  /// The next datagram, at the begin of `into`; what does not fit is lost. Returns its size, 0
  /// where there is none, or an empty one. Does not wait. A peer that is not there is nothing to
  /// read.
  std::size_t receive(std::span<std::uint8_t> into) noexcept {
    sockaddr_in from{};
    socklen_t size = sizeof from;
    const ssize_t n =
        ::recvfrom(file_, into.data(), into.size(), MSG_DONTWAIT, generic(&from), &size);
    if (n <= 0) return 0;
    if (!connected_) {
      peer_ = from;
      known_ = true;
    }
    return static_cast<std::size_t>(n);
  }
  /// One datagram. False: not sent, as nobody is known to send to or the system does not take it
  /// now; it is not kept. Does not wait. An empty one is not sent, which is well.
  bool send(std::span<const std::uint8_t> bytes) noexcept {
    if (bytes.empty()) return true;
    const bool named = !connected_;
    if (named && !known_) return false;
    // The first call after a datagram that nobody took reports that, and sends nothing.
    for (int tries = 0; tries < 2; ++tries) {
      const ssize_t n =
          ::sendto(file_, bytes.data(), bytes.size(), MSG_DONTWAIT | MSG_NOSIGNAL,
                   named ? generic(&peer_) : nullptr, named ? socklen_t(sizeof peer_) : 0);
      if (n == static_cast<ssize_t>(bytes.size())) return true;
      if (errno != ECONNREFUSED) return false;
    }
    return false;
  }
  /// The port of this end; 0 where the system does not say.
  std::uint16_t port() const noexcept {
    sockaddr_in at{};
    socklen_t size = sizeof at;
    if (::getsockname(file_, generic(&at), &size) != 0) return 0;
    return ntohs(at.sin_port);
  }

 private:
  UdpSocket() : file_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)) {
    if (file_ < 0) detail::invalid("UDP: socket: ", std::strerror(errno));
  }
  static sockaddr_in name(const std::string& address, std::uint16_t port) {
    sockaddr_in result{};
    result.sin_family = AF_INET;
    result.sin_port = htons(port);
    if (::inet_pton(AF_INET, address.c_str(), &result.sin_addr) != 1) {
      detail::invalid("UDP: '", address, "' is no address of IPv4 in numbers");
    }
    return result;
  }
  static sockaddr* generic(sockaddr_in* a) noexcept { return reinterpret_cast<sockaddr*>(a); }
  static const sockaddr* generic(const sockaddr_in* a) noexcept {
    return reinterpret_cast<const sockaddr*>(a);
  }
  [[noreturn]] [[gnu::cold]] static void failed(const char* what, const std::string& address,
                                                std::uint16_t port) {
    detail::invalid("UDP: ", what, " ", address, ":", port, ": ", std::strerror(errno));
  }

  int file_;
  bool connected_{false};
  bool known_{false};
  sockaddr_in peer_{};
};

}  // namespace icat
