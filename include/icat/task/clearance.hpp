// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Obstacle and self-collision avoidance: spheres and capsules on frames of the robot keep clear of
/// obstacles and of each other. A row for each pair,
///
///     x = signed distance,   ẋ = ∇φᵀ (v_a + ω_a × (p − p_a)) − ∇φᵀ (the same of the other)
///
/// with x, ∇φ and the point p of proximity.hpp: J is the exact derivative of x and continuous, also
/// where nearest points would jump. x is the true distance where one of the two is a sphere.
/// Otherwise the capsule is made thicker in its middle, and x is smaller, by at most `bulge` times
/// its length; of two of the robot's capsules the shorter one is thicker. Where centre lines meet,
/// or the middle of a box, ∇φ is 0 and the row fades out.
#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include "icat/math/proximity.hpp"
#include "icat/task/task.hpp"

namespace icat {

/// A sphere or a capsule that is fixed to a frame of the robot.
template <class Scalar>
struct CollisionBody {
  FrameId frame;          ///< that it moves with
  Capsule<Scalar> shape;  ///< on that frame

  /// `center` on the frame, m.
  static CollisionBody sphere(FrameId frame, const Vector3<Scalar>& center,
                              Scalar radius) noexcept {
    return {frame, {center, center, radius}};
  }
  /// `from` and `to` on the frame, m.
  static CollisionBody capsule(FrameId frame, const Vector3<Scalar>& from,
                               const Vector3<Scalar>& to, Scalar radius) noexcept {
    return {frame, {from, to, radius}};
  }
};

/// Two bodies of a list, by their places in it.
struct BodyPair {
  Index first;   ///< one
  Index second;  ///< another, on another frame
};

namespace detail {

/// Settings of both tasks.
template <class Scalar>
struct ClearanceSettings {
  std::string name;
  Scalar bulge, gain, max_rate;
};

/// What both tasks share.
template <FramedRobot R>
class ClearanceTask : public ReactiveTask<R> {
 public:
  using Scalar = typename R::Scalar;
  using Body = CollisionBody<Scalar>;

  /// Signed distance of row `row` at the last update, m.
  Scalar value(Index row) const noexcept { return values_[static_cast<std::size_t>(row)]; }
  /// The smallest of them, m.
  Scalar smallest() const noexcept { return *std::min_element(values_.begin(), values_.end()); }

  /// The objective on every distance.
  const Objective<Scalar>& objective() const noexcept { return objective_; }
  /// Another objective. Its construction throws on bad numbers, so build it outside the loop.
  void set_objective(const Objective<Scalar>& objective) noexcept { objective_ = objective; }
  /// Another limit of the error's part of |ẋ̄|, m/s; refused unless > 0.
  Status set_max_rate(Scalar rate) noexcept {
    if (!(rate > Scalar(0))) return Status::out_of_range;
    max_rate_ = rate;
    return Status::ok;
  }
  /// Another shape of a body: a tool or a load that came or went. Refused where there is no such
  /// body, or the shape has a radius ≤ 0 or is not finite; then the old one stays.
  Status set_shape(Index body, const Capsule<Scalar>& shape) noexcept {
    if (body < 0 || body >= body_count()) return Status::out_of_range;
    const Status status = check(shape).status;
    if (status == Status::ok) bodies_[static_cast<std::size_t>(body)].shape = shape;
    return status;
  }

 protected:
  ClearanceTask(const R& robot, Index rows, const std::vector<Body>& bodies,
                const Objective<Scalar>& objective, const ClearanceSettings<Scalar>& settings)
      : ReactiveTask<R>(robot, settings.name, rows, settings.gain),
        objective_(objective),
        max_rate_(settings.max_rate),
        bulge_(settings.bulge),
        bodies_(bodies),
        values_(static_cast<std::size_t>(rows), Scalar(0)) {
    this->set_length_power(0, rows, 1);
    this->require_rate("max_rate", max_rate_);
    if (!(bulge_ > Scalar(0) && bulge_ <= Scalar(1))) {
      invalid("task '", this->name(), "': bulge must be in (0, 1], got ", bulge_);
    }
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
      this->require_frame(bodies_[i].frame);
      this->measure_reach(bodies_[i].frame);
      require("body", static_cast<Index>(i), check(bodies_[i].shape));
      placed_.push_back(bodies_[i].shape);
    }
  }
  /// @throws std::invalid_argument with this task's name where there is a fault.
  void require(const char* what, Index i, const ShapeFault<Scalar>& fault) const {
    if (fault.status == Status::ok) return;
    invalid("task '", this->name(), "': ", what, " ", i, ": ", fault.what, " ", fault.value);
  }

