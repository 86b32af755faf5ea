// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A vehicle-manipulator with nothing aligned, and states for it: random and awkward ones.
#pragma once

#include <icat/model/maris.hpp>
#include <icat/model/uvms.hpp>
#include <numbers>
#include <random>
#include <string>
#include <vector>

namespace testing_support {

template <class Scalar>
using Robot = icat::KinematicTree<Scalar, 13>;

template <class Scalar>
struct State {
  std::string name;
  icat::Vector<Scalar, 7> q;
  icat::Pose<Scalar> vehicle;
};

template <class Scalar>
icat::Pose<Scalar> make_pose(double x, double y, double z, double roll, double pitch, double yaw) {
  using V = icat::Vector3<Scalar>;
  icat::Pose<Scalar> p = icat::Pose<Scalar>::Identity();
  p.translation() << Scalar(x), Scalar(y), Scalar(z);
  p.linear() = icat::axis_rotation<Scalar>(V::UnitZ(), Scalar(yaw)) *
               icat::axis_rotation<Scalar>(V::UnitY(), Scalar(pitch)) *
               icat::axis_rotation<Scalar>(V::UnitX(), Scalar(roll));
  return p;
}

template <class Scalar>
Robot<Scalar> make_robot() {
  return icat::uvms(icat::maris_arm<Scalar>(),
                    {.arm = make_pose<Scalar>(0.2, -0.1, 0.43, 0.3, -0.4, 2.0),
                     .camera = make_pose<Scalar>(0.5, 0.1, 0.2, -0.2, 0.7, 0.4),
                     .tool = make_pose<Scalar>(0.03, -0.02, 0.15, 0.5, 0.1, -1.0)});
}

template <class Scalar>
std::vector<State<Scalar>> random_states(int count, unsigned seed) {
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> u(-1, 1);
  const auto arm = icat::maris_arm<Scalar>();
  std::vector<State<Scalar>> states;
  for (int i = 0; i < count; ++i) {
    State<Scalar> s{"random " + std::to_string(i), {}, {}};
    for (int j = 0; j < 7; ++j) {
      const auto& joint = arm.joints[static_cast<std::size_t>(j)];
      const Scalar middle = (joint.lower + joint.upper) / 2;
      const Scalar half = (joint.upper - joint.lower) / 2;
      s.q(j) = middle + half * Scalar(u(rng));
    }
    // One by one: the order of arguments is the compiler's.
    double p[6];
    for (double& x : p) x = u(rng);
    s.vehicle = make_pose<Scalar>(2 * p[0], 2 * p[1], 2 * p[2], 3.1 * p[3], 1.5 * p[4], 3.1 * p[5]);
    states.push_back(s);
  }
  return states;
}

/// Singular arms (stretched; wrist and shoulder aligned), gimbal lock, level, upside down.
template <class Scalar>
std::vector<State<Scalar>> awkward_states() {
  constexpr double pi = std::numbers::pi;
  icat::Vector<Scalar, 7> zero = icat::Vector<Scalar, 7>::Zero(), bent, aligned;
  bent << Scalar(0.3), Scalar(-0.7), Scalar(0.2), Scalar(-1.3), Scalar(0.4), Scalar(0.6),
      Scalar(0.1);
  aligned << Scalar(0.5), Scalar(0), Scalar(0.2), Scalar(-1.3), Scalar(0.4), Scalar(0), Scalar(0.1);
  return {{"stretched arm", zero, make_pose<Scalar>(0.3, 0.2, 1, 0.1, 0.2, 0.3)},
          {"aligned wrist and shoulder", aligned, make_pose<Scalar>(0.3, 0.2, 1, 0.1, 0.2, 0.3)},
          {"gimbal lock up", bent, make_pose<Scalar>(0.3, 0.2, 1, 0, pi / 2, 0)},
          {"gimbal lock down", bent, make_pose<Scalar>(0.3, 0.2, 1, 0.4, -pi / 2, 0)},
          {"level", bent, make_pose<Scalar>(0.3, 0.2, 1, 0, 0, 0.7)},
          {"upside down", bent, make_pose<Scalar>(0.3, 0.2, 1, pi, 0, 0)},
          {"half a turn", bent, make_pose<Scalar>(0.3, 0.2, 1, 0, 0, pi)},
          {"origin", bent, icat::Pose<Scalar>::Identity()}};
}

template <class Scalar>
std::vector<State<Scalar>> all_states(int random_count, unsigned seed) {
  auto states = awkward_states<Scalar>();
  for (auto& s : random_states<Scalar>(random_count, seed)) states.push_back(s);
  return states;
}

/// The state displaced by ẏ·(unit time).
template <class Scalar, class Y>
void displace(Robot<Scalar>& robot, const State<Scalar>& s, const Y& y) {
  const icat::Vector6<Scalar> v = y.template tail<6>();
  if (robot.update(s.q + y.template head<7>(), icat::integrate(s.vehicle, v, Scalar(1))) !=
      icat::Status::ok) {
    std::abort();
  }
}

/// Twist over a small displacement: [Δp; rotation vector], components on ⟨0⟩.
template <class Scalar>
icat::Vector6<Scalar> difference(const icat::Pose<Scalar>& from, const icat::Pose<Scalar>& to) {
  icat::Vector6<Scalar> d;
  d << to.translation() - from.translation(),
      icat::rotation_log<Scalar>(to.linear() * from.linear().transpose());
  return d;
}

}  // namespace testing_support
