// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A `KDL::Tree` or `KDL::Chain` is the robot. The program links `orocos-kdl`; docs/adapters.md has
/// the lines of CMake.
///
///     ẏ = [q̇; v]     q̇ in the order of KDL (`q_nr`), then the base's columns
///
/// A frame for each segment, at its tip, and one for the root; a joint for each joint of KDL that
/// is not fixed. KDL knows neither limits nor which joints turn without end: `set_limits` says it.
/// It knows no base that moves either: the constructor takes one.
#pragma once

#include <kdl/chain.hpp>
#include <kdl/tree.hpp>
#include <string>
#include <vector>

#include "icat/adapters/foreign_robot.hpp"

namespace icat {

/// A model of KDL, copied at construction. Construction allocates and throws; the control step does
/// neither.
class KdlRobot : public ForeignRobot<double> {
 public:
  /// Of all segments of `tree`. At q = 0, the root on ⟨0⟩.
  /// @throws std::invalid_argument on two joints of one name, and where nothing can move.
  explicit KdlRobot(const KDL::Tree& tree, const Base<double>& base = Base<double>::fixed()) {
    add_node(KDL::Segment(), -1, -1, tree.getRootSegment()->first);
    add_children(tree.getRootSegment(), 0);
    build(static_cast<Index>(tree.getNrOfJoints()), base);
  }
  /// Of all segments of `chain`; its root is called "base". Segments and joints that KDL calls
  /// "NoName" are "segment1", "joint1", … by their place in the chain.
  /// @throws std::invalid_argument on two segments or joints of one name, and where nothing can
  ///         move.
  explicit KdlRobot(const KDL::Chain& chain, const Base<double>& base = Base<double>::fixed()) {
    add_node(KDL::Segment(), -1, -1, "base");
    Index column = 0;
    for (unsigned i = 0; i < chain.getNrOfSegments(); ++i) {
      const KDL::Segment& segment = chain.getSegment(i);
      const std::string number = std::to_string(i + 1);
      const std::string& name = segment.getName();
      add_node(segment, static_cast<Index>(i), moves(segment) ? column++ : -1,
               name == unnamed() ? "segment" + number : name);
      if (nodes_.back().joint == unnamed()) nodes_.back().joint = "joint" + number;
    }
    build(column, base);
  }

