// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A model of MuJoCo, or the part of it below one body, is the robot. The program links `mujoco`;
/// docs/adapters.md has the lines of CMake.
///
///     ẏ: the entries of `qvel` that are the robot's, in MuJoCo's order, except that the base's
///     linear velocity has components on the base, not on the world: `write_qvel` turns it back
///
/// A frame for the world, each body of the robot and each site on it, by their names. Joints:
/// hinges and slides; a free joint of the robot's root is its base, ball joints are refused. A
/// hinge without range turns without end. MuJoCo knows no limits of velocity: `set_limits` says
/// them. Equality constraints, so also joints that MuJoCo couples, are not seen.
#pragma once

#include <mujoco/mujoco.h>

#include <memory>
#include <string>
#include <vector>

#include "icat/adapters/foreign_robot.hpp"

namespace icat {

/// A model of MuJoCo. The robot refers to the model, which must live as long as the robot does, and
/// has an `mjData` of its own, so that it does not disturb a simulation. Construction allocates and
/// throws; the control step does neither. Can be moved, not copied.
class MujocoRobot : public ForeignRobot<mjtNum> {
 public:
  /// The part of `model` below the body `root`, which must hang on the world, or all of it. In the
  /// model's reference state (`qpos0`).
  /// @throws std::invalid_argument on a body that there is not, with those there are; on joints
  ///         that are not supported; on two joints of one name; and where nothing can move.
  explicit MujocoRobot(const mjModel& model, const std::string& root = "world")
      : model_(&model), root_(find_body(root)), data_(mj_makeData(&model)) {
    if (!data_) detail::invalid("MujocoRobot: mj_makeData failed");
    if (model.body_parentid[root_] != 0) {
      detail::invalid("MujocoRobot: body '", root, "' hangs on '",
                      name(mjOBJ_BODY, model.body_parentid[root_]), "', not on the world");
    }
    for (int body = root_; body < model.nbody; ++body) {
      if (of_robot(body)) last_body_ = body;
    }
    add_frames();
    add_joints();
    if (dof_count_ == 0) detail::invalid("MujocoRobot: nothing can move");
    const bool free = free_body_ >= 0, welded = model.body_jntnum[root_] == 0;
    finish(dof_count_,
           frame_of_body(free     ? free_body_
                         : welded ? root_
                                  : 0),
           0, free ? Base<Scalar>::free() : Base<Scalar>::fixed());
    rows_.resize(static_cast<std::size_t>(6 * model.nv));
    accept(model.qpos0);
  }

  /// The model.
  const mjModel& model() const noexcept { return *model_; }
  /// Positions of what is not the robot's are those of `qpos0`, or of the last `update(data)`.
  const mjData& data() const noexcept { return *data_; }

  /// New positions of `joints`, the base where it was. `q` may be any Eigen vector. NaN, infinity
  /// or a wrong size: refused, the state stays. No allocation.
  template <class Q>
  Status update(const Eigen::MatrixBase<Q>& q) noexcept {
    if (const Status status = check_positions(q); status != Status::ok) return status;
    for (std::size_t i = 0; i < positions_.size(); ++i) {
      data_->qpos[positions_[i]] = q(static_cast<Index>(i));
    }
    accept(data_->qpos);
    return Status::ok;
  }
  /// New positions and pose of the base in ⟨0⟩. A pose that is no rotation is refused too, and for
  /// a robot without free joint `out_of_range` answers any pose but the one that its base has.
  template <class Q>
  Status update(const Eigen::MatrixBase<Q>& q, const Pose<Scalar>& base) noexcept {
    if (const Status status = check_positions(q); status != Status::ok) return status;
    if (const Status status = check_pose(base); status != Status::ok) return status;
    if (free_body_ < 0) {
      return same_pose(base, pose(this->base())) ? update(q) : Status::out_of_range;
    }
    mjtNum* qpos = data_->qpos + model_->jnt_qposadr[model_->body_jntadr[free_body_]];
    const auto rotation = detail::UnitQuaternion<Scalar>::of(detail::rotation(base));
    qpos[3] = rotation.w;
    for (int i = 0; i < 3; ++i) {
      qpos[i] = base.matrix()(i, 3);
      qpos[4 + i] = rotation.v(i);
    }
    return update(q);
  }
  /// The state (`qpos`) of a simulation of the model. NaN or infinity: refused, the state stays. No
  /// allocation.
  Status update(const mjData& simulation) noexcept {
    if (!all_finite(Eigen::Map<const Positions>(simulation.qpos, model_->nq))) {
      return Status::non_finite;
    }
    accept(simulation.qpos);
    return Status::ok;
  }

