// SPDX-License-Identifier: BSD-3-Clause
// Base and joints at rates of their own [MARIS, III-B9], and what happens when an input stays away.
#include <gtest/gtest.h>

#include <icat/control/base_state.hpp>
#include <icat/control/held_reference.hpp>
#include <icat/control/parallel_controller.hpp>
#include <icat/model/maris.hpp>
#include <icat/model/uvms.hpp>
#include <icat/sim/kinematic_plant.hpp>
#include <icat/task/column_tasks.hpp>
#include <icat/task/direction_tasks.hpp>
#include <icat/task/frame_tasks.hpp>
#include <icat/task/manipulability.hpp>
#include <numbers>
#include <random>

#include "support/allocation_counter.hpp"
#include "support/sanitized.hpp"

namespace {

using Robot = icat::KinematicTree<double, 13>;
using Parallel = icat::ParallelController<Robot>;
using Pose = icat::Pose<double>;
using Vector3 = icat::Vector3<double>;
using Vector6 = icat::Vector6<double>;
using Vector13 = icat::Vector<double, 13>;
using icat::Status;
namespace task = icat::task;

Robot make_robot() {
  return icat::uvms(icat::maris_arm<double>(), {.arm = icat::maris_arm_mount<double>()});
}
Pose at(const Vector3& position) {
  return icat::detail::make_pose<double>(icat::detail::identity<icat::Matrix3<double>>(3),
                                         position);
}
Eigen::VectorXd folded() {
  Eigen::VectorXd q(7);
  q << 0, 0.7, 0, -1.8, 0, 1.1, 0;
  return q;
}

// --- an optimum is one of its slice, too ---------------------------------------------------------

TEST(MultiRate, JointsOfBothTpiksAgreeWhereTheBaseDoesAsItIsTold) {
  Robot robot = make_robot();
  const icat::FrameId tool = robot.frame("tool");
  task::Attitude<Robot> level(robot, robot.base());
  task::FramePosition<Robot> position(robot, tool, {0.5, -0.3, 2});
  task::FrameOrientation<Robot> orientation(robot, tool,
                                            icat::rotation_exp<double>({0.3, -0.8, 2}));
  task::Minimality<Robot> still_vehicle(robot, robot.base_columns(), "still vehicle");
  task::Minimality<Robot> still_arm(robot, icat::joint_columns(robot), "still arm");
  task::Manipulability<Robot> manipulability(robot, tool,
                                             icat::Objective<double>::at_least(0.05, 0.01));
  // Equalities alone, so that activations are 0 or 1.
  Parallel controller(robot,
                      {{"vehicle rests", {{level}, {position}, {orientation}, {still_vehicle}}},
                       {"arm rests", {{level}, {position}, {orientation}, {still_arm}}},
                       {"least motion", {{position}, {orientation}}},
                       {"position alone", {{level}, {position}, {still_arm}}}},
                      {.solver = {.regularization = {1e-16, 1e-12}}, .limits = icat::unlimited});
  std::mt19937 random(9);
  std::uniform_real_distribution<double> any(-1, 1);
  double worst = 0, fastest = 0, t = 0;
  int compared = 0;
  for (int k = 0; k < (sanitized ? 20 : 400); ++k) {
    Eigen::VectorXd q = folded();
    Vector6 displacement;
    for (int i = 0; i < 7; ++i) q(i) += 0.4 * any(random);
    for (int i = 0; i < 6; ++i) displacement(i) = any(random);
    ASSERT_EQ(robot.update(q, icat::integrate(at({0, 0, 0}), displacement, 1.0)), Status::ok);
    manipulability.update();
    if (manipulability.value() < 0.05) continue;
    for (const char* action : {"vehicle rests", "arm rests", "least motion", "position alone"}) {
      ASSERT_EQ(controller.start(action, t += 0.01), Status::ok);
      ASSERT_EQ(controller.step(t, Vector6(Vector6::Zero())), Status::ok);
      const Vector13 first = controller.first().velocity();
      const Vector6 told = first.tail<6>();
      // The level that rests may find nothing left to choose.
      const auto levels = controller.first().report().levels();
      for (std::size_t l = 0; l < 3; ++l) ASSERT_FALSE(levels[l].regularized) << action;
      ASSERT_EQ(controller.step(t, told), Status::ok);
      EXPECT_EQ(controller.first().velocity(), first);
      worst = std::max(worst, (controller.second().velocity() - first).norm());
      fastest = std::max(fastest, first.head<7>().norm());
      ++compared;
    }
  }
  EXPECT_GT(compared, sanitized ? 20 : 1000);
  EXPECT_GT(fastest, 0.1);
  EXPECT_LT(worst, 1e-9);
}

// --- a loop with rates ---------------------------------------------------------------------------

/// Hz. `law`: of q̇ = ρ̃ + P v between solutions at `joints`; 0: none.
struct Rates {
  int base = 20, joints = 100, law = 0, navigation = 100;
};
enum class Input { none, pose, velocity, joints, base_reference, joint_reference };

/// A vehicle that lags in a current, its tool to a goal; each part at its own rate, on its own
/// newest input. A tick is 1 ms.
class Loop {
 public:
  Loop(const Rates& rates, const Vector3& goal, double hold)
      : rates_(rates),
        goal_(goal),
        robot_(make_robot()),
        tool_(robot_, robot_.frame("tool"), at(goal), {.gain = 0.5, .max_linear_rate = 0.1}),
        still_arm_(robot_, icat::joint_columns(robot_)),
        controller_(robot_, {{"reach", {{tool_}, {still_arm_}}}},
                    {.limits = icat::unlimited, .time = {.hold = hold}}),
        plant_(robot_, {.q = folded(),
                        .tracking_lag = 0.5,
                        .current =
                            [](double t) {
                              const double w = 2 * std::numbers::pi / 10;
                              return Vector3(0.05 * std::sin(w * t), 0, 0);
                            }}),
        base_reference_({.hold = hold}),
        joint_reference_({.hold = hold}),
        q_(plant_.q()) {
    EXPECT_EQ(controller_.switch_to("reach", 0, 1), Status::ok);
  }