  Index body_count() const noexcept { return static_cast<Index>(bodies_.size()); }
  const Body& body(Index i) const noexcept { return bodies_[static_cast<std::size_t>(i)]; }
  /// Where the bodies are in ⟨0⟩.
  void place() noexcept {
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
      const Pose<Scalar> pose = this->robot().pose(bodies_[i].frame);
      const Capsule<Scalar>& shape = bodies_[i].shape;
      placed_[i] = {transform(pose, shape.from), transform(pose, shape.to), shape.radius};
    }
  }
  const Capsule<Scalar>& placed(Index i) const noexcept {
    return placed_[static_cast<std::size_t>(i)];
  }

  /// Row `row` for body `i`, which is `placed`, and an obstacle.
  Proximity<Scalar> measure(Index row, Index i, const Obstacle<Scalar>& obstacle) noexcept {
    const Proximity<Scalar> near = proximity(placed(i), obstacle, bulge_);
    for (Index j = 0; j < this->jacobian_.cols(); ++j) this->jacobian_(row, j) = Scalar(0);
    add_motion(row, i, near, Scalar(1));
    values_[static_cast<std::size_t>(row)] = near.distance;
    // ‖∇φ‖ is 1/√3 at least away from the middle of what is penetrated.
    const Scalar fade = smooth_step(Scalar(2) * norm(near.gradient));
    this->set_scalar(row, near.distance, objective_, max_rate_, fade);
    return near;
  }
  /// Adds to the row what the velocity of body `i` at the point does, times `sign`.
  void add_motion(Index row, Index i, const Proximity<Scalar>& near, Scalar sign) noexcept {
    const FrameId frame = body(i).frame;
    const Vector3<Scalar> gradient = scaled(near.gradient, sign);
    const Vector3<Scalar> r = minus(near.point, origin(Pose<Scalar>(this->robot().pose(frame))));
    const auto& J = this->robot().jacobian(frame);
    for (Index j = 0; j < J.cols(); ++j) {
      this->jacobian_(row, j) += dot(gradient, velocity_at(J, j, r));
    }
  }

 private:
  Objective<Scalar> objective_;
  Scalar max_rate_, bulge_;
  std::vector<Body> bodies_;
  std::vector<Capsule<Scalar>> placed_;
  std::vector<Scalar> values_;
};

}  // namespace detail

namespace task {

/// Every body keeps clear of every obstacle. Row = body · (number of obstacles) + obstacle.
template <FramedRobot R>
class Clearance : public detail::ClearanceTask<R> {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  /// Settings, with defaults.
  struct Options {
    std::string name = "clearance";  ///< in errors and logs
    /// How much thicker a capsule is in its middle, in lengths of it, in (0, 1]: more makes the
    /// nearest point move slower and x smaller, see proximity.hpp.
    Scalar bulge{static_cast<Scalar>(0.02)};
    Scalar gain{1};                     ///< γ, 1/s
    Scalar max_rate{infinity<Scalar>};  ///< m/s, of the error's part
  };

  /// `objective` on every distance, such as `at_least(0.05, 0.1)`, m. Obstacles begin at rest.
  /// @throws std::invalid_argument on shapes or settings out of range. Allocates.
  Clearance(const R& robot, const std::vector<CollisionBody<Scalar>>& bodies,
            const std::vector<Obstacle<Scalar>>& obstacles, const Objective<Scalar>& objective)
      : Clearance(robot, bodies, obstacles, objective, Options{}) {}
  /// The same with options.
  Clearance(const R& robot, const std::vector<CollisionBody<Scalar>>& bodies,
            const std::vector<Obstacle<Scalar>>& obstacles, const Objective<Scalar>& objective,
            Options options)
      : detail::ClearanceTask<R>(robot, static_cast<Index>(bodies.size() * obstacles.size()),
                                 bodies, objective,
                                 {options.name, options.bulge, options.gain, options.max_rate}),
        obstacles_(obstacles),
        velocities_(obstacles.size(), detail::zeros<Vector6<Scalar>>(6)) {
    for (std::size_t i = 0; i < obstacles_.size(); ++i) {
      this->require("obstacle", static_cast<Index>(i), obstacles_[i].check());
    }
  }

  /// Where the distance of a body and an obstacle stands.
  Index row(Index body, Index obstacle) const noexcept {
    return body * static_cast<Index>(obstacles_.size()) + obstacle;
  }
  /// As set last.
  const Obstacle<Scalar>& obstacle(Index i) const noexcept {
    return obstacles_[static_cast<std::size_t>(i)];
  }
  /// Another obstacle in the place of the `i`-th, of any shape, that moves with `velocity`
  /// [linear; angular] at its `origin`, m/s, rad/s, components on ⟨0⟩. Refused where there is no
  /// such one, or it has edges or a radius ≤ 0, a normal not of length 1, a pose that is none, or
  /// is not finite; then the old one stays.
  Status set_obstacle(
      Index i, const Obstacle<Scalar>& obstacle,
      const Vector6<Scalar>& velocity = detail::zeros<Vector6<Scalar>>(6)) noexcept {
    const std::size_t at = static_cast<std::size_t>(i);
    if (i < 0 || at >= obstacles_.size()) return Status::out_of_range;
    if (!detail::all_finite(velocity)) return Status::non_finite;
    const Status status = obstacle.check().status;
    if (status != Status::ok) return status;
    obstacles_[at] = obstacle;
    velocities_[at] = velocity;
    return Status::ok;
  }

