// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A CAN socket of Linux (SocketCAN, CAN_RAW; `Documentation/networking/can.rst` of the kernel) as
/// the transport of frames. It never waits. Linux only.
///
/// The interface is brought up by the system: `ip link set can0 up type can bitrate 1000000`, with
/// `restart-ms 100` where a bus that went off is to come back by itself.
#pragma once

#include <fcntl.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string>
#include <utility>

#include "icat/adapters/can_frame.hpp"
#include "icat/core/error.hpp"

namespace icat {

/// Results of the calls of a CAN socket.
enum class [[nodiscard]] CanStatus{
    ok,         ///< a frame went out, or came in
    empty,      ///< nothing has come
    full,       ///< the queue of what is to be sent is full; the frame is not in it
    error,      ///< the controller reports an error: `errors` counts it
    malformed,  ///< what came is no frame of classical CAN; what is to be sent neither
    down,       ///< the interface is down or gone: `last_error` is the reason
};

/// What the controller reported since the socket was opened.
struct CanErrors {
  unsigned frames{0};          ///< error frames in all
  unsigned bus_off{0};         ///< how often the controller left the bus
  unsigned passive{0};         ///< how often it became error-passive
  unsigned restarted{0};       ///< how often it came back
  unsigned lost{0};            ///< frames that came faster than the controller could take them
  unsigned unacknowledged{0};  ///< frames that no other node took
  bool off{false};             ///< it is off the bus now
};

/// See the file comment. Owns its descriptor. After construction nothing allocates.
class SocketCan {
 public:
  /// Opens `interface`, "can0" for example.
  /// @throws std::invalid_argument with the name and the system's reason.
  [[gnu::cold]] explicit SocketCan(const std::string& interface) {
    if (interface.empty() || interface.size() >= IFNAMSIZ) {
      detail::invalid("CAN interface '", interface, "': no such name");
    }
    descriptor_ = ::socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW);
    if (descriptor_ < 0) refuse(interface);
    ifreq request{};
    std::memcpy(request.ifr_name, interface.data(), interface.size());
    const can_err_mask_t all = CAN_ERR_MASK;
    sockaddr_can address{};
    address.can_family = AF_CAN;
    if (::ioctl(descriptor_, SIOCGIFINDEX, &request) != 0 ||
        ::setsockopt(descriptor_, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &all, sizeof all) != 0 ||
        (address.can_ifindex = request.ifr_ifindex,
         ::bind(descriptor_, reinterpret_cast<const sockaddr*>(&address), sizeof address)) != 0) {
      refuse(interface);
    }
  }
  /// Takes an open descriptor that carries `struct can_frame`, one in each message: a CAN socket
  /// that was opened elsewhere, or one end of a `SOCK_SEQPACKET` pair. It is made non-blocking, and
  /// is closed by the destructor.
  /// @throws std::invalid_argument where it is not open.
  [[gnu::cold]] static SocketCan from_descriptor(int descriptor) {
    const int flags = ::fcntl(descriptor, F_GETFL);
    if (flags < 0 || ::fcntl(descriptor, F_SETFL, flags | O_NONBLOCK) != 0) {
      detail::invalid("CAN socket: descriptor ", descriptor, " is not open");
    }
    return SocketCan(descriptor);
  }
  /// Closes the descriptor.
  ~SocketCan() { close(); }
  /// Leaves `other` without descriptor: it answers `down`.
  SocketCan(SocketCan&& other) noexcept
      : descriptor_(std::exchange(other.descriptor_, -1)),
        last_error_(other.last_error_),
        errors_(other.errors_) {}
  /// The same.
  SocketCan& operator=(SocketCan&& other) noexcept {
    if (this != &other) {
      close();
      descriptor_ = std::exchange(other.descriptor_, -1);
      last_error_ = other.last_error_;
      errors_ = other.errors_;
    }
    return *this;
  }