  /// The next tick; `missing` does not come.
  void tick(Input missing = Input::none) {
    const double t = 1e-3 * ticks_;
    // The goal sways, 0.3 m to each side.
    const double w = 2 * std::numbers::pi / 12;
    Vector6 sway = Vector6::Zero();
    sway(1) = 0.3 * w * std::cos(w * t);
    (void)tool_.set_goal(at(goal_ + Vector3(0, 0.3 * std::sin(w * t), 0)), sway);
    base_status = joint_status = Status::ok;
    if (due(rates_.navigation)) {
      const Vector6 v = plant_.velocity().tail<6>();
      if (missing != Input::pose) (void)where_.set(plant_.base(), v, t);
      if (missing != Input::velocity) (void)speed_.set(plant_.base(), v, t);
    }
    if (due(rates_.joints) && missing != Input::joints) {
      q_ = plant_.q();
      q_stamp_ = t;
    }
    const icat::InputAge age{
        .state = t - q_stamp_, .velocity = speed_.age(t), .pose = where_.age(t)};
    if (due(rates_.base) && missing != Input::base_reference) {
      EXPECT_EQ(robot_.update(q_, where_.pose(t)), Status::ok);
      base_status = controller_.step_base(t, speed_.velocity(), age);
      EXPECT_EQ(base_reference_.set(controller_.command().tail<6>()), Status::ok);
    }
    if (missing != Input::joint_reference) {
      if (due(rates_.joints)) {
        EXPECT_EQ(robot_.update(q_, where_.pose(t)), Status::ok);
        joint_status = rates_.law == 0 ? controller_.step_joints(t, speed_.velocity(), age)
                                       : controller_.step_joint_law(t, age);
      }
      if (rates_.law > 0 && due(rates_.law)) {
        const icat::InputAge newer{.velocity = age.velocity};
        joint_status = controller_.follow_joint_law(t, speed_.velocity(), newer);
      }
      if (due(std::max(rates_.joints, rates_.law))) {
        EXPECT_EQ(joint_reference_.set(controller_.command().head<7>()), Status::ok);
      }
    }
    base_reader = base_reference_.update(t);
    joint_reader = joint_reference_.update(t);
    Vector13 command;
    command << joint_reference_.value(), base_reference_.value();
    plant_.step(command, t, 1e-3);
    ++ticks_;
  }
  /// How far the tool really is from its goal, m.
  double error() {
    EXPECT_EQ(robot_.update(plant_.q(), plant_.base()), Status::ok);
    return (tool_.goal().translation() - robot_.pose(robot_.frame("tool")).translation()).norm();
  }
  Vector6 base() const { return base_reference_.value(); }
  icat::Vector<double, 7> joints() const { return joint_reference_.value(); }

