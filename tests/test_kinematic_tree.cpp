// SPDX-License-Identifier: BSD-3-Clause
// Trees of links and joints: poses against literal products, Jacobians against central differences,
// what is refused and what the errors say.
#include <gtest/gtest.h>

#include <icat/model/kinematic_tree.hpp>
#include <icat/model/maris.hpp>
#include <icat/model/point.hpp>
#include <icat/model/uvms.hpp>

#include "support/allocation_counter.hpp"
#include "support/trees.hpp"

namespace {

using icat::DhConvention;
using icat::Index;
using icat::JointType;
using icat::Status;
using testing_support::difference;
using testing_support::difference_tolerance;
using testing_support::differentiate;
using testing_support::make_pose;
using testing_support::make_torso;
using testing_support::message_of;
using testing_support::place;
using testing_support::roundings;
using testing_support::TreeState;
constexpr double pi = std::numbers::pi;
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

template <class K>
class KinematicTrees : public testing::Test {};
TYPED_TEST_SUITE(KinematicTrees, testing_support::AllKinds);

template <class Tree>
Tree chain(std::vector<icat::Joint<typename Tree::Scalar>> joints) {
  return Tree({.joints = std::move(joints)});
}

// --- the MARIS arm -------------------------------------------------------------------------------

TYPED_TEST(KinematicTrees, MarisArmHasThePublishedJacobian) {
  using S = typename TypeParam::Scalar;
  using Tree = typename TypeParam::template Tree<7>;
  const Tree arm = chain<Tree>(icat::axes_chain(icat::maris_arm<S>()));
  const icat::FrameId tip = arm.frame("end_effector");
  const auto& J = arm.jacobian(tip);
  const double linear[7][3] = {{0, -0.1455, 0}, {0.9835, 0, 0.1455}, {0, -0.1455, 0}, {0.552, 0, 0},
                               {0, 0, 0},       {0.132, 0, 0},       {0, 0, 0}};
  for (int j = 0; j < 7; ++j) {
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(J(i, j), linear[j][i], 1e-6) << i << ' ' << j;
    EXPECT_EQ(J(j % 2 ? 4 : 5, j), S(1));
  }
  EXPECT_NEAR(arm.pose(tip).translation().z(), 1.2665, 1e-6);
  EXPECT_EQ(arm.joints()[3].lower, S(-2.95));
  EXPECT_EQ(arm.joints()[3].upper, S(0.01));
  EXPECT_NEAR(arm.pose(arm.frame(icat::maris_elbow)).translation().x(), -0.1455, 1e-7);
}

TEST(Uvms, HasThePapersColumnsAndFrames) {
  const auto robot = testing_support::make_robot<double>();
  EXPECT_EQ(robot.dof(), 13);
  EXPECT_EQ(robot.base_columns().first, 7);
  EXPECT_EQ(robot.base_columns().count, 6);
  EXPECT_EQ(robot.base(), robot.frame("vehicle"));
  EXPECT_EQ(robot.base_motion(), icat::Matrix6<double>::Identity());
  // ẏ = [q̇; v] with v on ⟨v⟩: at the origin of ⟨v⟩ the base's columns are R_v.
  auto moved = robot;
  const auto state = testing_support::random_states<double>(1, 7)[0];
  ASSERT_EQ(moved.update(state.q, state.vehicle), Status::ok);
  const auto& J = moved.jacobian(moved.base());
  EXPECT_LT((J.topRows<3>().middleCols<3>(7) - state.vehicle.linear()).norm(), 1e-15);
  EXPECT_LT((J.bottomRows<3>().rightCols<3>() - state.vehicle.linear()).norm(), 1e-15);
  EXPECT_EQ(J.leftCols<7>().norm(), 0);
  const auto camera = make_pose<double>(0.5, 0.1, 0.2, -0.2, 0.7, 0.4);
  EXPECT_LT((moved.pose(moved.frame("camera")).matrix() - (state.vehicle * camera).matrix()).norm(),
            1e-14);
}

// --- Jacobians -----------------------------------------------------------------------------------

// Every frame and the centre of mass of the torso on `base`.
template <class K, int Columns>
void expect_differences(const char* name, const icat::Base<typename K::Scalar>& base) {
  using S = typename K::Scalar;
  using Tree = typename K::template Tree<testing_support::torso_joint_count + Columns>;
  SCOPED_TRACE(name);
  Tree robot = make_torso<Tree>(base);
  ASSERT_EQ(robot.dof(), testing_support::torso_joint_count + Columns);
  ASSERT_EQ(robot.base_columns().first, testing_support::torso_joint_count);
  ASSERT_EQ(robot.base_columns().count, Columns);
  const icat::FrameId tool = robot.add_frame("tool", robot.frame("finger3"),
                                             make_pose<S>(0.02, 0.1, 0.05, 0.3, 0.2, -0.5));
  for (const TreeState& s : testing_support::all_torso_states(robot, 6, 1)) {
    SCOPED_TRACE(s.name);
    place(robot, s);
    std::vector<icat::Pose<S>> at;
    for (Index f = 0; f < robot.frame_count(); ++f) at.push_back(robot.pose(icat::FrameId(f)));
    // All frames and the centre of mass stacked.
    const auto numeric = differentiate(robot, s, [&](const Tree& moved) {
      Eigen::Matrix<S, Eigen::Dynamic, 1> all(6 * moved.frame_count() + 3);
      for (Index f = 0; f < moved.frame_count(); ++f) {
        all.template segment<6>(6 * f) =
            difference<S>(at[static_cast<std::size_t>(f)], moved.pose(icat::FrameId(f)));
      }
      all.template tail<3>() = moved.center_of_mass();
      return all;
    });
    // Twelve columns of lengths up to 2 m, and numbers of up to 12 for the third finger.
    const S tolerance = difference_tolerance<S> * 4;
    for (Index f = 0; f < robot.frame_count(); ++f) {
      const icat::FrameId frame(f);
      const S size = frame == tool || robot.frame_name(frame) == "finger3" ? S(12) : S(1);
      EXPECT_LT((robot.jacobian(frame) - numeric.middleRows(6 * f, 6)).norm(), tolerance * size)
          << robot.frame_name(frame);
    }
    EXPECT_LT((robot.center_of_mass_jacobian() - numeric.bottomRows(3)).norm(), tolerance);
  }
}

TYPED_TEST(KinematicTrees, JacobiansEqualCentralDifferencesOnEveryBase) {
  using S = typename TypeParam::Scalar;
  using Base = icat::Base<S>;
  expect_differences<TypeParam, 0>("fixed", Base::fixed());
  expect_differences<TypeParam, 6>("free", Base::free());
  expect_differences<TypeParam, 3>("surface", Base::surface());
  expect_differences<TypeParam, 2>("differential drive", Base::differential_drive());
  typename Base::Motion own(6, 4);  // coupled velocities, as of tilted thrusters
  own << S(1), S(0), S(0.3), S(0),  //
      S(0), S(0), S(0.2), S(-0.5),  //
      S(0.1), S(1), S(0), S(0.3),   //
      S(0), S(0.4), S(0.2), S(0),   //
      S(0), S(0), S(-0.6), S(0.2),  //
      S(0.5), S(0), S(0), S(1);
  expect_differences<TypeParam, 4>("the user's own", Base(own));
}

TEST(Bases, HaveTheColumnsTheySay) {
  using Base = icat::Base<double>;
  EXPECT_EQ(Base::fixed().columns(), 0);
  EXPECT_EQ(Base::free().motion(), icat::Matrix6<double>::Identity());
  const icat::Matrix6<double> I = icat::Matrix6<double>::Identity();
  ASSERT_EQ(Base::surface().columns(), 3);
  EXPECT_EQ(Base::surface().motion().col(0), I.col(0));
  EXPECT_EQ(Base::surface().motion().col(1), I.col(1));
  EXPECT_EQ(Base::surface().motion().col(2), I.col(5));
  ASSERT_EQ(Base::differential_drive().columns(), 2);
  EXPECT_EQ(Base::differential_drive().motion().col(0), I.col(0));
  EXPECT_EQ(Base::differential_drive().motion().col(1), I.col(5));
  Base::Motion bad = I;
  bad(2, 2) = 0;
  EXPECT_EQ(message_of([&] { Base{bad}; }), "Base: column 2 of the motion is zero");
  bad(2, 2) = nan;
  EXPECT_EQ(message_of([&] { Base{bad}; }), "Base: the motion is not finite");
}

TYPED_TEST(KinematicTrees, UpdateWithoutABasePoseLeavesTheBaseWhereItWas) {
  using S = typename TypeParam::Scalar;
  using Tree = typename TypeParam::template Tree<20>;
  Tree robot = make_torso<Tree>();
  const auto states = testing_support::random_tree_states(robot, 2, 3);
  place(robot, states[0]);
  const icat::Pose<S> base = robot.pose(robot.base());
  const Eigen::Matrix<S, Eigen::Dynamic, 1> q = states[1].q.template cast<S>();
  ASSERT_EQ(robot.update(q), Status::ok);
  EXPECT_EQ(robot.pose(robot.base()).matrix(), base.matrix());
  EXPECT_EQ(robot.q(), q);
  for (Index i = 0; i < q.size(); ++i) EXPECT_EQ(robot.position(i), q(i));
  // The same as both at once.
  Tree other = make_torso<Tree>();
  ASSERT_EQ(other.update(q, base), Status::ok);
  EXPECT_EQ(other.jacobian(other.frame("left_hand")), robot.jacobian(robot.frame("left_hand")));
  EXPECT_EQ(other.center_of_mass(), robot.center_of_mass());
}

// A fixed robot may stand anywhere.
TYPED_TEST(KinematicTrees, AFixedBaseMayHaveAnyPose) {
  using S = typename TypeParam::Scalar;
  using Tree = typename TypeParam::template Tree<7>;
  Tree arm = chain<Tree>(icat::axes_chain(icat::maris_arm<S>()));
  const icat::FrameId tip = arm.frame("end_effector");
  const icat::Vector<S, 7> q = testing_support::random_states<S>(1, 2)[0].q;
  ASSERT_EQ(arm.update(q), Status::ok);
  const icat::Pose<S> in_base = arm.pose(tip);
  const auto J = arm.jacobian(tip);
  const auto base = make_pose<S>(1, -2, 0.5, 0.3, 0.4, 2);
  ASSERT_EQ(arm.update(q, base), Status::ok);
  EXPECT_LT((arm.pose(tip).matrix() - (base * in_base).matrix()).norm(), roundings<S>(40));
  for (Index j = 0; j < 7; ++j) {
    for (Index part = 0; part < 6; part += 3) {
      EXPECT_LT((arm.jacobian(tip).template block<3, 1>(part, j) -
                 base.linear() * J.template block<3, 1>(part, j))
                    .norm(),
                roundings<S>(40));
    }
  }
}

// --- joints --------------------------------------------------------------------------------------

// ⟨link⟩ in ⟨parent⟩ = origin · motion(q) · link_pose, literally.
TYPED_TEST(KinematicTrees, EveryTypeOfJointMovesAsDocumented) {
  using S = typename TypeParam::Scalar;
  using V = icat::Vector3<S>;
  using Tree = typename TypeParam::template Tree<20>;
  Tree robot = make_torso<Tree>();
  const auto joints = testing_support::torso_joints<S>();
  for (const TreeState& s : testing_support::all_torso_states(robot, 5, 4)) {
    SCOPED_TRACE(s.name);
    place(robot, s);
    for (const auto& joint : joints) {
      S position(0);
      const auto of = [&](const char* name) {
        return robot.position(icat::joint_index(robot, name));
      };
      if (joint.link == "finger2") {
        position = S(0.01) - of("finger1");
      } else if (joint.link == "finger3") {
        position = S(12) * (S(0.01) - of("finger1")) + S(0.3);
      } else if (joint.type != JointType::fixed) {
        position = of(joint.name.c_str());
      }
      icat::Pose<S> motion = icat::Pose<S>::Identity();
      if (joint.type == JointType::prismatic) {
        motion.translation() = V(position * joint.axis);
      } else if (joint.type != JointType::fixed) {
        motion.linear() = Eigen::AngleAxis<S>(position, joint.axis).toRotationMatrix();
      }
      const icat::Pose<S> expected =
          robot.pose(robot.frame(joint.parent)) * joint.origin * motion * joint.link_pose;
      EXPECT_LT((robot.pose(robot.frame(joint.link)).matrix() - expected.matrix()).norm(),
                roundings<S>(60))
          << joint.name;
    }
  }
}

TYPED_TEST(KinematicTrees, MimicsHaveNoColumnAndMoveWithTheirLeader) {
  using S = typename TypeParam::Scalar;
  using Tree = typename TypeParam::template Tree<20>;
  Tree robot = make_torso<Tree>();
  place(robot, testing_support::random_tree_states(robot, 1, 5)[0]);
  ASSERT_EQ(robot.joints().size(), 14u);
  const Index column =
      robot.joints()[static_cast<std::size_t>(icat::joint_index(robot, "finger1"))].column;
  const auto v = [&](const char* frame) {
    return icat::Vector6<S>(robot.jacobian(robot.frame(frame)).col(column));
  };
  EXPECT_LT((v("finger1") + v("finger2")).norm(), roundings<S>(4));
  // x of the hand, turned by 12 · (−1) rad per m.
  const icat::Vector3<S> x = robot.pose(robot.frame("left_hand")).linear().col(0);
  EXPECT_LT((v("finger3").template tail<3>() + S(12) * x).norm(), roundings<S>(60));
  EXPECT_EQ(v("left_hand").norm(), S(0));
  EXPECT_THROW((void)icat::joint_index(robot, "finger2"), std::invalid_argument);
}

TEST(KinematicTree, ColumnsFollowTheDescription) {
  using J = icat::Joint<double>;
  const icat::KinematicTree<double> robot(
      {.joints = {J{"b", "one", "two", JointType::revolute}, J{"a", "root", "one"},
                  J{"fixed", "root", "three", JointType::fixed},
                  J{"c", "three", "four", JointType::prismatic},
                  J{"d", "two", "five", JointType::continuous}},
       .base = icat::Base<double>::surface()});
  // "b" stands first, but it is carried by "a", and "d" by "b".
  std::vector<std::string> names;
  for (std::size_t i = 0; i < robot.joints().size(); ++i) {
    names.push_back(robot.joints()[i].name);
    EXPECT_EQ(robot.joints()[i].column, static_cast<Index>(i));
  }
  EXPECT_EQ(names, (std::vector<std::string>{"a", "c", "b", "d"}));
}

TEST(KinematicTree, JointsSayWhatWasDescribed) {
  icat::Joint<double> joint{"slide", "root", "sled", JointType::prismatic};
  joint.lower = -0.25;
  joint.upper = 2;
  joint.max_velocity = 0.5;
  joint.max_acceleration = 4;
  icat::Joint<double> turn{"turn", "sled", "table", JointType::continuous};
  turn.lower = -1;  // of no meaning
  turn.upper = 1;
  const icat::KinematicTree<double> robot({.joints = {joint, turn}});
  const auto& info = robot.joints();
  EXPECT_EQ(info[0].lower, -0.25);
  EXPECT_EQ(info[0].upper, 2);
  EXPECT_EQ(info[0].max_velocity, 0.5);
  EXPECT_EQ(info[0].max_acceleration, 4);
  EXPECT_FALSE(info[0].continuous);
  EXPECT_TRUE(info[1].continuous);
  EXPECT_EQ(info[1].lower, -INFINITY);
  EXPECT_EQ(info[1].upper, INFINITY);
  EXPECT_EQ(info[1].max_velocity, INFINITY);
}

TEST(KinematicTree, AxesAreNormalizedAndSaidInTheWorld) {
  icat::Joint<double> joint{"turn", "root", "link"};
  joint.axis = {0.6, 0, 0.80004};
  joint.origin = make_pose<double>(1, 2, 3, 0.3, -0.2, 0.5);
  icat::KinematicTree<double> robot({.joints = {joint}, .base = icat::Base<double>::free()});
  const auto base = make_pose<double>(-1, 0.5, 2, 1, 0.3, -2);
  ASSERT_EQ(robot.update(icat::Vector<double, 1>(0.7), base), Status::ok);
  EXPECT_NEAR(robot.axis(0).norm(), 1, 1e-15);
  const icat::Vector3<double> axis = (base * joint.origin).linear() * joint.axis.normalized();
  EXPECT_LT((robot.axis(0) - axis).norm(), 1e-14);
  EXPECT_LT((robot.axis_point(0) - (base * joint.origin).translation()).norm(), 1e-14);
}

// A base alone moves too.
TEST(KinematicTree, ARobotWithoutJoints) {
  icat::KinematicTree<double, 3> robot(
      {.joints = {}, .base = icat::Base<double>::surface(), .root = "hull"});
  EXPECT_EQ(robot.frame_name(robot.base()), "hull");
  ASSERT_EQ(robot.update(Eigen::VectorXd(0), make_pose<double>(1, 2, 0, 0, 0, pi / 2)), Status::ok);
  EXPECT_LT((robot.jacobian(robot.base()).col(0).head<3>() - icat::Vector3<double>::UnitY()).norm(),
            1e-15);
}

// --- Denavit–Hartenberg and axes -----------------------------------------------------------------

// The literal product of the file comment of joint.hpp.
template <class S>
icat::Pose<S> dh_product(const std::vector<icat::DhRow<S>>& rows, DhConvention convention,
                         const Eigen::Matrix<S, Eigen::Dynamic, 1>& q) {
  using V = icat::Vector3<S>;
  const auto rot = [](S angle, const V& axis) {
    icat::Pose<S> p = icat::Pose<S>::Identity();
    p.linear() = Eigen::AngleAxis<S>(angle, axis).toRotationMatrix();
    return p;
  };
  const auto trans = [](S length, const V& axis) {
    icat::Pose<S> p = icat::Pose<S>::Identity();
    p.translation() = V(length * axis);
    return p;
  };
  const V x = V::UnitX(), z = V::UnitZ();
  icat::Pose<S> T = icat::Pose<S>::Identity();
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const auto& row = rows[i];
    const bool slides = row.type == JointType::prismatic;
    const S at = q(static_cast<Index>(i));
    const S theta = row.theta + (slides ? S(0) : at), d = row.d + (slides ? at : S(0));
    if (convention == DhConvention::standard) {
      T = T * rot(theta, z) * trans(d, z) * trans(row.a, x) * rot(row.alpha, x);
    } else {
      T = T * rot(row.alpha, x) * trans(row.a, x) * rot(theta, z) * trans(d, z);
    }
  }
  return T;
}

