// SPDX-License-Identifier: BSD-3-Clause
// Robots, plants and loops as members of classes, initialised from bare braces: the usual form of a
// user's program, and one that GCC 12 answers with an internal error wherever a default inside the
// braces calls a function. That this file compiles is most of the test.
#include <gtest/gtest.h>

#include <icat/control/low_pass.hpp>
#include <icat/control/pi_loop.hpp>
#include <icat/control/sample_hold.hpp>
#include <icat/control/vehicle_loop.hpp>
#include <icat/model/maris.hpp>
#include <icat/model/uvms.hpp>
#include <icat/sim/channel.hpp>
#include <icat/sim/grasped_object_plant.hpp>
#include <icat/sim/kinematic_plant.hpp>
#include <icat/sim/maris_dynamics.hpp>
#include <icat/tpik/tpik.hpp>

namespace {

template <class S>
class MemberInitialisers : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(MemberInitialisers, Scalars);

// Descriptions and settings.
template <class S>
struct Plain {
  icat::JointInfo<S> info{.name = "shoulder", .column = 0};
  icat::Mimic<S> mimic{.joint = "shoulder"};
  icat::Joint<S> joint{.name = "shoulder", .parent = "base", .link = "upper_arm"};
  icat::LinkMass<S> mass{.link = "upper_arm", .mass = 1, .center = {0, 0, 1}};
  icat::DhRow<S> row{.a = 1, .alpha = 0, .d = 0, .theta = 0};
  icat::JointAxis<S> axis{.lower = -1, .upper = 1};
  icat::SerialArm<S, 1> arm{.joints = {icat::JointAxis<S>{}}};
  icat::UvmsMounts<S> mounts{.arm = icat::maris_arm_mount<S>()};
  typename icat::KinematicTree<S>::Description tree{.joints = {joint}};
  icat::RigidBody<S> body{.mass = 2};
  typename icat::KinematicPlant<icat::KinematicTree<S>>::Options plant{.tracking_lag = 0.5};
  typename icat::HydrodynamicPlant<S, 7>::State state{.velocity = icat::Filled{0.5}};
  typename icat::VehicleManipulatorDynamics<S, 7>::Description dynamics{
      .arm = icat::maris_arm<S>(), .vehicle = {.mass = 300}, .links = {}};
  typename icat::PiLoop<S, 6>::Options loop{.proportional = icat::Filled{1}};
  icat::Channel<icat::Vector6<float>>::Options channel{.rate = 10};
  icat::VelocityBounds<S, 7> free{};
  icat::VelocityBounds<S, 7> bounds{.upper = icat::Filled{0.5}};
  typename icat::Tpik<S, 7>::Options solver{.projection_weight = 1};
  typename icat::Tpik<S>::Options dynamic_solver{.bounds = {}};
};

// The objects themselves.
template <class S>
struct Program {
  icat::Base<S> platform{};
  icat::KinematicTree<S> pendulum{{.joints = {{.name = "joint", .parent = "base", .link = "tip"}}}};
  icat::KinematicTree<S> rover{{.joints = {{.name = "joint", .parent = "base", .link = "tip"}},
                                .base = icat::Base<S>::differential_drive()}};
  icat::KinematicTree<S, 13> robot{icat::uvms<S, 7>(
      icat::maris_arm<S>(), {.arm = icat::maris_arm_mount<S>(), .tool = icat::IdentityPose{}})};
  icat::KinematicPlant<icat::KinematicTree<S, 13>> plant{robot, {.tracking_lag = 0.1}};
  icat::KinematicPlant<icat::KinematicTree<S, 13>> defaults{robot};
  icat::HydrodynamicPlant<S, 7> wet{icat::maris_dynamics<S>(), {.q = icat::Filled{0.1}}};
  icat::VehicleManipulatorDynamics<S, 7> dynamics{icat::maris_dynamics<S>()};
  icat::GraspedObjectPlant<S, 7> pair{wet, wet, {.mass = 28}, icat::IdentityPose{}};
  icat::LowPass<S, 3> filter{0.5};
  icat::PiLoop<S, 7> loop{{.proportional = icat::Filled{2}, .integral = icat::Filled{1}}};
  icat::SampleHold<icat::Vector6<S>> feedback{10, icat::Filled{0}};
  icat::Channel<icat::Vector6<float>> channel{{.rate = 10, .duplex = icat::Duplex::half}};
};

// In a base class, in a nested class, and with a constructor of its own.
template <class S>
class Mission : private Plain<S> {
 public:
  Mission() {}
  explicit Mission(double lag) : inner_{.plant{Program<S>{}.robot, {.tracking_lag = lag}}} {}
  const Plain<S>& plain() const { return *this; }
  const Program<S>& program() const { return program_; }

