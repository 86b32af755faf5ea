// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A `MavlinkVehicle` as the back-end of a robot (control/back_end.hpp), or of the base of one:
/// joints are left to another back-end.
///
///     twist of the base, on itself = B v     the robot's; BᵀB = I, so v = Bᵀ twist
///
/// ArduSub obeys surge, sway, heave and yaw; roll and pitch it keeps level itself. Where the base
/// has columns for these two, make them given columns of the controller: commands in these columns
/// are ignored.
#pragma once

#include <concepts>

#include "icat/adapters/mavlink.hpp"
#include "icat/control/back_end.hpp"

namespace icat {

/// What carries bytes without waiting, such as `UdpSocket`: `receive` fills a buffer and returns
/// how many bytes came, `send` returns whether they went.
template <class T>
concept MavlinkTransport = requires(T& transport, std::span<std::uint8_t> into,
                                    std::span<const std::uint8_t> bytes) {
  { transport.receive(into) }
  noexcept->std::convertible_to<std::size_t>;
  { transport.send(bytes) }
  noexcept->std::convertible_to<bool>;
};

/// See the file comment. Refers to vehicle and transport, which must live as long. After
/// construction nothing allocates.
template <class R, MavlinkTransport T>
requires MobileRobot<R> && JointedRobot<R>
class MavlinkBackEnd {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;

  /// @throws std::invalid_argument where BᵀB is not I.
  [[gnu::cold]] MavlinkBackEnd(const R& robot, MavlinkVehicle& vehicle, T& transport)
      : vehicle_(&vehicle),
        transport_(&transport),
        columns_(robot.base_columns()),
        size_(robot.dof()) {
    if (columns_.count > 6) {
      detail::invalid("MavlinkBackEnd: a base of ", columns_.count, " columns");
    }
    for (Index i = 0; i < columns_.count; ++i) {
      for (Index k = 0; k < 6; ++k) {
        motion_[static_cast<std::size_t>(i)][static_cast<std::size_t>(k)] =
            static_cast<double>(robot.base_motion()(k, i));
      }
      for (Index j = 0; j <= i; ++j) {
        double product = 0;
        for (std::size_t k = 0; k < 6; ++k) product += column(i)[k] * column(j)[k];
        if (!(std::fabs(product - (i == j)) < 1e-5)) {
          detail::invalid("MavlinkBackEnd: columns ", j, " and ", i,
                          " of the base's motion have the product ", product,
                          "; they must be orthonormal");
        }
      }
    }
  }

  /// Takes what has come, 64 datagrams at most. Sets the base, the base's columns of the velocity,
  /// and `state.time`, when the older of attitude and position came; nothing before both came
  /// (`not_measured`).
  Status read(double time, RobotState<R>& state) noexcept {
    for (int k = 0; k < 64; ++k) {
      const std::size_t n = transport_->receive(buffer_);
      if (n == 0) break;
      vehicle_->receive({buffer_.data(), n < buffer_.size() ? n : buffer_.size()}, time);
    }
    const auto& attitude = vehicle_->attitude();
    const auto& position = vehicle_->position();
    if (attitude.count == 0 || position.count == 0) return Status::not_measured;
    const Odometry o = vehicle_->odometry();
    const auto& [x, y, z, w] = o.orientation;
    const double rotation[3][3] = {
        {1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
        {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
        {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)}};
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) state.base.matrix()(i, j) = static_cast<Scalar>(rotation[i][j]);
      state.base.matrix()(i, 3) = static_cast<Scalar>(o.position[static_cast<std::size_t>(i)]);
    }
    for (Index i = 0; i < columns_.count; ++i) {
      double v = 0;
      for (std::size_t k = 0; k < 6; ++k) v += column(i)[k] * o.twist[k];
      state.velocity(columns_.first + i) = static_cast<Scalar>(v);
    }
    state.time = std::fmin(attitude.time, position.time);
    return Status::ok;
  }

  /// The base's columns of ẏ go out, with whatever else is due; zero where one of them is not
  /// finite (`non_finite`), beyond the plausible (`implausible`) or of another size than the robot
  /// (`wrong_size`), and while the vehicle is not healthy.
  Status write(double time, const Vector<Scalar, R::size>& velocity) noexcept {
    std::array<double, 6> twist{};
    Status status = Status::ok;
    if (velocity.size() != size_) {
      status = Status::wrong_size;
    } else {
      for (Index i = 0; i < columns_.count; ++i) {
        const auto v = static_cast<double>(velocity(columns_.first + i));
        for (std::size_t k = 0; k < 6; ++k) twist[k] += column(i)[k] * v;
      }
    }
    const Status wished = vehicle_->set_velocity({twist[0], twist[1], twist[2], twist[5]}, time);
    if (status == Status::ok) status = wished;
    transport_->send(vehicle_->send(time));
    return status;
  }

  /// Of the vehicle.
  bool healthy(double time) const noexcept { return vehicle_->healthy(time); }

 private:
  const std::array<double, 6>& column(Index i) const noexcept {
    return motion_[static_cast<std::size_t>(i)];
  }

  MavlinkVehicle* vehicle_;
  T* transport_;
  ColumnRange columns_;
  Index size_;                                     // of ẏ
  std::array<std::array<double, 6>, 6> motion_{};  // of each column its twist
  std::array<std::uint8_t, 2048> buffer_;
};

}  // namespace icat