template <class S>
std::vector<icat::DhRow<S>> dh_rows(std::initializer_list<std::array<double, 4>> table) {
  std::vector<icat::DhRow<S>> rows;  // a, α, d, θ
  for (const auto& r : table) rows.push_back({S(r[0]), S(r[1]), S(r[2]), S(r[3])});
  return rows;
}

template <class S>
std::vector<icat::DhRow<S>> puma() {  // standard; Corke, Robotics, Vision and Control
  return dh_rows<S>({{0, pi / 2, 0, 0},
                     {0.4318, 0, 0, 0},
                     {0.0203, -pi / 2, 0.15005, 0},
                     {0, pi / 2, 0.4318, 0},
                     {0, -pi / 2, 0, 0},
                     {0, 0, 0, 0}});
}
template <class S>
std::vector<icat::DhRow<S>> panda() {  // modified; the maker's table up to the last joint
  return dh_rows<S>({{0, 0, 0.333, 0},
                     {0, -pi / 2, 0, 0},
                     {0, pi / 2, 0.316, 0},
                     {0.0825, pi / 2, 0, 0},
                     {-0.0825, -pi / 2, 0.384, 0},
                     {0, pi / 2, 0, 0},
                     {0.088, pi / 2, 0, 0}});
}

template <class Tree>
void expect_dh(const std::vector<icat::DhRow<typename Tree::Scalar>>& rows,
               DhConvention convention) {
  using S = typename Tree::Scalar;
  Tree robot = chain<Tree>(icat::dh_chain(rows, convention));
  const icat::FrameId tip = robot.frame("link" + std::to_string(rows.size()));
  std::mt19937 rng(5);
  std::uniform_real_distribution<double> u(-3, 3);
  for (int k = 0; k < 20; ++k) {
    Eigen::Matrix<S, Eigen::Dynamic, 1> q(static_cast<Index>(rows.size()));
    for (Index i = 0; i < q.size(); ++i) q(i) = S(u(rng));
    ASSERT_EQ(robot.update(q), Status::ok);
    // Seven products of rotations, positions of up to some metres.
    EXPECT_LT((robot.pose(tip).matrix() - dh_product(rows, convention, q).matrix()).norm(),
              roundings<S>(200));
  }
}