 private:
  struct Inner {
    icat::KinematicTree<S, 13> robot{icat::uvms<S, 7>(icat::maris_arm<S>(), {})};
    icat::KinematicPlant<icat::KinematicTree<S, 13>> plant{robot, {}};
  };
  Program<S> program_{};
  Inner inner_{};
};

// Not a template: there the compiler resolves defaults at another time.
struct Robots {
  icat::KinematicTree<double, 13> robot{
      icat::uvms<double, 7>(icat::maris_arm<double>(), {.arm = icat::maris_arm_mount<double>()})};
  icat::KinematicPlant<icat::KinematicTree<double, 13>> plant{
      robot, {.q = icat::Vector<double, 7>::Constant(-0.4), .current = nullptr}};
  icat::HydrodynamicPlant<double, 7> wet{icat::maris_dynamics<double>(), {}};
  icat::RigidBody<double> body{.mass = 2};
  icat::PiLoop<double, 7> loop{{.bound = icat::Filled{3}}};
  icat::VehicleLoop<double> vehicle{icat::r2_vehicle_body<double>(), icat::Filled{1}};
  icat::LowPass<double, 3> filter{0.5};
  icat::Channel<double> channel{{}};
};

TYPED_TEST(MemberInitialisers, HaveTheDefaultsThatTheyShould) {
  using S = TypeParam;
  const Mission<S> mission, other(0.3);
  const Plain<S>& plain = mission.plain();
  EXPECT_EQ(plain.joint.upper, std::numeric_limits<S>::infinity());
  EXPECT_TRUE(plain.joint.origin.matrix().isIdentity(0));
  EXPECT_FALSE(plain.joint.mimic);
  EXPECT_TRUE(plain.tree.masses.empty());
  EXPECT_EQ(plain.tree.base.columns(), 0);
  EXPECT_TRUE(plain.body.inertia.isIdentity(0));
  EXPECT_TRUE(plain.body.added_mass.isZero(0));
  EXPECT_TRUE(plain.body.pose.matrix().isIdentity(0));
  EXPECT_EQ(plain.plant.q.size(), 0);
  EXPECT_EQ(plain.plant.not_actuated.size(), 0);
  EXPECT_FALSE(plain.plant.current);
  EXPECT_TRUE(plain.state.q.isZero(0));
  EXPECT_TRUE(plain.state.velocity.isConstant(S(0.5)));
  EXPECT_TRUE(plain.loop.integral.isZero(0));
  EXPECT_EQ(plain.loop.bound.minCoeff(), std::numeric_limits<S>::infinity());

  const Program<S>& program = mission.program();
  EXPECT_EQ(program.robot.dof(), 13);
  EXPECT_EQ(program.rover.dof(), 3);
  EXPECT_EQ(program.plant.q().size(), 7);
  EXPECT_EQ(program.wet.q()(3), S(0.1));
  EXPECT_TRUE(program.filter.value().isZero(0));
  EXPECT_EQ(Robots().plant.q()(6), -0.4);
}

}  // namespace
