// SPDX-License-Identifier: BSD-3-Clause
// The code of docs/tutorial.md.
#include <gtest/gtest.h>

#include <icat/icat.hpp>
#include <icat/sim/kinematic_plant.hpp>

namespace {

//! [robot]
using Robot = icat::Uvms<double, 7>;

Robot make_robot() {
  return Robot({.arm = icat::maris_arm<double>(), .arm_mount = icat::maris_arm_mount<double>()});
}
//! [robot]

//! [class]
// The tool stays above the seabed: altitude = seabed − z_tool ≥ minimum (z points down).
class ToolAltitude : public icat::Task<Robot> {
 public:
  struct Options {
    double seabed;   // depth of the seabed, m
    double minimum;  // m
    double margin;   // m
    double gain;     // 1/s
  };

  ToolAltitude(const Robot& robot, const Options& options)
      : Task("tool altitude", 1, robot.dof()),
        options_(options),
        objective_(icat::Objective<double>::at_least(options.minimum, options.margin)) {
    require_gain(options.gain);
  }

 private:
  void compute(const Robot& robot) noexcept override {
    const double altitude = options_.seabed - robot.tool().translation().z();
    jacobian_.row(0) = -robot.tool_jacobian(icat::Frame::world).row(2);
    set_scalar(0, altitude, objective_, options_.gain, 0.2);  // at most 0.2 m/s
  }

  Options options_;
  icat::Objective<double> objective_;
};
//! [class]

//! [lambda]
auto make_altitude_task(const Robot& robot, double seabed) {
  using Task = icat::task::FunctionTask<Robot>;
  return Task(robot, {.name = "tool altitude",
                      .rows = 1,
                      .evaluate =
                          [seabed](const Robot& r, Task::Rows& x, Task::Jacobian& J) {
                            x(0) = seabed - r.tool().translation().z();
                            J.row(0) = -r.tool_jacobian(icat::Frame::world).row(2);
                          },
                      .objective = icat::Objective<double>::at_least(0.3, 0.1),
                      .gain = 1.0});
}
//! [lambda]

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
  const icat::Vector<double, 13> velocity = tpik.velocity();  // finite, whatever came in
  //! [solver]
  EXPECT_EQ(status, icat::Status::ok);
  EXPECT_EQ(closing, icat::Status::ok);
  EXPECT_NEAR(J1.row(0).dot(velocity), 0.1, 1e-9);
}

TEST(Tutorial, LambdaAndClassAreTheSameTask) {
  Robot robot = make_robot();
  ASSERT_EQ(robot.update(shape(), icat::Pose<double>::Identity()), icat::Status::ok);
  const double seabed = robot.tool().translation().z() + 0.35;
  auto lambda = make_altitude_task(robot, seabed);
  ToolAltitude object(robot, {.seabed = seabed, .minimum = 0.3, .margin = 0.1, .gain = 1.0});
  lambda.update(robot);
  object.update(robot);
  EXPECT_EQ(lambda.jacobian(), object.jacobian());
  EXPECT_EQ(lambda.reference(), object.reference());
  EXPECT_EQ(lambda.activation(), object.activation());
  EXPECT_NEAR(object.activation()(0), 0.5, 1e-9);
}

TEST(Tutorial, TheJacobianIsChecked) {
  //! [check]
  Robot robot = make_robot();
  const icat::Vector<double, 7> q = shape();
  const icat::Pose<double> vehicle = icat::Pose<double>::Identity();
  EXPECT_EQ(robot.update(q, vehicle), icat::Status::ok);
  const double seabed = robot.tool().translation().z() + 0.35;  // where the rate is not limited
  ToolAltitude task(robot, {.seabed = seabed, .minimum = 0.3, .margin = 0.1, .gain = 1});

  // x as a function of a small displacement [Δq; twist]: x = x* − ẋ̄ / γ.
  const auto x = [&](const icat::Vector<double, 13>& d) {
    const icat::Vector6<double> twist = d.tail<6>();
    EXPECT_EQ(robot.update(q + d.head<7>(), icat::integrate(vehicle, twist, 1.0)),
              icat::Status::ok);
    task.update(robot);
    return icat::Vector<double, 1>(-task.reference()(0));
  };
  const icat::Vector<double, 13> zero = icat::Vector<double, 13>::Zero();
  const auto numeric = icat::central_difference(x, zero);
  x(zero);
  EXPECT_LT((task.jacobian() - numeric).norm(), 1e-8);
  //! [check]
  // The rate is limited to 0.2 m/s there, so the check would fail if it were not inside.
  EXPECT_LT(std::abs(task.reference()(0)), 0.2);
}

TEST(Tutorial, TheToolStaysAboveTheSeabed) {
  //! [use]
  Robot robot = make_robot();
  icat::KinematicPlant<double, 7> plant({.q = shape()});
  ASSERT_EQ(robot.update(plant.q(), plant.vehicle()), icat::Status::ok);
  const double seabed = robot.tool().translation().z() + 0.6;
  icat::Pose<double> goal = robot.tool();
  goal.translation() += icat::Vector3<double>(0.2, 0, 0.5);  // 0.1 m above the seabed

  ToolAltitude altitude(robot, {.seabed = seabed, .minimum = 0.3, .margin = 0.1, .gain = 1.0});
  icat::task::ToolPose tool(robot, {.goal = goal, .gain = 0.5});
  icat::Controller controller(robot, {{"reach", {{altitude}, {tool}}}});

  ASSERT_EQ(controller.switch_to("reach", 0, 1), icat::Status::ok);
  for (double t = 0; t < 20; t += 0.01) {
    ASSERT_EQ(robot.update(plant.q(), plant.vehicle()), icat::Status::ok);
    ASSERT_EQ(controller.step(t), icat::Status::ok);
    plant.step(controller.joint_velocity(), controller.vehicle_velocity(), t, 0.01);
  }
  //! [use]
  const icat::Vector3<double> error = goal.translation() - robot.tool().translation();
  const double height = seabed - robot.tool().translation().z();
  EXPECT_GE(height, 0.3);
  EXPECT_LE(height, 0.4);
  EXPECT_LT(error.head<2>().norm(), 1e-3);  // what does not conflict is reached
  EXPECT_GT(controller.report().levels()[1].tracking_error, 0.01);
}

}  // namespace