  /// Of the last tick; `ok` where nothing was due.
  Status base_status{}, joint_status{}, base_reader{}, joint_reader{};

 private:
  bool due(int rate) const { return ticks_ % (1000 / rate) == 0; }

  Rates rates_;
  Vector3 goal_;
  Robot robot_;
  task::FramePose<Robot> tool_;
  task::Minimality<Robot> still_arm_;
  Parallel controller_;
  icat::KinematicPlant<Robot> plant_;
  icat::BaseState<double> where_, speed_;
  icat::HeldReference<double, 6> base_reference_;
  icat::HeldReference<double, 7> joint_reference_;
  Eigen::VectorXd q_;
  double q_stamp_{0};
  int ticks_{0};
};

/// RMS of the tool's error while it holds its goal in the current for two periods, mm.
double held(const Rates& rates) {
  Loop loop(rates, {0.6, 0.1, 1.4}, 0.25);
  double sum = 0;
  int count = 0;
  for (int k = 0; k < 35000; ++k) {
    loop.tick();
    if (k < 15000 || k % 10 != 0) continue;
    const double e = loop.error();
    sum += e * e;
    ++count;
  }
  return 1e3 * std::sqrt(sum / count);
}

TEST(MultiRate, FastJointsMakeUpForASlowBase) {
  if (sanitized) GTEST_SKIP();
  const double fast = held({.base = 100, .joints = 100, .navigation = 100});
  const double mixed = held({.base = 10, .joints = 100, .navigation = 100});
  const double slow = held({.base = 10, .joints = 10, .navigation = 10});
  std::printf(
      "tool error, RMS: both at 100 Hz %.3f mm; base at 10 Hz %.3f mm; both at 10 Hz %.3f mm\n",
      fast, mixed, slow);
  EXPECT_LE(mixed, 1.2 * fast);
  EXPECT_LT(mixed, 0.3 * slow);
}

// As in [Coop, Table III], where the vehicle's velocity at 10 instead of 100 Hz costs a factor 3 of
// the final error.
TEST(MultiRate, TheErrorGrowsAsTheFeedbackGetsSlower) {
  if (sanitized) GTEST_SKIP();
  double last = 0;
  std::printf("tool error, RMS:");
  for (const int rate : {100, 50, 20, 10}) {
    const double error = held({.base = 20, .joints = 100, .navigation = rate});
    std::printf(" %d Hz %.3f mm%s", rate, error, rate > 10 ? ";" : "\n");
    EXPECT_GT(error, last) << rate;
    last = error;
  }
}

// As on the page.
TEST(MultiRate, EachPartAtItsOwnRate) {
  Robot robot = make_robot();
  icat::KinematicPlant<Robot> plant(robot, {.q = folded(), .tracking_lag = 0.5});
  task::FramePosition<Robot> tool(robot, robot.frame("tool"), {1.5, 0.2, 1.4},
                                  {.gain = 0.5, .max_rate = 0.1});
  //! [rates]
  icat::ParallelController controller(robot, {{"reach", {{tool}}}});
  icat::BaseState<double> base;                                      // the newest estimate
  icat::HeldReference<double, 6> vehicle_reference({.hold = 0.15});  // in the vehicle's loop
  icat::HeldReference<double, 7> joint_reference;
  //! [rates]
  ASSERT_EQ(controller.switch_to("reach", 0, 1), Status::ok);
  for (int k = 0; k < 40000; ++k) {
    const double t = 1e-3 * k;
    Status navigation = Status::ok, vehicle = Status::ok, joints = Status::ok;
    const Vector6 twist = plant.velocity().tail<6>();
    //! [rates cycle]
    if (k % 10 == 0) navigation = base.set(plant.base(), twist, t);  // 100 Hz, with its stamp
    const icat::InputAge age{.velocity = base.age(t), .pose = base.age(t)};
    if (k % 50 == 0) {  // 20 Hz
      vehicle = robot.update(plant.q(), base.pose(t));
      if (vehicle == Status::ok) {  // with late input the command goes to zero
        vehicle = controller.step_base(t, base.velocity(), age);
        (void)vehicle_reference.set(controller.command().tail<6>());
      }
    }
    if (k % 10 == 0) {  // 100 Hz: the joints compensate the vehicle's error
      joints = robot.update(plant.q(), base.pose(t));
      if (joints == Status::ok) joints = controller.step_joint_law(t, age);
    }
    // The law stores the age of its pose.
    const Status law = controller.follow_joint_law(t, base.velocity(), {.velocity = age.velocity});
    (void)joint_reference.set(controller.command().head<7>());
    (void)vehicle_reference.update(t);  // 1 kHz, in the loops that follow them: value()
    (void)joint_reference.update(t);
    //! [rates cycle]
    for (const Status status : {navigation, vehicle, joints, law})
      ASSERT_EQ(status, Status::ok) << t;
    Vector13 command;
    command << joint_reference.value(), vehicle_reference.value();
    plant.step(command, t, 1e-3);
  }
  EXPECT_LT(tool.position_error(), 1e-3);
}

// The law for a newer velocity is as good as a solution at its rate: what is left comes from the
// state and the goal, which it takes at 100 Hz.
TEST(MultiRate, TheLawAtAKilohertz) {
  if (sanitized) GTEST_SKIP();
  const double slow = held({.joints = 100, .navigation = 20});
  const double law = held({.joints = 100, .law = 1000, .navigation = 1000});
  EXPECT_LT(law, 0.3 * slow);
  EXPECT_LE(law, 1.2 * held({.joints = 100, .navigation = 100}));
}

// --- the ladder ----------------------------------------------------------------------------------

constexpr double hold = 0.1, ramp = 0.5;  // s, of TimeOptions

/// What one input that stays away does: who says what, who stops.
struct Case {
  Input missing;
  Status status;    ///< of whoever reads it
  bool controller;  ///< the controller says it; otherwise the reader of its references
  bool base_stops, joints_stop;
};

class Ladder : public testing::TestWithParam<Rates> {};

TEST_P(Ladder, EachInputThatStaysAwayIsHeldThenRampedThenComesBack) {
  const Rates rates = GetParam();
  for (const Case& c :
       {Case{Input::velocity, Status::stale_velocity, true, true, true},
        Case{Input::pose, Status::stale_pose, true, true, true},
        Case{Input::joints, Status::stale_state, true, true, true},
        Case{Input::base_reference, Status::stale_reference, false, true, false},
        Case{Input::joint_reference, Status::stale_reference, false, false, true}}) {
    SCOPED_TRACE(icat::describe(c.status));
    Loop loop(rates, {3, 1, 2}, hold);  // metres away, so that all move all the time
    for (int k = 0; k < 3000; ++k) {
      loop.tick();
      ASSERT_EQ(loop.base_status, Status::ok);
      ASSERT_EQ(loop.joint_status, Status::ok);
    }
    ASSERT_EQ(loop.base_reader, Status::ok);
    ASSERT_EQ(loop.joint_reader, Status::ok);
    ASSERT_GT(loop.base().norm(), 0.01);
    ASSERT_GT(loop.joints().norm(), 1e-3);

    // Whatever has the longest period may have been heard of that long ago.
    const double period = 1.0 / std::min({rates.base, rates.joints, rates.navigation});
    double last_base = 1e9, last_joints = 1e9, most_base = 0, most_joints = 0;
    bool base_said = false, joints_said = false;
    for (int k = 1; k <= 1500; ++k) {
      const double away = 1e-3 * k;
      const Vector6 base = loop.base();
      const icat::Vector<double, 7> joints = loop.joints();
      loop.tick(c.missing);
      const Status base_says = c.controller ? loop.base_status : loop.base_reader;
      const Status joints_say = c.controller ? loop.joint_status : loop.joint_reader;
      if (away < hold - period) {  // held: all as usual
        EXPECT_EQ(base_says, Status::ok) << away;
        EXPECT_EQ(joints_say, Status::ok) << away;
      }
      base_said = base_said || base_says == c.status;
      joints_said = joints_said || joints_say == c.status;
      EXPECT_TRUE(base_says == Status::ok || (c.base_stops && base_says == c.status)) << away;
      EXPECT_TRUE(joints_say == Status::ok || (c.joints_stop && joints_say == c.status)) << away;
      // From then on less and less, and no jump: 0.5 s to zero, in steps of the slowest layer.
      if (away > hold + 2 * period) {
        EXPECT_TRUE(!c.base_stops || loop.base().norm() <= last_base) << away;
        EXPECT_TRUE(!c.joints_stop || loop.joints().norm() <= last_joints) << away;
        last_base = loop.base().norm();
        last_joints = loop.joints().norm();
      }
      // The smooth ramp is less than twice as steep as a straight one.
      most_base = std::max(most_base, loop.base().norm());
      most_joints = std::max(most_joints, loop.joints().norm());
      const double share = 2 * period / ramp;
      EXPECT_LT((loop.base() - base).norm(), 0.01 + share * most_base) << away;
      EXPECT_LT((loop.joints() - joints).norm(), 0.01 + share * most_joints) << away;
      if (away > hold + ramp + 3 * period) {
        EXPECT_EQ(loop.base().norm() == 0, c.base_stops) << away;
        EXPECT_EQ(loop.joints().norm() == 0, c.joints_stop) << away;
      }
    }
    EXPECT_EQ(base_said, c.base_stops);
    EXPECT_EQ(joints_said, c.joints_stop);
    for (int k = 0; k < 1000; ++k) loop.tick();
    EXPECT_EQ(loop.base_reader, Status::ok);
    EXPECT_EQ(loop.joint_reader, Status::ok);
    EXPECT_GT(loop.base().norm(), 0.01);
    EXPECT_GT(loop.joints().norm(), 1e-3);
  }
}
INSTANTIATE_TEST_SUITE_P(
    Rates, Ladder,
    testing::Values(Rates{.base = 20, .joints = 100, .navigation = 100},
                    Rates{.base = 20, .joints = 100, .navigation = 20},
                    Rates{.base = 100, .joints = 100, .navigation = 100},
                    Rates{.base = 20, .joints = 100, .law = 1000, .navigation = 500}));

// --- the parts -----------------------------------------------------------------------------------

TEST(BaseState, CarriesThePoseAlongItsTwist) {
  icat::BaseState<double> state;
  EXPECT_EQ(state.age(1), INFINITY);
  EXPECT_EQ(state.pose(1).matrix(), Pose::Identity().matrix());
  const double epoch = 1.76e9;
  Vector6 twist;
  twist << 0.2, -0.1, 0.05, 0.1, -0.3, 0.4;
  const Pose start = icat::integrate(at({1, 2, 3}), twist, 2.0);
  ASSERT_EQ(state.set(start, twist, epoch), Status::ok);
  EXPECT_EQ(state.velocity(), twist);
  EXPECT_EQ(state.pose(epoch).matrix(), start.matrix());
  EXPECT_EQ(state.pose(epoch - 1).matrix(), start.matrix());  // it does not know
  EXPECT_NEAR(state.age(epoch + 0.25), 0.25, 1e-6);
  EXPECT_NEAR(state.age(epoch - 0.25), 0.25, 1e-6);  // nor is that good
  // exp(v t) in a thousand small steps.
  Pose small = start;
  for (int k = 0; k < 1000; ++k) small = icat::integrate(small, twist, 0.5e-3);
  EXPECT_LT((state.pose(epoch + 0.5).matrix() - small.matrix()).norm(), 1e-7);  // rounded stamps
  // Refused, and what was there gets old.
  Pose bad = start;
  bad.translation().x() = NAN;
  EXPECT_EQ(state.set(bad, twist, epoch + 1), Status::non_finite);
  EXPECT_EQ(state.set(start, Vector6::Constant(INFINITY), epoch + 1), Status::non_finite);
  EXPECT_EQ(state.set(start, twist, NAN), Status::non_finite);
  EXPECT_EQ(state.set(start, Vector6::Constant(1e300), epoch + 1), Status::implausible);
  bad = start;
  bad.matrix()(1, 1) += 0.1;
  EXPECT_EQ(state.set(bad, twist, epoch + 1), Status::not_a_rotation);
  EXPECT_NEAR(state.age(epoch + 1), 1, 1e-6);
  EXPECT_EQ(state.pose(NAN).matrix(), start.matrix());
  EXPECT_TRUE(std::isnan(state.age(NAN)));  // too old
}

template <class S>
class Held : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(Held, Scalars);

TYPED_TEST(Held, IsHeldRampedAndBack) {
  using S = TypeParam;
  using V = icat::Vector<S, 3>;
  icat::HeldReference<S, 3> reference;
  icat::HeldReference<S, Eigen::Dynamic> dynamic({}, 3);
  EXPECT_THROW((icat::HeldReference<S, Eigen::Dynamic>{}), std::invalid_argument);
  EXPECT_THROW((icat::HeldReference<S, 3>({.hold = 0})), std::invalid_argument);
  EXPECT_THROW((icat::HeldReference<S, 3>({.ramp = NAN})), std::invalid_argument);
  const V wanted(S(0.5), S(-0.25), S(1));
  EXPECT_EQ(reference.update(0), Status::stale_reference);  // none yet
  EXPECT_EQ(dynamic.update(0), Status::stale_reference);
  EXPECT_EQ(reference.value(), V::Zero());
  int last = 0;  // when one came
  const auto run = [&](int from, int to, bool comes) {
    S least(2), most(0);
    for (int k = from; k < to; ++k) {
      if (comes && k % 50 == 0) {
        EXPECT_EQ(reference.set(wanted), Status::ok);
        EXPECT_EQ(dynamic.set(wanted), Status::ok);
        last = k;
      }
      const Status status = reference.update(1e-3 * k);
      // A reference is as old as the cycles since it came, that of its own among them.
      EXPECT_EQ(status, k - last < 100 ? Status::ok : Status::stale_reference) << k;
      EXPECT_EQ(dynamic.update(1e-3 * k), status);
      EXPECT_EQ(dynamic.value(), reference.value());
      least = std::min(least, reference.value().norm());
      most = std::max(most, reference.value().norm());
    }
    return std::pair(least, most);
  };
  run(50, 1000, true);
  EXPECT_EQ(reference.value(), wanted);  // faded in over `ramp`
  const auto [least, most] = run(1000, 2001, true);
  EXPECT_EQ(least, most);
  run(2001, 2100, false);
  EXPECT_EQ(reference.value(), wanted);
  run(2100, 2400, false);
  EXPECT_GT(reference.value().norm(), S(0.01));
  EXPECT_LT(reference.value().norm(), S(0.99) * wanted.norm());
  run(2400, 2700, false);
  EXPECT_EQ(reference.value(), V::Zero());
  run(2700, 3300, true);
  EXPECT_EQ(reference.value(), wanted);
  // Bad ones do not make it younger; nor does a clock that stands still, or none.
  const double age = reference.age();
  EXPECT_EQ(reference.set(V(S(NAN), S(0), S(0))), Status::non_finite);
  EXPECT_EQ(dynamic.set(icat::Vector<S, Eigen::Dynamic>::Zero(4)), Status::wrong_size);
  EXPECT_EQ(reference.age(), age);
  Status status = Status::ok;
  for (int k = 0; k < 700; ++k) status = reference.update(NAN);
  EXPECT_EQ(status, Status::non_finite);
  EXPECT_EQ(reference.value(), V::Zero());
  ASSERT_EQ(reference.set(wanted), Status::ok);
  for (int k = 0; k < 700; ++k) status = reference.update(5);
  EXPECT_EQ(status, Status::clock_stalled);
  EXPECT_EQ(reference.value(), V::Zero());
}

// However long it waited for it.
TEST(HeldReference, TheFirstComesInWithoutAJump) {
  for (const int waits : {0, 1, 50, 300, 1000}) {
    icat::HeldReference<double, 1> reference;
    for (int k = 0; k < waits; ++k) EXPECT_EQ(reference.update(1e-3 * k), Status::stale_reference);
    double last = 0;
    for (int k = waits; k < waits + 1100; ++k) {
      ASSERT_EQ(reference.set(icat::Vector<double, 1>(1.0)), Status::ok);
      ASSERT_EQ(reference.update(1e-3 * k), Status::ok);
      EXPECT_LT(reference.value()(0) - last, 0.006) << waits;  // 1 in 0.5 s is 0.002 in the mean
      last = reference.value()(0);
    }
    EXPECT_EQ(last, 1) << waits;
  }
}

// At the end of a gap it steps by what has changed, times what the ramp has left of it.
TEST(HeldReference, AGapEndsWithAStepOfWhatIsLeft) {
  using One = icat::Vector<double, 1>;
  const double fastest = 15.0 / 8 / ramp * 1e-3;  // of the smooth step, in a cycle
  for (const int gap : {50, 200, 350, 500, 650, 900}) {
    icat::HeldReference<double, 1> reference;
    const auto cycle = [&](int k) {
      const double last = reference.value()(0);
      const Status status = reference.update(1e-3 * k);
      EXPECT_EQ(status, reference.age() <= 0.1 + 1e-9 ? Status::ok : Status::stale_reference);
      return reference.value()(0) - last;
    };
    int k = 0;
    for (; k < 1000; ++k) {
      ASSERT_EQ(reference.set(One(1.0)), Status::ok);
      (void)cycle(k);
    }
    for (; k < 1000 + gap; ++k) EXPECT_LE(std::abs(cycle(k)), fastest * (1 + 1e-9)) << k;
    const double left = reference.value()(0);
    ASSERT_EQ(reference.set(One(1.5)), Status::ok);
    EXPECT_NEAR(cycle(k), 0.5 * left, 1.5 * fastest) << gap;
    EXPECT_EQ(left > 0, gap < 600) << gap;
    for (int end = k + 501; k < end;) {
      ASSERT_EQ(reference.set(One(1.5)), Status::ok);
      EXPECT_LE(std::abs(cycle(++k)), 1.5 * fastest * (1 + 1e-9)) << k;
    }
    EXPECT_EQ(reference.value()(0), 1.5);
  }
}

TEST(MultiRate, DoesNotAllocate) {
#ifdef ICAT_TEST_NO_MALLOC_COUNT
  GTEST_SKIP() << "malloc belongs to the sanitizer";
#endif
  icat::BaseState<double> state;
  icat::HeldReference<double, 6> fixed;
  icat::HeldReference<double, Eigen::Dynamic> dynamic({}, 7);
  const icat::Vector<double, Eigen::Dynamic> joints = folded();
  double sum = 0;
  const long count = count_allocations([&] {
    for (int k = 0; k < 2000; ++k) {
      const double t = 1e-3 * k;
      if (k % 100 == 0 && k < 1000) {
        (void)state.set(at({0, 0, 1}), Vector6::Constant(0.1), t);
        (void)fixed.set(state.velocity());
        (void)dynamic.set(joints);
      }
      (void)fixed.update(t);
      (void)dynamic.update(t);
      sum += state.pose(t)(0, 3) + fixed.value()(0) + dynamic.value()(1);
    }
  });
  EXPECT_EQ(count, 0);
  EXPECT_GT(sum, 0);
}

}  // namespace
