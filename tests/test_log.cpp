// SPDX-License-Identifier: BSD-3-Clause
// The memory of a log, and what is recorded of a controller.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <icat/adapters/csv.hpp>
#include <icat/adapters/json_text.hpp>
#include <icat/adapters/mcap.hpp>
#include <icat/adapters/replay.hpp>
#include <icat/control/controller.hpp>
#include <icat/control/controller_log.hpp>
#include <icat/control/parallel_controller.hpp>
#include <icat/model/maris.hpp>
#include <icat/model/uvms.hpp>
#include <icat/task/column_tasks.hpp>
#include <icat/task/frame_tasks.hpp>
#include <icat/task/joint_tasks.hpp>
#include <sstream>

#include "support/allocation_counter.hpp"

namespace {

using icat::Log;
using icat::LogKind;
using Robot = icat::KinematicTree<double, 13>;

std::size_t channel(const Log& log, std::string_view name) {
  for (std::size_t c = 0; c < log.channel_count(); ++c) {
    if (log.name(c) == name) return c;
  }
  ADD_FAILURE() << "no channel " << name;
  return 0;
}

TEST(Log, KeepsWhatIsSetAndNaNWhereNothingIs) {
  Log log({.samples = 3});
  const auto a = log.add("group/a", "m"), b = log.add("b"), p = log.add("p", "m", LogKind::point);
  log.set(a, 7);  // no sample is open
  ASSERT_TRUE(log.begin(0.5));
  log.set(a, 1);
  log.set(p, 1, 2, 3);
  log.set(p, 9);                   // another kind
  log.set(icat::LogChannel{}, 9);  // no channel
  ASSERT_TRUE(log.begin(1));
  log.set(b, 2);
  ASSERT_EQ(log.size(), 2u);
  EXPECT_EQ(log.time(0), 0.5);
  EXPECT_EQ(log.values(0, 0)[0], 1);
  EXPECT_TRUE(std::isnan(log.values(1, 0)[0]));
  EXPECT_EQ(log.values(2, 0)[2], 3);
  EXPECT_TRUE(std::isnan(log.values(0, 1)[0]));
  EXPECT_EQ(log.values(1, 1)[0], 2);
  EXPECT_EQ(log.unit(0), "m");
}

TEST(Log, RefusesTimesThatDoNotRise) {
  Log log({.samples = 3});
  const auto a = log.add("a");
  ASSERT_TRUE(log.begin(1));
  for (const double t : {1.0, 0.5, double(NAN), double(INFINITY)}) {
    EXPECT_FALSE(log.begin(t)) << t;
    log.set(a, 5);
  }
  EXPECT_EQ(log.refused(), 4u);
  EXPECT_EQ(log.size(), 1u);
  EXPECT_TRUE(std::isnan(log.values(0, 0)[0]));
}

TEST(Log, StopsOrKeepsTheNewestWhenItIsFull) {
  for (const auto full : {icat::LogFull::stop, icat::LogFull::newest}) {
    Log log({.samples = 4, .full = full});
    const auto a = log.add("a"), p = log.add("p", "", LogKind::point);
    for (int k = 0; k < 11; ++k) {
      EXPECT_EQ(log.begin(k), k < 4 || full == icat::LogFull::newest);
      log.set(a, 10 * k);
      log.set(p, k, 2 * k, 3 * k);
    }
    EXPECT_EQ(log.size(), 4u);
    EXPECT_EQ(log.lost(), 7u);
    for (std::size_t i = 0; i < 4; ++i) {
      const double k = double(i) + (full == icat::LogFull::newest ? 7 : 0);
      EXPECT_EQ(log.time(i), k);
      EXPECT_EQ(log.values(0, i)[0], 10 * k);
      EXPECT_EQ(log.values(1, i)[1], 2 * k);
    }
    log.clear();
    EXPECT_EQ(log.size(), 0u);
    EXPECT_TRUE(log.begin(0));
  }
}

TEST(Log, PosesAreUnitQuaternionsAlsoAtHalfATurn) {
  Log log({.samples = 2});
  const auto p = log.add("p", "m", LogKind::pose);
  icat::Pose<float> pose = icat::IdentityPose{};
  pose.linear() = icat::rotation_exp<float>({float(M_PI), 0, 0});
  pose.translation() << 1, 2, 3;
  ASSERT_TRUE(log.begin(0));
  log.set(p, pose);
  const double* v = log.values(0, 0);
  EXPECT_EQ(v[1], 2);
  // float: sin π is 9e-8, and half of it remains.
  EXPECT_NEAR(std::abs(v[3]), 1, 1e-6);
  EXPECT_NEAR(v[6], 0, 1e-6);
}

TEST(Log, RefusesBadChannels) {
  EXPECT_THROW(Log({.samples = 0}), std::invalid_argument);
  Log log;
  log.add("a");
  EXPECT_THROW(log.add("a"), std::invalid_argument);
  EXPECT_THROW(log.add(""), std::invalid_argument);
  ASSERT_TRUE(log.begin(0));
  EXPECT_THROW(log.add("late"), std::invalid_argument);
}

TEST(Log, TextsHoldUntilTheNextAndAreBounded) {
  Log log({.samples = 2, .texts = 4, .characters = 20});
  log.phase(0, "reach");
  log.explain(0, "limit");
  log.phase(1, "reach");  // the same: takes no memory
  log.event(1, "x");
  log.event(2, "x");  // events are never the same
  ASSERT_EQ(log.text_count(), 4u);
  EXPECT_EQ(log.text(1).text, "limit");
  EXPECT_EQ(log.text(3).time, 2);
  log.phase(3, "lift");
  EXPECT_EQ(log.texts_lost(), 1u);
  Log small({.samples = 2, .texts = 4, .characters = 5});
  small.event(0, "123456");
  small.event(0, "12345");
  small.event(NAN, "");
  EXPECT_EQ(small.text_count(), 1u);
  EXPECT_EQ(small.texts_lost(), 2u);
}

TEST(Log, NewestKeepsTheLastTextsAndWhatHolds) {
  Log log({.samples = 2, .full = icat::LogFull::newest, .texts = 8, .characters = 60});
  log.phase(0, "approach");
  log.explain(0, "all is well");
  for (int k = 0; k < 1000; ++k) log.event(k, std::to_string(k));
  ASSERT_GE(log.text_count(), 5u);
  EXPECT_EQ(log.text_count() + log.texts_lost(), 1002u);
  EXPECT_EQ(log.text(0).text, "approach");  // it still holds
  EXPECT_EQ(log.text(1).text, "all is well");
  for (std::size_t i = 2; i < log.text_count(); ++i) {
    EXPECT_EQ(log.text(i).text, std::to_string(1000 - log.text_count() + i));
  }
  log.phase(1000, "grasp");
  log.phase(1000, "grasp");
  for (int k = 0; k < 20; ++k) log.event(1000 + k, "x");
  EXPECT_EQ(log.text(0).topic, icat::LogTopic::explanation);
  EXPECT_EQ(log.text(1).text, "grasp");  // "approach" holds no longer
  const std::size_t count = log.text_count(), lost = log.texts_lost();
  log.event(2000, std::string(61, 'x'));  // more than all of the memory: nothing makes room for it
  EXPECT_EQ(log.text_count(), count);
  EXPECT_EQ(log.texts_lost(), lost + 1);
  Log two({.samples = 2, .full = icat::LogFull::newest, .texts = 2});
  two.phase(0, "a");
  two.explain(0, "b");
  two.event(1, "c");
  EXPECT_EQ(two.texts_lost(), 1u);
  EXPECT_EQ(two.text_count(), 2u);
}

TEST(Csv, HasOneLineOfNamesAndEmptyCellsWhereNothingIsSet) {
  Log log({.samples = 3});
  const auto a = log.add("activation/joint limits; \"all\", always"),
             p = log.add("tip", "m", LogKind::point);
  (void)log.begin(0.1);
  log.set(a, 1.0 / 3);
  (void)log.begin(0.2);
  log.set(p, 1, -2e-9, NAN);
  std::ostringstream text;
  ASSERT_TRUE(icat::write_csv(log, text));
  EXPECT_EQ(text.str(),
            "time,activation/joint_limits___all___always,tip/x,tip/y,tip/z\n"
            "0.1,0.3333333333333333,,,\n"
            "0.2,,1,-2e-09,\n");
  EXPECT_FALSE(icat::write_csv(log, "/nowhere/at/all.csv"));
}

// A table with two columns of one name is read as one, or not at all.
TEST(Csv, TellsNamesApart) {
  Log log({.samples = 1});
  for (const char* name : {"a b", "a_b", "a,b", "a_b_2", "time", "p/x"}) log.add(name);
  log.add("p", "m", LogKind::point);
  std::ostringstream text;
  ASSERT_TRUE(icat::write_csv(log, text));
  EXPECT_EQ(text.str(), "time,a_b,a_b_2,a_b_3,a_b_2_2,time_2,p/x,p/x_2,p/y,p/z\n");
}

// What writes and cannot flush says so, also where there is little to write.
TEST(Files, SayThatADiskIsFull) {
  if (!std::ofstream("/dev/full")) GTEST_SKIP() << "no /dev/full";
  Log log({.samples = 1});
  EXPECT_FALSE(icat::write_csv(log, "/dev/full"));
  EXPECT_FALSE(icat::write_mcap(log, "/dev/full"));
}

TEST(Replay, InfinityIsAGapAndTheFinitePartKeepsItsScale) {
  std::string is, gap;
  icat::detail::replay_column(is, {1, INFINITY, -INFINITY, 1e300, NAN}, LogKind::number);
  // 1, then what a float can say: ∞, −∞, its largest number, NaN.
  std::string bytes;
  for (const std::uint32_t x : {0x3f800000u, 0x7f800000u, 0xff800000u, 0x7f7fffffu, 0x7fc00000u}) {
    icat::detail::put_integer(bytes, x);
  }
  icat::detail::base64(gap, bytes);
  EXPECT_EQ(is, '"' + gap + '"');
}

TEST(JsonText, EscapesWhatWouldEndAStringOrAScript) {
  std::string json = "{";
  icat::detail::json_member(json, "a\"\\\n\x01", "</script> ü");
  icat::detail::json_member(json, "n", NAN);
  icat::detail::json_member(json, "x", -0.1);
  EXPECT_EQ(json + "}", R"({"a\"\\\u000a\u0001":"\u003c/script> ü","n":null,"x":-0.1})");
}