  /// Hands a frame to the kernel: `ok`, `full`, `malformed` or `down`. `ok` does not say that
  /// another node has it.
  CanStatus send(const CanFrame& frame) noexcept {
    const std::uint32_t most = frame.extended ? CAN_EFF_MASK : CAN_SFF_MASK;
    if (frame.id > most || frame.size > 8) return CanStatus::malformed;
    can_frame raw{};
    raw.can_id = frame.id | (frame.extended ? CAN_EFF_FLAG : 0) | (frame.remote ? CAN_RTR_FLAG : 0);
    raw.can_dlc = frame.size;
    if (!frame.remote) std::memcpy(raw.data, frame.data.data(), frame.size);
    const ssize_t n = ::send(descriptor_, &raw, sizeof raw, MSG_DONTWAIT | MSG_NOSIGNAL);
    if (n == static_cast<ssize_t>(sizeof raw)) return CanStatus::ok;
    if (n >= 0) return CanStatus::malformed;
    if (errno == ENOBUFS || errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR) {
      return CanStatus::full;
    }
    last_error_ = errno;
    return CanStatus::down;
  }
  /// Takes the next frame that has come. Anything but `ok` leaves `frame` as it was. After `empty`
  /// there is no more; after `down` there may be what came before the interface went.
  CanStatus receive(CanFrame& frame) noexcept {
    can_frame raw{};
    // A message that is longer is no can_frame: MSG_TRUNC makes the kernel say so.
    const ssize_t n = ::recv(descriptor_, &raw, sizeof raw, MSG_DONTWAIT | MSG_TRUNC);
    if (n < 0) {
      if (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR) return CanStatus::empty;
      last_error_ = errno;
      return CanStatus::down;
    }
    if (n == 0) {
      last_error_ = EPIPE;
      return CanStatus::down;
    }
    if (n != static_cast<ssize_t>(sizeof raw) || raw.can_dlc > 8) return CanStatus::malformed;
    if ((raw.can_id & CAN_ERR_FLAG) != 0) {
      count(raw);
      return CanStatus::error;
    }
    frame.extended = (raw.can_id & CAN_EFF_FLAG) != 0;
    frame.remote = (raw.can_id & CAN_RTR_FLAG) != 0;
    frame.id = raw.can_id & (frame.extended ? CAN_EFF_MASK : CAN_SFF_MASK);
    frame.size = raw.can_dlc;
    frame.data.fill(0);
    if (!frame.remote) std::memcpy(frame.data.data(), raw.data, frame.size);
    return CanStatus::ok;
  }

  /// Gives each frame that has come to `take`, `void(const CanFrame&)`, at most `most` of them, so
  /// that a bus that never falls silent does not hold the loop. `ok`, also where nothing came;
  /// `full`: there may be more; `down`.
  template <class Take>
  CanStatus receive_all(Take&& take, int most = 1024) noexcept {
    CanFrame frame;
    for (int i = 0; i < most; ++i) {
      const CanStatus status = receive(frame);
      if (status == CanStatus::empty) return CanStatus::ok;
      if (status == CanStatus::down) return status;
      if (status == CanStatus::ok) take(static_cast<const CanFrame&>(frame));
    }
    return CanStatus::full;
  }

  /// What the controller reported.
  const CanErrors& errors() const noexcept { return errors_; }
  /// `errno` of the last `down`; 0 where there was none.
  int last_error() const noexcept { return last_error_; }
  /// To wait on with `poll`, outside of a control step.
  int descriptor() const noexcept { return descriptor_; }

 private:
  explicit SocketCan(int descriptor) noexcept : descriptor_(descriptor) {}
  void close() noexcept {
    if (descriptor_ >= 0) ::close(descriptor_);
    descriptor_ = -1;
  }
  [[noreturn]] [[gnu::cold]] void refuse(const std::string& interface) {
    const char* reason = std::strerror(errno);
    close();
    detail::invalid("CAN interface '", interface, "': ", reason);
  }
  void count(const can_frame& raw) noexcept {
    ++errors_.frames;
    if ((raw.can_id & CAN_ERR_BUSOFF) != 0) {
      ++errors_.bus_off;
      errors_.off = true;
    }
    if ((raw.can_id & CAN_ERR_RESTARTED) != 0) {
      ++errors_.restarted;
      errors_.off = false;
    }
    if ((raw.can_id & CAN_ERR_ACK) != 0) ++errors_.unacknowledged;
    if ((raw.can_id & CAN_ERR_CRTL) != 0) {
      if ((raw.data[1] & (CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE)) != 0) {
        ++errors_.passive;
      }
      if ((raw.data[1] & CAN_ERR_CRTL_RX_OVERFLOW) != 0) ++errors_.lost;
    }
  }

  int descriptor_{-1};
  int last_error_{0};
  CanErrors errors_;
};

}  // namespace icat
