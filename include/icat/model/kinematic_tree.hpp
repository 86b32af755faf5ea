// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Kinematics of a tree of links and joints on a base, any branching.
///
///     ẏ = [q̇; v]: a column for each joint that is neither fixed nor a mimic, in the order of the
///     description (a joint after those that carry it), then the base's
///     J_f = [ z_j × (p_f − p_j) ; z_j ] revolute,  [ z_j ; 0 ] prismatic,
///           [ I −[p_f − p_b]× ; 0 I ] diag(R_b, R_b) B   for the base
///
/// Links that do not move against each other are one body; a mimic adds its multiplier times its
/// column to that of the joint it follows. `update` computes poses; Jacobians and masses are
/// computed at the first request and kept until the next `update`, so one robot must not be used by
/// two threads at once.
#pragma once

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "icat/core/list.hpp"
#include "icat/core/status.hpp"
#include "icat/model/base.hpp"
#include "icat/model/joint.hpp"
#include "icat/model/robot.hpp"

namespace icat {

/// A robot of `N` columns, or `Eigen::Dynamic`: as many as the description has. Construction,
/// `add_frame` and `frame` allocate and throw; nothing else does.
template <class ScalarType, int N = Eigen::Dynamic>
class KinematicTree {
 public:
  /// Scalar type.
  using Scalar = ScalarType;
  /// Columns at compile time.
  static constexpr int size = N;
  /// Of a frame, 6 × n.
  using Jacobian = Eigen::Matrix<Scalar, 6, N>;
  /// Of a point, 3 × n.
  using PointJacobian = Eigen::Matrix<Scalar, 3, N>;
  /// One entry for each of `joints`; the memory is the tree's, see `q`.
  using Positions = Vector<Scalar, Eigen::Dynamic>;

  /// What the robot is made of.
  struct Description {
    std::vector<Joint<Scalar>> joints = EmptyList{};     ///< in any order
    Base<Scalar> base{};                                 ///< fixed by default: what the root can do
    std::vector<LinkMass<Scalar>> masses = EmptyList{};  ///< of some links, or none
    std::string root = "";  ///< name of the root link; needed only where there are no joints
  };

  /// Starts at q = 0 with the root on ⟨0⟩.
  /// @throws std::invalid_argument on what is no tree, with the names of the links and joints at
  ///         fault; names that stand twice; axes not of length 1; limits out of order; poses that
  ///         are none; another number of columns than `N`.
  [[gnu::cold]] explicit KinematicTree(const Description& description)
      : base_motion_(description.base.motion()),
        base_twist_(base_motion_),
        bodies_(count(description.joints, false) + 1),
        frames_(description.joints.size() + 1),
        joints_(count(description.joints, true)),
        joint_body_(joints_.size()) {
    build(description);
    const Index n = joint_count() + base_motion_.cols();
    if (N != Eigen::Dynamic && n != N) {
      detail::invalid("KinematicTree: ", N, " columns at compile time, but ", joint_count(),
                      " joints and ", base_motion_.cols(), " columns of the base");
    }
    if (n == 0) detail::invalid("KinematicTree: nothing can move");
    dof_ = n;
    q_ = detail::zeros<Positions>(joint_count());
    for (Frame& frame : frames_) frame.jacobian = detail::zeros<Jacobian>(6, n);
    center_jacobian_ = detail::zeros<PointJacobian>(3, n);
    compute();
  }

  /// n.
  Index dof() const noexcept { return dof_; }

  // --- frames