TEST(Log, OfAControlLoop) {
  auto robot = icat::uvms(icat::maris_arm<double>());
  ASSERT_EQ(robot.update(icat::Vector<double, 7>::Constant(-0.4), icat::Pose<double>::Identity()),
            icat::Status::ok);
  icat::Pose<double> goal = robot.pose(robot.frame("tool"));
  icat::task::FramePose reach(robot, robot.frame("tool"), goal, {.name = "reach"});
  icat::Controller controller(robot, {{"reach", {{reach}}}});
  //! [log]
  icat::Log log({.samples = 6000, .full = icat::LogFull::newest});  // the last minute
  icat::ControllerLog recorder(log, controller, {.frames = {"tool"}});
  const auto battery = log.add("battery/voltage", "V");
  //! [log]
  icat::Status status = controller.start("reach", 0);
  for (int k = 1; k < 10 && status == icat::Status::ok; ++k) {
    const double t = 0.01 * k;
    const double volts = 24 - t;
    //! [loop]
    status = controller.step(t);
    if (log.begin(t)) {  // a sample of this cycle
      recorder.record();
      log.set(battery, volts);
    }
    if (status != icat::Status::ok) log.event(t, icat::describe(status));
    //! [loop]
  }
  EXPECT_EQ(log.size(), 9u);
  const std::string folder = ::testing::TempDir();
  //! [files]
  const bool written = icat::write_csv(log, folder + "/run.csv") &&  // adapters/csv.hpp
                       icat::write_mcap(log, folder + "/run.mcap");  // adapters/mcap.hpp
  //! [files]
  EXPECT_TRUE(written);
}

