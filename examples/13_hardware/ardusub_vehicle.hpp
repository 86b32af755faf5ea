// SPDX-License-Identifier: BSD-3-Clause
// ArduSub flies the vehicle; another back-end moves the rest of the robot.
#pragma once

#include <algorithm>
#include <array>
#include <icat/adapters/mavlink.hpp>
#include <icat/adapters/udp.hpp>
#include <string>

#include "mission.hpp"

namespace reach {

template <icat::BackEnd<Robot> Rest>
class ArduSubVehicle {
 public:
  /// The vehicle listens at UDP `port` of `address`. ⟨0⟩ is its local world, NED.
  ArduSubVehicle(Rest& rest, const std::string& address, std::uint16_t port)
      : rest_(&rest), socket_(icat::UdpSocket::connect(address, port)) {}

  icat::Status read(double time, icat::RobotState<Robot>& state) noexcept {
    for (int i = 0; i < 1000; ++i) {
      const std::size_t size = socket_.receive(buffer_);
      if (size == 0) break;
      vehicle_.receive({buffer_.data(), size}, time);
    }
    // Also after a restart of its. On a robot with people around, let an operator say so.
    const auto& heartbeat = vehicle_.heartbeat();
    if (heartbeat.fresh(time, 3) && !(time < next_try_)) {
      next_try_ = time + 4;  // longer than the requests are repeated
      if (heartbeat.value.mode != icat::ArduSubMode::guided) {
        vehicle_.set_mode(icat::ArduSubMode::guided);
      }
      if (!heartbeat.value.armed) vehicle_.arm();
    }
    const icat::Status status = rest_->read(time, state);
    if (status != icat::Status::ok) return status;
    const icat::Odometry o = vehicle_.odometry();
    const Eigen::Quaterniond turned(o.orientation[3], o.orientation[0], o.orientation[1],
                                    o.orientation[2]);
    state.base.linear() = turned.toRotationMatrix();
    for (icat::Index i = 0; i < 3; ++i) {
      state.base.translation()(i) = o.position[static_cast<std::size_t>(i)];
    }
    for (icat::Index i = 0; i < 6; ++i)
      state.velocity(7 + i) = o.twist[static_cast<std::size_t>(i)];
    state.time = std::min(state.time, time - vehicle_.age(time));
    return status;
  }
  icat::Status write(double time, const icat::Vector<double, 13>& command) noexcept {
    (void)vehicle_.set_velocity({command(7), command(8), command(9), command(12)}, time);
    (void)socket_.send(vehicle_.send(time));
    return rest_->write(time, command);
  }
  bool healthy(double time) const noexcept {
    return vehicle_.healthy(time) && rest_->healthy(time);
  }

 private:
  Rest* rest_;
  icat::UdpSocket socket_;
  icat::MavlinkVehicle vehicle_;
  std::array<std::uint8_t, 2048> buffer_{};
  double next_try_{0};
};

}  // namespace reach
