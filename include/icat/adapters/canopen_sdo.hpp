// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A client of the service data objects of CANopen, which reads and writes a node's object
/// dictionary [CiA 301, 7.2.4]: expedited up to four bytes, in segments of seven beyond; no block
/// transfer. Bytes in, bytes out: `receive` takes a frame, `send` gives the next one, `advance`
/// looks at the clock. A transfer takes several cycles; no call blocks.
///
/// Replies that belong to no transfer, come twice or late are ignored. What never comes ends in a
/// time-out. Replies do not say which transfer they belong to: after a time-out the next one waits
/// as long again, and an answer that is later than two time-outs can be taken for another's.
#pragma once

#include <algorithm>
#include <cstring>
#include <span>
#include <vector>

#include "icat/adapters/can_frame.hpp"
#include "icat/core/error.hpp"

namespace icat::canopen {

/// How a transfer stands.
enum class SdoState {
  idle,       ///< none was asked for
  busy,       ///< on its way
  done,       ///< the node has taken, or given, all of it
  aborted,    ///< the node refused it: `abort_code` says why
  timed_out,  ///< the node did not answer in time
  refused,    ///< the node's answer is against the protocol, or larger than the capacity
};

/// The value of an abort code in words [CiA 301, table 22]. No allocation.
constexpr const char* describe_abort(std::uint32_t code) noexcept {
  switch (code) {
    case 0x05030000:
      return "toggle bit not alternated";
    case 0x05040000:
      return "no answer in time";
    case 0x05040001:
      return "unknown command";
    case 0x05040005:
      return "out of memory";
    case 0x06010000:
      return "unsupported access to the object";
    case 0x06010001:
      return "the object can only be written";
    case 0x06010002:
      return "the object can only be read";
    case 0x06020000:
      return "no such object";
    case 0x06040041:
      return "the object cannot be mapped to the PDO";
    case 0x06040042:
      return "the mapping is longer than a PDO";
    case 0x06060000:
      return "hardware error";
    case 0x06070010:
      return "wrong length";
    case 0x06090011:
      return "no such subindex";
    case 0x06090030:
      return "value out of range";
    case 0x08000000:
      return "general error";
    case 0x08000020:
      return "cannot be stored";
    case 0x08000021:
      return "cannot be stored because of local control";
    case 0x08000022:
      return "cannot be stored in the present state of the device";
    default:
      return "unknown abort code";
  }
}

/// See the file comment. One transfer at a time. Construction allocates, nothing else does.
class SdoClient {
 public:
  /// Of the node `node`, 1 to 127. `timeout`, s, is how long an answer may take; `capacity`, bytes,
  /// how much can be carried.
  /// @throws std::invalid_argument on a node or timeout out of range, and on a capacity below 4.
  [[gnu::cold]] explicit SdoClient(int node, double timeout = 0.5, std::size_t capacity = 64)
      : node_(static_cast<std::uint32_t>(node)), timeout_(timeout), data_(capacity) {
    if (node < 1 || node > 127) detail::invalid("SDO client: node must be 1 to 127, got ", node);
    detail::require_positive("SDO client", "timeout", timeout);
    if (capacity < 4) detail::invalid("SDO client: capacity must be at least 4, got ", capacity);
  }

  /// Begins to read an object. False while a transfer or its abort is still on its way, and for one
  /// `timeout` after a transfer that timed out.
  bool upload(std::uint16_t index, std::uint8_t subindex, double now) noexcept {
    if (!begin(index, subindex, now)) return false;
    size_ = 0;
    step_ = Step::upload;
    request(0x40);
    return true;
  }
  /// Begins to write an object: `bytes` are little-endian and are copied. False where `upload` is,
  /// where there is nothing to write, and beyond the capacity.
  bool download(std::uint16_t index, std::uint8_t subindex, std::span<const std::uint8_t> bytes,
                double now) noexcept {
    if (bytes.empty() || bytes.size() > data_.size()) return false;
    if (!begin(index, subindex, now)) return false;
    std::copy(bytes.begin(), bytes.end(), data_.begin());
    size_ = bytes.size();
    step_ = Step::download;
    if (size_ <= 4) {
      request(static_cast<std::uint8_t>(0x23 | (4 - size_) << 2));
      std::copy(bytes.begin(), bytes.end(), out_.data.begin() + 4);
    } else {
      request(0x21);
      put_u32(static_cast<std::uint32_t>(size_));
    }
    return true;
  }
  /// The same for a number of `bytes` bytes, 1 to 4.
  bool download(std::uint16_t index, std::uint8_t subindex, std::uint32_t value, int bytes,
                double now) noexcept {
    if (bytes < 1 || bytes > 4) return false;
    std::array<std::uint8_t, 4> data{};
    for (std::size_t i = 0; i < 4; ++i) data[i] = static_cast<std::uint8_t>(value >> 8 * i & 0xff);
    return download(index, subindex, std::span(data).first(static_cast<std::size_t>(bytes)), now);
  }
  /// Forgets the transfer and says nothing to the node.
  void reset() noexcept {
    state_ = SdoState::idle;
    pending_ = false;
  }

