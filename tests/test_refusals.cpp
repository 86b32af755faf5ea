// SPDX-License-Identifier: BSD-3-Clause
// What is refused because it would do something else than it says, or nothing.
#include <gtest/gtest.h>

#include <icat/icat.hpp>

namespace {

using Tree = icat::KinematicTree<double>;
using Objective = icat::Objective<double>;
using Vector3 = icat::Vector3<double>;
namespace task = icat::task;

std::vector<icat::Joint<double>> chain(int joints) {
  std::vector<icat::DhRow<double>> rows;
  for (int i = 0; i < joints; ++i) {
    rows.push_back({0.2, i % 2 == 0 ? 1.2 : -0.9, 0.1, 0.3, icat::JointType::revolute, -2.5, 2.5});
  }
  return icat::dh_chain<double>(rows, icat::DhConvention::standard);
}

template <class F>
std::string error_of(F&& f) {
  try {
    f();
  } catch (const std::invalid_argument& e) {
    return e.what();
  }
  return "";
}
void expect_error(const std::string& text, const char* part) {
  EXPECT_NE(text.find(part), std::string::npos) << "'" << text << "' has no '" << part << "'";
}

TEST(Refusals, FramesThatJointsMoveStay) {
  Tree robot({.joints = chain(3), .base = icat::Base<double>::free()});
  const icat::Pose<double> identity = icat::IdentityPose{};
  EXPECT_EQ(robot.set_frame(robot.base(), robot.frame("link3"), identity),
            icat::Status::out_of_range);
  EXPECT_EQ(robot.set_frame(robot.frame("link2"), robot.base(), identity),
            icat::Status::out_of_range);
  const icat::FrameId tip = robot.add_frame("tip", robot.frame("link3"), identity);
  EXPECT_EQ(robot.set_frame(tip, robot.base(), identity), icat::Status::ok);
}

TEST(Refusals, NoNamesAreNoColumns) {
  const Tree robot({.joints = chain(3)});
  const std::vector<std::string> dead;
  EXPECT_EQ(icat::joint_columns(robot, dead).size(), 0);
  EXPECT_EQ(icat::joint_columns(robot).size(), 3);
}

TEST(Refusals, ManipulabilityOfJointsThatDoNotMoveTheFrame) {
  const Tree robot({.joints = chain(6)});
  expect_error(error_of([&] {
                 task::Manipulability<Tree>(robot, robot.frame("link2"),
                                            Objective::at_least(0.1, 0.1),
                                            {.joints = {"joint1", "joint3"}});
               }),
               "'joint3' does not move");
}

TEST(Refusals, WithoutMassesThereIsNoCenterOfMass) {
  const Tree robot({.joints = chain(2)});
  expect_error(error_of([&] { task::CenterOfMass<Tree>(robot, Vector3(0, 0, 1)); }), "no masses");
}

// Every task of frames, and the tree itself, notices a frame that was looked up elsewhere: beyond
// the last one, or another in its place.
TEST(Refusals, FramesOfAnotherRobot) {
  Tree robot({.joints = chain(3)});
  Tree longer({.joints = chain(5)});
  auto renamed = chain(3);
  renamed[2].link = "gripper";
  Tree other({.joints = renamed});
  const icat::FrameId tip = robot.frame("link3");
  const icat::Pose<double> pose = icat::IdentityPose{};
  const auto objective = Objective::at_least(0.1, 0.1);
  const auto body = [](icat::FrameId frame) {
    return icat::CollisionBody<double>::sphere(frame, Vector3(0, 0, 0), 0.1);
  };
  const std::vector<icat::Obstacle<double>> obstacles{
      icat::Obstacle<double>::sphere(Vector3(9, 0, 0), 0.1)};
  for (const icat::FrameId bad :
       {longer.frame("link5"), other.frame("gripper"), icat::FrameId(-1), icat::FrameId(4)}) {
    SCOPED_TRACE(bad.index());
    const auto refused = [&](const char* name, auto&& make) {
      EXPECT_EQ(error_of(make),
                "task '" + std::string(name) + "': the frame was looked up in another robot");
    };
    refused("frame pose", [&] { task::FramePose<Tree>(robot, bad, pose); });
    refused("x",
            [&] { task::FramePose<Tree>(robot, tip, pose, {.name = "x", .relative_to = bad}); });
    refused("frame position", [&] { task::FramePosition<Tree>(robot, bad, Vector3(0, 0, 1)); });
    refused("frame orientation",
            [&] { task::FrameOrientation<Tree>(robot, bad, icat::Matrix3<double>::Identity()); });
    refused("frame velocity", [&] { task::FrameVelocity<Tree>(robot, bad); });
    refused("attitude", [&] { task::Attitude<Tree>(robot, bad); });
    refused("look at", [&] { task::LookAt<Tree>(robot, bad, Vector3(9, 0, 1)); });
    refused("look at", [&] { task::LookAt<Tree>(robot, tip, bad); });
    refused("occlusion", [&] { task::Occlusion<Tree>(robot, bad, tip, objective); });
    refused("frame distance",
            [&] { task::FrameDistance<Tree>(robot, bad, Vector3(9, 0, 1), objective); });
    refused("frame distance", [&] { task::FrameDistance<Tree>(robot, tip, bad, objective); });
    refused("manipulability", [&] { task::Manipulability<Tree>(robot, bad, objective); });
    refused("clearance", [&] { task::Clearance<Tree>(robot, {body(bad)}, obstacles, objective); });
    refused("self clearance", [&] {
      task::SelfClearance<Tree>(robot, {body(tip), body(bad)}, {{0, 1}}, objective);
    });
    EXPECT_EQ(error_of([&] { robot.add_frame("tool", bad, pose); }),
              "KinematicTree: the parent of frame 'tool' was looked up in another robot");
  }
  const icat::FrameId tool = robot.add_frame("tool", tip, pose);
  EXPECT_EQ(robot.set_frame(tool, other.frame("gripper"), pose), icat::Status::out_of_range);
  EXPECT_EQ(robot.set_frame(longer.frame("link4"), tip, pose), icat::Status::out_of_range);
  // The same name in the same place means the same, and a number alone is taken as it is.
  task::Attitude<Tree> same(robot, longer.frame("link3"));
  task::Attitude<Tree> number(robot, icat::FrameId(3));
  EXPECT_EQ(tool, icat::FrameId(4));
}

TEST(Refusals, TasksOfAFrameAndItself) {
  const Tree robot({.joints = chain(3), .base = icat::Base<double>::free()});
  const icat::FrameId tip = robot.frame("link3");
  const icat::Pose<double> goal = icat::IdentityPose{};
  expect_error(error_of([&] { task::FramePose<Tree>(robot, tip, goal, {.relative_to = tip}); }),
               "itself");
  expect_error(error_of([&] { task::FrameVelocity<Tree>(robot, tip, {.relative_to = tip}); }),
               "itself");
  expect_error(
      error_of([&] { task::FrameDistance<Tree>(robot, tip, tip, Objective::at_least(1, 0.1)); }),
      "itself");
  expect_error(error_of([&] { task::LookAt<Tree>(robot, tip, tip); }), "itself");
}

TEST(Refusals, BodiesThatCannotMoveApart) {
  Tree robot({.joints = chain(3)});
  const icat::FrameId tip = robot.frame("link3"),
                      tool = robot.add_frame("tool", tip, icat::Pose<double>(icat::IdentityPose{}));
  using Body = icat::CollisionBody<double>;
  const Vector3 zero(0, 0, 0);
  const std::vector<Body> bodies{Body::sphere(tip, zero, 0.1), Body::sphere(tool, zero, 0.1),
                                 Body::sphere(robot.frame("link1"), zero, 0.1)};
  expect_error(error_of([&] {
                 task::SelfClearance<Tree>(robot, bodies, {{0, 1}}, Objective::at_least(0.1, 0.1));
               }),
               "no joint lies between");
  task::SelfClearance<Tree> fine(robot, bodies, {{0, 2}}, Objective::at_least(0.1, 0.1));
}

TEST(Refusals, BasesOfAnotherSize) {
  expect_error(error_of([] { icat::Base<double>(Eigen::MatrixXd::Identity(6, 7)); }), "6 x 7");
  expect_error(error_of([] { icat::Base<double>(Eigen::MatrixXd::Identity(5, 2)); }), "5 x 2");
}

TEST(Refusals, PositionsWhoseProductsOverflow) {
  Tree robot({.joints = {{"slide", "base", "cart", icat::JointType::prismatic}}});
  EXPECT_EQ(robot.update(Eigen::VectorXd::Constant(1, 1e308)), icat::Status::out_of_range);
  EXPECT_EQ(robot.q()(0), 0);
}

TEST(Refusals, SayingASwitchAgainChangesNothing) {
  const Tree robot({.joints = chain(3)});
  task::Minimality<Tree> rest(robot, icat::joint_columns(robot));
  icat::Controller<Tree> controller(robot, {{"rest", {{rest}}}});
  for (int i = 0; i <= 100; ++i) {
    ASSERT_EQ(controller.switch_to("rest", 0.01 * i, 1.0), icat::Status::ok);
    ASSERT_EQ(controller.step(0.01 * i), icat::Status::ok);
  }
  EXPECT_EQ(controller.phase_activations()[0], 1);
  EXPECT_FALSE(controller.in_transition());
  EXPECT_EQ(controller.switch_to("rest", 1.0, -1.0), icat::Status::invalid_duration);
}

TEST(Refusals, AgentsShareTasksOnTheWorldOnly) {
  Tree robot({.joints = chain(6), .base = icat::Base<double>::free()});
  const icat::FrameId tip = robot.frame("link6");
  const icat::Pose<double> goal = icat::IdentityPose{};
  task::FramePose<Tree> turned(robot, tip, goal, {.on = icat::On::frame}), good(robot, tip, goal);
  expect_error(error_of([&] {
                 icat::Agent<Tree>(robot, {{"carry", {{turned}}}}, {{"carry", turned}}, {});
               }),
               "on the world");
  icat::Agent<Tree> agent(robot, {{"carry", {{good}}}}, {{"carry", good}}, {});
  ASSERT_EQ(agent.start("carry", 0), icat::Status::ok);
  ASSERT_EQ(agent.propose(0), icat::Status::ok);
  icat::Vector6<double> correction = icat::Vector6<double>::Zero();
  correction(2) = std::nan("");
  const Eigen::VectorXd still = Eigen::VectorXd::Zero(12);
  EXPECT_EQ(agent.step(0, still, correction), icat::Status::non_finite);
  EXPECT_EQ(agent.follow_joint_law(0, still), icat::Status::not_started);
}

}  // namespace
