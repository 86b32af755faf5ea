// SPDX-License-Identifier: BSD-3-Clause
// Robots from URDF: what is read, what is refused and with which words. That poses and Jacobians
// are right is shown against Pinocchio, see pinocchio/test_pinocchio.cpp.
#include <icat/adapters/urdf.hpp>
// First, so that the header is seen to include what it needs.
#include <gtest/gtest.h>

#include <clocale>
#include <fstream>
#include <locale>

#include "robot_data.hpp"
#include "torso.hpp"

// Links that carry each other hold each other in urdfdom, too, for ever.
extern "C" const char* __lsan_default_suppressions() { return "leak:liburdfdom_model\n"; }

namespace {

using icat::parse_urdf;
using icat::Status;
using Options = icat::UrdfOptions<double>;

static_assert(icat::FramedRobot<decltype(icat::load_urdf(""))>);
static_assert(std::is_same_v<decltype(icat::load_urdf("")), icat::KinematicTree<double>>);
static_assert(std::is_same_v<decltype(icat::load_urdf<float>("")), icat::KinematicTree<float>>);

// What the error says, or "" where there is none.
template <class F>
std::string error(F&& f) {
  try {
    f();
  } catch (const std::invalid_argument& e) {
    return e.what();
  }
  return "";
}
std::string refusal(const std::string& text, const Options& options = {}) {
  return error([&] { parse_urdf(text, options); });
}
testing::AssertionResult says(const std::string& text, const std::string& part) {
  if (text.find(part) != std::string::npos) return testing::AssertionSuccess();
  return testing::AssertionFailure() << "'" << text << "' does not say '" << part << "'";
}

std::string robot(const std::string& inside) {
  return "<robot name='r'><link name='a'/><link name='b'/><link name='c'/>" + inside + "</robot>";
}
std::string joint(const std::string& name, const std::string& type, const std::string& parent,
                  const std::string& child, const std::string& more = "") {
  return "<joint name='" + name + "' type='" + type + "'><parent link='" + parent +
         "'/><child link='" + child + "'/>" + more + "</joint>";
}
const std::string range = "<limit lower='-1' upper='2' velocity='0.5' effort='1'/>";

TEST(Urdf, JointsLimitsAndMasses) {
  const auto tree = parse_urdf(
      "<robot name='r'><link name='root'/>"
      "<link name='a'><inertial><origin xyz='0.1 0.2 0.3'/><mass value='2'/><inertia ixx='1' "
      "ixy='0' ixz='0' iyy='1' iyz='0' izz='1'/></inertial></link>"
      "<link name='b'/><link name='c'/><link name='d'/><link name='e'/>" +
      joint("fixed", "fixed", "root", "a", "<origin xyz='0 0 1'/>") +
      joint("turn", "revolute", "a", "b", range + "<axis xyz='0 0 2'/>") +
      joint("slide", "prismatic", "a", "c", range) +
      joint("wheel", "continuous", "a", "d",
            "<axis xyz='0 1 0'/><limit velocity='3' effort='1'/>") +
      joint("open", "revolute", "c", "e", "<limit lower='0' upper='0' velocity='0' effort='0'/>") +
      "</robot>");
  ASSERT_EQ(tree.joints().size(), 4u);
  EXPECT_EQ(tree.dof(), 4);
  EXPECT_EQ(tree.frame_count(), 6);
  EXPECT_EQ(tree.base_columns().count, 0);
  // Depth first, by the names of the joints.
  const char* const names[] = {"slide", "open", "turn", "wheel"};
  for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(tree.joints()[i].name, names[i]);
  for (const std::size_t i : {0u, 2u}) {
    EXPECT_EQ(tree.joints()[i].lower, -1);
    EXPECT_EQ(tree.joints()[i].upper, 2);
    EXPECT_EQ(tree.joints()[i].max_velocity, 0.5);
  }
  EXPECT_TRUE(tree.joints()[3].continuous);
  EXPECT_EQ(tree.joints()[3].max_velocity, 3);
  // [0, 0] and 0 are what a file says that states nothing.
  EXPECT_FALSE(tree.joints()[1].continuous);
  EXPECT_EQ(tree.joints()[1].upper, icat::infinity<double>);
  EXPECT_EQ(tree.joints()[1].max_velocity, icat::infinity<double>);
  EXPECT_EQ(tree.mass(), 2);
  EXPECT_LT((tree.center_of_mass() - Eigen::Vector3d(0.1, 0.2, 1.3)).norm(), 1e-15);
  EXPECT_NEAR(tree.jacobian(tree.frame("b"))(5, 2), 1, 1e-15);  // the axis has length 1 now
}

TEST(Urdf, FloatAndBase) {
  auto tree = parse_urdf<float>(robot(joint("x", "continuous", "a", "b") +
                                      joint("y", "fixed", "b", "c", "<origin xyz='1 0 0'/>")),
                                {.base = icat::Base<float>::differential_drive()});
  EXPECT_EQ(tree.dof(), 3);
  EXPECT_EQ(tree.base_columns().count, 2);
  EXPECT_EQ(tree.pose(tree.frame("c")).translation().x(), 1.0F);
  EXPECT_EQ(tree.frame_name(tree.base()), "a");
}

TEST(Urdf, OneLinkOnAFreeBase) {
  const std::string one = "<robot name='r'><link name='hull'/></robot>";
  EXPECT_EQ(parse_urdf(one, {.base = icat::Base<double>::free()}).dof(), 6);
  EXPECT_TRUE(says(refusal(one), "nothing can move"));
}

TEST(Urdf, MimicsHaveNoColumn) {
  const auto mimic = [](const std::string& of, const std::string& more) {
    return range + "<mimic joint='" + of + "' " + more + "/>";
  };
  auto tree = parse_urdf(
      robot(joint("lead", "prismatic", "a", "b", range) +
            joint("follow", "prismatic", "b", "c", mimic("lead", "multiplier='-2' offset='0.1'"))));
  ASSERT_EQ(tree.joints().size(), 1u);
  ASSERT_EQ(tree.update(Eigen::VectorXd::Constant(1, 0.5)), Status::ok);
  EXPECT_NEAR(tree.pose(tree.frame("c")).translation().x(), 0.5 - 2 * 0.5 + 0.1, 1e-15);
  EXPECT_NEAR(tree.jacobian(tree.frame("c"))(0, 0), -1, 1e-15);

  EXPECT_TRUE(says(refusal(robot(joint("x", "prismatic", "a", "b", range) +
                                 joint("y", "prismatic", "b", "c", mimic("z", "")))),
                   "joint 'y' follows 'z', and there is no such joint"));
  EXPECT_TRUE(says(refusal(robot(joint("x", "prismatic", "a", "b", mimic("y", "")) +
                                 joint("y", "prismatic", "b", "c", mimic("x", "")))),
                   "which does not move"));
}

TEST(Urdf, LockedJointsAndTheirMimicsAreFixed) {
  const std::string text =
      "<robot name='r'><link name='a'/><link name='b'/><link name='c'/><link name='d'/>" +
      joint("x", "revolute", "a", "b", range + "<axis xyz='0 0 1'/><origin xyz='1 2 3'/>") +
      joint("y", "prismatic", "b", "c", range + "<mimic joint='x' multiplier='2' offset='0.3'/>") +
      joint("z", "continuous", "c", "d", "<axis xyz='0 1 0'/><origin xyz='0.5 0 0'/>") + "</robot>";
  auto moving = parse_urdf(text);
  const auto locked = parse_urdf(text, {.locked = {{"x", 0.7}}});
  ASSERT_EQ(moving.joints().size(), 2u);
  ASSERT_EQ(locked.joints().size(), 1u);
  EXPECT_EQ(locked.joints()[0].name, "z");
  ASSERT_EQ(moving.update(Eigen::Vector2d(0.7, 0)), Status::ok);
  for (const char* const link : {"a", "b", "c", "d"}) {
    EXPECT_LT((moving.pose(moving.frame(link)).matrix() - locked.pose(locked.frame(link)).matrix())
                  .norm(),
              1e-15)
        << link;
  }
  EXPECT_TRUE(says(refusal(text, {.locked = {{"elbow", 0}}}),
                   "no moving joint 'elbow' to lock; there are 'x', 'z'"));
  EXPECT_TRUE(says(refusal(text, {.locked = {{"y", 0}}}), "joint 'y' follows 'x': lock that one"));
  EXPECT_TRUE(says(refusal(text, {.locked = {{"x", 0}, {"x", 1}}}), "'x' is to be locked twice"));
  EXPECT_TRUE(says(refusal(text, {.locked = {{"x", NAN}}}), "'x' is to be locked at nan"));
  EXPECT_TRUE(says(refusal(text, {.locked = {{"x", 0}, {"z", 0}}}), "nothing can move"));
}

TEST(Urdf, WhatIsRefusedAndHow) {
  testing::internal::CaptureStderr();
  EXPECT_TRUE(says(error([] { icat::load_urdf("no/such.urdf"); }),
                   "load_urdf: 'no/such.urdf': there is no such file"));
  EXPECT_TRUE(says(error([] { icat::load_urdf("/"); }), "load_urdf: '/': "));
  EXPECT_TRUE(says(refusal(""), "parse_urdf: is no URDF"));
  EXPECT_TRUE(says(refusal("no XML"), "is no URDF: "));
  EXPECT_TRUE(says(refusal("<robot name='r'><link"), "is no URDF: "));
  EXPECT_TRUE(says(refusal("<sdf/>"), "is no URDF: Could not find the 'robot' element"));
  EXPECT_TRUE(says(refusal("<robot name='r'/>"), "is no URDF: No link elements found"));
  EXPECT_TRUE(says(refusal(robot(joint("x", "continuous", "a", "b"))), "Two root links found"));
  EXPECT_TRUE(
      says(refusal(robot(joint("x", "continuous", "a", "b") + joint("y", "continuous", "b", "c") +
                         joint("z", "continuous", "c", "a"))),
           "not a valid tree"));
  EXPECT_TRUE(
      says(refusal(robot(joint("x", "continuous", "a", "b") + joint("y", "continuous", "a", "c") +
                         joint("z", "continuous", "b", "c"))),
           "parse_urdf: KinematicTree: link 'c' has two parents"));
  // Two links that carry each other, apart from the root.
  EXPECT_FALSE(
      refusal(robot(joint("y", "continuous", "b", "c") + joint("z", "continuous", "c", "b")))
          .empty());
  EXPECT_TRUE(says(refusal(robot(joint("x", "continuous", "a", "nowhere"))), "nowhere"));
  EXPECT_TRUE(says(refusal(robot(joint("x", "revolute", "a", "b") + joint("y", "fixed", "b", "c"))),
                   "does not specify limits"));
  EXPECT_FALSE(
      refusal(robot(joint("x", "universal", "a", "b") + joint("y", "fixed", "b", "c"))).empty());
  const std::string rest = joint("y", "fixed", "b", "c");
  EXPECT_TRUE(says(refusal(robot(joint("x", "floating", "a", "b") + rest)),
                   "joint 'x' is floating: if it carries the robot, take the joint and its parent "
                   "'a' out of the file and say UrdfOptions{.base = Base::free()}"));
  EXPECT_TRUE(says(refusal(robot(joint("x", "planar", "a", "b") + rest)),
                   "joint 'x' is planar: if it carries the robot, take the joint and its parent "
                   "'a' out of the file and say UrdfOptions{.base = Base::surface()}"));
  EXPECT_TRUE(says(refusal(robot(joint("x", "continuous", "a", "b", "<axis xyz='0 0 0'/>") + rest)),
                   "joint 'x' has an axis of length 0"));
  EXPECT_TRUE(says(refusal(robot(joint("x", "revolute", "a", "b",
                                       "<limit lower='1' upper='-1' velocity='1' effort='1'/>") +
                                 rest)),
                   "joint 'x': limits must be in order, got [1, -1]"));
  EXPECT_TRUE(says(refusal(robot(joint("x", "prismatic", "a", "b",
                                       "<limit lower='0' upper='1' velocity='-1' effort='1'/>") +
                                 rest)),
                   "joint 'x': limits of velocity"));
  EXPECT_TRUE(
      says(refusal(robot(joint("x", "continuous", "a", "b", "<origin xyz='0 0 zero'/>") + rest)),
           "is no URDF: "));
  EXPECT_TRUE(says(refusal("<robot name='r'><link name='a'><inertial><mass value='-1'/><inertia "
                           "ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='1'/></inertial></link>"
                           "<link name='b'/>" +
                           joint("x", "continuous", "a", "b") + "</robot>"),
                   "the mass of link 'a'"));
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

TEST(Urdf, FilesAreNamedInErrors) {
  const std::string path = testing::TempDir() + "/icat_floating.urdf";
  std::ofstream(path) << robot(joint("x", "floating", "a", "b") + joint("y", "fixed", "b", "c"));
  EXPECT_TRUE(says(error([&] { icat::load_urdf(path); }),
                   "load_urdf: '" + path + "': joint 'x' is floating"));
  std::remove(path.c_str());
}

TEST(Urdf, AsThePageShows) {
  const std::string file = testing::TempDir() + "/icat_torso.urdf";
  std::ofstream(file) << torso::urdf;
  //! [load]
  auto torso = icat::load_urdf<double>(file);
  auto mobile = icat::load_urdf<double>(
      file, {.base = icat::Base<double>::differential_drive(), .locked = {{"lift", 0.2}}});
  //! [load]
  std::remove(file.c_str());
  EXPECT_EQ(torso.dof(), 6);
  EXPECT_EQ(mobile.dof(), 7);
}

// A program in a country with decimal commas.
struct Commas : std::numpunct<char> {
  char do_decimal_point() const override { return ','; }
};
TEST(Urdf, NumbersDoNotHangOnTheLocale) {
  const std::locale before = std::locale::global(std::locale(std::locale(), new Commas));
  const char* const c_before = std::setlocale(LC_NUMERIC, nullptr);
  const std::string keep = c_before ? c_before : "C";
  for (const char* const name : {"de_DE.UTF-8", "de_DE.utf8", "fr_FR.UTF-8"}) {
    if (std::setlocale(LC_NUMERIC, name)) break;  // where one is installed
  }
  const auto tree = parse_urdf(
      robot(joint("x", "revolute", "a", "b",
                  "<origin xyz='0.25 0 0' rpy='0.5 0 0'/><limit lower='-0.5' upper='1.5' "
                  "velocity='2.5' effort='1'/><axis xyz='0.6 0.8 0'/>") +
            joint("y", "fixed", "b", "c")));
  std::setlocale(LC_NUMERIC, keep.c_str());
  std::locale::global(before);
  EXPECT_EQ(tree.pose(tree.frame("b")).translation().x(), 0.25);
  EXPECT_NEAR(tree.pose(tree.frame("b")).matrix()(2, 1), std::sin(0.5), 1e-15);
  EXPECT_EQ(tree.joints()[0].upper, 1.5);
  EXPECT_EQ(tree.joints()[0].max_velocity, 2.5);
  EXPECT_NEAR(tree.jacobian(tree.frame("b"))(3, 0), 0.6, 1e-15);
}

// Every file of example-robot-data is read, or refused with the sentence that stands there. What is
// read is written down for the comparison with Pinocchio, which has a urdfdom of its own.
TEST(Urdf, ExampleRobotData) {
  const auto files = robot_data::files(ICAT_ROBOT_DATA);
  if (files.empty()) GTEST_SKIP() << "no example-robot-data (scripts/test.sh installs it)";
  EXPECT_EQ(files.size(), 69u);
  std::ofstream snapshot(ICAT_SNAPSHOT, std::ios::binary);
  std::size_t read = 0;
  for (const auto& file : files) {
    SCOPED_TRACE(file);
    const std::string path = std::string(ICAT_ROBOT_DATA) + "/" + file;
    const auto expected = robot_data::refused().find(file);
    const std::string text = error([&] {
      auto tree = icat::load_urdf(path, robot_data::options(file));
      robot_data::write(snapshot, tree);
      ++read;
    });
    if (expected == robot_data::refused().end()) {
      EXPECT_EQ(text, "");
    } else {
      EXPECT_EQ(text, "load_urdf: '" + path + "': " + expected->second);
    }
  }
  EXPECT_EQ(read + robot_data::refused().size(), files.size());
  std::printf("%zu files read, %zu refused\n", read, robot_data::refused().size());
}

}  // namespace