  /// Writes the velocity `y` (n) of the robot into the `qvel` of a simulation (nv); what is not the
  /// robot's stays. NaN, infinity or a wrong size: refused, nothing is written. No allocation.
  template <class Y>
  Status write_qvel(const Eigen::MatrixBase<Y>& y, mjtNum* qvel) const noexcept {
    if (y.size() != dof()) return Status::wrong_size;
    if (!all_finite(y)) return Status::non_finite;
    for (Index i = 0; i < y.size(); ++i) qvel[first_dof_ + i] = y(i);
    if (free_body_ >= 0) {
      const Vector3<Scalar> v =
          detail::times(detail::rotation(pose(base())), Vector3<Scalar>(y(0), y(1), y(2)));
      for (int i = 0; i < 3; ++i) qvel[first_dof_ + i] = v(i);
    }
    return Status::ok;
  }

  /// ⟨f⟩ in ⟨0⟩, which is MuJoCo's world. No allocation.
  Pose<Scalar> pose(FrameId frame) const noexcept {
    const Place& f = places_[static_cast<std::size_t>(frame.index())];
    const mjtNum* p = (f.site ? data_->site_xpos : data_->xpos) + 3 * f.id;
    const mjtNum* R = (f.site ? data_->site_xmat : data_->xmat) + 9 * f.id;
    Pose<Scalar> pose = detail::identity_pose<Scalar>();
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) pose.matrix()(i, j) = R[3 * i + j];
      pose.matrix()(i, 3) = p[i];
    }
    return pose;
  }
  /// 6 × n, rows linear then angular, at the origin of ⟨f⟩, components on ⟨0⟩. No allocation.
  const Jacobian& jacobian(FrameId frame) const noexcept {
    return kept_jacobian(frame, [&](Jacobian& J) {
      const Place& f = places_[static_cast<std::size_t>(frame.index())];
      mjtNum* angular = rows_.data() + 3 * model_->nv;
      if (f.site) {
        mj_jacSite(model_, data_.get(), rows_.data(), angular, f.id);
      } else {
        mj_jacBody(model_, data_.get(), rows_.data(), angular, f.id);
      }
      take(J, 6);
    });
  }

  /// Of the robot's bodies, kg.
  Scalar mass() const noexcept { return model_->body_subtreemass[root_]; }
  /// In ⟨0⟩, m. No allocation.
  Vector3<Scalar> center_of_mass() const noexcept {
    const mjtNum* c = data_->subtree_com + 3 * root_;
    return {c[0], c[1], c[2]};
  }
  /// 3 × n, components on ⟨0⟩. No allocation.
  const PointJacobian& center_of_mass_jacobian() const noexcept {
    keep_center([&](Vector3<Scalar>&, PointJacobian& J) {
      mj_jacSubtreeCom(model_, data_.get(), rows_.data(), root_);
      take(J, 3);
    });
    return kept_center_jacobian();
  }

 private:
  // What a frame is in MuJoCo.
  struct Place {
    bool site;
    int id;
  };
  struct Delete {
    void operator()(mjData* data) const noexcept { mj_deleteData(data); }
  };

  std::string name(mjtObj type, int id) const {
    const char* text = mj_id2name(model_, type, id);
    return text ? text : "";
  }
  [[gnu::cold]] int find_body(const std::string& root) const {
    const int id = mj_name2id(model_, mjOBJ_BODY, root.c_str());
    if (id >= 0) return id;
    std::vector<std::string> names;
    for (int i = 0; i < model_->nbody; ++i) names.push_back(name(mjOBJ_BODY, i));
    detail::invalid("MujocoRobot: no body '", root, "'; there are ", detail::listed(names));
  }
  // Bodies below one body are numbered without a gap, and so are their degrees of freedom.
  bool of_robot(int body) const noexcept {
    while (body > root_) body = model_->body_parentid[body];
    return body == root_;
  }
  bool among(int body) const noexcept { return body >= root_ && body <= last_body_; }

  [[gnu::cold]] void add_place(mjtObj type, int id) {
    const bool site = type == mjOBJ_SITE;
    const std::string text = name(type, id);
    if (site && text.empty()) return;
    if (add_frame(text.empty() ? "body" + std::to_string(id) : text)) places_.push_back({site, id});
  }
  [[gnu::cold]] void add_frames() {
    add_place(mjOBJ_BODY, 0);
    for (int body = 1; body < model_->nbody; ++body) {
      if (among(body)) add_place(mjOBJ_BODY, body);
    }
    for (int site = 0; site < model_->nsite; ++site) {
      if (among(model_->site_bodyid[site])) add_place(mjOBJ_SITE, site);
    }
  }
  [[gnu::cold]] FrameId frame_of_body(int body) const noexcept {
    Index i = 0;
    while (places_[static_cast<std::size_t>(i)].site ||
           places_[static_cast<std::size_t>(i)].id != body) {
      ++i;
    }
    return FrameId(i);
  }
  [[gnu::cold]] void add_joints() {
    for (int joint = 0; joint < model_->njnt; ++joint) {
      const int body = model_->jnt_bodyid[joint];
      if (!among(body)) continue;
      if (dof_count_ == 0) first_dof_ = model_->jnt_dofadr[joint];
      const int type = model_->jnt_type[joint];
      if (type == mjJNT_FREE ? dof_count_ > 0
                             : free_body_ >= 0 && model_->body_rootid[body] != free_body_) {
        const std::string free = name(mjOBJ_BODY, type == mjJNT_FREE ? body : free_body_);
        detail::invalid("MujocoRobot: body '", free,
                        "' floats and is not all that moves: say which body is the root of the "
                        "robot, as in MujocoRobot(model, \"",
                        free, "\")");
      }
      if (type == mjJNT_FREE) {
        free_body_ = body;
        dof_count_ = 6;
        continue;
      }
      std::string text = name(mjOBJ_JOINT, joint);
      if (text.empty()) text = "joint" + std::to_string(joint);
      if (type == mjJNT_BALL) {
        detail::invalid("MujocoRobot: joint '", text, "' of body '", name(mjOBJ_BODY, body),
                        "' is a ball: write it as three hinges");
      }
      JointInfo<Scalar> info{text, dof_count_++};
      if (model_->jnt_limited[joint]) {
        info.lower = model_->jnt_range[2 * joint];
        info.upper = model_->jnt_range[2 * joint + 1];
      } else {
        info.continuous = type == mjJNT_HINGE;
      }
      add_joint(std::move(info));
      positions_.push_back(model_->jnt_qposadr[joint]);
    }
  }

  void accept(const mjtNum* qpos) noexcept {
    if (qpos != data_->qpos) mju_copy(data_->qpos, qpos, model_->nq);
    mj_kinematics(model_, data_.get());
    mj_comPos(model_, data_.get());
    for (std::size_t i = 0; i < positions_.size(); ++i) {
      set_position(static_cast<Index>(i), data_->qpos[positions_[i]]);
    }
    moved();
  }
  // The robot's columns of the rows that MuJoCo left, the base's on the base.
  template <class M>
  void take(M& J, Index rows) const noexcept {
    for (Index i = 0; i < rows; ++i) {
      const mjtNum* row = rows_.data() + i * model_->nv + first_dof_;
      for (Index j = 0; j < dof(); ++j) J(i, j) = row[j];
    }
    if (free_body_ < 0) return;
    const Matrix3<Scalar> R = detail::rotation(pose(base()));
    for (Index i = 0; i < rows; ++i) {
      detail::set_row3(J, i, 0, detail::transposed_times(R, detail::row3(J, i, 0)));
    }
  }

  const mjModel* model_;
  int root_;
  std::unique_ptr<mjData, Delete> data_;
  int last_body_{0};
  std::vector<Place> places_;
  int free_body_{-1};
  int first_dof_{0};
  Index dof_count_{0};
  std::vector<int> positions_;        // of each joint in qpos
  mutable std::vector<mjtNum> rows_;  // 6 × nv, as MuJoCo writes them
};

}  // namespace icat
