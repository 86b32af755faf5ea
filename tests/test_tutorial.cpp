// SPDX-License-Identifier: BSD-3-Clause
// Code that pages show: docs/tutorial.md, docs/robots.md, docs/safety.md, docs/tasks.md, README.md.
#include <gtest/gtest.h>

#include <icat/icat.hpp>
#include <icat/sim/kinematic_plant.hpp>

namespace {

using Robot = icat::KinematicTree<double, 13>;  // seven joints and the vehicle's six velocities

Robot make_robot() {
  return icat::uvms(icat::maris_arm<double>(), {.arm = icat::maris_arm_mount<double>()});
}

//! [class]
// The frame stays above the seabed: altitude = seabed − z ≥ minimum (z points down).
class Altitude : public icat::ReactiveTask<Robot> {
 public:
  struct Options {
    double seabed;   // depth of the seabed, m
    double minimum;  // m
    double margin;   // m
    double gain;     // 1/s
  };

  Altitude(const Robot& robot, icat::FrameId frame, const Options& options)
      : ReactiveTask(robot, "altitude", 1, options.gain),
        frame_(frame),
        seabed_(options.seabed),
        objective_(icat::Objective<double>::at_least(options.minimum, options.margin)) {
    set_length_power(0, 1, 1);  // row 0 is in metres
  }

 private:
  void compute() noexcept override {
    const double altitude = seabed_ - robot().pose(frame_).translation().z();
    jacobian_.row(0) = -robot().jacobian(frame_).row(2);
    set_scalar(0, altitude, objective_, 0.2);  // at most 0.2 m/s
  }

