// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A serial port (termios) or a TCP connection to a device on Linux, as a stream of bytes that
/// never blocks, for sensors and modems; docs/acoustic_modem.md has an example.
///
/// `open` is called once per cycle. It opens the stream where it is closed, with a pause between
/// two tries, and finishes a connection that is under way. A stream that breaks closes itself;
/// the next `open` begins anew. No call but `close` of a serial line waits; none allocates, throws
/// or raises a signal (SIGPIPE).
#pragma once

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <span>
#include <string>

#include "icat/core/error.hpp"

namespace icat {

/// A serial device: 8 data bits, no parity, one stop bit, no flow control.
struct SerialPort {
  std::string device;  ///< such as "/dev/ttyUSB0"
  int baud{19200};     ///< bit/s, one of termios: 1200 … 921600
};

/// A device that listens for TCP connections. Names are not resolved, as that would wait.
struct TcpServer {
  std::string address;  ///< in numbers, such as "127.0.0.1" or "::1"
  int port{0};          ///< 1 … 65535
};

namespace detail::byte_stream {

struct Speed {
  int baud;
  speed_t code;
};
inline constexpr Speed speeds[] = {
    {1200, B1200},     {2400, B2400},   {4800, B4800},     {9600, B9600},     {19200, B19200},
    {38400, B38400},   {57600, B57600}, {115200, B115200}, {230400, B230400},
#ifdef B460800
    {460800, B460800},
#endif
#ifdef B921600
    {921600, B921600},
#endif
};

}  // namespace detail::byte_stream

/// See the file comment. Belongs to one thread.
class ByteStream {
 public:
  /// Settings, with defaults.
  struct Options {
    double retry{1};            ///< s, > 0, between two tries to open
    double connect_timeout{3};  ///< s, > 0, after which a connection that is under way is given up
    double broken_after{5};  ///< s, > 0: TCP gives up on a peer that acknowledges nothing so long
  };

  /// Opens nothing yet. Allocates.
  /// @throws std::invalid_argument on an empty name, a baud rate that termios does not have, or
  ///         options that are not > 0.
  explicit ByteStream(const SerialPort& port, const Options& options)
      : options_(validated(options)), device_(port.device), serial_(true) {
    if (device_.empty()) detail::invalid("ByteStream: the serial device has no name");
    for (const auto& speed : detail::byte_stream::speeds) {
      if (speed.baud == port.baud) speed_ = speed.code;
    }
    if (speed_ == B0) {
      detail::invalid("ByteStream '", device_, "': no baud rate of termios: ", port.baud);
    }
  }
  /// The same with the default options.
  explicit ByteStream(const SerialPort& port) : ByteStream(port, Options{}) {}
  /// Connects to nothing yet. Allocates.
  /// @throws std::invalid_argument on an address that is not in numbers, a port outside 1 … 65535,
  ///         or options that are not > 0.
  explicit ByteStream(const TcpServer& server, const Options& options)
      : options_(validated(options)), device_(server.address) {
    if (server.port < 1 || server.port > 65535) {
      detail::invalid("ByteStream '", device_, "': port must be in [1, 65535], got ", server.port);
    }
    const auto port = htons(static_cast<std::uint16_t>(server.port));
    sockaddr_in four{};
    sockaddr_in6 six{};
    if (::inet_pton(AF_INET, device_.c_str(), &four.sin_addr) == 1) {
      four.sin_family = AF_INET;
      four.sin_port = port;
      std::memcpy(&peer_, &four, peer_size_ = sizeof four);
    } else if (::inet_pton(AF_INET6, device_.c_str(), &six.sin6_addr) == 1) {
      six.sin6_family = AF_INET6;
      six.sin6_port = port;
      std::memcpy(&peer_, &six, peer_size_ = sizeof six);
    } else {
      detail::invalid("ByteStream: '", device_, "' is no IP address in numbers");
    }
  }
  /// The same with the default options.
  explicit ByteStream(const TcpServer& server) : ByteStream(server, Options{}) {}
  /// Closes it.
  ~ByteStream() { close(); }
  ByteStream(const ByteStream&) = delete;
  ByteStream& operator=(const ByteStream&) = delete;

  /// To be called once per cycle at `time`, s: opens the stream where it is closed and `retry` has
  /// passed since the last try. Whether it is open now; a time that is not finite opens nothing.
  bool open(double time) noexcept {
    if (open_) return true;
    if (!std::isfinite(time)) return false;
    if (descriptor_ >= 0) return finish(time);
    // A clock that was set back does not make it wait longer.
    const double left = tried_ + options_.retry - time;
    if (left > 0 && left <= options_.retry) return false;
    tried_ = time;
    return serial_ ? open_serial() : connect(time);
  }
  /// It can be read and written.
  bool is_open() const noexcept { return open_; }
  /// How often it was opened; wraps around. A change says that what was sent before may be lost.
  std::uint32_t openings() const noexcept { return openings_; }
  /// For `poll`; −1 where it is closed.
  int descriptor() const noexcept { return descriptor_; }
  /// Nothing happens where it is closed. A serial line that has not sent all waits for that, by
  /// Linux's default up to 30 s.
  void close() noexcept {
    if (descriptor_ >= 0) ::close(descriptor_);
    descriptor_ = -1;
    open_ = false;
  }