  /// Takes a frame that came at `now`, s. Returns whether it was this node's answer.
  bool receive(const CanFrame& frame, double now) noexcept {
    if (frame.extended || frame.remote || frame.id != 0x580 + node_) return false;
    // An answer to a request that is not out yet is an answer to another one.
    if (state_ != SdoState::busy || pending_ || frame.size != 8) return true;
    const std::uint8_t command = frame.data[0];
    const bool same = frame.data[1] == (index_ & 0xff) && frame.data[2] == index_ >> 8 &&
                      frame.data[3] == subindex_;
    const bool in_segments = step_ == Step::upload_segment || step_ == Step::download_segment;
    if (command == 0x80) {
      if (!same && !in_segments) return true;
      abort_code_ = u32(frame);
      finish(SdoState::aborted);
      return true;
    }
    const int kind = command >> 5;
    if (step_ == Step::upload && kind == 2 && same) {
      take_upload(frame, command);
    } else if (step_ == Step::download && kind == 3 && same) {
      if (size_ <= 4) {
        finish(SdoState::done);
      } else {
        step_ = Step::download_segment;
        send_segment();
      }
    } else if (step_ == Step::upload_segment && kind == 0 && toggle_fits(command)) {
      take_segment(frame, command);
    } else if (step_ == Step::download_segment && kind == 1 && toggle_fits(command)) {
      toggle_ ^= 0x10;
      if (moved_ == size_) {
        finish(SdoState::done);
      } else {
        send_segment();
      }
    } else {
      return true;
    }
    since_ = now;
    return true;
  }
  /// Ends a transfer whose answer is late at `now`, s.
  void advance(double now) noexcept {
    if (now < since_) since_ = now;  // a clock that was set back
    if (state_ == SdoState::busy && !(now - since_ <= timeout_)) {
      give_up(0x05040000);
      since_ = now;
    }
  }
  /// Hands the next frame to `send`, `bool(const CanFrame&)`, if there is one. Returns false where
  /// `send` did: the frame stays.
  template <class Send>
  bool send(Send&& send) noexcept {
    if (!pending_) return true;
    if (!send(static_cast<const CanFrame&>(out_))) return false;
    pending_ = false;
    return true;
  }

  /// How the last transfer stands.
  SdoState state() const noexcept { return state_; }
  /// Why it ended, where it did not end well; 0 otherwise.
  std::uint32_t abort_code() const noexcept { return abort_code_; }
  /// What the node gave: of use after an upload that is `done`, until the next transfer.
  std::span<const std::uint8_t> data() const noexcept { return std::span(data_).first(size_); }
  /// The first four bytes of `data` as a number; bytes that are not there count as 0.
  std::uint32_t value() const noexcept {
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < std::min<std::size_t>(size_, 4); ++i) {
      value |= static_cast<std::uint32_t>(data_[i]) << 8 * i;
    }
    return value;
  }
  /// Index of the last transfer.
  std::uint16_t index() const noexcept { return index_; }
  /// Subindex of the last transfer.
  std::uint8_t subindex() const noexcept { return subindex_; }

 private:
  enum class Step { upload, upload_segment, download, download_segment };