 private:
  void compute() noexcept override {
    this->place();
    Index row = 0;
    for (Index i = 0; i < this->body_count(); ++i) {
      for (std::size_t k = 0; k < obstacles_.size(); ++k, ++row) {
        const Proximity<Scalar> near = this->measure(row, i, obstacles_[k]);
        const Vector3<Scalar> arm = detail::minus(near.point, obstacles_[k].origin());
        this->reference_(row) +=
            detail::dot(near.gradient, detail::velocity_at(velocities_[k], 0, arm));
      }
    }
  }

  std::vector<Obstacle<Scalar>> obstacles_;
  std::vector<Vector6<Scalar>> velocities_;
};

/// Pairs of the robot's bodies keep clear of each other; row i is pair i. Neighbours that always
/// touch at their joint are no pair.
template <FramedRobot R>
class SelfClearance : public detail::ClearanceTask<R> {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  /// Settings, with defaults.
  struct Options {
    std::string name = "self clearance";  ///< in errors and logs
    /// How much thicker a capsule is in its middle, in lengths of it, in (0, 1]: more makes the
    /// nearest point move slower and x smaller, see proximity.hpp.
    Scalar bulge{static_cast<Scalar>(0.02)};
    Scalar gain{1};                     ///< γ, 1/s
    Scalar max_rate{infinity<Scalar>};  ///< m/s, of |ẋ̄|
  };

  /// `objective` on every distance, such as `at_least(0.05, 0.1)`, m.
  /// @throws std::invalid_argument on shapes or settings out of range, a pair of bodies that are
  ///         not in the list, or of two on one frame. Allocates.
  SelfClearance(const R& robot, const std::vector<CollisionBody<Scalar>>& bodies,
                const std::vector<BodyPair>& pairs, const Objective<Scalar>& objective)
      : SelfClearance(robot, bodies, pairs, objective, Options{}) {}
  /// The same with options.
  SelfClearance(const R& robot, const std::vector<CollisionBody<Scalar>>& bodies,
                const std::vector<BodyPair>& pairs, const Objective<Scalar>& objective,
                Options options)
      : detail::ClearanceTask<R>(robot, static_cast<Index>(pairs.size()), bodies, objective,
                                 {options.name, options.bulge, options.gain, options.max_rate}),
        pairs_(pairs) {
    for (const BodyPair& pair : pairs_) {
      for (const Index i : {pair.first, pair.second}) {
        if (i < 0 || i >= this->body_count()) {
          detail::invalid("task '", this->name(), "': body ", i, " is not among the ",
                          this->body_count());
        }
      }
      if (this->body(pair.first).frame == this->body(pair.second).frame) {
        detail::invalid("task '", this->name(), "': bodies ", pair.first, " and ", pair.second,
                        " are on one frame, so they cannot move apart");
      }
      const auto& J = robot.jacobian(this->body(pair.first).frame);
      const auto& K = robot.jacobian(this->body(pair.second).frame);
      bool apart = false;
      for (Index j = 0; j < robot.dof(); ++j) {
        const Vector3<Scalar> r =
            detail::minus(detail::origin(Pose<Scalar>(robot.pose(this->body(pair.second).frame))),
                          detail::origin(Pose<Scalar>(robot.pose(this->body(pair.first).frame))));
        const Vector3<Scalar> v = detail::minus(detail::column3(K, 0, j),
                                                detail::velocity_at(J, j, r)),
                              w = detail::minus(detail::column3(K, 3, j), detail::column3(J, 3, j));
        apart = apart || detail::norm(v) + detail::norm(w) > Scalar(1e-5);
      }
      if (!apart) {
        detail::invalid("task '", this->name(), "': no joint lies between bodies ", pair.first,
                        " and ", pair.second);
      }
    }
  }

 private:
  void compute() noexcept override {
    this->place();
    for (Index row = 0; row < this->rows(); ++row) {
      // The shorter one is made thicker. On their frames lengths are constant, so nothing flips.
      BodyPair pair = pairs_[static_cast<std::size_t>(row)];
      if (length(pair.second) < length(pair.first)) std::swap(pair.first, pair.second);
      const Capsule<Scalar>& other = this->placed(pair.second);
      const auto obstacle = Obstacle<Scalar>::capsule(other.from, other.to, other.radius);
      const Proximity<Scalar> near = this->measure(row, pair.first, obstacle);
      this->add_motion(row, pair.second, near, Scalar(-1));
    }
  }

  Scalar length(Index i) const noexcept {
    const Capsule<Scalar>& shape = this->body(i).shape;
    return detail::norm(detail::minus(shape.to, shape.from));
  }

  std::vector<BodyPair> pairs_;
};

}  // namespace task
}  // namespace icat