struct ControllerLogTest : ::testing::Test {
  Robot robot = icat::uvms(icat::maris_arm<double>());
  icat::Vector<double, 7> q = icat::Vector<double, 7>::Constant(-0.4);
  icat::Pose<double> base = icat::Pose<double>::Identity();
  void SetUp() override {
    base.translation() << 1, 2, 3;
    ASSERT_EQ(robot.update(q, base), icat::Status::ok);
  }
};

TEST_F(ControllerLogTest, RecordsRobotTasksAndReportByName) {
  icat::Pose<double> goal = robot.pose(robot.frame("tool"));
  goal.translation() += icat::Vector3<double>(0.1, 0, 0);
  icat::task::JointLimits limits(robot, {.margin = 0.1});
  icat::task::FramePose reach(robot, robot.frame("tool"), goal, {.name = "reach"});
  icat::task::Minimality still(robot, robot.base_columns(), "still");
  // "reach" stands twice: the actions order it differently.
  icat::Controller controller(
      robot, {{"go", {{limits}, {reach}, {still}}}, {"rest", {{limits}, {still}, {reach}}}});
  Log log({.samples = 10});
  icat::ControllerLog recorder(log, controller, {.frames = {"tool"}});
  ASSERT_EQ(controller.start("go", 0), icat::Status::ok);
  ASSERT_EQ(controller.step(0.01), icat::Status::ok);
  ASSERT_TRUE(log.begin(0.01));
  recorder.record();
  const auto value = [&](const char* name, std::size_t i = 0) {
    return log.values(channel(log, name), 0)[i];
  };
  EXPECT_EQ(value(("joint/" + robot.joints()[2].name).c_str()), -0.4);
  EXPECT_EQ(value("velocity/surge"), controller.velocity()(7));
  EXPECT_EQ(value("frame/base", 1), 2);
  EXPECT_EQ(value("frame/tool", 0), robot.pose(robot.frame("tool")).translation().x());
  EXPECT_EQ(value("activation/reach"), 1);
  // The other occurrence of one of the two tasks rests.
  const bool reach_twice = controller.hierarchy().size() > 3;
  ASSERT_TRUE(reach_twice);
  EXPECT_EQ(value("activation/joint limits"), 0);
  EXPECT_EQ(value("report/failed level"), 0);
  const icat::Vector6<double> achieved = reach.jacobian() * controller.velocity();
  double sum = 0;
  for (int i = 0; i < 6; ++i) {
    const std::string row = "task/reach/" + std::to_string(i + 1);
    EXPECT_EQ(value((row + "/reference").c_str()), reach.reference()(i));
    // Sums of 13 products in another order.
    EXPECT_NEAR(value((row + "/achieved").c_str()), achieved(i), 1e-14);
    EXPECT_EQ(value((row + "/activation").c_str()), 1);
    sum += std::pow(reach.reference()(i) - achieved(i), 2);
  }
  EXPECT_NEAR(value("error/reach"), std::sqrt(sum), 1e-14);
  EXPECT_THROW(icat::ControllerLog(log, controller), std::invalid_argument);  // after a sample
  Log other;
  EXPECT_THROW(icat::ControllerLog(other, controller, {.frames = {"tail"}}), std::invalid_argument);
}

