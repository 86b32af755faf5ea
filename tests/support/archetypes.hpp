// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The least that satisfies each concept of a robot: a point moved by three slides, its name "tip".
/// Nothing can be copied, compared or defaulted that the concepts do not ask for; what may be
/// returned by value is, where its size is static.
///
/// The mobile one has its base's columns first, and the point's slide last.
#pragma once

#include <array>
#include <icat/model/robot.hpp>
#include <span>
#include <type_traits>

namespace archetypes {

template <class S, int N>
struct Bare {
  using Scalar = S;
  static constexpr long size = N;
  Bare() = default;
  Bare(const Bare&) = delete;
  Bare& operator=(const Bare&) = delete;
  short dof() const { return 3; }

  // Not of the concepts: the tests' own.
  std::array<S, 3> x{};
};

// A value where the size is static, the robot's own where it is not: no allocation in either case.
template <class M>
using Returned = std::conditional_t<M::SizeAtCompileTime == Eigen::Dynamic, const M&, M>;

template <class S, int N>
struct Framed : Bare<S, N> {
  using Jacobian = Eigen::Matrix<S, 6, N>;
  Jacobian J = Jacobian::Identity(6, 3);
  icat::FrameId frame(std::string_view) const { return icat::FrameId(7); }
  icat::Pose<S> pose(icat::FrameId) const {
    icat::Pose<S> p = icat::Pose<S>::Identity();
    p.translation() << this->x[0], this->x[1], this->x[2];
    return p;
  }
  Returned<Jacobian> jacobian(icat::FrameId) const { return J; }
};

template <class S>
struct Joints {
  std::array<icat::JointInfo<S>, 3> infos{icat::JointInfo<S>{"a", 0, S(-1), S(1)},
                                          icat::JointInfo<S>{"b", 1, S(-1), S(2)},
                                          icat::JointInfo<S>{"c", 2}};
  std::span<const icat::JointInfo<S>> joints() const { return infos; }
};

template <class S, int N>
struct Jointed : Bare<S, N>, Joints<S> {
  float position(icat::Index i) const {
    return static_cast<float>(this->x[static_cast<std::size_t>(i)]);
  }
};

template <class S, int N>
struct FramedAndJointed : Framed<S, N>, Joints<S> {
  S position(icat::Index i) const { return this->x[static_cast<std::size_t>(i)]; }
};

template <class S, int N>
struct Mobile : Framed<S, N> {
  icat::FrameId base() const { return icat::FrameId(0); }
  icat::ColumnRange base_columns() const { return {0, 2}; }
  Eigen::Matrix<S, 6, 2> base_motion() const { return Eigen::Matrix<S, 6, 2>::Identity(); }
};

template <class S, int N>
struct Massive : Bare<S, N> {
  using CenterJacobian = Eigen::Matrix<S, 3, N>;
  CenterJacobian J = CenterJacobian::Identity(3, 3);
  S mass() const { return S(1); }
  icat::Vector3<S> center_of_mass() const { return {this->x[0], this->x[1], this->x[2]}; }
  Returned<CenterJacobian> center_of_mass_jacobian() const { return J; }
};

}  // namespace archetypes
