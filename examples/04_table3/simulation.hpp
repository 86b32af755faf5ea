// SPDX-License-Identifier: BSD-3-Clause
// The hydrodynamic runs of [Coop, V-B, Table III]: two dynamic vehicle-manipulators carry a pipe
// and set it down, with PI velocity loops, vehicles that track badly, and communication that is
// slow, late or half-duplex.
#pragma once

#include <functional>
#include <string>

#include "side.hpp"

namespace table3 {

/// What is under way: the bytes, and the round, which is the slot of the modem.
struct Message {
  long long round;
  std::array<std::byte, icat::message_size(42)> bytes;  ///< the longest, spans included
};

// --- one run -------------------------------------------------------------------------------------

struct Sample {
  double t;
  Vector6 interaction;  ///< [N; N m] on ⟨o⟩
  double position_error, orientation_error;
  std::array<Vector6, 2> agreed, vehicle_wrench;
  double object_speed;
};

struct Statistics {
  double max = 0, mean = 0, deviation = 0;
};

/// Of a part of the run.
struct Part {
  double final_error = 0, final_orientation = 0;  ///< m, rad
  Statistics force, moment;                       ///< over all 2 kHz steps
};

struct Result {
  std::vector<Sample> samples;  ///< at 100 Hz
  bool aborted = false;         ///< before pre-deployment, at the force limit or by a fault
  bool deployed = false;        ///< went on to the end
  double end = 0;               ///< s
  Part transport, deployment;   ///< the table is about the first
  double thrust_peak = 0;       ///< N, largest along an axis of a vehicle
  double thrust_mean = 0;       ///< N, mean of |.| along the axis where that is largest
  double drift = 0;             ///< m, of the grasps
  double proposals_apart = 0;   ///< RMS of ‖ẋ_a − ẋ_b‖
  icat::Status status = icat::Status::ok;
};

/// Running maximum, mean and deviation of a norm.
class Accumulator {
 public:
  void add(double x) {
    max_ = std::max(max_, x);
    sum_ += x;
    squares_ += x * x;
    ++count_;
  }
  Statistics get() const {
    const double n = std::max(count_, 1.0), mean = sum_ / n;
    return {max_, mean, std::sqrt(std::max(squares_ / n - mean * mean, 0.0))};
  }

