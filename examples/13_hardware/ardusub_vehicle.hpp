// SPDX-License-Identifier: BSD-3-Clause
// ArduSub flies the vehicle; another back-end moves the rest of the robot.
#pragma once

#include <algorithm>
#include <icat/adapters/mavlink_back_end.hpp>
#include <icat/adapters/udp.hpp>
#include <string>

#include "mission.hpp"

namespace reach {

template <icat::BackEnd<Robot> Rest>
class ArduSubVehicle {
 public:
  /// The vehicle listens at UDP `port` of `address`. ⟨0⟩ is its local world, NED.
  ArduSubVehicle(const Robot& robot, Rest& rest, const std::string& address, std::uint16_t port)
      : rest_(&rest),
        socket_(icat::UdpSocket::connect(address, port)),
        base_(robot, vehicle_, socket_) {}
  ArduSubVehicle(const ArduSubVehicle&) = delete;  // base_ refers to vehicle_ and socket_
  ArduSubVehicle& operator=(const ArduSubVehicle&) = delete;

  icat::Status read(double time, icat::RobotState<Robot>& state) noexcept {
    icat::Status status = rest_->read(time, state);
    const double rest = state.time;
    if (status == icat::Status::ok) status = base_.read(time, state);
    state.time = std::min(state.time, rest);
    // Also after a restart of its. On a robot with people around, let an operator say so.
    const auto& heartbeat = vehicle_.heartbeat();
    if (heartbeat.fresh(time, 3) && !(time < next_try_)) {
      next_try_ = time + 4;  // longer than the requests are repeated
      if (heartbeat.value.mode != icat::ArduSubMode::guided) {
        vehicle_.set_mode(icat::ArduSubMode::guided);
      }
      if (!heartbeat.value.armed) vehicle_.arm();
    }
    return status;
  }
  icat::Status write(double time, const icat::Vector<double, 13>& command) noexcept {
    const icat::Status status = base_.write(time, command);
    const icat::Status rest = rest_->write(time, command);
    return status == icat::Status::ok ? rest : status;
  }
  bool healthy(double time) const noexcept { return base_.healthy(time) && rest_->healthy(time); }

 private:
  Rest* rest_;
  icat::UdpSocket socket_;
  icat::MavlinkVehicle vehicle_;
  icat::MavlinkBackEnd<Robot, icat::UdpSocket> base_;
  double next_try_{0};
};

}  // namespace reach
