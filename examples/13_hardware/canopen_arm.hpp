// SPDX-License-Identifier: BSD-3-Clause
// Seven CiA 402 drives on a CAN line are the arm; another back-end moves the rest of the robot.
#pragma once

#include <algorithm>
#include <icat/adapters/drive_bus.hpp>
#include <icat/adapters/socketcan.hpp>
#include <string>
#include <vector>

#include "mission.hpp"

namespace reach {

template <icat::BackEnd<Robot> Rest>
class CanopenArm {
 public:
  /// `interface`: "can0". The drives are nodes 1 to 7; their position 0 is the folded arm.
  CanopenArm(Rest& rest, const std::string& interface)
      : rest_(&rest),
        socket_(interface),
        bus_(drives(), {.period = period, .feedback_timeout = 0.2, .command_timeout = 0.2}) {}

  icat::Status read(double time, icat::RobotState<Robot>& state) noexcept {
    icat::CanFrame frame;
    for (int i = 0; i < 1000; ++i) {
      const icat::CanStatus came = socket_.receive(frame);
      if (came == icat::CanStatus::ok) bus_.receive(frame, time);
      if (came == icat::CanStatus::empty || came == icat::CanStatus::down) break;
    }
    // After a stop, once all drives are heard of again. On a robot with people around, let an
    // operator say so.
    if (!bus_.enabled() && bus_.ready(time) && !(time < next_try_)) {
      next_try_ = time + 4;  // longer than a start may take
      (void)bus_.enable(time);
    }
    const icat::Status status = rest_->read(time, state);
    if (status != icat::Status::ok) return status;
    for (std::size_t i = 0; i < bus_.size(); ++i) {
      const auto& sample = bus_.drive(i).sample();
      if (sample.count > 0) state.q(static_cast<icat::Index>(i)) = sample.value.position;
      state.time = std::min(state.time, sample.time);
    }
    return status;
  }
  icat::Status write(double time, const icat::Vector<double, 13>& command) noexcept {
    for (std::size_t i = 0; i < bus_.size(); ++i) {
      (void)bus_.command_velocity(i, command(static_cast<icat::Index>(i)), time);
    }
    bus_.send(time, [&](const icat::CanFrame& frame) {
      return socket_.send(frame) == icat::CanStatus::ok;
    });
    return rest_->write(time, command);
  }
  bool healthy(double time) const noexcept { return bus_.healthy(time) && rest_->healthy(time); }
  /// Why the arm stopped last, for a log.
  std::string why() const {
    if (bus_.cause() == icat::canopen::StopCause::none) return "";
    return bus_.drive(bus_.culprit()).options().name + ": " + icat::canopen::describe(bus_.cause());
  }

 private:
  static std::vector<icat::canopen::DriveOptions> drives() {
    std::vector<icat::canopen::DriveOptions> all(7);
    for (int i = 0; i < 7; ++i) {
      auto& drive = all[static_cast<std::size_t>(i)];
      drive.name = "joint" + std::to_string(i + 1);
      drive.node = i + 1;
      drive.counts_per_radian = 1e5;
      drive.zero = support::folded_arm()(i);
      drive.max_velocity = 1;
    }
    return all;
  }

  Rest* rest_;
  icat::SocketCan socket_;
  icat::canopen::DriveBus bus_;
  double next_try_{0};
};

}  // namespace reach