TYPED_TEST(KinematicTrees, DenavitHartenbergEqualsTheProductOfMatrices) {
  using S = typename TypeParam::Scalar;
  expect_dh<typename TypeParam::template Tree<6>>(puma<S>(), DhConvention::standard);
  expect_dh<typename TypeParam::template Tree<7>>(panda<S>(), DhConvention::modified);
  // Sliding joints with offsets; both conventions.
  auto rows = dh_rows<S>({{0.2, 0.7, 0.1, 0.4}, {-0.1, -0.3, 0.5, -1.1}, {0.3, 1.9, -0.2, 2}});
  rows[1].type = JointType::prismatic;
  expect_dh<typename TypeParam::template Tree<3>>(rows, DhConvention::standard);
  expect_dh<typename TypeParam::template Tree<3>>(rows, DhConvention::modified);
}

TEST(DenavitHartenberg, KnownPoses) {
  using Tree = icat::KinematicTree<double>;
  Tree arm({.joints = icat::dh_chain(puma<double>(), DhConvention::standard)});
  const icat::FrameId tip = arm.frame("link6");
  // Corke's qz and qr.
  EXPECT_LT((arm.pose(tip).translation() - icat::Vector3<double>(0.4521, -0.15005, 0.4318)).norm(),
            1e-12);
  EXPECT_LT((arm.pose(tip).linear() - icat::Matrix3<double>::Identity()).norm(), 1e-12);
  icat::Vector<double, 6> ready;
  ready << 0, pi / 2, -pi / 2, 0, 0, 0;
  ASSERT_EQ(arm.update(ready), Status::ok);
  EXPECT_LT((arm.pose(tip).translation() - icat::Vector3<double>(0.0203, -0.15005, 0.8636)).norm(),
            1e-12);

  Tree franka({.joints = icat::dh_chain(panda<double>(), DhConvention::modified)});
  const icat::FrameId flange =
      franka.add_frame("flange", franka.frame("link7"), make_pose<double>(0, 0, 0.107, 0, 0, 0));
  EXPECT_LT((franka.pose(flange).translation() - icat::Vector3<double>(0.088, 0, 0.926)).norm(),
            1e-12);
  icat::Vector<double, 7> q;
  q << 0, -pi / 4, 0, -3 * pi / 4, 0, pi / 2, pi / 4;
  ASSERT_EQ(franka.update(q), Status::ok);
  // The maker's pose of readiness, 0.4869 m high at the fingers, which are 0.1034 m on.
  EXPECT_LT((franka.pose(flange).translation() - icat::Vector3<double>(0.3069, 0, 0.5903)).norm(),
            1e-4);
}