  /// New positions of `joints`, the base where it was. `q` may be any Eigen vector, as `data` of a
  /// `KDL::JntArray`. NaN, infinity or a wrong size: refused, the state stays. No allocation.
  template <class Q>
  Status update(const Eigen::MatrixBase<Q>& q) noexcept {
    return update(q, pose(base()));
  }
  /// New positions and pose of the base in ⟨0⟩; a pose that is no rotation is refused too.
  template <class Q>
  Status update(const Eigen::MatrixBase<Q>& q, const Pose<double>& base) noexcept {
    if (const Status status = check_positions(q); status != Status::ok) return status;
    if (const Status status = check_pose(base); status != Status::ok) return status;
    for (Index i = 0; i < q.size(); ++i) set_position(i, q(i));
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) nodes_[0].pose.M(i, j) = base.matrix()(i, j);
      nodes_[0].pose.p(i) = base.matrix()(i, 3);
    }
    compute();
    return Status::ok;
  }

  /// ⟨f⟩ in ⟨0⟩. No allocation.
  Pose<double> pose(FrameId frame) const noexcept {
    const KDL::Frame& T = node(frame.index()).pose;
    Pose<double> pose = detail::identity_pose<double>();
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) pose.matrix()(i, j) = T.M(i, j);
      pose.matrix()(i, 3) = T.p(i);
    }
    return pose;
  }
  /// 6 × n, rows linear then angular, at the origin of ⟨f⟩, components on ⟨0⟩. No allocation.
  const Jacobian& jacobian(FrameId frame) const noexcept {
    return kept_jacobian(frame, [&](Jacobian& J) {
      const KDL::Vector& p = node(frame.index()).pose.p;
      for (Index i = frame.index(); i > 0; i = node(i).parent) {
        if (node(i).column < 0) continue;
        const KDL::Twist twist = node(i).twist.RefPoint(p - node(i).pose.p);
        for (int row = 0; row < 6; ++row) J(row, node(i).column) = twist(row);
      }
      for (Index j = 0; j < base_motion().cols(); ++j) {
        const KDL::Twist twist = base_twist(j, p);
        for (int row = 0; row < 6; ++row) J(row, base_columns().first + j) = twist(row);
      }
    });
  }

  /// Of all segments, kg.
  double mass() const noexcept { return mass_; }
  /// In ⟨0⟩, m; ⟨0⟩'s origin where the segments have no mass. No allocation.
  Vector3<double> center_of_mass() const noexcept {
    compute_center();
    return kept_center();
  }
  /// 3 × n, components on ⟨0⟩. No allocation.
  const PointJacobian& center_of_mass_jacobian() const noexcept {
    compute_center();
    return kept_center_jacobian();
  }

 private:
  struct Node {
    KDL::Segment segment;
    std::string joint;
    Index parent;      // −1: the root
    Index column;      // −1: does not move
    KDL::Frame pose;   // in ⟨0⟩
    KDL::Twist twist;  // of the tip by the joint's unit velocity, on ⟨0⟩
  };

  static const char* unnamed() noexcept { return "NoName"; }  // KDL's default
  static bool moves(const KDL::Segment& segment) noexcept {
    return segment.getJoint().getType() != KDL::Joint::Fixed;
  }
  const Node& node(Index i) const noexcept { return nodes_[static_cast<std::size_t>(i)]; }

  [[gnu::cold]] void add_node(const KDL::Segment& segment, Index parent, Index column,
                              const std::string& frame) {
    if (!add_frame(frame)) detail::invalid("KdlRobot: two segments are called '", frame, "'");
    nodes_.push_back({segment, segment.getJoint().getName(), parent, column, {}, {}});
  }
  [[gnu::cold]] void add_children(KDL::SegmentMap::const_iterator parent, Index index) {
    for (const auto& child : GetTreeElementChildren(parent->second)) {
      const KDL::Segment& segment = GetTreeElementSegment(child->second);
      const auto column = static_cast<Index>(GetTreeElementQNr(child->second));
      add_node(segment, index, moves(segment) ? column : -1, child->first);
      add_children(child, static_cast<Index>(nodes_.size()) - 1);
    }
  }
  [[gnu::cold]] void build(Index joint_count, const Base<double>& base) {
    for (Index column = 0; column < joint_count; ++column) {
      for (const Node& n : nodes_) {
        if (n.column != column) continue;
        JointInfo<double> info{n.joint, column};
        add_joint(std::move(info));
      }
    }
    for (const Node& n : nodes_) mass_ += n.segment.getInertia().getMass();
    if (joint_count + base.columns() == 0) detail::invalid("KdlRobot: nothing can move");
    finish(joint_count + base.columns(), FrameId(0), joint_count, base);
    compute();
  }

  void compute() noexcept {
    for (std::size_t i = 1; i < nodes_.size(); ++i) {
      Node& n = nodes_[i];
      const KDL::Frame& parent = node(n.parent).pose;
      const double q = n.column < 0 ? 0.0 : position(n.column);
      n.pose = parent * n.segment.pose(q);
      if (n.column >= 0) n.twist = parent.M * n.segment.twist(q, 1.0);
    }
    moved();
  }
  // Of the point `p` by column `j` of the base.
  KDL::Twist base_twist(Index j, const KDL::Vector& p) const noexcept {
    const auto& B = base_motion();
    const KDL::Twist on_base(KDL::Vector(B(0, j), B(1, j), B(2, j)),
                             KDL::Vector(B(3, j), B(4, j), B(5, j)));
    return (nodes_[0].pose.M * on_base).RefPoint(p - nodes_[0].pose.p);
  }
  void compute_center() const noexcept {
    keep_center([&](Vector3<double>& center, PointJacobian& J) {
      if (!(mass_ > 0)) return;
      KDL::Vector sum = KDL::Vector::Zero();
      for (std::size_t k = 0; k < nodes_.size(); ++k) {
        const double share = nodes_[k].segment.getInertia().getMass() / mass_;
        const KDL::Vector p = nodes_[k].pose * nodes_[k].segment.getInertia().getCOG();
        sum += share * p;
        for (Index i = static_cast<Index>(k); i > 0; i = node(i).parent) {
          if (node(i).column < 0) continue;
          const KDL::Vector v = node(i).twist.RefPoint(p - node(i).pose.p).vel;
          for (int row = 0; row < 3; ++row) J(row, node(i).column) += share * v(row);
        }
      }
      for (Index j = 0; j < base_motion().cols(); ++j) {
        const KDL::Vector v = base_twist(j, sum).vel;
        for (int row = 0; row < 3; ++row) J(row, base_columns().first + j) = v(row);
      }
      for (int row = 0; row < 3; ++row) center(row) = sum(row);
    });
  }

  std::vector<Node> nodes_;  // a node after its parent; frame i is node i
  double mass_{0};
};

}  // namespace icat