// What is achieved counts the base as it is measured: what the joints do is for that.
TEST_F(ControllerLogTest, AParallelControllerAchievesWithTheBaseAsMeasured) {
  icat::Pose<double> goal = robot.pose(robot.frame("tool"));
  goal.translation().x() += 0.1;
  icat::task::FramePose reach(robot, robot.frame("tool"), goal);
  icat::ParallelController controller(robot, {{"go", {{reach}}}}, {.characteristic_length = 1});
  Log log({.samples = 5});
  icat::ControllerLog recorder(log, controller);
  ASSERT_EQ(controller.start("go", 0), icat::Status::ok);
  icat::Vector6<double> drift = icat::Vector6<double>::Zero();
  drift(1) = 0.05;  // m/s
  ASSERT_EQ(controller.step(0.01, drift), icat::Status::ok);
  ASSERT_TRUE(log.begin(0.01));
  recorder.record();
  const auto off = [&](const icat::Vector<double, 13>& y) {
    return (reach.reference() - reach.jacobian() * y).norm();
  };
  icat::Vector<double, 13> moves = controller.velocity();
  moves.tail<6>() = drift;
  EXPECT_NEAR(log.values(channel(log, "error/" + reach.name()), 0)[0], off(moves), 1e-12);
  EXPECT_GT(std::abs(off(controller.velocity()) - off(moves)), 0.01);  // of what is commanded
}