TEST(DenavitHartenberg, NamesLimitsAndRoot) {
  auto rows = puma<double>();
  rows[2].lower = -1;
  rows[2].upper = 0.5;
  rows[3].type = JointType::continuous;
  const auto joints = icat::dh_chain(rows, DhConvention::standard, "world");
  ASSERT_EQ(joints.size(), 6u);
  EXPECT_EQ(joints[0].parent, "world");
  EXPECT_EQ(joints[2].name, "joint3");
  EXPECT_EQ(joints[2].parent, "link2");
  EXPECT_EQ(joints[2].link, "link3");
  EXPECT_EQ(joints[2].lower, -1);
  EXPECT_EQ(joints[2].upper, 0.5);
  EXPECT_EQ(joints[3].type, JointType::continuous);
}

// The axes of a DH arm at q = 0 describe the same arm.
TYPED_TEST(KinematicTrees, AxesDescribeTheSameArmAsDenavitHartenberg) {
  using S = typename TypeParam::Scalar;
  using Tree = typename TypeParam::template Tree<6>;
  auto rows = puma<S>();
  rows[2].type = JointType::prismatic;
  Tree dh = chain<Tree>(icat::dh_chain(rows, DhConvention::standard));
  icat::SerialArm<S, 6> arm;
  for (Index i = 0; i < 6; ++i) {
    // Any point on the axis is good.
    arm.joints[static_cast<std::size_t>(i)] = {rows[static_cast<std::size_t>(i)].type, dh.axis(i),
                                               dh.axis_point(i) + S(0.3) * dh.axis(i)};
  }
  const icat::FrameId tip = dh.frame("link6");
  arm.end_effector = dh.pose(tip);
  Tree axes = chain<Tree>(icat::axes_chain(arm));
  const icat::FrameId end = axes.frame("end_effector");
  std::mt19937 rng(6);
  std::uniform_real_distribution<double> u(-3, 3);
  for (int k = 0; k < 20; ++k) {
    icat::Vector<S, 6> q;
    for (Index i = 0; i < 6; ++i) q(i) = S(u(rng));
    ASSERT_EQ(dh.update(q), Status::ok);
    ASSERT_EQ(axes.update(q), Status::ok);
    EXPECT_LT((dh.pose(tip).matrix() - axes.pose(end).matrix()).norm(), roundings<S>(200));
    EXPECT_LT((dh.jacobian(tip) - axes.jacobian(end)).norm(), roundings<S>(200));
  }
}

