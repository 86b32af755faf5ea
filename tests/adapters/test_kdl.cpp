// SPDX-License-Identifier: BSD-3-Clause
// Trees and chains of KDL as robots, against the same robot as a kinematic tree and against KDL's
// own solvers.
#include <icat/adapters/kdl.hpp>
#include <icat/adapters/urdf.hpp>
#include <kdl/chainfksolverpos_recursive.hpp>
#include <kdl/chainjnttojacsolver.hpp>
#include <kdl/treefksolverpos_recursive.hpp>
#include <kdl/treejnttojacsolver.hpp>

#include "torso.hpp"

namespace {

using icat::KdlRobot;
using icat::Status;

static_assert(icat::FramedRobot<KdlRobot> && icat::JointedRobot<KdlRobot> &&
              icat::MobileRobot<KdlRobot> && icat::MassiveRobot<KdlRobot>);
static_assert(KdlRobot::size == Eigen::Dynamic);

KDL::Frame frame(const icat::Pose<double>& pose) {
  KDL::Frame frame;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) frame.M(i, j) = pose.matrix()(i, j);
    frame.p(i) = pose.matrix()(i, 3);
  }
  return frame;
}

// As kdl_parser does it.
KDL::Tree kdl(const torso::Tree::Description& description) {
  KDL::Tree tree(description.root);
  for (const auto& joint : description.joints) {
    const KDL::Frame origin = frame(joint.origin);
    const KDL::Vector axis = origin.M * KDL::Vector(joint.axis(0), joint.axis(1), joint.axis(2));
    const KDL::Joint moved =
        joint.type == icat::JointType::fixed
            ? KDL::Joint(joint.name, KDL::Joint::Fixed)
            : KDL::Joint(joint.name, origin.p, axis,
                         joint.type == icat::JointType::prismatic ? KDL::Joint::TransAxis
                                                                  : KDL::Joint::RotAxis);
    KDL::RigidBodyInertia inertia = KDL::RigidBodyInertia::Zero();
    for (const auto& mass : description.masses) {
      if (mass.link != joint.link) continue;
      inertia = KDL::RigidBodyInertia(mass.mass,
                                      KDL::Vector(mass.center(0), mass.center(1), mass.center(2)));
    }
    EXPECT_TRUE(tree.addSegment(KDL::Segment(joint.link, moved, origin, inertia), joint.parent));
  }
  return tree;
}

struct Kdl : testing::Test {
  // With the base free and fixed.
  torso::Tree tree = icat::parse_urdf(torso::urdf, {.base = icat::Base<double>::free()});
  torso::Tree bolted = icat::parse_urdf(torso::urdf);
  KDL::Tree model = kdl(icat::detail::urdf_description<double>(torso::urdf, {}, "test"));
  KdlRobot robot{model, icat::Base<double>::free()};
  KdlRobot fixed{model};

  // KDL knows no limits.
  void set_limits() {
    for (const auto& joint : tree.joints()) {
      for (KdlRobot* const r : {&robot, &fixed}) {
        if (joint.continuous) {
          r->set_limits(joint.name, {.max_velocity = joint.max_velocity, .continuous = true});
        } else {
          r->set_limits(
              joint.name,
              {.lower = joint.lower, .upper = joint.upper, .max_velocity = joint.max_velocity});
        }
      }
    }
  }
  void move(KdlRobot& to, const torso::State& s) {
    ASSERT_EQ(to.update(torso::positions(tree, to, s.q), s.base), Status::ok);
  }
};

TEST_F(Kdl, PosesJacobiansAndTheCentreOfMassAreTheTrees) {
  double worst = 0;
  for (const auto& s : torso::states(tree, 50, 1)) {
    ASSERT_EQ(tree.update(s.q, s.base), Status::ok);
    ASSERT_EQ(bolted.update(s.q, s.base), Status::ok);
    move(robot, s);
    move(fixed, s);
    worst = std::max({worst, torso::difference(tree, robot), torso::difference(bolted, fixed),
                      torso::center_difference(tree, robot)});
  }
  EXPECT_LT(worst, 1e-13);
  std::printf("worst difference to the tree %.1e\n", worst);
}

TEST_F(Kdl, AndKdlsOwn) {
  KDL::TreeFkSolverPos_recursive position(model);
  KDL::TreeJntToJacSolver jacobian(model);
  double worst = 0;
  for (const auto& s : torso::states(bolted, 50, 2, false)) {
    move(fixed, s);
    KDL::JntArray q(model.getNrOfJoints());
    q.data = fixed.q();
    for (icat::Index i = 1; i < fixed.frame_count(); ++i) {
      KDL::Frame pose;
      KDL::Jacobian J(model.getNrOfJoints());
      const std::string& name = fixed.frame_name(icat::FrameId(i));
      ASSERT_GE(position.JntToCart(q, pose, name), 0);
      ASSERT_GE(jacobian.JntToJac(q, J, name), 0);
      const Eigen::MatrixXd difference = J.data - fixed.jacobian(icat::FrameId(i));
      worst = std::max(worst, difference.cwiseAbs().maxCoeff());
      worst = std::max(worst, KDL::diff(pose, frame(fixed.pose(icat::FrameId(i)))).vel.Norm());
    }
  }
  EXPECT_LT(worst, 1e-13);
}

