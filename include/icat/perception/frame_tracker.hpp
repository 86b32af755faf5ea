// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A cylinder followed on the vehicle [MARIS, IV: a tracking algorithm updates the frame and
/// filters wrong outcomes; V: trackers of ᵛT_g and ᶜT_l; no equations printed]. Between images its
/// frame ⟨o⟩ moves by the inverse motion of the vehicle, then a measurement corrects it by a share
/// k:
///
///     ᵛT_o ← (⁰T_v)⁻¹ ⁰T_v(before) ᵛT_o
///     p ← p + k (p_z − p),   R ← R exp(k log(Rᵀ R_z))
///
/// A measurement whose deviation σ is larger than what is `trusted`, such as that of one camera
/// alone, whose depth is bad, counts less, k (trusted/σ)², each for position and turn; infinities
/// give the same k to all.
///
/// A measurement without an end (five degrees of freedom) draws p to the point of its axis that is
/// nearest, and leaves it where it is along the axis. Gates: distance from the vehicle, jump, turn.
/// Valid after some hits; given up after too many pictures without one. A cylinder looks the same
/// turned by half a turn about its z: of both frames the one nearer to the prediction is taken.
///
/// The paper tracks ᵛT_g and ᶜT_l apart. Both are rigid on ⟨o⟩, so one tracker of ᵛT_o gives both:
///
///     ᵛT_g = ᵛT_c ᶜT_o ᵒT_g,    ᶜT_l = ᶜT_o ᵒT_l
///
/// Gains, gates and counts are ours. A track survives drop-outs of up to 30 misses, 3 s at 10 Hz;
/// meanwhile the frame is as accurate as the vehicle's odometry.
#pragma once

#include <algorithm>

#include "icat/core/status.hpp"
#include "icat/perception/cylinder_pose.hpp"

namespace icat {

/// See the file comment. No allocation, no exception after construction.
template <class Scalar>
class FrameTracker {
 public:
  /// Gain, gates and counts.
  struct Options {
    Scalar gain = static_cast<Scalar>(0.6);      ///< k, in (0, 1]
    Scalar trusted = static_cast<Scalar>(0.02);  ///< deviation across the axis, m, > 0: see above
    Scalar trusted_tilt = static_cast<Scalar>(0.02);  ///< the same of the axis, rad, > 0
    Scalar nearest = static_cast<Scalar>(0.5);        ///< of ⟨o⟩ to ⟨c⟩, m, >= 0
    Scalar furthest = Scalar(4);                      ///< the same, m, > nearest
    Scalar max_jump = static_cast<Scalar>(0.5);       ///< from the prediction, m, > 0
    Scalar max_turn = static_cast<Scalar>(0.35);      ///< the same, rad, in (0, π/2)
    int hits = 2;                                     ///< pictures in a row until valid, >= 1
    int misses = 30;                                  ///< pictures in a row until given up, >= 1
  };

  /// @param camera   ⟨c⟩ in ⟨v⟩
  /// @param options  gain, gates and counts
  /// @throws std::invalid_argument on options out of range, or a pose that is not rigid.
  explicit FrameTracker(const Pose<Scalar>& camera, const Options& options = Options())
      : options_(options), camera_(camera) {
    const char* const owner = "FrameTracker";
    if (!is_rigid(camera)) detail::invalid(owner, ": the pose of the camera is not rigid");
    if (!(options.gain > Scalar(0) && options.gain <= Scalar(1))) {
      detail::invalid(owner, ": gain must be in (0, 1], got ", options.gain);
    }
    if (!(options.trusted > Scalar(0)) || !(options.trusted_tilt > Scalar(0))) {
      detail::invalid(owner, ": trusted and trusted_tilt must be > 0, got ", options.trusted,
                      " and ", options.trusted_tilt);
    }
    detail::require_non_negative(owner, "nearest", options.nearest);
    if (!(options.furthest > options.nearest) || !std::isfinite(options.furthest)) {
      detail::invalid(owner, ": furthest must be finite and > nearest, got ", options.furthest);
    }
    detail::require_positive(owner, "max_jump", options.max_jump);
    if (!(options.max_turn > Scalar(0) && options.max_turn < static_cast<Scalar>(1.57))) {
      detail::invalid(owner, ": max_turn must be in (0, 1.57) rad, got ", options.max_turn);
    }
    if (options.hits < 1 || options.misses < 1) {
      detail::invalid(owner, ": hits and misses must be >= 1, got ", options.hits, " and ",
                      options.misses);
    }
  }