// --- frames --------------------------------------------------------------------------------------

TYPED_TEST(KinematicTrees, FramesCanBeAddedAndMoved) {
  using S = typename TypeParam::Scalar;
  using Tree = typename TypeParam::template Tree<20>;
  Tree robot = make_torso<Tree>();
  const Index links = robot.frame_count();
  const auto tool = make_pose<S>(0.1, 0.2, 0.3, 0.4, 0.5, 0.6);
  const auto tip = make_pose<S>(0, 0, 0.2, -1, 0.1, 0);
  const icat::FrameId a = robot.add_frame("tool", robot.frame("left_hand"), tool);
  const icat::FrameId b = robot.add_frame("tip", a, tip);
  EXPECT_EQ(robot.frame_count(), links + 2);
  EXPECT_EQ(robot.frame("tip"), b);
  EXPECT_EQ(robot.frame_name(b), "tip");
  place(robot, testing_support::random_tree_states(robot, 1, 7)[0]);
  const auto at = [&](const char* name) { return robot.pose(robot.frame(name)); };
  EXPECT_LT((at("tip").matrix() - (at("left_hand") * tool * tip).matrix()).norm(),
            roundings<S>(60));
  const auto before = robot.jacobian(b);

  // To another link, without an update in between.
  ASSERT_EQ(robot.set_frame(b, robot.frame("right_hand"), tool), Status::ok);
  EXPECT_LT((at("tip").matrix() - (at("right_hand") * tool).matrix()).norm(), roundings<S>(60));
  const icat::FrameId other = robot.add_frame("other", robot.frame("right_hand"), tool);
  EXPECT_EQ(robot.jacobian(b), robot.jacobian(other));
  EXPECT_NE(robot.jacobian(b), before);

  // Refused: it stays.
  const icat::Pose<S> stays = robot.pose(b);
  auto bad = tool;
  bad.translation().x() = S(nan);
  EXPECT_EQ(robot.set_frame(b, a, bad), Status::non_finite);
  bad = tool;
  bad.linear() *= S(2);
  EXPECT_EQ(robot.set_frame(b, a, bad), Status::not_a_rotation);
  EXPECT_EQ(robot.pose(b).matrix(), stays.matrix());
  // On itself: a step from where it is.
  ASSERT_EQ(robot.set_frame(b, b, tip), Status::ok);
  EXPECT_LT((robot.pose(b).matrix() - (stays * tip).matrix()).norm(), roundings<S>(60));
}