 private:
  double max_ = 0, sum_ = 0, squares_ = 0, count_ = 0;
};

/// Of both robots and the pipe.
struct Cycle {
  const Plant& plant;
  const std::array<Side*, 2>& sides;
  const Sample& sample;
};

/// Runs one row; `watch` sees every cycle.
inline Result run(const Row& row, const Parameters& p,
                  const std::function<void(const Cycle&)>& watch = {}) {
  Plant plant(plant_of(0, p), plant_of(1, p), icat::maris_pipe_body<double>(), pipe_start);
  Side a(0, plant, row, p), b(1, plant, row, p);
  const std::array<Side*, 2> sides{&a, &b};
  icat::Channel<Message> channel({.rate = row.rate > 0 ? row.rate : 1,
                                  .latency = row.latency,
                                  .duplex = row.duplex,
                                  .loss = row.loss});
  Result result;
  const auto check = [&](icat::Status s) {
    if (result.status == icat::Status::ok) result.status = s;
  };
  for (Side* side : sides) {
    check(side->agent.start("hold", 0));
  }

  struct Sums {
    Accumulator force, moment;
  } transport, deployment;
  Eigen::Matrix<double, 6, 2> thrust = Eigen::Matrix<double, 6, 2>::Zero();
  double apart = 0;
  const auto step_at = [](double time) { return static_cast<int>(std::lround(time / plant_dt)); };
  const int steps = step_at(p.duration + p.deployment);
  const int per_cycle = static_cast<int>(std::lround(control_dt / plant_dt));
  const auto finish = [&](Part& part, const Sums& sums, const Pose& goal) {
    const auto error = support::distance(goal, plant.object());
    part = {error.position, error.orientation, sums.force.get(), sums.moment.get()};
  };
  const auto receive = [&](double t) {
    for (std::size_t i = 0; i < 2; ++i) {
      if (const auto message = channel.receive(static_cast<int>(i), t)) {
        const std::size_t size = icat::message_size(row.spans ? 42 : 6);
        check(
            sides[i]->agent.receive(1 - i, message->round, std::span(message->bytes).first(size)));
      }
    }
  };
  for (int k = 0; k < steps && result.status == icat::Status::ok; ++k) {
    const double t = k * plant_dt;
    if (k % per_cycle == 0) {
      const bool arrived = k >= step_at(p.duration);
      for (Side* side : sides) {
        if (k == step_at(p.join)) check(side->agent.switch_to("transport", t, p.ramp));
        if (k == step_at(p.duration)) check(side->agent.switch_to("deploy", t, p.join));
      }
      if (k == step_at(p.duration)) finish(result.transport, transport, pre_deployment);
      std::array<Vector13, 2> measured;
      for (std::size_t i = 0; i < 2; ++i) {
        const auto& body = plant.robot(i);
        check(sides[i]->robot.update(body.q(), body.vehicle()));
        check(sides[i]->see(plant.robot(1 - i).vehicle().translation()));
        measured[i] = sides[i]->measured(t, body.vehicle_velocity());
        check(sides[i]->agent.propose(t, measured[i]));
      }
      if (row.rate > 0) {
        receive(t);
        for (int i = 0; i < 2; ++i) {
          if (!channel.ready(i, t)) continue;
          const long long slot = std::llround(std::floor(t * row.rate + 1e-6));
          // Where rounds have to be complete, two slots of a half-duplex channel are one.
          const bool pairs = row.duplex == icat::Duplex::half && !p.latest;
          Message message{pairs ? slot / 2 : slot, {}};
          const auto bytes = sides[static_cast<std::size_t>(i)]->agent.send(message.round);
          std::copy(bytes.begin(), bytes.end(), message.bytes.begin());
          channel.send(i, t, message);
        }
        receive(t);
      }
      for (std::size_t i = 0; i < 2; ++i) {
        // Robot a presses with +w, b with −w: both give way along it.
        Vector6 correction = Vector6::Zero();
        if (row.force) {
          const Vector6 w = (i == 0 ? -1 : 1) * plant.interaction();
          correction << p.force_gain * w.head<3>(), p.moment_gain * w.tail<3>();
        }
        check(sides[i]->agent.step(t, measured[i], correction));
      }
      Sample s;
      s.t = t;
      s.interaction = plant.interaction();
      const auto error = support::distance(arrived ? seabed : pre_deployment, plant.object());
      s.position_error = error.position;
      s.orientation_error = error.orientation;
      s.object_speed = plant.object_velocity().head<3>().norm();
      std::array<Vector6, 2> own;
      for (std::size_t i = 0; i < 2; ++i) {
        s.agreed[i] = sides[i]->agent.agreed_velocity();
        own[i] = sides[i]->own_tool_velocity();
      }
      apart += (own[0] - own[1]).squaredNorm();
      for (auto& wrench : s.vehicle_wrench) wrench.setZero();
      result.samples.push_back(s);
      if (watch) watch({plant, sides, s});
    }
    std::array<Vector13, 2> forces;
    for (std::size_t i = 0; i < 2; ++i) {
      check(sides[i]->forces(plant.robot(i).velocity(), forces[i]));
      if (k % per_cycle == 0) result.samples.back().vehicle_wrench[i] = forces[i].tail<6>();
      thrust.col(static_cast<Eigen::Index>(i)) += forces[i].tail<6>().cwiseAbs();
      result.thrust_peak =
          std::max(result.thrust_peak, forces[i].segment<3>(7).cwiseAbs().maxCoeff());
    }
    check(plant.step(forces[0], forces[1], plant_dt));
    const Vector6 w = plant.interaction();
    Sums& sums = k < step_at(p.duration) ? transport : deployment;
    sums.force.add(w.head<3>().norm());
    sums.moment.add(w.tail<3>().norm());
    result.drift =
        std::max({result.drift, plant.drift(0).head<3>().norm(), plant.drift(1).head<3>().norm()});
    result.end = t + plant_dt;
    if (w.head<3>().norm() > p.force_limit) break;
  }
  const int done = step_at(result.end);
  result.aborted = done < step_at(p.duration);
  result.deployed = done == steps && result.status == icat::Status::ok;
  if (done <= step_at(p.duration)) finish(result.transport, transport, pre_deployment);
  if (done > step_at(p.duration)) finish(result.deployment, deployment, seabed);
  result.thrust_mean = thrust.topRows<3>().maxCoeff() * plant_dt / std::max(result.end, plant_dt);
  result.proposals_apart =
      std::sqrt(apart / std::max(static_cast<double>(result.samples.size()), 1.0));
  return result;
}

}  // namespace table3