  /// The frame of a link, or one that was added.
  /// @throws std::invalid_argument with the names there are.
  [[gnu::cold]] FrameId frame(std::string_view name) const {
    return FrameId(detail::look_up(frames_, name, "frame"), name);
  }
  /// Number of frames: the root, the other links, each after its parent, and those added.
  Index frame_count() const noexcept { return static_cast<Index>(frames_.size()); }
  /// As given.
  const std::string& frame_name(FrameId frame) const noexcept { return at(frame).name; }
  /// A frame with the pose `pose` in the frame `parent`, fixed to the same link.
  /// @throws std::invalid_argument on a name that there is, a pose that is none, or a parent of
  ///         another robot. Allocates.
  [[gnu::cold]] FrameId add_frame(std::string name, FrameId parent, const Pose<Scalar>& pose) {
    if (detail::index_of(frames_, name) >= 0) {
      detail::invalid("KinematicTree: there is a frame '", name, "' already");
    }
    if (!is_rigid(pose)) {
      detail::invalid("KinematicTree: the pose of frame '", name,
                      "' is not finite or not a rotation");
    }
    if (!detail::may_have(*this, parent)) {
      detail::invalid("KinematicTree: the parent of frame '", name,
                      "' was looked up in another robot");
    }
    const Index body = at(parent).body;
    Pose<Scalar> in_body = detail::compose(at(parent).pose, pose);
    frames_.push_back({std::move(name), body, in_body, true, detail::zeros<Jacobian>(6, dof_), 0});
    return FrameId(frame_count() - 1, frames_[frames_.size() - 1].name);
  }
  /// Moves a frame to the pose `pose` in the frame `parent`, to whose link it is fixed from now on:
  /// for an exchanged tool, or the frame of an object that was just grasped. Only frames that were
  /// added and links on fixed joints can be moved; a pose that is not finite or no rotation is
  /// refused, and so are frames of another robot. No allocation.
  Status set_frame(FrameId frame, FrameId parent, const Pose<Scalar>& pose) noexcept {
    if (!detail::may_have(*this, frame) || !detail::may_have(*this, parent)) {
      return Status::out_of_range;
    }
    if (!at(frame).fixed) return Status::out_of_range;
    if (!detail::all_finite(pose.matrix())) return Status::non_finite;
    if (!is_rigid(pose)) return Status::not_a_rotation;
    const Pose<Scalar> in_body = detail::compose(at(parent).pose, pose);
    Frame& moved = frames_[static_cast<std::size_t>(frame.index())];
    moved.body = at(parent).body;
    moved.pose = in_body;
    moved.stamp = 0;
    return Status::ok;
  }
  /// ⟨f⟩ in ⟨0⟩. No allocation.
  Pose<Scalar> pose(FrameId frame) const noexcept {
    const Frame& f = at(frame);
    return detail::compose(bodies_[static_cast<std::size_t>(f.body)].pose, f.pose);
  }
  /// 6 × n, rows linear then angular, velocity of ⟨f⟩ with respect to ⟨0⟩ at the origin of ⟨f⟩,
  /// components on ⟨0⟩. No allocation.
  const Jacobian& jacobian(FrameId frame) const noexcept {
    const Frame& f = at(frame);
    if (f.stamp != stamp_) {
      fill_jacobian(f.body, detail::transform(body(f.body).pose, detail::origin(f.pose)),
                    f.jacobian);
      f.stamp = stamp_;
    }
    return f.jacobian;
  }

  // --- joints

  /// Those that are neither fixed nor mimics; joint i has column i of ẏ.
  const std::vector<JointInfo<Scalar>>& joints() const noexcept { return joints_; }
  /// Of joint `i` of `joints`, rad or m.
  Scalar position(Index i) const noexcept { return q_(i); }
  /// Calls `visit(column, linear, angular)` for each joint that moves the frame, mimics too, from
  /// the frame to the base: what the column does to the frame through this joint alone, as in
  /// `jacobian`, which is the sum. No allocation.
  template <class Visit>
  void for_each_joint_of(FrameId frame, Visit&& visit) const noexcept {
    const Frame& f = at(frame);
    visit_joints(f.body, detail::transform(body(f.body).pose, detail::origin(f.pose)), visit);
  }
  /// Positions of all of `joints`, rad or m.
  const Positions& q() const noexcept { return q_; }
  /// Unit vector along the axis of joint `i`, on ⟨0⟩.
  const Vector3<Scalar>& axis(Index i) const noexcept { return driven(i).axis; }
  /// A point on the axis of joint `i`, in ⟨0⟩.
  const Vector3<Scalar>& axis_point(Index i) const noexcept { return driven(i).point; }
  /// The joint's frame as joint `i` has moved it (the link's, `Joint::link_pose` apart), in ⟨0⟩.
  const Pose<Scalar>& moved_frame(Index i) const noexcept { return driven(i).pose; }

  // --- base