  bool begin(std::uint16_t index, std::uint8_t subindex, double now) noexcept {
    if (state_ == SdoState::busy || pending_) return false;
    if (state_ == SdoState::timed_out && now - since_ < timeout_ && now >= since_) return false;
    index_ = index;
    subindex_ = subindex;
    since_ = now;
    toggle_ = 0;
    moved_ = 0;
    announced_ = 0;
    abort_code_ = 0;
    state_ = SdoState::busy;
    return true;
  }
  void request(std::uint8_t command) noexcept {
    out_ = CanFrame{0x600 + node_, 8, {}};
    out_.data[0] = command;
    out_.data[1] = static_cast<std::uint8_t>(index_ & 0xff);
    out_.data[2] = static_cast<std::uint8_t>(index_ >> 8);
    out_.data[3] = subindex_;
    pending_ = true;
  }
  void put_u32(std::uint32_t value) noexcept {
    for (std::size_t i = 0; i < 4; ++i) {
      out_.data[4 + i] = static_cast<std::uint8_t>(value >> 8 * i & 0xff);
    }
  }
  static std::uint32_t u32(const CanFrame& frame) noexcept {
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < 4; ++i) {
      value |= static_cast<std::uint32_t>(frame.data[4 + i]) << 8 * i;
    }
    return value;
  }
  void finish(SdoState state) noexcept {
    if (state != SdoState::done && step_ != Step::download && step_ != Step::download_segment) {
      size_ = 0;  // half of an object is none
    }
    state_ = state;
    pending_ = false;
  }
  void give_up(std::uint32_t code) noexcept {
    finish(code == 0x05040000 ? SdoState::timed_out : SdoState::refused);
    abort_code_ = code;
    request(0x80);
    put_u32(code);
  }
  bool toggle_fits(std::uint8_t command) const noexcept { return (command & 0x10) == toggle_; }

  void take_upload(const CanFrame& frame, std::uint8_t command) noexcept {
    const bool sized = (command & 1) != 0;
    if ((command & 2) != 0) {
      size_ = sized ? 4u - (command >> 2 & 3u) : 4u;
      std::copy_n(frame.data.begin() + 4, size_, data_.begin());
      return finish(SdoState::done);
    }
    announced_ = sized ? u32(frame) : 0;
    if (announced_ > data_.size()) return give_up(0x05040005);
    step_ = Step::upload_segment;
    request_segment();
  }
  void take_segment(const CanFrame& frame, std::uint8_t command) noexcept {
    const std::size_t count = 7u - (command >> 1 & 7u);
    if (count > data_.size() - size_) return give_up(0x05040005);
    std::copy_n(frame.data.begin() + 1, count, data_.begin() + static_cast<std::ptrdiff_t>(size_));
    size_ += count;
    toggle_ ^= 0x10;
    if ((command & 1) == 0) {
      if (count == 0) return give_up(0x05040001);  // it would never end
      return request_segment();
    }
    if (announced_ != 0 && announced_ != size_) return give_up(0x06070010);
    finish(SdoState::done);
  }
  void request_segment() noexcept {
    out_ = CanFrame{0x600 + node_, 8, {}};
    out_.data[0] = static_cast<std::uint8_t>(0x60 | toggle_);
    pending_ = true;
  }
  void send_segment() noexcept {
    const std::size_t count = std::min<std::size_t>(7, size_ - moved_);
    out_ = CanFrame{0x600 + node_, 8, {}};
    std::copy_n(data_.begin() + static_cast<std::ptrdiff_t>(moved_), count, out_.data.begin() + 1);
    moved_ += count;
    out_.data[0] =
        static_cast<std::uint8_t>(toggle_ | (7 - count) << 1 | (moved_ == size_ ? 1u : 0u));
    pending_ = true;
  }

  std::uint32_t node_;
  double timeout_;
  std::vector<std::uint8_t> data_;
  std::size_t size_{0};
  std::size_t moved_{0};
  std::uint32_t announced_{0};
  std::uint32_t abort_code_{0};
  std::uint16_t index_{0};
  std::uint8_t subindex_{0};
  std::uint8_t toggle_{0};
  SdoState state_{SdoState::idle};
  Step step_{Step::upload};
  double since_{0};
  CanFrame out_;
  bool pending_{false};
};

}  // namespace icat::canopen
