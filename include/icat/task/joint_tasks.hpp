// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Tasks of the arm alone: joint limits, manipulability, preferred shape, arm motion minimality.
#pragma once

#include <limits>
#include <optional>
#include <vector>

#include "icat/math/spatial_algebra.hpp"
#include "icat/task/task.hpp"

namespace icat::task {

/// q_m ≤ q ≤ q_M for every joint [Coop, Eq. (10)], in the component form with the two activations
/// summed [Coop, III-C]. The limits are the arm's; a joint without limits is never active.
template <VehicleManipulator R>
class JointLimits : public Task<R> {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  /// Settings, with defaults.
  struct Options {
    /// What errors and logs call it.
    std::string name = "joint limits";
    Scalar margin{static_cast<Scalar>(0.1)};                   ///< β, rad or m
    Scalar gain{1};                                            ///< γ, 1/s
    Scalar max_rate{std::numeric_limits<Scalar>::infinity()};  ///< rad/s, m/s
  };

  /// @throws std::invalid_argument on settings out of range. Allocates.
  explicit JointLimits(const R& robot) : JointLimits(robot, Options{}) {}
  /// @throws std::invalid_argument on settings out of range. Allocates.
  JointLimits(const R& robot, Options options)
      : Task<R>(options.name, robot.arm_dof(), robot.dof()), options_(options) {
    this->require_gain(options.gain);
    this->require_rate("max_rate", options.max_rate);
    for (Index i = 0; i < robot.arm_dof(); ++i) {
      this->jacobian_(i, i) = Scalar(1);
      objectives_.push_back(Objective<Scalar>::between(
          robot.arm().lower_limits()(i), robot.arm().upper_limits()(i), options.margin));
    }
  }

 private:
  void compute(const R& robot) noexcept override {
    for (Index i = 0; i < this->rows(); ++i) {
      this->set_scalar(i, robot.q()(i), objectives_[static_cast<std::size_t>(i)], options_.gain,
                       options_.max_rate);
    }
  }

  Options options_;
  std::vector<Objective<Scalar>> objectives_;
};

/// μ ≥ μ_m [Coop, Eq. (11)], [MARIS, Eq. (14)–(18)].
template <VehicleManipulator R>
class Manipulability : public Task<R> {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  /// Settings, with defaults.
  struct Options {
    /// What errors and logs call it.
    std::string name = "manipulability";
    Scalar minimum;  ///< μ_m, in the unit of μ (m³ for a revolute arm of six joints or more)
    Scalar margin;   ///< Δ of [MARIS, Eq. (16)]
    /// γ, 1/s, > 0.
    Scalar gain{1};
    /// Largest reference rate, in the unit of x per second.
    Scalar max_rate{std::numeric_limits<Scalar>::infinity()};
  };

  /// @throws std::invalid_argument on settings out of range. Allocates.
  Manipulability(const R& robot, Options options)
      : Task<R>(options.name, 1, robot.dof()),
        options_(options),
        objective_(Objective<Scalar>::at_least(options.minimum, options.margin)) {
    this->require_gain(options.gain);
    this->require_rate("max_rate", options.max_rate);
  }

 private:
  void compute(const R& robot) noexcept override {
    const auto& mu = robot.manipulability();
    for (Index j = 0; j < robot.arm_dof(); ++j) this->jacobian_(0, j) = mu.gradient(j);
    this->set_scalar(0, mu.value, objective_, options_.gain, options_.max_rate);
  }

  Options options_;
  Objective<Scalar> objective_;
};

/// The arm near a preferred shape q* [Coop, II-D2], [MARIS, III-B7]: component by component to
/// zero, or an objective on ‖q − q*‖ where `norm` is given (Coop, Remark 1).
template <VehicleManipulator R>
class PreferredShape : public Task<R> {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  /// Joint positions or velocities.
  using VectorQ = typename R::VectorQ;
  /// Settings, with defaults.
  struct Options {
    /// What errors and logs call it.
    std::string name = "preferred shape";
    /// q*, rad or m
    VectorQ shape{unset()};
    /// Given: the norm form with this objective. Not given: the component form.
    std::optional<Objective<Scalar>> norm{};
    /// γ, 1/s, > 0.
    Scalar gain{1};
    Scalar max_rate{std::numeric_limits<Scalar>::infinity()};  ///< of ‖q̇‖

   private:
    static VectorQ unset() {
      VectorQ q;
      detail::fill(q, std::numeric_limits<Scalar>::quiet_NaN());
      return q;
    }
  };

  /// @throws std::invalid_argument on settings out of range. Allocates.
  PreferredShape(const R& robot, Options options)
      : Task<R>(options.name, options.norm ? 1 : robot.arm_dof(), robot.dof()), options_(options) {
    this->require_gain(options.gain);
    this->require_rate("max_rate", options.max_rate);
    if (!detail::all_finite(options.shape)) {
      detail::invalid("task '", options.name, "': the shape is not finite");
    }
    if (!options.norm) this->select_columns(0);
  }

 private:
  void compute(const R& robot) noexcept override {
    VectorQ error = options_.shape;
    Scalar square(0);
    for (Index j = 0; j < error.size(); ++j) {
      error(j) -= robot.q()(j);
      square += error(j) * error(j);
    }
    if (!options_.norm) {
      this->set_error(0, error, options_.gain, options_.max_rate);
      return;
    }
    const Scalar distance = std::sqrt(square);
    for (Index j = 0; j < error.size(); ++j) {
      // At distance 0 the mean of both sides of the kink.
      this->jacobian_(0, j) = distance > Scalar(0) ? -error(j) / distance : Scalar(0);
    }
    this->set_scalar(0, distance, *options_.norm, options_.gain, options_.max_rate);
  }

  Options options_;
};

/// q̇ = 0 [Coop, III-D]: leaves the work to the vehicle. Goes to the bottom of the hierarchy.
template <VehicleManipulator R>
class ArmMotionMinimality : public Task<R> {
 public:
  /// @throws std::invalid_argument on settings out of range. Allocates.
  explicit ArmMotionMinimality(const R& robot, std::string name = "arm motion minimality")
      : Task<R>(std::move(name), robot.arm_dof(), robot.dof()) {
    this->select_columns(0);
  }

 private:
  void compute(const R&) noexcept override {}
};

}  // namespace icat::task