  /// What has come, at most what `bytes` holds: how many bytes of it were filled, 0 where there is
  /// nothing. Where the other side has gone the stream closes.
  std::size_t read(std::span<std::byte> bytes) noexcept {
    if (!open_ || bytes.empty()) return 0;
    const ssize_t n = ::read(descriptor_, bytes.data(), bytes.size());
    if (n > 0) return static_cast<std::size_t>(n);
    if (n == 0 || !is_transient(errno)) close();
    return 0;
  }
  /// How many of `bytes`, from the front, the system has taken; the caller offers the rest again.
  /// Where the other side has gone the stream closes.
  std::size_t write(std::span<const std::byte> bytes) noexcept {
    if (!open_ || bytes.empty()) return 0;
    const ssize_t n = serial_ ? ::write(descriptor_, bytes.data(), bytes.size())
                              : ::send(descriptor_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (n >= 0) return static_cast<std::size_t>(n);
    if (!is_transient(errno)) close();
    return 0;
  }

 private:
  static const Options& validated(const Options& o) {
    detail::require_positive("ByteStream", "retry", o.retry);
    detail::require_positive("ByteStream", "connect_timeout", o.connect_timeout);
    detail::require_positive("ByteStream", "broken_after", o.broken_after);
    return o;
  }
  static bool is_transient(int error) noexcept {
    return error == EAGAIN || error == EWOULDBLOCK || error == EINTR;
  }
  bool fail() noexcept {
    close();
    return false;
  }
  bool succeed() noexcept {
    open_ = true;
    ++openings_;
    return true;
  }

  bool open_serial() noexcept {
    descriptor_ = ::open(device_.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (descriptor_ < 0) return false;
    termios raw{};
    // What is no terminal fails here, so no `write` meets a pipe, which could raise SIGPIPE.
    if (::tcgetattr(descriptor_, &raw) != 0) return fail();
    raw.c_iflag = 0;
    raw.c_oflag = 0;
    raw.c_lflag = 0;
    raw.c_cflag = CS8 | CREAD | CLOCAL;
    raw.c_cc[VMIN] = 1;  // with 0, nothing to read would look like the end
    raw.c_cc[VTIME] = 0;
    if (::cfsetispeed(&raw, speed_) != 0 || ::cfsetospeed(&raw, speed_) != 0 ||
        ::tcsetattr(descriptor_, TCSANOW, &raw) != 0) {
      return fail();
    }
    (void)::ioctl(descriptor_, TIOCEXCL);  // another reader would take half of the bytes
    (void)::tcflush(descriptor_, TCIOFLUSH);
    return succeed();
  }

  bool connect(double time) noexcept {
    descriptor_ = ::socket(peer_.ss_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (descriptor_ < 0) return false;
    const int on = 1;
    (void)::setsockopt(descriptor_, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    (void)::setsockopt(descriptor_, SOL_SOCKET, SO_KEEPALIVE, &on, sizeof on);
#ifdef TCP_USER_TIMEOUT
    // A cable that is pulled says nothing: without these the kernel waits for many minutes.
    const double limit = std::fmin(options_.broken_after, 86400);
    const auto milliseconds = static_cast<unsigned>(std::ceil(1e3 * limit));
    const int seconds = static_cast<int>(std::ceil(limit));
    (void)::setsockopt(descriptor_, IPPROTO_TCP, TCP_USER_TIMEOUT, &milliseconds,
                       sizeof milliseconds);
    (void)::setsockopt(descriptor_, IPPROTO_TCP, TCP_KEEPIDLE, &seconds, sizeof seconds);
    (void)::setsockopt(descriptor_, IPPROTO_TCP, TCP_KEEPINTVL, &seconds, sizeof seconds);
#endif
    began_ = time;
    if (::connect(descriptor_, reinterpret_cast<const sockaddr*>(&peer_), peer_size_) == 0) {
      return finish(time);
    }
    return errno == EINPROGRESS ? finish(time) : fail();
  }
  bool finish(double time) noexcept {
    pollfd ready{descriptor_, POLLOUT, 0};
    if (::poll(&ready, 1, 0) <= 0) {
      const double waited = time - began_;
      return waited >= 0 && waited <= options_.connect_timeout ? false : fail();
    }
    int error = 0;
    socklen_t size = sizeof error;
    if (::getsockopt(descriptor_, SOL_SOCKET, SO_ERROR, &error, &size) != 0 || error != 0) {
      return fail();
    }
    return is_itself() ? fail() : succeed();
  }
  // A port of this machine that nobody listens on may be the one the system chose for our own end:
  // TCP then connects the socket to itself.
  bool is_itself() const noexcept {
    sockaddr_storage mine{}, other{};
    socklen_t mine_size = sizeof mine, other_size = sizeof other;
    if (::getsockname(descriptor_, reinterpret_cast<sockaddr*>(&mine), &mine_size) != 0 ||
        ::getpeername(descriptor_, reinterpret_cast<sockaddr*>(&other), &other_size) != 0) {
      return true;  // not connected after all
    }
    return mine_size == other_size && std::memcmp(&mine, &other, mine_size) == 0;
  }

  Options options_;
  std::string device_;
  bool serial_{false}, open_{false};
  speed_t speed_{B0};
  sockaddr_storage peer_{};
  socklen_t peer_size_{0};
  int descriptor_{-1};
  std::uint32_t openings_{0};
  double tried_{-std::numeric_limits<double>::infinity()}, began_{0};
};

}  // namespace icat