// --- points of frames ----------------------------------------------------------------------------

TYPED_TEST(KinematicTrees, PointsOfFramesHaveExactJacobians) {
  using S = typename TypeParam::Scalar;
  using Tree = typename TypeParam::template Tree<20>;
  Tree robot = make_torso<Tree>();
  const icat::Vector3<S> point(S(0.2), S(-0.1), S(0.3));
  auto J = typename Tree::PointJacobian(3, robot.dof());
  for (const TreeState& s : testing_support::all_torso_states(robot, 3, 17)) {
    SCOPED_TRACE(s.name);
    for (const char* name : {"pelvis", "left4", "right3", "camera", "finger2"}) {
      SCOPED_TRACE(name);
      const icat::FrameId frame = robot.frame(name);
      const auto numeric = differentiate(robot, s, [&](const Tree& moved) {
        return Eigen::Matrix<S, Eigen::Dynamic, 1>(icat::point_position(moved, frame, point));
      });
      EXPECT_LT((icat::point_position(robot, frame, point) - robot.pose(frame) * point).norm(),
                roundings<S>(20));
      ASSERT_EQ(icat::point_jacobian(robot, frame, point, J), Status::ok);
      EXPECT_LT((J - numeric).norm(), difference_tolerance<S> * 4);
    }
  }
  // Into a part of something larger, and the same as that of a frame that was added.
  const icat::FrameId hand = robot.frame("left_hand");
  const icat::FrameId tip =
      robot.add_frame("tip", hand, icat::detail::make_pose<S>(icat::Matrix3<S>::Identity(), point));
  Eigen::Matrix<S, Eigen::Dynamic, Eigen::Dynamic> two =
      Eigen::Matrix<S, Eigen::Dynamic, Eigen::Dynamic>::Zero(6, 20);
  ASSERT_EQ(icat::point_jacobian(robot, hand, point, two.bottomRows(3)), Status::ok);
  EXPECT_LT((two.bottomRows(3) - robot.jacobian(tip).topRows(3)).norm(), roundings<S>(100));
  EXPECT_EQ(two.topRows(3).norm(), S(0));
  EXPECT_EQ(icat::point_jacobian(robot, hand, point, two), Status::wrong_size);
  EXPECT_EQ(icat::point_jacobian(robot, hand, point, two.topLeftCorner(3, 19)), Status::wrong_size);
  EXPECT_EQ(two.topRows(3).norm(), S(0));
}

TEST(KinematicTree, FramesThatAreRefused) {
  using Tree = icat::KinematicTree<double>;
  Tree robot({.joints = {icat::Joint<double>{"turn", "root", "link"}}});
  EXPECT_EQ(message_of([&] { (void)robot.frame("lnik"); }),
            "no frame 'lnik'; there are 'root', 'link'");
  (void)robot.add_frame("tool", robot.frame("link"), icat::Pose<double>::Identity());
  EXPECT_EQ(message_of([&] { (void)robot.frame("lnik"); }),
            "no frame 'lnik'; there are 'root', 'link', 'tool'");
  EXPECT_EQ(message_of([&] {
              (void)robot.add_frame("tool", robot.frame("root"), icat::Pose<double>::Identity());
            }),
            "KinematicTree: there is a frame 'tool' already");
  auto bad = icat::Pose<double>::Identity();
  bad.linear().setZero();
  EXPECT_EQ(message_of([&] { (void)robot.add_frame("lens", robot.frame("root"), bad); }),
            "KinematicTree: the pose of frame 'lens' is not finite or not a rotation");
  EXPECT_EQ(robot.frame_count(), 3);
}

// --- masses --------------------------------------------------------------------------------------

TYPED_TEST(KinematicTrees, TheCentreOfMassIsThatOfTheLinks) {
  using S = typename TypeParam::Scalar;
  using Tree = typename TypeParam::template Tree<20>;
  Tree robot = make_torso<Tree>();
  const auto masses = testing_support::torso_masses<S>();
  S total(0);
  for (const auto& m : masses) total += m.mass;
  EXPECT_NEAR(robot.mass(), total, roundings<S>(200));
  for (const TreeState& s : testing_support::all_torso_states(robot, 5, 8)) {
    SCOPED_TRACE(s.name);
    place(robot, s);
    icat::Vector3<S> sum = icat::Vector3<S>::Zero();
    for (const auto& m : masses) sum += m.mass * (robot.pose(robot.frame(m.link)) * m.center);
    EXPECT_LT((robot.center_of_mass() - sum / total).norm(), roundings<S>(60));
  }
}

TYPED_TEST(KinematicTrees, WithoutMassesTheCentreIsTheRootsOrigin) {
  using S = typename TypeParam::Scalar;
  using Tree = typename TypeParam::template Tree<20>;
  Tree robot({.joints = testing_support::torso_joints<S>(), .base = icat::Base<S>::free()});
  place(robot, testing_support::random_tree_states(robot, 1, 9)[0]);
  EXPECT_EQ(robot.mass(), S(0));
  EXPECT_EQ(robot.center_of_mass(), robot.pose(robot.base()).translation());
  EXPECT_EQ(robot.center_of_mass_jacobian(), robot.jacobian(robot.base()).template topRows<3>());
}