  /// The root link's frame.
  FrameId base() const noexcept { return FrameId(0); }
  /// The last ones.
  ColumnRange base_columns() const noexcept { return {joint_count(), base_motion_.cols()}; }
  /// B, see robot.hpp.
  const typename Base<Scalar>::Motion& base_motion() const noexcept { return base_motion_; }

  // --- state

  /// New positions of `joints`, the base where it was. `q` may be any Eigen vector. NaN, infinity
  /// or a wrong size: refused, the state stays. No allocation.
  template <class Q>
  Status update(const Eigen::MatrixBase<Q>& q) noexcept {
    return update(q, bodies_[0].pose);
  }
  /// New positions and pose of the base in ⟨0⟩; a pose that is no rotation is refused too, and so
  /// are positions beyond 1e9.
  template <class Q>
  Status update(const Eigen::MatrixBase<Q>& q, const Pose<Scalar>& base) noexcept {
    if (q.size() != joint_count()) return Status::wrong_size;
    Scalar sum(0), largest(0);
    for (Index i = 0; i < joint_count(); ++i) {
      sum += Scalar(0) * q(i);
      largest = std::max(largest, std::abs(q(i)));
    }
    for (Index i = 0; i < 3; ++i) largest = std::max(largest, std::abs(base.matrix()(i, 3)));
    if (!(sum == Scalar(0)) || !detail::all_finite(base.matrix())) return Status::non_finite;
    // Their products must not overflow, not even in float.
    if (largest > Scalar(1e9)) return Status::out_of_range;
    if (!is_rigid(base)) return Status::not_a_rotation;
    for (Index i = 0; i < joint_count(); ++i) q_(i) = q(i);
    bodies_[0].pose = base;
    compute();
    return Status::ok;
  }

  // --- masses

  /// Of all links, kg; 0 where no masses were given.
  Scalar mass() const noexcept { return mass_; }
  /// In ⟨0⟩, m; the root's origin where no masses were given. No allocation.
  Vector3<Scalar> center_of_mass() const noexcept {
    compute_center();
    return center_;
  }
  /// 3 × n, components on ⟨0⟩. No allocation.
  const PointJacobian& center_of_mass_jacobian() const noexcept {
    compute_center();
    return center_jacobian_;
  }

 private:
  // Links that do not move against each other, and the joint that moves them.
  struct Body {
    Index parent{-1};
    bool turns{true};
    Pose<Scalar> origin = IdentityPose{};  // of the joint's frame in the parent body
    Vector3<Scalar> local_axis{Scalar(0), Scalar(0), Scalar(1)};  // on the joint's frame
    Index column{-1};                                             // −1: the root
    Scalar multiplier{1}, offset{0};
    Scalar mass{0};
    // mass × centre of mass, on the body
    Vector3<Scalar> mass_center{Scalar(0), Scalar(0), Scalar(0)};
    // In ⟨0⟩.
    Pose<Scalar> pose = IdentityPose{};
    Vector3<Scalar> axis{Scalar(0), Scalar(0), Scalar(0)};
    Vector3<Scalar> point{Scalar(0), Scalar(0), Scalar(0)};
    // Mass and mass × centre of mass of all that it carries, as of `center_of_mass`.
    mutable Scalar carried_mass{0};
    mutable Vector3<Scalar> carried_center{Scalar(0), Scalar(0), Scalar(0)};
  };
  struct Frame {
    std::string name;
    Index body{0};
    Pose<Scalar> pose = IdentityPose{};  // in the body
    bool fixed{false};                   // to the body by a fixed joint, or added
    mutable Jacobian jacobian;
    mutable unsigned stamp{0};
  };

  const Frame& at(FrameId frame) const noexcept {
    return frames_[static_cast<std::size_t>(frame.index())];
  }
  const Body& body(Index i) const noexcept { return bodies_[static_cast<std::size_t>(i)]; }
  const Body& driven(Index joint) const noexcept {
    return body(joint_body_[static_cast<std::size_t>(joint)]);
  }
  Index joint_count() const noexcept { return static_cast<Index>(joints_.size()); }

