// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The last estimate of the base's pose and velocity, extrapolated to the present: the joints run
/// faster than the navigation [MARIS, III-B9], and the base moves between its samples.
///
///     ⁰T_b(t) = ⁰T_b(t₀) exp(v (t − t₀))
///
/// Ours; the paper only asks for a velocity feedback as fast as the joints.
#pragma once

#include <cmath>

#include "icat/core/status.hpp"
#include "icat/math/rigid_motion.hpp"
#include "icat/tpik/level_check.hpp"

namespace icat {

/// The newest sample, nothing else: it is never queued. No allocation, no exception.
template <class Scalar>
class BaseState {
 public:
  /// ⟨b⟩ in ⟨0⟩ and its twist (components on ⟨b⟩, m/s, rad/s) as they were at `stamp`, s. A sample
  /// that is not finite, no rotation, or faster than 1e6 (`implausible`) is refused: the one before
  /// stays, and its age grows.
  Status set(const Pose<Scalar>& pose, const Vector6<Scalar>& velocity, double stamp) noexcept {
    if (!detail::all_finite(pose.matrix()) || !detail::all_finite(velocity) ||
        !std::isfinite(stamp)) {
      return Status::non_finite;
    }
    if (!is_rigid(pose)) return Status::not_a_rotation;
    for (Index i = 0; i < 6; ++i) {
      if (std::abs(velocity(i)) > Scalar(implausible_speed)) return Status::implausible;
    }
    pose_ = pose;
    velocity_ = velocity;
    stamp_ = stamp;
    return Status::ok;
  }
  /// ⟨b⟩ in ⟨0⟩ at `time`, s; as it was where that is before the sample.
  Pose<Scalar> pose(double time) const noexcept {
    const double passed = time - stamp_;
    if (!(passed > 0) || !std::isfinite(passed)) return pose_;
    return integrate(pose_, velocity_, static_cast<Scalar>(passed));
  }
  /// The twist of the sample, held.
  const Vector6<Scalar>& velocity() const noexcept { return velocity_; }
  /// Of the sample at `time`, s, also of one from the future; infinite before the first.
  double age(double time) const noexcept { return std::abs(time - stamp_); }

 private:
  Pose<Scalar> pose_ = detail::identity_pose<Scalar>();
  Vector6<Scalar> velocity_ = detail::zeros<Vector6<Scalar>>(6);
  double stamp_{-infinity<double>};
};

}  // namespace icat