// --- what is refused -----------------------------------------------------------------------------

TYPED_TEST(KinematicTrees, BadStatesAreRefused) {
  using S = typename TypeParam::Scalar;
  using Tree = typename TypeParam::template Tree<20>;
  Tree robot = make_torso<Tree>();
  const auto states = testing_support::random_tree_states(robot, 2, 5);
  place(robot, states[0]);
  const icat::FrameId hand = robot.frame("left_hand");
  const icat::Pose<S> before = robot.pose(hand);
  const auto J = robot.jacobian(hand);
  const Eigen::Matrix<S, Eigen::Dynamic, 1> q = states[1].q.template cast<S>();
  const icat::Pose<S> base = states[1].base.template cast<S>();
  for (const double bad : {nan, double(INFINITY), -double(INFINITY)}) {
    auto positions = q;
    positions(2) = S(bad);
    EXPECT_EQ(robot.update(positions, base), Status::non_finite);
    EXPECT_EQ(robot.update(positions), Status::non_finite);
    auto pose = base;
    pose.translation().x() = S(bad);
    EXPECT_EQ(robot.update(q, pose), Status::non_finite);
    pose = base;
    pose.linear()(1, 2) = S(bad);
    EXPECT_EQ(robot.update(q, pose), Status::non_finite);
  }
  auto pose = base;
  pose.linear() *= S(2);
  EXPECT_EQ(robot.update(q, pose), Status::not_a_rotation);
  pose = base;
  pose.linear().col(0) *= S(-1);
  EXPECT_EQ(robot.update(q, pose), Status::not_a_rotation);
  pose.linear().setZero();
  EXPECT_EQ(robot.update(q, pose), Status::not_a_rotation);
  EXPECT_EQ(robot.update(q.head(13), base), Status::wrong_size);
  EXPECT_EQ(robot.update(Eigen::Matrix<S, 15, 1>::Zero(), base), Status::wrong_size);
  EXPECT_EQ(robot.pose(hand).matrix(), before.matrix());
  EXPECT_EQ(robot.jacobian(hand), J);
  EXPECT_EQ(robot.q(), states[0].q.template cast<S>());
}

TEST(KinematicTree, ConfigurationErrorsNameWhatIsAtFault) {
  using J = icat::Joint<double>;
  using Tree = icat::KinematicTree<double>;
  const auto text = [](std::vector<J> joints) {
    return message_of([&] { Tree({.joints = joints}); });
  };
  EXPECT_EQ(text({J{"a", "root", "one"}, J{"b", "rot", "two"}}),
            "KinematicTree: 'root' and 'rot' are both roots, or one of them is misspelt");
  EXPECT_EQ(message_of([&] {
              Tree({.joints = {J{"a", "root", "one"}}, .root = "base"});
            }),
            "KinematicTree: 'base' and 'root' are both roots, or one of them is misspelt");
  EXPECT_EQ(message_of([&] {
              Tree({.joints = {J{"a", "root", "one"}}, .root = "one"});
            }),
            "KinematicTree: 'one' and 'root' are both roots, or one of them is misspelt");
  EXPECT_EQ(text({J{"a", "one", "two"}, J{"b", "two", "one"}}),
            "KinematicTree: no link is the root: the joints form a loop, or a name is ''");
  EXPECT_EQ(text({J{"a", "root", "one"}, J{"b", "three", "two"}, J{"c", "two", "three"}}),
            "KinematicTree: not joined to the root 'root': the joints 'b', 'c'");
  EXPECT_EQ(text({J{"a", "root", "one"}, J{"b", "root", "one"}}),
            "KinematicTree: link 'one' has two parents");
  EXPECT_EQ(text({J{"a", "root", "one"}, J{"a", "root", "two"}}),
            "KinematicTree: two joints are called 'a'");
  // Fixed joints and mimics have names too: a mimic could follow the wrong one.
  EXPECT_EQ(text({J{"a", "root", "one"}, J{"a", "one", "two", JointType::fixed}}),
            "KinematicTree: two joints are called 'a'");
  EXPECT_EQ(text({}), "KinematicTree: there are no joints; name the root link by .root");
  EXPECT_EQ(message_of([&] { Tree({.joints = {}, .root = "rock"}); }),
            "KinematicTree: nothing can move");
  EXPECT_EQ(text({J{"weld", "root", "one", JointType::fixed}}), "KinematicTree: nothing can move");

  J joint{"hip", "root", "leg"};
  joint.axis = {0, 0, 2};
  EXPECT_EQ(text({joint}), "KinematicTree: joint 'hip': its axis must have length 1, got 2");
  joint.axis = {0, nan, 1};
  EXPECT_EQ(text({joint}), "KinematicTree: joint 'hip': its axis must have length 1, got nan");
  joint.type = JointType::fixed;  // then it has none
  EXPECT_EQ(text({joint}), "KinematicTree: nothing can move");

  joint = J{"hip", "root", "leg"};
  joint.lower = 1;
  joint.upper = -1;
  EXPECT_EQ(text({joint}), "KinematicTree: joint 'hip': limits must be in order, got [1, -1]");
  joint.upper = 1;
  EXPECT_EQ(text({joint}), "KinematicTree: joint 'hip': limits must be in order, got [1, 1]");
  joint.upper = nan;
  EXPECT_EQ(text({joint}), "KinematicTree: joint 'hip': limits must be in order, got [1, nan]");

  joint = J{"hip", "root", "leg"};
  joint.origin.linear() *= 2;
  EXPECT_EQ(text({joint}),
            "KinematicTree: joint 'hip': its origin is not finite or not a rotation");
  joint = J{"hip", "root", "leg"};
  joint.link_pose.translation().y() = nan;
  EXPECT_EQ(text({joint}),
            "KinematicTree: joint 'hip': its link's pose is not finite or not a rotation");
  for (const double bad : {0.0, -1.0, nan}) {
    joint = J{"hip", "root", "leg"};
    joint.max_velocity = bad;
    EXPECT_EQ(text({joint}),
              "KinematicTree: joint 'hip': limits of velocity and acceleration must be > 0");
    joint = J{"hip", "root", "leg"};
    joint.max_acceleration = bad;
    EXPECT_EQ(text({joint}),
              "KinematicTree: joint 'hip': limits of velocity and acceleration must be > 0");
  }

  const J leader{"lead", "root", "leg"};
  J follower{"follow", "leg", "foot"};
  follower.mimic = icat::Mimic<double>{"led"};
  EXPECT_EQ(text({leader, follower}),
            "KinematicTree: joint 'follow' follows 'led', which does not move");
  follower.mimic = icat::Mimic<double>{"follow"};
  EXPECT_EQ(text({leader, follower}),
            "KinematicTree: joint 'follow' follows 'follow', which does not move");
  follower.mimic = icat::Mimic<double>{"weld"};
  EXPECT_EQ(text({leader, follower, J{"weld", "root", "rail", JointType::fixed}}),
            "KinematicTree: joint 'follow' follows 'weld', which does not move");
  follower.mimic = icat::Mimic<double>{"lead", nan};
  EXPECT_EQ(text({leader, follower}), "KinematicTree: joint 'follow': its mimic is not finite");

  const auto massive = [&](icat::LinkMass<double> mass) {
    return message_of([&] { Tree({.joints = {leader}, .masses = {mass}}); });
  };
  for (const double bad : {-1.0, nan, double(INFINITY)}) {
    EXPECT_EQ(massive({"leg", bad, {0, 0, 0}}),
              "KinematicTree: the mass of link 'leg' must be finite and >= 0");
  }
  EXPECT_EQ(massive({"leg", 1, {0, nan, 0}}),
            "KinematicTree: the centre of mass of link 'leg' is not finite");
  EXPECT_EQ(massive({"arm", 1, {0, 0, 0}}), "no frame 'arm'; there are 'root', 'leg'");

  EXPECT_EQ(
      message_of([&] {
        icat::KinematicTree<double, 8>({.joints = {leader}, .base = icat::Base<double>::free()});
      }),
      "KinematicTree: 8 columns at compile time, but 1 joints and 6 columns of the base");
}