TEST_F(Kdl, TheSameTasksGiveTheSameVelocities) {
  set_limits();
  torso::expect_same_joints(tree, robot);
  torso::expect_same_velocities(
      tree, robot, [&](KdlRobot& r, const auto& s) { move(r, s); }, true);
  torso::expect_same_velocities(
      bolted, fixed, [&](KdlRobot& r, const auto& s) { move(r, s); }, false);
}

TEST_F(Kdl, BadInputIsRefusedAndNothingAllocates) {
  torso::expect_refusals_and_no_allocation(robot);
}

TEST(KdlTree, AsThePageShows) {
  const KDL::Tree tree = kdl(icat::detail::urdf_description<double>(torso::urdf, {}, "test"));
  KDL::Chain chain;
  ASSERT_TRUE(tree.getChain("world_link", "left_tip", chain));
  const auto [q, base_pose] = torso::states(KdlRobot(tree), 1, 1)[0];
  //! [robot]
  icat::KdlRobot arm(chain);                                 // a KDL::Chain
  icat::KdlRobot vehicle(tree, icat::Base<double>::free());  // a KDL::Tree
  vehicle.set_limits("left_wrist", {.max_velocity = 2, .continuous = true});
  icat::Status status = vehicle.update(q, base_pose);
  //! [robot]
  EXPECT_EQ(status, Status::ok);
  EXPECT_EQ(arm.dof(), 4);
  EXPECT_TRUE(vehicle.joints()[static_cast<std::size_t>(icat::joint_index(vehicle, "left_wrist"))]
                  .continuous);
}

TEST(KdlChain, NamesAndKdlsOwn) {
  KDL::Chain chain;
  chain.addSegment(KDL::Segment(KDL::Joint(KDL::Joint::RotZ), KDL::Frame(KDL::Vector(0, 0, 0.2))));
  chain.addSegment(KDL::Segment(KDL::Joint(KDL::Joint::Fixed), KDL::Frame(KDL::Vector(0.1, 0, 0))));
  chain.addSegment(KDL::Segment("arm", KDL::Joint("elbow", KDL::Joint::RotY, -1, 0.3),
                                KDL::Frame(KDL::Rotation::RPY(1, 2, 3), KDL::Vector(0, 0.3, 0.2))));
  chain.addSegment(
      KDL::Segment(KDL::Joint(KDL::Joint::TransX, 2), KDL::Frame(KDL::Vector(0.3, 0.1, 0))));
  KdlRobot robot(chain);
  ASSERT_EQ(robot.joints().size(), 3u);
  EXPECT_EQ(robot.joints()[0].name, "joint1");
  EXPECT_EQ(robot.joints()[1].name, "elbow");
  EXPECT_EQ(robot.joints()[2].name, "joint4");
  EXPECT_EQ(robot.frame_name(robot.base()), "base");
  EXPECT_EQ(robot.frame_name(icat::FrameId(1)), "segment1");
  KDL::ChainFkSolverPos_recursive position(chain);
  KDL::ChainJntToJacSolver jacobian(chain);
  KDL::JntArray q(3);
  q.data << 0.4, -0.7, 0.2;
  ASSERT_EQ(robot.update(q.data), Status::ok);
  KDL::Frame pose;
  KDL::Jacobian J(3);
  ASSERT_GE(position.JntToCart(q, pose), 0);
  ASSERT_GE(jacobian.JntToJac(q, J), 0);
  const icat::FrameId tip = robot.frame("segment4");
  EXPECT_LT((J.data - robot.jacobian(tip)).norm(), 1e-14);
  EXPECT_LT(KDL::diff(pose, frame(robot.pose(tip))).vel.Norm(), 1e-14);

  const auto error = [&](auto&& f) {
    try {
      f();
    } catch (const std::invalid_argument& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  EXPECT_EQ(error([&] { static_cast<void>(robot.frame("tip")); }),
            "no frame 'tip'; there are 'base', 'segment1', 'segment2', 'arm', 'segment4'");
  EXPECT_EQ(error([&] { robot.set_limits("joint7", {}); }),
            "no joint 'joint7'; there are 'joint1', 'elbow', 'joint4'");
  EXPECT_EQ(error([&] { robot.set_limits("elbow", {.lower = 1, .upper = 0}); }),
            "joint 'elbow': limits must be in order, got [1, 0]");
  EXPECT_EQ(error([&] { robot.set_limits("elbow", {.max_velocity = 0}); }),
            "joint 'elbow': limits of velocity and acceleration must be > 0, got 0 and inf");
  EXPECT_EQ(error([&] { robot.set_limits("elbow", {.lower = 1, .continuous = true}); }),
            "joint 'elbow' is to be continuous and to have an end");
  EXPECT_EQ(error([] { KdlRobot(KDL::Chain{}); }), "KdlRobot: nothing can move");
  chain.addSegment(KDL::Segment("arm", KDL::Joint("more", KDL::Joint::RotX)));
  EXPECT_EQ(error([&] { KdlRobot{chain}; }), "KdlRobot: two segments are called 'arm'");
}

}  // namespace
