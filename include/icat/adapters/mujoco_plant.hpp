// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A MuJoCo simulation as the robot: every joint and the free base follow the commanded velocity by
/// a servo; MuJoCo simulates inertia, gravity, water and contacts. The program links `mujoco`;
/// docs/hardware.md has the lines of CMake.
///
///     w = M(q) (commanded ẏ − ẏ),     f = w/τ + ∫ w dt / 4τ²
///
/// with M what MuJoCo's mass matrix has for the joints, or for the base: each of the two uses its
/// own inertia, with everything that it carries, and ignores the motion of the other. τ is the lag
/// of the servo, and 4τ its reset time, which damps critically. f goes to `qfrc_applied`. At the
/// start the integral balances the weight; where f reaches its limit the integral waits.
///
/// MuJoCo runs at the time step of its model. A control period is as many steps as fit; what is
/// left over is carried to the next one. The integrator RK4 counts as Euler (`mj_step1`,
/// `mj_step2`).
#pragma once

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "icat/core/status.hpp"
#include "icat/math/rigid_motion.hpp"
#include "icat/model/robot.hpp"

namespace icat {

/// See the file comment. `R` is the robot that controls: joints are found in the model by their
/// names, and the body of the base by the name of the robot's base frame. Its surface is that of
/// `KinematicPlant`; the robot itself stays where it is. Can be moved, not copied.
template <JointedRobot R>
class MujocoPlant {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  /// One entry for each of the robot's `joints`, rad or m.
  using Positions = Vector<Scalar, Eigen::Dynamic>;
  /// ẏ, n.
  using Velocity = Vector<Scalar, R::size>;
  /// Settings, with defaults.
  struct Options {
    Positions q = Filled{0};                          ///< at the start; empty: the model's `qpos0`
    std::optional<Pose<Scalar>> base = std::nullopt;  ///< of a free base; none: the model's
    std::string base_body = "";                       ///< none: the name of the robot's base frame
    double joint_lag{0.02};  ///< τ of joints, s; at least five time steps of the model
    double base_lag{0.1};    ///< τ of the base, s; likewise
    Columns not_actuated = ColumnRange{};  ///< no force is applied there
    /// Largest force of each column, n; N or N m, > 0. Empty: none.
    std::vector<Scalar> max_force = EmptyList{};
  };

  /// The robot at the model's `qpos0`.
  MujocoPlant(const R& robot, const mjModel& model) : MujocoPlant(robot, model, Options{}) {}
  /// `model` must live as long as the plant, which has an `mjData` of its own; `robot` is not
  /// needed afterwards. Allocates.
  /// @throws std::invalid_argument on a joint or base that the model has not; a base that is
  ///         neither `Base::free()` on a free joint nor fixed on a fixed body; a column of the
  ///         robot that belongs neither to a joint nor to the base; a start that is not finite, of
  ///         another size or no pose; a lag below five time steps; a force that is not > 0.
  [[gnu::cold]] MujocoPlant(const R& robot, const mjModel& model, Options options)
      : model_(&model),
        data_(mj_makeData(&model)),
        error_(static_cast<std::size_t>(model.nv)),
        wanted_(error_.size()),
        q_(detail::zeros<Positions>(static_cast<Index>(robot.joints().size()))),
        base_(detail::identity_pose<Scalar>()),
        velocity_(detail::zeros<Velocity>(robot.dof())) {
    if (!data_) detail::invalid("MujocoPlant: mj_makeData failed");
    add_joints(robot, options);
    add_base(robot, options);
    check(robot, options);
    place(options);
    for (const Index c : options.not_actuated) servo(c).driven = false;
    if (!options.max_force.empty()) {
      for (Servo& s : servos_) {
        s.most = static_cast<mjtNum>(options.max_force[static_cast<std::size_t>(s.column)]);
      }
    }
    mj_forward(model_, data_.get());
    for (Servo& s : servos_) s.integral = on_base(s, data_->qfrc_bias);
    read();
  }