TEST(KinematicTree, JointNamesAreLookedUpAndListed) {
  const auto robot = make_torso<icat::KinematicTree<double>>();
  EXPECT_EQ(icat::joint_index(robot, "left2"), 3);
  EXPECT_EQ(icat::joint_columns(robot, {"neck", "lift"})[0], 12);
  EXPECT_EQ(icat::joint_columns(robot, {"neck", "lift"})[1], 0);
  EXPECT_EQ(icat::joint_columns(robot).size(), 14);
  const std::string text = message_of([&] { (void)icat::joint_index(robot, "elbow"); });
  EXPECT_EQ(text.substr(0, 48), "no joint 'elbow'; there are 'lift', 'waist', 'le") << text;
  EXPECT_EQ(text.substr(text.size() - 9), "'finger1'") << text;
}

// --- no allocation -------------------------------------------------------------------------------

TYPED_TEST(KinematicTrees, NothingAllocatesAfterConfiguration) {
#ifdef ICAT_TEST_NO_MALLOC_COUNT
  GTEST_SKIP() << "malloc belongs to the sanitizer";
#endif
  using S = typename TypeParam::Scalar;
  using Tree = typename TypeParam::template Tree<20>;
  Tree robot = make_torso<Tree>();
  const icat::FrameId tool =
      robot.add_frame("tool", robot.frame("left_hand"), make_pose<S>(0.1, 0, 0, 0, 0, 1));
  const auto s = testing_support::random_tree_states(robot, 1, 10)[0];
  const Eigen::Matrix<S, Eigen::Dynamic, 1> q = s.q.template cast<S>();
  const icat::Pose<S> base = s.base.template cast<S>();
  auto bad = base;
  bad.linear() *= S(2);
  typename Tree::PointJacobian of_point(3, robot.dof());
  S sum(0);
  Status refused = Status::ok, good = Status::not_started, point = Status::not_started;
  EXPECT_EQ(count_allocations([&] {
              good = robot.update(q, base);
              refused = robot.update(q, bad);
              if (robot.set_frame(tool, robot.base(), base) != Status::ok) return;
              for (Index f = 0; f < robot.frame_count(); ++f) {
                sum += robot.pose(icat::FrameId(f)).translation().x();
                sum += robot.jacobian(icat::FrameId(f))(0, 0);
              }
              const icat::Vector3<S> r(S(0.1), S(0.2), S(0.3));
              point = icat::point_jacobian(robot, tool, r, of_point);
              sum += icat::point_position(robot, tool, r).x() + of_point(0, 0);
              sum += robot.center_of_mass().x() + robot.center_of_mass_jacobian()(0, 0);
            }),
            0);
  EXPECT_EQ(good, Status::ok);
  EXPECT_EQ(refused, Status::not_a_rotation);
  EXPECT_EQ(point, Status::ok);
  EXPECT_TRUE(std::isfinite(sum));
}

}  // namespace