// As `explain` and configurations call them.
TEST_F(ControllerLogTest, ColumnsOfABaseAreCalledByTheirAxes) {
  using Tree = icat::KinematicTree<double>;
  const auto names = [](const icat::Base<double>& kind) {
    Tree tree({.joints = icat::axes_chain(icat::maris_arm<double>()), .base = kind});
    icat::task::JointLimits limits(tree);
    icat::Controller controller(tree, {{"go", {{limits}}}});
    Log log({.samples = 1});
    const icat::ControllerLog recorder(log, controller);
    std::string all;
    for (std::size_t c = 0; c < log.channel_count(); ++c) {
      if (log.name(c).starts_with("velocity/") && !log.name(c).starts_with("velocity/joint")) {
        all += log.name(c).substr(9) + ", ";
      }
    }
    return all;
  };
  EXPECT_EQ(names(icat::Base<double>::surface()), "surge, sway, yaw rate, ");
  EXPECT_EQ(names(icat::Base<double>::differential_drive()), "surge, yaw rate, ");
  EXPECT_EQ(names(icat::Base<double>::free()),
            "surge, sway, heave, roll rate, pitch rate, yaw rate, ");
}

TEST_F(ControllerLogTest, RecordsAParallelControllerWithoutAllocation) {
#ifdef ICAT_TEST_NO_MALLOC_COUNT
  GTEST_SKIP() << "sanitizers interpose malloc";
#endif
  icat::task::JointLimits limits(robot, {.margin = 0.1});
  icat::task::FramePose reach(robot, robot.frame("tool"), robot.pose(robot.frame("tool")));
  icat::ParallelController controller(robot, {{"go", {{limits}, {reach}}}}, {});
  Log log({.samples = 5, .full = icat::LogFull::newest});
  icat::ControllerLog recorder(log, controller, {.prefix = "a/", .frames = {"tool"}});
  ASSERT_EQ(controller.start("go", 0), icat::Status::ok);
  const long before = allocations;
  for (int k = 1; k < 20; ++k) {
    (void)controller.step(0.01 * k, icat::Vector6<double>::Zero());
    (void)log.begin(0.01 * k);
    recorder.record();
    log.event(0.01 * k, "a cycle");
    log.explain(0.01 * k, "nothing is lost");
  }
  EXPECT_EQ(allocations, before);
  EXPECT_EQ(log.size(), 5u);
  EXPECT_EQ(log.lost(), 14u);
  EXPECT_EQ(log.values(channel(log, "a/frame/base"), 0)[2], 3);
}

}  // namespace
