// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A model of Pinocchio is the robot. Pinocchio has Eigen in its interface and crashes in a program
/// that is compiled with `-march=native`; docs/adapters.md has the flags and the lines of CMake
/// that work.
///
///     ẏ = Pinocchio's velocity v ∈ R^nv, in Pinocchio's order
///
/// A frame for each frame of the model; where a body and a joint have one name it is the body's.
/// Joints: all with one degree of freedom; mimics follow their leader and have no column. A
/// free-flyer or planar joint at the root is the base; others with several degrees of freedom are
/// refused. Pinocchio knows no limits of acceleration: `set_limits` says them. A range [0, 0] and a
/// velocity 0 are no limits, as in urdf.hpp.
///
/// `q` of `update` has an entry for each of `joints`: an angle in rad also where Pinocchio has
/// cosine and sine. The root's part of Pinocchio's configuration comes from the pose of the base.
#pragma once

#include <algorithm>
#include <cmath>
#include <pinocchio/algorithm/frames.hpp>
#include <pinocchio/algorithm/jacobian.hpp>
#include <string>
#include <utility>
#include <vector>

#include "icat/adapters/foreign_robot.hpp"

namespace icat {

/// A model of Pinocchio, with a `Data` of its own. Construction allocates and throws; the control
/// step does neither.
template <class ScalarType = double>
class PinocchioRobot : public ForeignRobot<ScalarType> {
  using Foreign = ForeignRobot<ScalarType>;

 public:
  using typename Foreign::Jacobian;
  using typename Foreign::PointJacobian;
  using typename Foreign::Scalar;
  /// Of Pinocchio.
  using Model = pinocchio::ModelTpl<Scalar>;
  /// Of Pinocchio.
  using Data = pinocchio::DataTpl<Scalar>;
  /// Of Pinocchio, nq.
  using Configuration = Vector<Scalar, Eigen::Dynamic>;

  /// All joints at 0, the base on the model's root.
  /// @throws std::invalid_argument on joints that are not supported, limits out of order, and where
  ///         nothing can move.
  [[gnu::cold]] explicit PinocchioRobot(Model model) : model_(std::move(model)), data_(model_) {
    configuration_ = detail::zeros<Configuration>(model_.nq);
    if (model_.nv == 0) detail::invalid("PinocchioRobot: nothing can move");
    add_joints();
    add_frames();
    this->finish(model_.nv, base_frame(), 0,
                 base_joint_ == 0 ? Base<Scalar>::fixed()
                 : planar_        ? Base<Scalar>::surface()
                                  : Base<Scalar>::free());
    point_ = detail::zeros<Jacobian>(6, model_.nv);
    for (const auto& inertia : model_.inertias) mass_ += inertia.mass();
    compute();
  }

  /// The model.
  const Model& model() const noexcept { return model_; }
  /// Joint placements and Jacobians (`oMi`, `J`) of the last update.
  const Data& data() const noexcept { return data_; }
  /// Pinocchio's configuration of the last update.
  const Configuration& configuration() const noexcept { return configuration_; }