  /// From `time` to `time + dt` (s) under the command ẏ (n), base columns with components on the
  /// base; takes as long as MuJoCo needs for so many steps. `wrong_size`, `non_finite` (the period,
  /// too): refused, nothing moves. `numerical_failure`: MuJoCo found its state unstable and gave
  /// up; what is known stays that of before, and no step is made any more. No allocation.
  Status step(const Velocity& command, double time, double dt) noexcept {
    (void)time;
    if (command.size() != velocity_.size()) return Status::wrong_size;
    double sum = dt;
    for (Index i = 0; i < command.size(); ++i) sum += 0.0 * static_cast<double>(command(i));
    if (!std::isfinite(sum)) return Status::non_finite;
    if (failed_) return Status::numerical_failure;
    const double h = model_->opt.timestep;
    for (due_ += std::max(dt, 0.0); due_ > h / 2; due_ -= h) {
      mj_step1(model_, data_.get());
      drive(command, true);
      drive(command, false);
      mj_step2(model_, data_.get());
      if (unstable()) {
        failed_ = true;
        return Status::numerical_failure;
      }
    }
    read();
    return Status::ok;
  }

  /// Positions of the robot's `joints`, rad or m; what turns without end is not wrapped.
  const Positions& q() const noexcept { return q_; }
  /// The base's pose in ⟨0⟩, which is MuJoCo's world.
  const Pose<Scalar>& base() const noexcept { return base_; }
  /// ẏ, n; base columns with respect to ⟨0⟩, components on the base.
  const Velocity& velocity() const noexcept { return velocity_; }
  /// What the servo of column `c` applied in MuJoCo's last step, N or N m.
  Scalar force(Index c) const noexcept {
    for (const Servo& s : servos_) {
      if (s.column == c) return static_cast<Scalar>(s.force);
    }
    return Scalar(0);
  }
  /// The simulation: contacts, other bodies.
  const mjData& data() const noexcept { return *data_; }
  /// The same, to place or push what is not the robot's.
  mjData& data() noexcept { return *data_; }

 private:
  // A column of the robot, and a degree of freedom of MuJoCo's; 0 … 5 of the base, −1: a joint.
  struct Servo {
    Index column;
    int dof;
    int axis;
    mjtNum lag;
    mjtNum integral{0}, force{0};
    mjtNum most{infinity<mjtNum>};
    bool driven{true};
  };
  struct Delete {
    void operator()(mjData* data) const noexcept { mj_deleteData(data); }
  };