  /// The present pose of the vehicle, ⟨v⟩ in ⟨0⟩: to be called at any rate, and before an image. If
  /// `position_known` is false only its rotation counts. What is not finite or rigid is refused;
  /// the motion is made up for by the next call. No allocation.
  Status predict(const Pose<Scalar>& vehicle, bool position_known = true) noexcept {
    const Status status = check(vehicle);
    if (status != Status::ok) return status;
    if (started_) frame_ = carried(frame_, vehicle_, vehicle, position_known && positioned_);
    vehicle_ = vehicle;
    positioned_ = position_known;
    started_ = true;
    return Status::ok;
  }

  /// A picture shows the cylinder. Anything but `ok` is a miss and moves nothing:
  /// - `non_finite`, `not_a_rotation`: of the measurement, its covariance or the vehicle
  /// - `not_started`: `predict` was never called
  /// - `not_measured`: five degrees of freedom, and no frame to take the sixth from
  /// - `outlier`: a gate refused it. Before the tracker is valid the new frame takes the place of
  ///   the old one, and counts as the first hit.
  ///
  /// @param seen     ⟨o⟩ in ⟨c⟩, when the picture was taken
  /// @param vehicle  ⟨v⟩ in ⟨0⟩, at that time; what has moved since is made up for
  Status update(const CylinderMeasurement<Scalar>& seen, const Pose<Scalar>& vehicle) noexcept {
    Status status = check(seen.frame);
    if (status == Status::ok) status = check(vehicle);
    if (status == Status::ok && !started_) status = Status::not_started;
    // Of the origin along the axis nothing is asked.
    const Matrix6<Scalar>& P = seen.covariance;
    const Scalar position = std::max(P(0, 0), P(2, 2));
    const Scalar turn = std::max(P(3, 3), P(5, 5));
    if (status == Status::ok && !std::isfinite(P(0, 0) + P(2, 2) + P(3, 3) + P(5, 5))) {
      status = Status::non_finite;
    }
    bool begun = false;
    if (status == Status::ok) {
      const Gains gains{weighed(options_.trusted, position), weighed(options_.trusted_tilt, turn)};
      status = take(carried(detail::compose(camera_, seen.frame), vehicle, vehicle_, positioned_),
                    detail::norm(detail::origin(seen.frame)), seen.end_seen, gains, begun);
    }
    if (status != Status::ok && !begun) miss();
    return status;
  }
  /// A picture does not show the cylinder. No allocation.
  void miss() noexcept {
    if (!valid_) hits_ = 0;
    if (++misses_ > options_.misses) reset();
  }
  /// Forgets the frame.
  void reset() noexcept {
    valid_ = false;
    hits_ = misses_ = 0;
  }

  /// The track is valid: enough detections, and the last one is not too old.
  bool valid() const noexcept { return valid_; }
  /// Pictures since the last hit.
  int misses() const noexcept { return misses_; }
  /// ᵛT_o. It means something only while `valid`.
  const Pose<Scalar>& frame() const noexcept { return frame_; }
  /// ᵛT_g of a grasp `in_object`, ᵒT_g. No allocation.
  Pose<Scalar> grasp(const Pose<Scalar>& in_object) const noexcept {
    return detail::compose(frame_, in_object);
  }
  /// ᶜp_l of a point of the cylinder such as one of its ends, `in_object` in ⟨o⟩, m.
  Vector3<Scalar> point_in_camera(const Vector3<Scalar>& in_object) const noexcept {
    return detail::transform(inverse(camera_), detail::transform(frame_, in_object));
  }

