// SPDX-License-Identifier: BSD-3-Clause
// The characteristic length of a robot, and arms of one shape in four sizes: what they lose to
// regularization with their rows divided by it and without. The tables of docs/tasks.md are printed
// here.
#include <gtest/gtest.h>

#include <Eigen/SVD>
#include <cstdio>
#include <icat/icat.hpp>

#include "support/allocation_counter.hpp"
#include "support/archetypes.hpp"
#include "support/robots.hpp"

namespace {

using namespace testing_support;  // NOLINT
using icat::Status;
using Vector6 = icat::Vector6<double>;
namespace task = icat::task;

constexpr double sizes[] = {0.15, 0.3, 1, 3};  // reach, m
constexpr double maris_reach = 0.132 + 0.42 + 0.1455 + 0.4315;

/// Three links in a plane, 0.4, 0.35 and 0.25 of the `reach`; frame "tool".
template <class S>
icat::KinematicTree<S> planar_arm(double reach) {
  std::vector<icat::DhRow<S>> rows;
  for (const double a : {0.4, 0.35, 0.25}) rows.push_back({S(a * reach), S(0), S(0), S(0)});
  auto joints = icat::dh_chain<S>(rows, icat::DhConvention::standard);
  joints.back().link = "tool";
  return icat::KinematicTree<S>({.joints = joints});
}

/// The seven joints of the MARIS arm, of another size.
template <class S>
icat::SerialArm<S, 7> spatial_arm(double reach) {
  auto arm = icat::maris_arm<S>();
  const S scale = S(reach / maris_reach);
  for (auto& joint : arm.joints) joint.point *= scale;
  arm.end_effector.translation() *= scale;
  return arm;
}
template <class S>
icat::KinematicTree<S> fixed_arm_of(double reach) {
  return icat::KinematicTree<S>({.joints = icat::axes_chain(spatial_arm<S>(reach), "base")});
}
/// The same on `base`, off its middle.
Tree mobile_arm_of(double reach, const icat::Base<double>& base) {
  auto joints = icat::axes_chain(spatial_arm<double>(reach), "arm_base");
  joints.push_back({"mount", "platform", "arm_base", icat::JointType::fixed,
                    make_pose<double>(0.2 * reach, 0.1 * reach, 0.3 * reach, 0, 0, 0.5)});
  return Tree({.joints = joints, .base = base});
}

/// Joint positions of all sizes alike.
template <class T>
Eigen::VectorXd random_positions(const T& robot, std::mt19937& rng) {
  std::uniform_real_distribution<double> u(0, 1);
  Eigen::VectorXd q(static_cast<Eigen::Index>(robot.joints().size()));
  for (Eigen::Index i = 0; i < q.size(); ++i) {
    const auto& joint = robot.joints()[static_cast<std::size_t>(i)];
    const double low = std::max<double>(joint.lower, -2.9),
                 high = std::min<double>(joint.upper, 2.9);
    q(i) = low + (high - low) * u(rng);
  }
  return q;
}

// --- the length

TEST(CharacteristicLength, IsTheReachInEveryState) {
  std::mt19937 rng(1);
  for (const double reach : sizes) {
    Tree planar = planar_arm<double>(reach), spatial = fixed_arm_of<double>(reach);
    for (int k = 0; k < 20; ++k) {
      EXPECT_NEAR(icat::characteristic_length(planar), reach, 1e-12);
      EXPECT_NEAR(icat::characteristic_length(spatial), reach, 1e-12);
      ASSERT_EQ(planar.update(random_positions(planar, rng)), Status::ok);
      ASSERT_EQ(spatial.update(random_positions(spatial, rng)), Status::ok);
    }
    EXPECT_NEAR(icat::characteristic_length(fixed_arm_of<float>(reach)), reach, 1e-6);
  }
  // From the torso's axis to the shoulder and along the arm; the way to one arm has nothing of the
  // other.
  Tree two = torso();
  const double length = icat::characteristic_length(two);
  EXPECT_GT(length, maris_reach);
  EXPECT_LT(length, maris_reach + 0.6);
  ASSERT_EQ(two.update(random_positions(two, rng)), Status::ok);
  EXPECT_NEAR(icat::characteristic_length(two), length, 1e-12);
}

TEST(CharacteristicLength, BoundsEveryLever) {
  std::mt19937 rng(2);
  Tree robot = fixed_arm_of<double>(0.3);
  double longest = 0;
  for (int k = 0; k < 2000; ++k) {
    ASSERT_EQ(robot.update(random_positions(robot, rng)), Status::ok);
    const auto& J = robot.jacobian(robot.frame("end_effector"));
    for (Eigen::Index j = 0; j < 7; ++j) longest = std::max(longest, J.col(j).head<3>().norm());
  }
  EXPECT_LE(longest, 0.3);
  EXPECT_GT(longest, 0.25);
}

TEST(CharacteristicLength, OfBasesSlidesAndWhatCannotMove) {
  // A base does not add to the reach; it is in m/s, and not made small by a longer arm.
  for (const auto& base : {icat::Base<double>::differential_drive(), icat::Base<double>::surface(),
                           icat::Base<double>::free()}) {
    EXPECT_NEAR(icat::characteristic_length(mobile_arm_of(0.15, base)), 0.15, 1e-12);
    EXPECT_EQ(icat::characteristic_length(mobile_arm_of(3, base)), 1);
  }
  EXPECT_EQ(icat::characteristic_length(make_robot<double>()), 1);  // the papers' robot

  // A table of slides with a wrist, and a rail under an arm.
  const auto slide = icat::JointType::prismatic;
  icat::Vector3<double> x(1, 0, 0);
  std::vector<icat::Joint<double>> joints(3);
  joints[0] = {"x", "ground", "cart", slide};
  joints[0].axis = x;
  joints[1] = {"turn", "cart", "wrist"};
  joints[2] = {"tip", "wrist", "tip", icat::JointType::fixed,
               make_pose<double>(0.05, 0, 0, 0, 0, 0)};
  EXPECT_NEAR(icat::characteristic_length(Tree({.joints = joints})), 0.05, 1e-12);
  joints[2].origin.translation().x() = 2;
  EXPECT_EQ(icat::characteristic_length(Tree({.joints = joints})), 1);

  // Nothing that turns; a frame on the axis.
  EXPECT_EQ(icat::characteristic_length(Tree({.joints = {joints[0]}})), 1);
  joints[1].parent = "ground";
  EXPECT_EQ(icat::characteristic_length(Tree({.joints = {joints[1]}})), 1);
  EXPECT_EQ(icat::characteristic_length(Tree({.base = icat::Base<double>::free(), .root = "hull"})),
            1);

  // A mimic turns, too: its own axis counts.
  std::vector<icat::Joint<double>> finger(3);
  finger[0] = {"first", "palm", "one"};
  finger[1] = {"second", "one", "two", icat::JointType::revolute,
               make_pose<double>(0.04, 0, 0, 0, 0, 0)};
  finger[1].mimic = icat::Mimic<double>{"first", 0.7};
  finger[2] = {"tip", "two", "tip", icat::JointType::fixed, make_pose<double>(0.03, 0, 0, 0, 0, 0)};
  Tree hand({.joints = finger});
  EXPECT_NEAR(icat::characteristic_length(hand), 0.07, 1e-12);
  ASSERT_EQ(hand.update(Eigen::VectorXd::Constant(1, 1.2)), Status::ok);
  EXPECT_NEAR(icat::characteristic_length(hand), 0.07, 1e-12);

  // Robots of somebody else's, that do not count their frames.
  EXPECT_EQ(icat::characteristic_length(archetypes::Bare<double, 3>()), 1);
  EXPECT_EQ(icat::characteristic_length(archetypes::FramedAndJointed<double, 3>()), 1);
  EXPECT_EQ(icat::characteristic_length(BaseFirst<Tree>(fixed_arm_of<double>(0.3))), 1);
}

/// It does, and its columns stand in no order.
struct Counting : BaseFirst<Tree> {
  using BaseFirst::BaseFirst;
  icat::Index frame_count() const { return 9; }
  std::string frame_name(icat::FrameId) const { return "frame"; }
};
TEST(CharacteristicLength, OfAModelThatCountsItsFrames) {
  EXPECT_NEAR(icat::characteristic_length(Counting(fixed_arm_of<double>(0.3))), 0.3, 1e-12);
}

// --- rows

TEST(LengthPower, OfTheCatalogue) {
  Tree robot = mobile_arm_of(0.3, icat::Base<double>::free());
  const icat::FrameId hand = robot.frame("end_effector"), elbow = robot.frame("link4");
  const auto away = icat::Objective<double>::at_least(0.05, 0.1);
  const auto powers = [](const icat::Task<Tree>& t) {
    std::string text;
    for (icat::Index i = 0; i < t.rows(); ++i) text += std::to_string(t.length_power(i));
    return text;
  };
  const icat::Pose<double> goal = robot.pose(hand);
  EXPECT_EQ(powers(task::FramePose<Tree>(robot, hand, goal)), "111000");
  EXPECT_EQ(powers(task::FramePose<Tree>(robot, hand, goal, {.linear = {true, false, true}})),
            "11000");
  EXPECT_EQ(powers(task::FramePose<Tree>(robot, hand, goal,
                                         {.norms = icat::PoseNorms<double>{away, away}})),
            "10");
  EXPECT_EQ(powers(task::FramePosition<Tree>(robot, hand, goal.translation())), "111");
  EXPECT_EQ(powers(task::FrameOrientation<Tree>(robot, hand, goal.linear())), "000");
  EXPECT_EQ(powers(task::FrameVelocity<Tree>(robot, hand)), "111000");
  EXPECT_EQ(powers(task::FrameVelocity<Tree>(
                robot, hand, {.linear = {false, false, true}, .angular = {true, false, true}})),
            "100");
  EXPECT_EQ(powers(task::FrameDistance<Tree>(robot, hand, elbow, away)), "1");
  EXPECT_EQ(powers(task::Attitude<Tree>(robot, hand)), "00");
  EXPECT_EQ(powers(task::LookAt<Tree>(robot, hand, {1, 0, 0})), "00");
  EXPECT_EQ(powers(task::Occlusion<Tree>(robot, robot.base(), elbow, away)), "0");
  EXPECT_EQ(powers(task::Manipulability<Tree>(robot, hand, away)), "3");
  EXPECT_EQ(powers(task::Manipulability<Tree>(robot, elbow, away)), "0");
  EXPECT_EQ(powers(task::JointLimits<Tree>(robot)), "0000000");
  EXPECT_EQ(powers(task::Minimality<Tree>(robot, robot.base_columns())), "000000");
  using Body = icat::CollisionBody<double>;
  const std::vector<Body> bodies{Body::sphere(hand, {0, 0, 0}, 0.01),
                                 Body::sphere(elbow, {0, 0, 0}, 0.01)};
  EXPECT_EQ(powers(task::Clearance<Tree>(robot, bodies,
                                         {icat::Obstacle<double>::sphere({1, 0, 0}, 0.1)}, away)),
            "11");
  EXPECT_EQ(powers(task::SelfClearance<Tree>(robot, bodies, {{0, 1}}, away)), "1");
  const auto nothing = [](const Tree&, auto, auto) {};
  EXPECT_EQ(powers(task::FunctionTask<Tree>(robot, away, nothing)), "0");
  EXPECT_EQ(powers(task::FunctionTask<Tree>(robot, away, nothing, {.rows = 2, .length_power = 1})),
            "11");
}

/// A controller that has `tool` alone, and its answer in the state of the robot.
struct Solved {
  template <class R>
  Solved(const R& robot, icat::Task<R>& tool, std::optional<typename R::Scalar> length) {
    icat::Controller<R> controller(robot, {{"go", {{tool}}}},
                                   {.limits = icat::unlimited, .characteristic_length = length});
    EXPECT_EQ(controller.start("go", 0), Status::ok);
    EXPECT_EQ(controller.step(0), Status::ok);
    velocity = controller.answer().template cast<double>();
    const auto& level = controller.report().levels()[0];
    regularized = level.regularized;
    requested = level.requested_rate;
    lost = level.tracking_error / level.requested_rate;
    const Eigen::VectorXd wanted = tool.reference().template cast<double>();
    const Eigen::VectorXd did = tool.jacobian().template cast<double>() * velocity;
    const Eigen::Index m = std::min<Eigen::Index>(3, wanted.size());
    lost_linear = (wanted - did).head(m).norm() / wanted.head(m).norm();
    rows = controller.levels()[0].jacobian.template cast<double>();
  }
  Eigen::VectorXd velocity;
  Eigen::MatrixXd rows;
  bool regularized;
  double requested, lost, lost_linear;
};

/// Of J with its rows in metres divided by the reach.
double smallest_singular_value(Eigen::MatrixXd J, double reach) {
  J.topRows(std::min<Eigen::Index>(3, J.rows())) /= reach;
  return Eigen::JacobiSVD<Eigen::MatrixXd>(J).singularValues().minCoeff();
}

/// The part of the rate of the position that is lost, of a task whose goal is about a tenth of the
/// reach away: mean and largest over the states that are away from singularities, mean of all.
constexpr int states = 400;
struct Loss {
  double mean{0}, worst{0}, of_all{0};
  int away{0};
};
template <class S, class Make>
Loss loss(icat::KinematicTree<S> robot, double reach, const char* frame, bool divide, Make make) {
  std::mt19937 rng(3);
  std::uniform_real_distribution<double> u(-1, 1);
  Loss sum;
  const icat::FrameId tool = robot.frame(frame);
  for (int k = 0; k < states; ++k) {
    EXPECT_EQ(robot.update(random_positions(robot, rng).template cast<S>()), Status::ok);
    icat::Pose<S> goal = moved(robot.pose(tool), 0.1 * reach * u(rng), 0.1 * reach * u(rng), 0);
    auto t = make(robot, tool, goal);
    const Solved solved(robot, t, divide ? std::nullopt : std::optional<S>(1));
    sum.of_all += solved.lost_linear / states;
    if (smallest_singular_value(solved.rows, reach) < 0.1) continue;
    ++sum.away;
    sum.mean += solved.lost_linear;
    sum.worst = std::max(sum.worst, solved.lost_linear);
  }
  sum.mean /= sum.away;
  return sum;
}
const auto planar_position = [](auto& robot, icat::FrameId f, const auto& goal) {
  using R = std::decay_t<decltype(robot)>;
  return task::FramePosition<R>(robot, f, goal.translation(), {.axes = {true, true, false}});
};
const auto position = [](auto& robot, icat::FrameId f, const auto& goal) {
  using R = std::decay_t<decltype(robot)>;
  return task::FramePosition<R>(robot, f, goal.translation());
};
const auto pose = [](auto& robot, icat::FrameId f, const auto& goal) {
  using R = std::decay_t<decltype(robot)>;
  return task::FramePose<R>(robot, f, goal);
};

// --- what is lost

TEST(SmallAndLargeArms, TheTable) {
  std::printf(
      "\n| reach | planar arm, position | 7R arm, position | 7R arm, pose |\n|---|---|---|---|\n");
  for (const bool divide : {false, true}) {
    for (const double reach : sizes) {
      const Loss columns[] = {
          loss(planar_arm<double>(reach), reach, "tool", divide, planar_position),
          loss(fixed_arm_of<double>(reach), reach, "end_effector", divide, position),
          loss(fixed_arm_of<double>(reach), reach, "end_effector", divide, pose)};
      std::printf("| %g m%s |", reach, divide ? "" : ", `characteristic_length = 1`");
      for (const Loss& l : columns) {
        std::printf(" %.1f %%, %.1f %%; %.1f %% |", 1e2 * l.mean, 1e2 * l.worst, 1e2 * l.of_all);
      }
      std::printf("\n");
      for (const Loss& l : columns) {
        EXPECT_GT(l.away, 100);
        if (divide || reach >= 1) {
          EXPECT_LT(l.worst, 0.01) << reach;
        } else {
          EXPECT_GT(l.worst, 0.1) << reach;
        }
      }
    }
  }
  std::printf("\n");
}

TEST(SmallAndLargeArms, LoseNothingInFloat) {
  for (const double reach : sizes) {
    EXPECT_LT(loss(planar_arm<float>(reach), reach, "tool", true, planar_position).worst, 0.01);
    EXPECT_LT(loss(fixed_arm_of<float>(reach), reach, "end_effector", true, pose).worst, 0.01);
  }
}

// Goals alike relative to the reach; singular states too.
TEST(SmallAndLargeArms, MoveAlike) {
  double difference = 0, without = 0;
  for (int k = 0; k < 100; ++k) {
    Eigen::VectorXd first[2];
    for (const double reach : sizes) {
      std::mt19937 rng(static_cast<unsigned>(k));
      Tree robot = fixed_arm_of<double>(reach);
      ASSERT_EQ(robot.update(random_positions(robot, rng)), Status::ok);
      const icat::FrameId f = robot.frame("end_effector");
      task::FramePose<Tree> t(robot, f, moved(robot.pose(f), 0.1 * reach, -0.05 * reach, 0));
      for (const bool divide : {true, false}) {
        const Solved solved(robot, t, divide ? std::nullopt : std::optional<double>(1));
        Eigen::VectorXd& reference = first[divide];
        if (reference.size() == 0) reference = solved.velocity;
        double& worst = divide ? difference : without;
        worst = std::max(worst, (solved.velocity - reference).norm() / reference.norm());
      }
    }
  }
  EXPECT_LT(difference, 1e-9);
  EXPECT_GT(without, 0.1);
}

TEST(SmallAndLargeArms, AreRegularizedAtTheSamePlace) {
  // The elbow of a planar arm of two links stretches; where the regularization begins.
  double begins[2][4];
  for (const bool divide : {false, true}) {
    for (std::size_t i = 0; i < 4; ++i) {
      const double reach = sizes[i];
      Tree robot = planar_arm<double>(reach);
      const icat::FrameId f = robot.frame("tool");
      double bend = 1.5;
      for (; bend > 1e-3; bend *= 0.99) {
        ASSERT_EQ(robot.update(Eigen::Vector3d(0.3, bend, -bend / 2)), Status::ok);
        task::FramePosition<Tree> t(robot, f,
                                    moved(robot.pose(f), 0.1 * reach, 0.1 * reach, 0).translation(),
                                    {.axes = {true, true, false}});
        if (Solved(robot, t, divide ? std::nullopt : std::optional<double>(1)).regularized) break;
      }
      begins[divide][i] = bend;
    }
    std::printf("regularized from an elbow of %.3f, %.3f, %.3f, %.3f rad on\n", begins[divide][0],
                begins[divide][1], begins[divide][2], begins[divide][3]);
  }
  for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(begins[true][i], begins[true][2]);
  EXPECT_EQ(begins[false][2], begins[true][2]);
  for (std::size_t i : {0u, 1u}) EXPECT_EQ(begins[false][i], 1.5);  // always
  EXPECT_LT(begins[false][3], begins[true][3] / 2);
}

// --- the option

TEST(CharacteristicLengthOption, OneIsThePapersRows) {
  std::mt19937 rng(4);
  Tree robot = fixed_arm_of<double>(0.15);
  const icat::FrameId f = robot.frame("end_effector");
  for (int k = 0; k < 50; ++k) {
    ASSERT_EQ(robot.update(random_positions(robot, rng)), Status::ok);
    task::FramePose<Tree> t(robot, f, moved(robot.pose(f), 0.02, 0.01, 0));
    const Solved off(robot, t, 1);
    icat::Tpik<double> tpik(7);
    tpik.reset();
    ASSERT_EQ(tpik.add_level(t.jacobian(), t.activation(), t.reference()), Status::ok);
    ASSERT_EQ(tpik.minimize_velocity(), Status::ok);
    EXPECT_EQ(off.velocity, tpik.velocity());  // to the last bit
    EXPECT_EQ(off.requested, tpik.report().levels()[0].requested_rate);
    // Whatever the option, rows and reports are in m/s.
    const Solved on(robot, t, {});
    EXPECT_EQ(on.rows, t.jacobian());
    EXPECT_EQ(on.requested, off.requested);
  }
}

TEST(CharacteristicLengthOption, IsOneNumberForTheWholeController) {
  Tree robot = fixed_arm_of<double>(0.3);
  const icat::FrameId f = robot.frame("end_effector");
  task::FramePose<Tree> t(robot, f, robot.pose(f));
  task::Manipulability<Tree> mu(robot, f, icat::Objective<double>::at_least(1e-3, 1e-3));
  icat::Controller<Tree> controller(robot, {{"go", {{mu}, {t}}}});
  EXPECT_NEAR(controller.characteristic_length(), 0.3, 1e-12);
  EXPECT_NEAR(controller.levels()[0].row_scale(0), 1 / 0.027, 1e-9);
  const auto& scale = controller.levels()[1].row_scale;
  for (int i = 0; i < 6; ++i) EXPECT_NEAR(scale(i), i < 3 ? 1 / 0.3 : 1, 1e-12);
  icat::Controller<Tree> chosen(robot, {{"go", {{t}}}}, {.characteristic_length = 0.5});
  EXPECT_EQ(chosen.characteristic_length(), 0.5);
  EXPECT_EQ(chosen.levels()[0].row_scale(0), 2);
  for (const double bad : {0.0, -0.3, double(NAN), double(INFINITY)}) {
    const std::string text = message_of([&] {
      icat::Controller<Tree>(robot, {{"go", {{t}}}}, {.characteristic_length = bad});
    });
    EXPECT_NE(text.find("controller: characteristic_length must be finite and > 0, got "),
              std::string::npos)
        << text;
  }
}

TEST(CharacteristicLengthOption, NothingAllocates) {
  Tree robot = fixed_arm_of<double>(0.3);
  const icat::FrameId f = robot.frame("end_effector");
  task::FramePose<Tree> t(robot, f, moved(robot.pose(f), 0.02, 0, 0));
  icat::Controller<Tree> controller(robot, {{"go", {{t}}}});
  ASSERT_EQ(controller.start("go", 0), Status::ok);
  ASSERT_EQ(controller.step(0), Status::ok);
  EXPECT_EQ(count_allocations([&] { (void)controller.step(0.01); }), 0);
}

// The manipulability of a small arm is that of a large one times the cube of its size.
TEST(SmallAndLargeArms, KeepTheirManipulabilityAlike) {
  Eigen::VectorXd first;
  for (const double reach : sizes) {
    Tree robot = fixed_arm_of<double>(reach);
    ASSERT_EQ(robot.update(bent_arm()), Status::ok);
    const double cube = reach * reach * reach;
    task::Manipulability<Tree> mu(robot, robot.frame("end_effector"),
                                  icat::Objective<double>::at_least(cube, cube));
    const Solved on(robot, mu, {});
    EXPECT_LT(on.lost, 0.05) << reach;
    if (first.size() == 0) first = on.velocity;
    EXPECT_LT((on.velocity - first).norm(), 1e-9 * first.norm());
    if (reach < 0.5) {
      EXPECT_GT(Solved(robot, mu, 1).lost, 0.5);
    }
  }
}

// --- mobile robots, and what else solves

TEST(SmallMobileArm, LosesNothingWhereTheBaseIsGiven) {
  Tree robot = mobile_arm_of(0.15, icat::Base<double>::differential_drive());
  ASSERT_EQ(robot.update(bent_arm(), make_pose<double>(1, -2, 0, 0, 0, 0.8)), Status::ok);
  const icat::FrameId f = robot.frame("end_effector");
  task::FramePose<Tree> t(robot, f, moved(robot.pose(f), 0.01, 0.01, 0));
  const std::vector<icat::Action<Tree>> actions{{"go", {{t}}}};
  const auto lost = [&](std::optional<double> length, bool parallel) {
    Eigen::VectorXd measured = Eigen::VectorXd::Zero(9), velocity;
    measured(7) = 0.01;
    icat::Controller<Tree>::Options options{.limits = icat::unlimited,
                                            .characteristic_length = length};
    if (parallel) {
      icat::ParallelController<Tree> controller(robot, actions, options);
      EXPECT_EQ(controller.start("go", 0), Status::ok);
      EXPECT_EQ(controller.step_joints(0, measured), Status::ok);
      velocity = controller.command();
      // The law and the solver say the same.
      icat::ParallelController<Tree> law(robot, actions, options);
      EXPECT_EQ(law.start("go", 0), Status::ok);
      EXPECT_EQ(law.step_joint_law(0), Status::ok);
      EXPECT_EQ(law.follow_joint_law(0, measured), Status::ok);
      EXPECT_LT((law.command() - velocity).norm(), 1e-9 * velocity.norm());
      velocity.tail<2>() = measured.tail<2>();
    } else {
      options.given = robot.base_columns();
      icat::Controller<Tree> controller(robot, actions, options);
      EXPECT_EQ(controller.start("go", 0), Status::ok);
      EXPECT_EQ(controller.step(0, measured), Status::ok);
      velocity = controller.velocity();
    }
    const Eigen::VectorXd error = t.reference() - t.jacobian() * velocity;
    return error.norm() / t.reference().norm();
  };
  for (const bool parallel : {false, true}) {
    EXPECT_LT(lost({}, parallel), 0.01);
    EXPECT_GT(lost(1, parallel), 0.02);
  }
}

// What goes over the bus is in m/s, and so is the span.
TEST(SmallAgents, AgreeInMetres) {
  Tree robot = fixed_arm_of<double>(0.15);
  ASSERT_EQ(robot.update(bent_arm()), Status::ok);
  const icat::FrameId f = robot.frame("end_effector");
  task::FramePose<Tree> tool(robot, f, moved(robot.pose(f), 0.01, 0.02, 0));
  const icat::Matrix3<double> R = robot.pose(f).linear();
  const auto run = [&](std::optional<double> length) {
    icat::Agent<Tree> agent(
        robot, {{"carry", {{tool}}}}, {{"carry", tool}},
        {.controller = {.limits = icat::unlimited, .characteristic_length = length},
         .agreement = {.spans = true, .fade = 0.01}});
    EXPECT_EQ(agent.start("carry", 0), Status::ok);
    for (int k = 0; k < 5; ++k) {
      EXPECT_EQ(agent.propose(0.01 * k), Status::ok);
      EXPECT_EQ(agent.receive(1, k, agent.send(k)), Status::ok);  // the other says the same
      EXPECT_EQ(agent.step(0.01 * k), Status::ok);
    }
    const Vector6 goal = agent.desired();
    EXPECT_LT((R * goal.head<3>() - tool.reference().head<3>()).norm(), 1e-12);  // m/s
    const Vector6 tool_velocity = robot.jacobian(f) * agent.velocity();
    Vector6 agreed = agent.agreed_velocity();
    agreed << R * agreed.head<3>(), R * agreed.tail<3>();
    return std::pair{(tool_velocity - tool.reference()).norm() / tool.reference().norm(),
                     (agreed - tool.reference()).norm() / tool.reference().norm()};
  };
  EXPECT_LT(run({}).first, 0.01);
  EXPECT_LT(run({}).second, 0.01);
  EXPECT_GT(run(1).first, 0.05);
}

// --- the solver's part

TEST(RowScale, IsThatOfTheRows) {
  std::mt19937 rng(5);
  std::uniform_real_distribution<double> u(-1, 1);
  const auto draw = [&](Eigen::Index rows, Eigen::Index cols) {
    return Eigen::MatrixXd(Eigen::MatrixXd::NullaryExpr(rows, cols, [&] { return u(rng); }));
  };
  for (int k = 0; k < 200; ++k) {
    icat::Tpik<double> tpik(7), by_hand(7);
    icat::ParametricTpik<double> law(7), law_by_hand(7);
    tpik.reset(), by_hand.reset(), law.reset(), law_by_hand.reset();
    for (const Eigen::Index rows : {1, 3, 9}) {  // the last has more rows than columns
      const Eigen::MatrixXd J = draw(rows, 7), V = draw(rows, 6);
      const Eigen::VectorXd x = draw(rows, 1), a = draw(rows, 1).cwiseAbs(),
                            s = (2 * draw(rows, 1)).array().exp();
      const std::span<const double> scale(s.data(), static_cast<std::size_t>(rows));
      ASSERT_EQ(tpik.add_level(J, a, x, scale), Status::ok);
      ASSERT_EQ(by_hand.add_level((s.asDiagonal() * J).eval(), a, s.cwiseProduct(x).eval()),
                Status::ok);
      Eigen::MatrixXd both(rows, 13);
      both << J, V;
      ASSERT_EQ(law.add_level(both, a, x, scale), Status::ok);
      ASSERT_EQ(law_by_hand.add_level((s.asDiagonal() * both).eval(), a, s.cwiseProduct(x).eval()),
                Status::ok);
      const auto& report = tpik.report().levels().back();
      EXPECT_NEAR(report.requested_rate, a.cwiseProduct(x).norm(), 1e-12);
      EXPECT_NEAR(report.tracking_error, a.cwiseProduct(x - J * tpik.velocity()).norm(), 1e-9);
    }
    EXPECT_LT((tpik.velocity() - by_hand.velocity()).norm(), 1e-8 * by_hand.velocity().norm());
    EXPECT_LT((law.P() - law_by_hand.P()).norm(), 1e-8 * law_by_hand.P().norm());
  }
}

TEST(RowScale, IsChecked) {
  icat::Tpik<double, 2> tpik;
  tpik.reset();
  const Eigen::Matrix2d J = Eigen::Matrix2d::Identity();
  const Eigen::Vector2d one = Eigen::Vector2d::Ones();
  for (const double bad : {0.0, -1.0, double(NAN), double(INFINITY)}) {
    const double scale[] = {1, bad};
    EXPECT_EQ(tpik.add_level(J, one, one, scale), Status::out_of_range);
    EXPECT_EQ(tpik.report().levels().back().bad_row, 1);
  }
  const double three[] = {1, 1, 1};
  EXPECT_EQ(tpik.add_level(J, one, one, three), Status::wrong_size);
  EXPECT_EQ(tpik.velocity(), Eigen::Vector2d::Zero());
  EXPECT_EQ(tpik.add_level(J, one, one, std::span(three).first(2)), Status::ok);
  EXPECT_EQ(tpik.velocity(), one);
}

}  // namespace