  void compute() noexcept {
    const Matrix3<Scalar> turn = detail::rotation(bodies_[0].pose);
    for (Index j = 0; j < base_motion_.cols(); ++j) {
      for (Index row = 0; row < 6; row += 3) {
        detail::set_column3(base_twist_, row, j,
                            detail::times(turn, detail::column3(base_motion_, row, j)));
      }
    }
    for (std::size_t i = 1; i < bodies_.size(); ++i) {
      Body& b = bodies_[i];
      const Pose<Scalar>& parent = body(b.parent).pose;
      const Matrix3<Scalar> R = detail::times(detail::rotation(parent), detail::rotation(b.origin));
      b.point = detail::transform(parent, detail::origin(b.origin));
      b.axis = detail::times(R, b.local_axis);
      const Scalar position = b.multiplier * q_(b.column) + b.offset;
      if (b.turns) {
        b.pose = detail::make_pose(detail::times(R, axis_rotation<Scalar>(b.local_axis, position)),
                                   b.point);
      } else {
        b.pose = detail::make_pose(R, detail::plus(b.point, position, b.axis));
      }
    }
    // 0 is "never computed".
    if (++stamp_ == 0) {
      for (Frame& f : frames_) f.stamp = 0;
      stamp_ = 1;
    }
    center_known_ = false;
  }

  // What the point `p` of body `i` does, [linear; angular], on ⟨0⟩.
  void fill_jacobian(Index i, const Vector3<Scalar>& p, Jacobian& J) const noexcept {
    for (Index c = 0; c < joint_count(); ++c) {
      for (Index row = 0; row < 6; ++row) J(row, c) = Scalar(0);
    }
    visit_joints(i, p,
                 [&J](Index c, const Vector3<Scalar>& linear, const Vector3<Scalar>& angular) {
                   for (Index row = 0; row < 3; ++row) {
                     J(row, c) += linear(row);
                     J(3 + row, c) += angular(row);
                   }
                 });
    fill_base_columns(p, J);
  }
  // What each joint does to the point `p` of body `i`, from there to the root.
  template <class Visit>
  void visit_joints(Index i, const Vector3<Scalar>& p, Visit&& visit) const noexcept {
    const Vector3<Scalar> none(Scalar(0), Scalar(0), Scalar(0));
    for (; i > 0; i = body(i).parent) {
      const Body& b = body(i);
      const Vector3<Scalar> axis = detail::scaled(b.axis, b.multiplier);
      if (b.turns) {
        visit(b.column, detail::cross(axis, detail::minus(p, b.point)), axis);
      } else {
        visit(b.column, axis, none);
      }
    }
  }
  // What the base's columns do to a point `p` that moves with it; 3 × n or 6 × n.
  template <class M>
  void fill_base_columns(const Vector3<Scalar>& p, M& J) const noexcept {
    const Vector3<Scalar> r = detail::minus(p, detail::origin(bodies_[0].pose));
    for (Index j = 0; j < base_motion_.cols(); ++j) {
      detail::set_column3(J, 0, joint_count() + j, detail::velocity_at(base_twist_, j, r));
      if constexpr (M::RowsAtCompileTime == 6) {
        detail::set_column3(J, 3, joint_count() + j, detail::column3(base_twist_, 3, j));
      }
    }
  }

  void compute_center() const noexcept {
    if (center_known_) return;
    center_known_ = true;
    detail::fill(center_jacobian_, Scalar(0));
    center_ = detail::origin(bodies_[0].pose);
    if (mass_ > Scalar(0)) add_carried();
    fill_base_columns(center_, center_jacobian_);
  }

  // The centre of mass and the columns of the joints. From the tips inwards: mass and
  // mass × centre of all that a joint carries.
  void add_carried() const noexcept {
    for (const Body& b : bodies_) {
      b.carried_mass = b.mass;
      b.carried_center = detail::plus(detail::times(detail::rotation(b.pose), b.mass_center),
                                      b.mass, detail::origin(b.pose));
    }
    for (std::size_t i = bodies_.size(); i-- > 1;) {
      const Body& b = bodies_[i];
      const Vector3<Scalar> linear =
          b.turns ? detail::cross(b.axis, detail::plus(b.carried_center, -b.carried_mass, b.point))
                  : detail::scaled(b.axis, b.carried_mass);
      for (Index row = 0; row < 3; ++row) {
        center_jacobian_(row, b.column) += b.multiplier * linear(row) / mass_;
      }
      const Body& parent = body(b.parent);
      parent.carried_mass += b.carried_mass;
      parent.carried_center = detail::plus(parent.carried_center, b.carried_center);
    }
    center_ = detail::scaled(bodies_[0].carried_center, Scalar(1) / mass_);
  }