 private:
  struct Gains {
    Scalar position, turn;
  };
  Scalar weighed(Scalar trusted, Scalar variance) const noexcept {
    const Scalar share = trusted * trusted / variance;  // infinite for none
    return share < Scalar(1) ? options_.gain * share : options_.gain;
  }
  static Status check(const Pose<Scalar>& pose) noexcept {
    if (!detail::all_finite(pose.matrix())) return Status::non_finite;
    return is_rigid(pose) ? Status::ok : Status::not_a_rotation;
  }
  static Matrix3<Scalar> orthonormal(const Matrix3<Scalar>& R) noexcept {
    return detail::UnitQuaternion<Scalar>::of(R).matrix();
  }
  static Pose<Scalar> inverse(const Pose<Scalar>& pose) noexcept {
    const Matrix3<Scalar> R = detail::transpose(detail::rotation(pose));
    return detail::make_pose(R, detail::scaled(detail::times(R, detail::origin(pose)), Scalar(-1)));
  }
  // A frame on the vehicle that is at rest in ⟨0⟩ while the vehicle goes.
  static Pose<Scalar> carried(const Pose<Scalar>& frame, const Pose<Scalar>& before,
                              const Pose<Scalar>& now, bool position) noexcept {
    // Steps are chained without end: what is wrong with a rotation would grow, and so would the
    // rounding of a position far from the origin.
    const Matrix3<Scalar> back = detail::transpose(orthonormal(detail::rotation(now)));
    const Matrix3<Scalar> turn = detail::times(back, orthonormal(detail::rotation(before)));
    Vector3<Scalar> p = detail::times(turn, detail::origin(frame));
    if (position) {
      const Vector3<Scalar> gone = detail::minus(detail::origin(before), detail::origin(now));
      p = detail::plus(p, detail::times(back, gone));
    }
    return detail::make_pose(orthonormal(detail::times(turn, detail::rotation(frame))), p);
  }

  Status take(const Pose<Scalar>& seen, Scalar distance, bool end_seen, const Gains& gains,
              bool& begun) noexcept {
    // Without an end the origin is the point nearest to the camera: no less near than the middle.
    if (!(distance >= options_.nearest && distance <= options_.furthest)) return Status::outlier;
    const bool known = valid_ || hits_ > 0;
    if (!known && !end_seen) return Status::not_measured;
    if (!known) {
      begin(seen);
      return Status::ok;
    }
    Matrix3<Scalar> R = detail::rotation(seen);
    if (detail::dot(detail::column3(R, 0, 1), detail::column3(frame_.matrix(), 0, 1)) < Scalar(0)) {
      for (Index j = 0; j < 2; ++j) {
        detail::set_column3(R, 0, j, detail::scaled(detail::column3(R, 0, j), Scalar(-1)));
      }
    }
    const Vector3<Scalar> y = detail::column3(R, 0, 1);
    Vector3<Scalar> jump = detail::minus(detail::origin(seen), detail::origin(frame_));
    if (!end_seen) jump = detail::plus(jump, -detail::dot(jump, y), y);
    const Matrix3<Scalar> from = detail::rotation(frame_);
    const Vector3<Scalar> turn = rotation_log<Scalar>(detail::times(detail::transpose(from), R));
    if (!(detail::norm(jump) <= options_.max_jump) || !(detail::norm(turn) <= options_.max_turn)) {
      if (!valid_ && end_seen) {
        begin(seen);
        begun = true;
      }
      return Status::outlier;
    }
    const Matrix3<Scalar> nearer =
        detail::times(from, rotation_exp<Scalar>(detail::scaled(turn, gains.turn)));
    frame_ = detail::make_pose(orthonormal(nearer),
                               detail::plus(detail::origin(frame_), gains.position, jump));
    hit();
    return Status::ok;
  }
  void begin(const Pose<Scalar>& seen) noexcept {
    frame_ = seen;
    hits_ = 0;
    hit();
  }
  void hit() noexcept {
    misses_ = 0;
    if (hits_ < options_.hits) ++hits_;
    if (hits_ == options_.hits) valid_ = true;
  }

  Options options_;
  Pose<Scalar> camera_;
  Pose<Scalar> frame_ = IdentityPose{}, vehicle_ = IdentityPose{};
  int hits_{0}, misses_{0};
  bool started_{false}, positioned_{true}, valid_{false};
};

/// ᵛT_g: from the camera's place on the vehicle, the cylinder in the camera and the
/// grasp on the cylinder, ᵛT_g = ᵛT_c ᶜT_o ᵒT_g. No allocation.
template <class Scalar>
Pose<Scalar> grasp_in_vehicle(const Pose<Scalar>& camera, const Pose<Scalar>& object,
                              const Pose<Scalar>& grasp) noexcept {
  return detail::compose(camera, detail::compose(object, grasp));
}

}  // namespace icat