  /// New positions of `joints`, the base where it was. `q` may be any Eigen vector. NaN, infinity
  /// or a wrong size: refused, the state stays. No allocation.
  template <class Q>
  Status update(const Eigen::MatrixBase<Q>& q) noexcept {
    if (const Status status = this->check_positions(q); status != Status::ok) return status;
    for (std::size_t i = 0; i < places_.size(); ++i) {
      const Scalar position = q(static_cast<Index>(i));
      this->set_position(static_cast<Index>(i), position);
      const Place& place = places_[i];
      configuration_(place.first) = place.circle ? std::cos(position) : position;
      if (place.circle) configuration_(place.first + 1) = std::sin(position);
    }
    compute();
    return Status::ok;
  }
  /// New positions and pose of the base in ⟨0⟩. A pose that is no rotation is refused too;
  /// `out_of_range` answers a pose that the model's root cannot have, to 1e-3: off the plane of a
  /// planar joint, or any but the one of a fixed root.
  template <class Q>
  Status update(const Eigen::MatrixBase<Q>& q, const Pose<Scalar>& base) noexcept {
    if (const Status status = this->check_positions(q); status != Status::ok) return status;
    if (const Status status = this->check_pose(base); status != Status::ok) return status;
    if (base_joint_ == 0) {
      return this->same_pose(base, pose(this->base())) ? update(q) : Status::out_of_range;
    }
    const Pose<Scalar> placement = to_pose(model_.jointPlacements[base_joint_]);
    const Matrix3<Scalar> back = detail::transpose(detail::rotation(placement));
    const Vector3<Scalar> p =
        detail::times(back, detail::minus(detail::origin(base), detail::origin(placement)));
    const Matrix3<Scalar> R = detail::times(back, detail::rotation(base));
    if (planar_) {
      const Scalar length = std::hypot(R(0, 0), R(1, 0));
      if (!(std::abs(p(2)) + std::abs(R(2, 0)) + std::abs(R(2, 1)) < Scalar(1e-3)) ||
          !(R(2, 2) > Scalar(0))) {
        return Status::out_of_range;
      }
      configuration_(0) = p(0), configuration_(1) = p(1);
      configuration_(2) = R(0, 0) / length, configuration_(3) = R(1, 0) / length;
    } else {
      const auto rotation = detail::UnitQuaternion<Scalar>::of(R);
      for (Index i = 0; i < 3; ++i) {
        configuration_(i) = p(i);
        configuration_(3 + i) = rotation.v(i);
      }
      configuration_(6) = rotation.w;
    }
    return update(q);
  }
  /// Pinocchio's own configuration (nq). NaN, infinity or a wrong size, and pairs of cosine and
  /// sine or quaternions that are none to 1e-3: refused, the state stays. No allocation.
  template <class Q>
  Status update_configuration(const Eigen::MatrixBase<Q>& q) noexcept {
    if (q.size() != model_.nq) return Status::wrong_size;
    if (!this->all_finite(q)) return Status::non_finite;
    // Numbers that must have length 1: of the root, and pairs of cosine and sine.
    const Index first = planar_ ? 2 : 3, count = base_joint_ == 0 ? 0 : planar_ ? 2 : 4;
    if (count > 0 && !is_unit(q, first, count)) return Status::not_a_rotation;
    for (const Place& place : places_) {
      if (place.circle && !is_unit(q, place.first, 2)) return Status::not_a_rotation;
    }
    for (Index i = 0; i < q.size(); ++i) configuration_(i) = q(i);
    if (count > 0) normalize(first, count);
    for (std::size_t i = 0; i < places_.size(); ++i) {
      const Index at = places_[i].first;
      Scalar position = configuration_(at);
      if (places_[i].circle) {
        normalize(at, 2);
        position = std::atan2(configuration_(at + 1), configuration_(at));
      }
      this->set_position(static_cast<Index>(i), position);
    }
    compute();
    return Status::ok;
  }

  /// ⟨f⟩ in ⟨0⟩, which is Pinocchio's world. No allocation.
  Pose<Scalar> pose(FrameId frame) const noexcept {
    const Placed& f = placed(frame);
    return to_pose(data_.oMi[f.joint] * f.placement);
  }
  /// 6 × n, rows linear then angular, at the origin of ⟨f⟩, components on ⟨0⟩. No allocation.
  const Jacobian& jacobian(FrameId frame) const noexcept {
    return this->kept_jacobian(frame, [&](Jacobian& J) {
      const Placed& f = placed(frame);
      pinocchio::getFrameJacobian(model_, data_, f.joint, f.placement,
                                  pinocchio::LOCAL_WORLD_ALIGNED, J);
    });
  }

  /// Calls `visit(column, linear, angular)` for each of `joints` that moves the frame, and each
  /// mimic, from the frame to the base: what the column does to the frame through this joint alone,
  /// as in `jacobian`. No allocation.
  template <class Visit>
  void for_each_joint_of(FrameId frame, Visit&& visit) const noexcept {
    const Placed& f = placed(frame);
    const Vector3<Scalar> p = data_.oMi[f.joint].act(f.placement.translation());
    // `J` has a column for each mimic too, at the origin of ⟨0⟩.
    for (std::size_t j = f.joint; j > 0 && j != base_joint_; j = model_.parents[j]) {
      const Index c = model_.idx_vExtendeds[j];
      visit(static_cast<Index>(model_.joints[j].idx_v()), detail::velocity_at(data_.J, c, p),
            detail::column3(data_.J, 3, c));
    }
  }

  /// Of all bodies, kg, also of those that are fixed to the world.
  Scalar mass() const noexcept { return mass_; }
  /// In ⟨0⟩, m; ⟨0⟩'s origin where the bodies have no mass. No allocation.
  Vector3<Scalar> center_of_mass() const noexcept {
    compute_center();
    return this->kept_center();
  }
  /// 3 × n, components on ⟨0⟩. No allocation.
  const PointJacobian& center_of_mass_jacobian() const noexcept {
    compute_center();
    return this->kept_center_jacobian();
  }

 private:
  // A frame.
  struct Placed {
    std::size_t joint;
    typename Model::SE3 placement;  // in the joint's
  };
  // Where a joint stands in Pinocchio's configuration.
  struct Place {
    Index first;
    bool circle;  // as cosine and sine
  };

  static Pose<Scalar> to_pose(const typename Model::SE3& placement) noexcept {
    return detail::make_pose<Scalar>(placement.rotation(), placement.translation());
  }
  template <class Q>
  static Scalar length(const Q& q, Index first, Index count) noexcept {
    Scalar square(0);
    for (Index i = first; i < first + count; ++i) square += q(i) * q(i);
    return std::sqrt(square);
  }
  template <class Q>
  static bool is_unit(const Q& q, Index first, Index count) noexcept {
    return std::abs(length(q, first, count) - Scalar(1)) < Scalar(1e-3);
  }
  void normalize(Index first, Index count) noexcept {
    const Scalar l = length(configuration_, first, count);
    for (Index i = first; i < first + count; ++i) configuration_(i) /= l;
  }
  const Placed& placed(FrameId frame) const noexcept {
    return frames_[static_cast<std::size_t>(frame.index())];
  }