  [[gnu::cold]] void add_joints(const R& robot, const Options& options) {
    for (const auto& joint : robot.joints()) {
      const int id = mj_name2id(model_, mjOBJ_JOINT, joint.name.c_str());
      if (id < 0) {
        std::string names;
        for (int j = 0; j < model_->njnt; ++j) {
          const char* name = mj_id2name(model_, mjOBJ_JOINT, j);
          if (name) detail::append_name(names, name);
        }
        detail::invalid("MujocoPlant: the model has no joint '", joint.name, "'; there are ",
                        names);
      }
      if (model_->jnt_type[id] != mjJNT_HINGE && model_->jnt_type[id] != mjJNT_SLIDE) {
        detail::invalid("MujocoPlant: joint '", joint.name, "' is neither a hinge nor a slide");
      }
      servos_.push_back(
          {joint.column, model_->jnt_dofadr[id], -1, static_cast<mjtNum>(options.joint_lag)});
      positions_.push_back(model_->jnt_qposadr[id]);
    }
  }
  [[gnu::cold]] void add_base(const R& robot, const Options& options) {
    if constexpr (MobileRobot<R>) {
      std::string name = options.base_body;
      if constexpr (requires { std::string(robot.frame_name(robot.base())); }) {
        if (name.empty()) name = robot.frame_name(robot.base());
      }
      base_body_ = mj_name2id(model_, mjOBJ_BODY, name.c_str());
      if (base_body_ < 0) detail::invalid("MujocoPlant: the model has no body '", name, "'");
      const ColumnRange columns = robot.base_columns();
      const int joint = model_->body_jntadr[base_body_];
      const bool floats = joint >= 0 && model_->jnt_type[joint] == mjJNT_FREE;
      const auto& B = robot.base_motion();
      bool free = columns.count == 6;
      for (Index j = 0; j < columns.count; ++j) {
        for (Index i = 0; i < 6; ++i) free = free && B(i, j) == Scalar(i == j ? 1 : 0);
      }
      if (!(floats && free) && !(columns.count == 0 && model_->body_weldid[base_body_] == 0)) {
        detail::invalid(
            "MujocoPlant: the base must be Base::free() on a free joint, or fixed on a ",
            "fixed body; '", name, "' has ", floats ? "a free joint" : "none",
            ", the robot's base ", columns.count, " columns");
      }
      if (!free) return;
      free_qpos_ = model_->jnt_qposadr[joint];
      for (int axis = 0; axis < 6; ++axis) {
        servos_.push_back({columns.first + axis, model_->jnt_dofadr[joint] + axis, axis,
                           static_cast<mjtNum>(options.base_lag)});
      }
    }
  }
  [[gnu::cold]] void check(const R& robot, const Options& options) {
    const Index n = robot.dof();
    for (const double lag : {options.joint_lag, options.base_lag}) {
      if (!(lag >= 5 * model_->opt.timestep) || !std::isfinite(lag)) {
        detail::invalid("MujocoPlant: a lag must be at least five time steps of ",
                        model_->opt.timestep, " s, got ", lag);
      }
    }
    if (options.q.size() != 0 && options.q.size() != q_.size()) {
      detail::invalid("MujocoPlant: q has ", options.q.size(), " entries for ", q_.size(),
                      " joints");
    }
    if (!detail::all_finite(options.q)) detail::invalid("MujocoPlant: q is not finite");
    if (options.base && free_qpos_ < 0) {
      detail::invalid("MujocoPlant: the base is fixed where the model has it");
    }
    if (options.base && !is_rigid(*options.base)) {
      detail::invalid("MujocoPlant: the base's pose is not finite or not a rotation");
    }
    detail::check_columns("MujocoPlant", options.not_actuated, n);
    if (!options.max_force.empty() && static_cast<Index>(options.max_force.size()) != n) {
      detail::invalid("MujocoPlant: max_force has ", options.max_force.size(), " entries for ", n,
                      " columns");
    }
    for (const Scalar most : options.max_force) {
      if (!(most > Scalar(0))) detail::invalid("MujocoPlant: max_force must be > 0, got ", most);
    }
    List<bool> moved(static_cast<std::size_t>(n));
    for (const Servo& s : servos_) moved[static_cast<std::size_t>(s.column)] = true;
    for (Index c = 0; c < n; ++c) {
      if (!moved[static_cast<std::size_t>(c)]) {
        detail::invalid("MujocoPlant: column ", c, " is neither a joint's nor the base's");
      }
    }
  }
  [[gnu::cold]] void place(const Options& options) {
    for (Index i = 0; i < options.q.size(); ++i) {
      data_->qpos[positions_[static_cast<std::size_t>(i)]] = static_cast<mjtNum>(options.q(i));
    }
    if (!options.base) return;
    Matrix3<mjtNum> turned;
    for (Index j = 0; j < 3; ++j) {
      for (Index i = 0; i < 3; ++i)
        turned(i, j) = static_cast<mjtNum>(options.base->matrix()(i, j));
    }
    const auto rotation = detail::UnitQuaternion<mjtNum>::of(turned);
    mjtNum* qpos = data_->qpos + free_qpos_;
    qpos[3] = rotation.w;
    for (int i = 0; i < 3; ++i) {
      qpos[i] = static_cast<mjtNum>(options.base->matrix()(i, 3));
      qpos[4 + i] = rotation.v(i);
    }
  }
  Servo& servo(Index column) noexcept {
    return *std::find_if(servos_.begin(), servos_.end(),
                         [&](const Servo& s) { return s.column == column; });
  }