  icat::FrameId frame_;
  double seabed_;
  icat::Objective<double> objective_;
};
//! [class]

auto make_altitude_task(const Robot& robot, icat::FrameId frame, double seabed) {
  const auto altitude = [=](const Robot& r, auto x, auto J) {
    x(0) = seabed - r.pose(frame).translation().z();
    J.row(0) = -r.jacobian(frame).row(2);
  };
  return icat::task::FunctionTask<Robot>(
      robot, icat::Objective<double>::at_least(0.3, 0.1), altitude,
      {.name = "altitude", .gain = 1.0, .max_rate = 0.2, .length_power = 1});  // metres
}

icat::Vector<double, 7> shape() {
  icat::Vector<double, 7> q;
  q << 0, 0.7, 0, -1.8, 0, 1.1, 0;
  return q;
}

TEST(Tutorial, JacobiansOfYourOwn) {
  const Eigen::Matrix<double, 2, 13> J1 = Eigen::Matrix<double, 2, 13>::Random();
  const Eigen::Matrix<double, 6, 13> J2 = Eigen::Matrix<double, 6, 13>::Random();
  const Eigen::Vector2d activation1(1, 0.4), rate1(0.1, -0.2);
  const icat::Vector6<double> activation2 = icat::Vector6<double>::Ones(), rate2 = activation2;
  //! [solver]
  icat::Tpik<double, 13> tpik;  // Tpik<double>(dof) if only known at run time
  tpik.reset();
  icat::Status status = tpik.add_level(J1, activation1, rate1);  // the highest priority first
  if (status == icat::Status::ok) status = tpik.add_level(J2, activation2, rate2);
  const icat::Status closing = tpik.minimize_velocity();      // always, last
  const icat::Vector<double, 13> velocity = tpik.velocity();  // always finite
  //! [solver]
  EXPECT_EQ(status, icat::Status::ok);
  EXPECT_EQ(closing, icat::Status::ok);
  EXPECT_NEAR(J1.row(0).dot(velocity), 0.1, 1e-9);
}

TEST(Tutorial, ARobotFromItsTable) {
  std::vector<icat::DhRow<double>> table;
  for (const double alpha : {1.57, 0.0, 0.0, 1.57, -1.57, 0.0}) {
    table.push_back({.a = 0.3, .alpha = alpha, .d = 0.1, .theta = 0});
  }
  icat::Pose<double> where_it_sits = icat::Pose<double>::Identity();
  where_it_sits.translation().z() = 0.4;
  //! [table]
  auto joints = icat::dh_chain<double>(table, icat::DhConvention::standard, "arm_base");
  joints.push_back({"mount", "chassis", "arm_base", icat::JointType::fixed, where_it_sits});
  icat::KinematicTree<double> robot(
      {.joints = joints, .base = icat::Base<double>::differential_drive()});
  //! [table]
  EXPECT_EQ(robot.dof(), 8);
  EXPECT_EQ(robot.frame_name(robot.base()), "chassis");
  icat::task::FramePosition position(robot, robot.frame("link6"), {0.5, 0, 0.8});
  //! [length]
  icat::Controller usual(robot, {{"reach", {{position}}}});  // 1 m: a longer arm, on wheels
  icat::Controller other(robot, {{"reach", {{position}}}}, {.characteristic_length = 0.6});
  //! [length]
  EXPECT_EQ(usual.characteristic_length(), 1);
  EXPECT_EQ(other.characteristic_length(), 0.6);
  EXPECT_EQ(robot.pose(robot.frame("arm_base")).matrix(), where_it_sits.matrix());
}

TEST(Tutorial, APointOfALink) {
  Robot robot = make_robot();
  ASSERT_EQ(robot.update(shape()), icat::Status::ok);
  const icat::FrameId forearm = robot.frame("link4");
  const icat::Vector3<double> contact(0.05, 0, 0.2);
  //! [point]
  Robot::PointJacobian J(3, robot.dof());
  icat::Status status = icat::point_jacobian(robot, forearm, contact, J);   // contact: on the link
  icat::Vector3<double> p = icat::point_position(robot, forearm, contact);  // ṗ = J ẏ
  //! [point]
  EXPECT_EQ(status, icat::Status::ok);
  EXPECT_LT((p - robot.pose(forearm) * contact).norm(), 1e-15);
  EXPECT_NEAR(J(2, 9), 1, 1e-15);  // heave
}

TEST(Tutorial, LambdaAndClassAreTheSameTask) {
  Robot robot = make_robot();
  const icat::FrameId tool = robot.frame("tool");
  ASSERT_EQ(robot.update(shape()), icat::Status::ok);
  const double seabed = robot.pose(tool).translation().z() + 0.35;
  auto lambda = make_altitude_task(robot, tool, seabed);
  Altitude object(robot, tool, {.seabed = seabed, .minimum = 0.3, .margin = 0.1, .gain = 1.0});
  lambda.update();
  object.update();
  EXPECT_EQ(lambda.jacobian(), object.jacobian());
  EXPECT_EQ(lambda.reference(), object.reference());
  EXPECT_EQ(lambda.activation(), object.activation());
  EXPECT_NEAR(object.activation()(0), 0.5, 1e-9);
}

TEST(Tutorial, TheJacobianIsChecked) {
  //! [check]
  Robot robot = make_robot();
  const icat::FrameId tool = robot.frame("tool");
  const icat::Vector<double, 7> q = shape();
  const icat::Pose<double> vehicle = icat::Pose<double>::Identity();
  EXPECT_EQ(robot.update(q, vehicle), icat::Status::ok);
  // Where the task is active and its rate is not limited.
  const double seabed = robot.pose(tool).translation().z() + 0.35;
  Altitude task(robot, tool, {.seabed = seabed, .minimum = 0.3, .margin = 0.1, .gain = 1});

  // x as a function of a small displacement [Δq; twist]: x = x* − ẋ̄ / γ.
  const auto x = [&](const icat::Vector<double, 13>& d) {
    const icat::Vector6<double> twist = d.tail<6>();
    EXPECT_EQ(robot.update(q + d.head<7>(), icat::integrate(vehicle, twist, 1.0)),
              icat::Status::ok);
    task.update();
    return icat::Vector<double, 1>(-task.reference()(0));
  };
  const icat::Vector<double, 13> zero = icat::Vector<double, 13>::Zero();
  const auto numeric = icat::central_difference(x, zero);
  x(zero);
  EXPECT_LT((task.jacobian() - numeric).norm(), 1e-8);
  //! [check]
  EXPECT_GT(task.reference()(0), 0);
  EXPECT_LT(task.reference()(0), 0.2);
}

TEST(Tutorial, TheToolStaysAboveTheSeabed) {
  Robot robot = make_robot();
  const icat::FrameId tool = robot.frame("tool");
  icat::KinematicPlant plant(robot, {.q = shape()});
  ASSERT_EQ(robot.update(plant.q(), plant.base()), icat::Status::ok);
  const double seabed = robot.pose(tool).translation().z() + 0.6;
  icat::Pose<double> goal = robot.pose(tool);
  goal.translation() += icat::Vector3<double>(0.2, 0, 0.5);  // 0.1 m above the seabed

  Altitude altitude(robot, tool, {.seabed = seabed, .minimum = 0.3, .margin = 0.1, .gain = 1.0});
  icat::task::FramePose reach(robot, tool, goal, {.gain = 0.5});
  icat::Controller controller(robot, {{"reach", {{altitude}, {reach}}}});

  ASSERT_EQ(controller.switch_to("reach", 0, 1), icat::Status::ok);
  for (double t = 0; t < 20; t += 0.01) {
    ASSERT_EQ(robot.update(plant.q(), plant.base()), icat::Status::ok);
    ASSERT_EQ(controller.step(t), icat::Status::ok);
    plant.step(controller.command(), t, 0.01);
  }
  const icat::Vector3<double> error = goal.translation() - robot.pose(tool).translation();
  const double height = seabed - robot.pose(tool).translation().z();
  EXPECT_GE(height, 0.3);
  EXPECT_LE(height, 0.4);
  EXPECT_LT(error.head<2>().norm(), 1e-3);  // what does not conflict is reached
  EXPECT_GT(controller.report().levels()[1].tracking_error, 0.01);
}

TEST(Tutorial, ALoopWithDelayWithinLimits) {
  icat::KinematicTree<double, 7> robot({.joints = icat::axes_chain(icat::maris_arm<double>())});
  const icat::FrameId tool = robot.frame("end_effector");
  ASSERT_EQ(robot.update(shape()), icat::Status::ok);
  icat::Pose<double> goal = robot.pose(tool);
  goal.translation() += icat::Vector3<double>(0.1, 0.1, -0.1);
  icat::task::JointLimits joints(robot);
  icat::task::FramePose reach(robot, tool, goal, {.gain = 2.0});
  const std::vector<icat::Action<decltype(robot)>> actions{{"reach", {{joints}, {reach}}}};
  //! [limits]
  const icat::MotionLimits limits(robot, {.reaction_time = 0.04, .max_acceleration = 2});
  icat::Controller controller(robot, actions, {.limits = limits});  // reaction time: period + delay
  icat::StatePredictor predictor(robot, {.delay = 0.03});           // s: age of the positions
  //! [limits]
  icat::Vector<double, 7> q = shape(), last = icat::Vector<double, 7>::Zero();
  std::vector<icat::Vector<double, 7>> arriving(3, q);  // 30 ms under way
  ASSERT_EQ(controller.switch_to("reach", 0, 1), icat::Status::ok);
  for (double t = 0; t < 10; t += 0.01) {
    const icat::Vector<double, 7> q_measured = arriving.front();
    //! [delayed cycle]
    icat::Status status = robot.update(predictor.predict(q_measured, t));
    if (status == icat::Status::ok) status = controller.step(t);
    if (status == icat::Status::ok) status = predictor.command(controller.velocity(), t);
    //! [delayed cycle]
    ASSERT_EQ(status, icat::Status::ok);
    EXPECT_LE((controller.command() - last).cwiseAbs().maxCoeff(), 2 * 0.01 + 1e-12);
    last = controller.command();
    q += 0.01 * last;
    arriving.erase(arriving.begin());
    arriving.push_back(q);
  }
  // A joint rests in its margin, half active; what that leaves grows with the robot.
  EXPECT_LT((goal.translation() - robot.pose(tool).translation()).norm(),
            1e-4 * controller.characteristic_length());
}

}  // namespace