  [[gnu::cold]] void add_frames() {
    // The universe first, then bodies, which hide joints of the same name.
    for (const bool bodies : {true, false}) {
      for (std::size_t i = 0; i < model_.frames.size(); ++i) {
        const auto& f = model_.frames[i];
        if ((i == 0 || f.type == pinocchio::BODY) != bodies) continue;
        if (this->add_frame(f.name)) frames_.push_back({f.parentJoint, f.placement});
      }
    }
  }
  // That of the base joint, which a model that was built by hand need not have.
  [[gnu::cold]] FrameId base_frame() {
    for (std::size_t i = 0; i < frames_.size(); ++i) {
      if (frames_[i].joint == base_joint_ && frames_[i].placement.isIdentity(Scalar(0))) {
        return FrameId(static_cast<Index>(i));
      }
    }
    std::string name = model_.names[base_joint_];
    while (!this->add_frame(name)) name += " of the base";
    frames_.push_back({base_joint_, Model::SE3::Identity()});
    return FrameId(this->frame_count() - 1);
  }
  [[gnu::cold]] void add_joints() {
    for (std::size_t j = 1; j < static_cast<std::size_t>(model_.njoints); ++j) {
      const auto& joint = model_.joints[j];
      const std::string& name = model_.names[j];
      const std::string type = joint.shortname();
      if (joint.nv() == 0) continue;  // a mimic
      const Index q = joint.idx_q(), v = joint.idx_v();
      const bool free = type == "JointModelFreeFlyer", planar = type == "JointModelPlanar";
      if ((free || planar) && j == 1) {
        base_joint_ = j;
        planar_ = planar;
        configuration_(planar ? 2 : 6) = Scalar(1);
        continue;
      }
      if (joint.nv() != 1) {
        detail::invalid("PinocchioRobot: joint '", name, "' is a ", type,
                        free || planar ? ", and not the first: only the root's may be"
                                       : ": write it as joints with one degree of freedom");
      }
      const bool circle = joint.nq() == 2;
      JointInfo<Scalar> info{name, v};
      info.continuous = circle;
      const Scalar lower = model_.lowerPositionLimit(q), upper = model_.upperPositionLimit(q);
      constexpr Scalar most = std::numeric_limits<Scalar>::max();
      if (!circle && (lower != Scalar(0) || upper != Scalar(0))) {
        if (lower > -most) info.lower = lower;
        if (upper < most) info.upper = upper;
      }
      const Scalar velocity = velocity_limits(model_)(v);
      if (velocity != Scalar(0) && velocity < most) info.max_velocity = velocity;
      this->add_joint(std::move(info));
      if (circle) configuration_(q) = Scalar(1);
      places_.push_back({q, circle});
    }
  }
  // The name is from Pinocchio 4.
  static const auto& velocity_limits(const auto& model) noexcept {
    if constexpr (requires { model.upperVelocityLimit; }) {
      return model.upperVelocityLimit;
    } else {
      return model.velocityLimit;
    }
  }

  void compute() noexcept {
    pinocchio::computeJointJacobians(model_, data_, configuration_);
    this->moved();
  }
  // Joint by joint, since Pinocchio's own does not know mimics.
  void compute_center() const noexcept {
    this->keep_center([&](Vector3<Scalar>& center, PointJacobian& J) {
      if (!(mass_ > Scalar(0))) return;
      for (std::size_t j = 0; j < static_cast<std::size_t>(model_.njoints); ++j) {
        const auto& inertia = model_.inertias[j];
        if (!(inertia.mass() > Scalar(0))) continue;
        const Scalar share = inertia.mass() / mass_;
        const Vector3<Scalar> p = data_.oMi[j].act(inertia.lever());
        center = detail::plus(center, share, p);
        if (j == 0) continue;
        const Vector3<Scalar> r = detail::minus<Scalar>(p, data_.oMi[j].translation());
        detail::fill(point_, Scalar(0));
        pinocchio::getJointJacobian(model_, data_, j, pinocchio::LOCAL_WORLD_ALIGNED, point_);
        for (Index c = 0; c < model_.nv; ++c) {
          const Vector3<Scalar> v = detail::velocity_at(point_, c, r);
          for (Index row = 0; row < 3; ++row) J(row, c) += share * v(row);
        }
      }
    });
  }

  Model model_;
  mutable Data data_;  // Pinocchio's Jacobians take it without const, and read it only
  Configuration configuration_;
  std::vector<Placed> frames_;
  std::vector<Place> places_;  // of each joint
  std::size_t base_joint_{0};  // 0: the root is fixed
  bool planar_{false};
  Scalar mass_{0};
  mutable Jacobian point_;
};

}  // namespace icat