  // Entry of the degree of freedom of `s` in `all`, nv; of a free joint's linear part, which MuJoCo
  // has on the world, Rᵀ times it.
  mjtNum on_base(const Servo& s, const mjtNum* all) const noexcept {
    if (s.axis < 0 || s.axis > 2) return all[s.dof];
    const mjtNum *x = data_->xmat + 9 * base_body_, *at = all + s.dof - s.axis;
    return x[s.axis] * at[0] + x[3 + s.axis] * at[1] + x[6 + s.axis] * at[2];
  }
  // Adds `value` to the same entry, R times it.
  void add_on_world(const Servo& s, mjtNum value, mjtNum* all) const noexcept {
    if (s.axis < 0 || s.axis > 2) {
      all[s.dof] += value;
      return;
    }
    const mjtNum* x = data_->xmat + 9 * base_body_;
    for (int i = 0; i < 3; ++i) all[s.dof - s.axis + i] += x[3 * i + s.axis] * value;
  }

  // The servos of the joints, or of the base.
  void drive(const Velocity& command, bool joints) noexcept {
    std::fill(error_.begin(), error_.end(), mjtNum(0));
    for (const Servo& s : servos_) {
      if (!s.driven || (s.axis < 0) != joints) continue;
      const mjtNum e = static_cast<mjtNum>(command(s.column)) - on_base(s, data_->qvel);
      add_on_world(s, e, error_.data());
    }
    mj_mulM(model_, data_.get(), wanted_.data(), error_.data());
    for (Servo& s : servos_) {
      if ((s.axis < 0) == joints) data_->qfrc_applied[s.dof] = 0;
    }
    for (Servo& s : servos_) {
      if (!s.driven || (s.axis < 0) != joints) continue;
      const mjtNum w = on_base(s, wanted_.data()), h = model_->opt.timestep;
      const mjtNum more = s.integral + h * w / (4 * s.lag * s.lag), force = w / s.lag + more;
      s.force = std::clamp(force, -s.most, s.most);
      if (s.force == force || (force - s.force) * w < 0) s.integral = more;
      add_on_world(s, s.force, data_->qfrc_applied);
    }
  }
  // MuJoCo puts its state back to the start where it finds it unstable, and counts that.
  bool unstable() const noexcept {
    return data_->warning[mjWARN_BADQPOS].number + data_->warning[mjWARN_BADQVEL].number +
               data_->warning[mjWARN_BADQACC].number >
           0;
  }
  void read() noexcept {
    mj_kinematics(model_, data_.get());  // a step leaves the poses of its beginning
    for (std::size_t i = 0; i < positions_.size(); ++i) {
      q_(static_cast<Index>(i)) = static_cast<Scalar>(data_->qpos[positions_[i]]);
    }
    if (base_body_ >= 0) {
      const mjtNum *p = data_->xpos + 3 * base_body_, *x = data_->xmat + 9 * base_body_;
      for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) base_.matrix()(i, j) = static_cast<Scalar>(x[3 * i + j]);
        base_.matrix()(i, 3) = static_cast<Scalar>(p[i]);
      }
    }
    for (const Servo& s : servos_) {
      velocity_(s.column) = static_cast<Scalar>(on_base(s, data_->qvel));
    }
  }

  const mjModel* model_;
  std::unique_ptr<mjData, Delete> data_;
  std::vector<mjtNum> error_, wanted_;  // nv
  std::vector<Servo> servos_;           // joints, then the base
  std::vector<int> positions_;          // of each joint in qpos
  int base_body_{-1};
  int free_qpos_{-1};  // of the base's free joint; −1: it has none
  double due_{0};      // s that MuJoCo is behind
  bool failed_{false};
  Positions q_;
  Pose<Scalar> base_;
  Velocity velocity_;
};

}  // namespace icat