  [[gnu::cold]] static void check(const Joint<Scalar>& joint) {
    const auto fault = [&](const char* what) {
      detail::invalid("KinematicTree: joint '", joint.name, "': ", what);
    };
    if (!is_rigid(joint.origin)) fault("its origin is not finite or not a rotation");
    if (!is_rigid(joint.link_pose)) fault("its link's pose is not finite or not a rotation");
    if (joint.type == JointType::fixed) return;
    // Four digits: what a data sheet gives. It is normalized later.
    const Scalar length = detail::norm(joint.axis);
    if (!(std::abs(length - Scalar(1)) < Scalar(1e-4))) {
      detail::invalid("KinematicTree: joint '", joint.name, "': its axis must have length 1, got ",
                      length);
    }
    if (!(joint.lower < joint.upper) && joint.type != JointType::continuous && !joint.mimic) {
      detail::invalid("KinematicTree: joint '", joint.name, "': limits must be in order, got [",
                      joint.lower, ", ", joint.upper, "]");
    }
    if (!(joint.max_velocity > Scalar(0)) || !(joint.max_acceleration > Scalar(0))) {
      fault("limits of velocity and acceleration must be > 0");
    }
  }

  // Joints that move, or those of them that follow no other.
  [[gnu::cold]] static std::size_t count(const std::vector<Joint<Scalar>>& joints, bool driven) {
    std::size_t n = 0;
    for (const Joint<Scalar>& joint : joints) {
      if (joint.type != JointType::fixed && !(driven && joint.mimic)) ++n;
    }
    return n;
  }

  // The root's name: the one link that nothing moves.
  [[gnu::cold]] static std::string find_root(const Description& description) {
    std::string root = description.root;
    const auto moved = [&](const std::string& link) {
      for (const Joint<Scalar>& joint : description.joints) {
        if (joint.link == link) return true;
      }
      return false;
    };
    for (const Joint<Scalar>& joint : description.joints) {
      for (const Joint<Scalar>* other = description.joints.data(); other != &joint; ++other) {
        if (other->link == joint.link) {
          detail::invalid("KinematicTree: link '", joint.link, "' has two parents");
        }
        if (other->name == joint.name) {
          detail::invalid("KinematicTree: two joints are called '", joint.name, "'");
        }
      }
    }
    for (const Joint<Scalar>& joint : description.joints) {
      if (moved(joint.parent)) continue;
      if (!root.empty() && root != joint.parent) {
        detail::invalid("KinematicTree: '", root, "' and '", joint.parent,
                        "' are both roots, or one of them is misspelt");
      }
      root = joint.parent;
    }
    if (root.empty() && description.joints.empty()) {
      detail::invalid("KinematicTree: there are no joints; name the root link by .root");
    }
    if (root.empty()) {
      detail::invalid(
          "KinematicTree: no link is the root: the joints form a loop, or a name is ''");
    }
    if (moved(root)) {
      detail::invalid("KinematicTree: the root '", root, "' is moved by a joint");
    }
    return root;
  }

  [[gnu::cold]] void build(const Description& description) {
    frames_[0].name = find_root(description);
    const auto& all = description.joints;
    List<Index> moved(all.size(), -1);  // body of each joint; −1 until it is placed
    Placed placed;
    while (placed.frames <= all.size()) {
      const std::size_t before = placed.frames;
      for (std::size_t i = 0; i < all.size(); ++i) {
        if (moved[i] >= 0) continue;
        std::size_t parent = 0;
        while (parent < placed.frames && frames_[parent].name != all[i].parent) ++parent;
        if (parent < placed.frames) moved[i] = place(all[i], frames_[parent], placed);
      }
      if (placed.frames > before) continue;
      std::string rest;
      for (std::size_t i = 0; i < all.size(); ++i) {
        if (moved[i] < 0) detail::append_name(rest, all[i].name);
      }
      detail::invalid("KinematicTree: not joined to the root '", frames_[0].name, "': the joints ",
                      rest);
    }
    follow(all, moved);
    for (const auto& m : description.masses) add_mass(m);
  }

