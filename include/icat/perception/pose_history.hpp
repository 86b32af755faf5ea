// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The vehicle's pose at the time of an image: images arrive a tenth of a second late, and in that
/// time a vehicle that turns at 0.2 rad/s displaces an object 2 m away by 4 cm.
#pragma once

#include "icat/core/status.hpp"
#include "icat/navigation/history.hpp"

namespace icat {

/// The poses of the last half second, every 9 ms or more. No allocation, no exception.
template <class Scalar>
class PoseHistory {
 public:
  /// ⟨v⟩ was at `pose` in ⟨0⟩ at `time`, s. A time before the last one begins anew. What is not
  /// finite or not rigid is refused and changes nothing.
  Status record(double time, const Pose<Scalar>& pose) noexcept {
    if (!std::isfinite(time) || !detail::all_finite(pose.matrix())) return Status::non_finite;
    if (!is_rigid(pose)) return Status::not_a_rotation;
    if (!started_ || time < last_time_) {
      positions_ = {};
      rotations_ = {};
      first_time_ = time;
    }
    started_ = true;
    last_time_ = time;
    last_ = pose;
    positions_.record(time, detail::origin(pose));
    rotations_.record(time, detail::rotation(pose));
    return Status::ok;
  }

  /// Fills `pose` with that at `time`, s, between its neighbours; a microsecond after the last one
  /// is the last one. Anything but `ok` leaves it: `not_started`, `non_finite`, `time_reversed`
  /// (after the last one), `late_measurement` (before the first, or half a second before the last).
  Status at(double time, Pose<Scalar>& pose) const noexcept {
    if (!started_) return Status::not_started;
    double age = last_time_ - time;
    const Status status = detail::check_age(age);
    if (status != Status::ok) return status;
    if (time < first_time_ - 1e-6) return Status::late_measurement;
    const Matrix3<Scalar> R = rotations_.at(time, last_time_, detail::rotation(last_));
    pose = detail::make_pose(detail::UnitQuaternion<Scalar>::of(R).matrix(),
                             positions_.at(time, last_time_, detail::origin(last_)));
    return Status::ok;
  }

 private:
  detail::History<Vector3<Scalar>> positions_;
  detail::History<Matrix3<Scalar>> rotations_;
  Pose<Scalar> last_ = IdentityPose{};
  double last_time_{0}, first_time_{0};
  bool started_{false};
};

}  // namespace icat