  // How many of each there are already.
  struct Placed {
    std::size_t frames{1}, bodies{1}, joints{0};
  };
  // A body and a frame for `joint`, which sits on the link of `parent`.
  [[gnu::cold]] Index place(const Joint<Scalar>& joint, const Frame& parent, Placed& placed) {
    check(joint);
    Frame& frame = frames_[placed.frames++];
    frame.name = joint.link;
    frame.pose = joint.link_pose;
    const Pose<Scalar> origin = detail::compose(parent.pose, joint.origin);
    if (joint.type == JointType::fixed) {
      frame.body = parent.body;
      frame.pose = detail::compose(origin, joint.link_pose);
      frame.fixed = true;
      return frame.body;
    }
    frame.body = static_cast<Index>(placed.bodies);
    Body& b = bodies_[placed.bodies++];
    b.parent = parent.body;
    b.turns = joint.type != JointType::prismatic;
    b.origin = origin;
    b.local_axis = detail::scaled(joint.axis, Scalar(1) / detail::norm(joint.axis));
    if (!joint.mimic) {
      b.column = static_cast<Index>(placed.joints);
      joint_body_[placed.joints] = frame.body;
      JointInfo<Scalar>& info = joints_[placed.joints++];
      info.name = joint.name;
      info.column = b.column;
      info.max_velocity = joint.max_velocity;
      info.max_acceleration = joint.max_acceleration;
      info.continuous = joint.type == JointType::continuous;
      if (!info.continuous) info.lower = joint.lower, info.upper = joint.upper;
    }
    return frame.body;
  }

  // Column, multiplier and offset of the mimics; one may follow another.
  [[gnu::cold]] void follow(const std::vector<Joint<Scalar>>& all, const List<Index>& moved) {
    for (std::size_t i = 0; i < all.size(); ++i) {
      if (!all[i].mimic || all[i].type == JointType::fixed) continue;
      Scalar multiplier(1), offset(0);
      std::size_t leader = i;
      for (std::size_t steps = 0; all[leader].mimic; ++steps) {
        const Mimic<Scalar>& mimic = *all[leader].mimic;
        offset += multiplier * mimic.offset;
        multiplier *= mimic.multiplier;
        std::size_t next = 0;
        while (next < all.size() && all[next].name != mimic.joint) ++next;
        if (next == all.size() || all[next].type == JointType::fixed || steps > all.size()) {
          detail::invalid("KinematicTree: joint '", all[i].name, "' follows '", mimic.joint,
                          "', which does not move");
        }
        leader = next;
      }
      Body& b = bodies_[static_cast<std::size_t>(moved[i])];
      b.column = body(moved[leader]).column;
      b.multiplier = multiplier;
      b.offset = offset;
      if (!std::isfinite(multiplier) || !std::isfinite(offset)) {
        detail::invalid("KinematicTree: joint '", all[i].name, "': its mimic is not finite");
      }
    }
  }

  [[gnu::cold]] void add_mass(const LinkMass<Scalar>& m) {
    if (!(m.mass >= Scalar(0)) || !std::isfinite(m.mass)) {
      detail::invalid("KinematicTree: the mass of link '", m.link, "' must be finite and >= 0");
    }
    if (!detail::all_finite(m.center)) {
      detail::invalid("KinematicTree: the centre of mass of link '", m.link, "' is not finite");
    }
    const Frame& link = at(frame(m.link));
    Body& b = bodies_[static_cast<std::size_t>(link.body)];
    b.mass += m.mass;
    b.mass_center = detail::plus(b.mass_center, m.mass, detail::transform(link.pose, m.center));
    mass_ += m.mass;
  }

  Index dof_{0};
  typename Base<Scalar>::Motion base_motion_, base_twist_;  // components on the base; on ⟨0⟩
  List<Body> bodies_;                                       // a body after its parent
  List<Frame> frames_;
  std::vector<JointInfo<Scalar>> joints_;
  List<Index> joint_body_;
  Positions q_;
  unsigned stamp_{0};
  Scalar mass_{0};
  mutable bool center_known_{false};
  mutable Vector3<Scalar> center_;
  mutable PointJacobian center_jacobian_;
};

}  // namespace icat
