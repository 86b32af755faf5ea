// SPDX-License-Identifier: BSD-3-Clause
// Pinocchio as the judge of what urdf.hpp reads, and models of Pinocchio as robots. In a project of
// its own, which is a user's: Pinocchio has Eigen and a urdfdom of its own in its interface.
#include <fstream>
#include <icat/adapters/pinocchio.hpp>
#include <icat/adapters/urdf.hpp>
#include <iterator>
#include <pinocchio/algorithm/joint-configuration.hpp>
#include <pinocchio/parsers/urdf.hpp>

#include "../robot_data.hpp"
#include "../torso.hpp"

namespace {

using icat::Status;
using Robot = icat::PinocchioRobot<double>;

static_assert(icat::FramedRobot<Robot> && icat::JointedRobot<Robot> && icat::MobileRobot<Robot> &&
              icat::MassiveRobot<Robot>);

pinocchio::Model model_of(const std::string& xml, bool free = false, bool mimics = true) {
  pinocchio::Model model;
  if (free) {
    pinocchio::urdf::buildModelFromXML(xml, pinocchio::JointModelFreeFlyer(), model, false, mimics);
  } else {
    pinocchio::urdf::buildModelFromXML(xml, model, false, mimics);
  }
  return model;
}
std::string content(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

// Pinocchio's parser knows a mimic only after its leader, which stands later in some files. Then
// the judge is Pinocchio without mimics, and a follower's position and column are coupled here.
struct Follower {
  std::string name, leader;
  double multiplier, offset;
};
struct Judge {
  pinocchio::Model model;
  std::vector<Follower> followers;

  Judge(const std::string& text, bool free) {
    try {
      model = model_of(text, free);
    } catch (const std::invalid_argument&) {
      model = model_of(text, free, false);
      const auto parsed = urdf::parseURDF(text);
      for (const auto& [name, joint] : parsed->joints_) {
        if (!joint->mimic || joint->type == urdf::Joint::FIXED) continue;
        const auto& mimic = *joint->mimic;
        followers.push_back({name, mimic.joint_name, mimic.multiplier, mimic.offset});
      }
    }
  }
  void set(Eigen::VectorXd& q, const std::string& name, double position) const {
    const auto joint = model.getJointId(name);
    const auto first = model.idx_qs[joint];
    q(first) = model.nqs[joint] == 2 ? std::cos(position) : position;
    if (model.nqs[joint] == 2) q(first + 1) = std::sin(position);
    for (const auto& f : followers) {
      if (f.leader == name) set(q, f.name, f.multiplier * position + f.offset);
    }
  }
  Eigen::VectorXd column(const Eigen::MatrixXd& J, const std::string& name) const {
    Eigen::VectorXd column = J.col(model.idx_vs[model.getJointId(name)]);
    for (const auto& f : followers) {
      if (f.leader == name) column += f.multiplier * this->column(J, f.name);
    }
    return column;
  }
};

// Every link of every file, with Pinocchio's own functions: no line of pinocchio.hpp takes part.
// The snapshot was written by test_urdf, whose urdfdom is another.
TEST(Pinocchio, AgreesOnEveryLinkOfExampleRobotData) {
  const auto files = robot_data::files(ICAT_ROBOT_DATA);
  if (files.empty()) GTEST_SKIP() << "no example-robot-data (scripts/test.sh installs it)";
  EXPECT_EQ(files.size(), 69u);
  std::ifstream snapshot(ICAT_SNAPSHOT, std::ios::binary);
  EXPECT_TRUE(snapshot) << "test_urdf writes " << ICAT_SNAPSHOT;
  std::mt19937 generator(1);
  double worst_pose = 0, worst_jacobian = 0, worst_snapshot = 0;
  std::size_t compared = 0, links = 0, mimics = 0, coupled = 0;
  for (const auto& file : files) {
    if (robot_data::refused().contains(file)) continue;
    SCOPED_TRACE(file);
    const std::string path = std::string(ICAT_ROBOT_DATA) + "/" + file;
    const auto options = robot_data::options(file);
    auto tree = icat::load_urdf<double>(path, options);
    const bool free = options.base.columns() > 0;
    const Judge judge(content(path), free);
    const pinocchio::Model& model = judge.model;
    pinocchio::Data data(model);
    ASSERT_EQ(model.nv - static_cast<int>(judge.followers.size()), tree.dof());
    mimics += model.mimicking_joints.size() + judge.followers.size();
    coupled += judge.followers.empty() ? 0 : 1;
    links += static_cast<std::size_t>(tree.frame_count());
    ++compared;

    const auto here = robot_data::snapshot(tree);
    std::vector<double> there(here.size());
    snapshot.read(reinterpret_cast<char*>(there.data()),
                  static_cast<std::streamsize>(there.size() * sizeof(double)));
    ASSERT_TRUE(snapshot);
    for (std::size_t i = 0; i < here.size(); ++i) {
      worst_snapshot = std::max(worst_snapshot, std::abs(here[i] - there[i]));
    }

    std::vector<pinocchio::FrameIndex> frames;
    for (icat::Index f = 0; f < tree.frame_count(); ++f) {
      frames.push_back(model.getFrameId(tree.frame_name(icat::FrameId(f)), pinocchio::BODY));
      ASSERT_LT(frames.back(), model.frames.size()) << tree.frame_name(icat::FrameId(f));
    }
    Eigen::MatrixXd J(6, model.nv);
    for (int k = 0; k < 100; ++k) {
      const Eigen::VectorXd at = robot_data::random_positions(tree, generator);
      icat::Pose<double> base = icat::Pose<double>::Identity();
      Eigen::VectorXd q = pinocchio::neutral(model);
      if (free) {
        base.linear() = icat::rotation_exp<double>(Eigen::Vector3d::Random());
        base.translation().setRandom();
        q << base.translation(), Eigen::Quaterniond(base.linear()).coeffs();
      }
      for (std::size_t i = 0; i < tree.joints().size(); ++i) {
        judge.set(q, tree.joints()[i].name, at(static_cast<Eigen::Index>(i)));
      }
      ASSERT_EQ(tree.update(at, base), Status::ok);
      pinocchio::computeJointJacobians(model, data, q);
      pinocchio::updateFramePlacements(model, data);
      for (icat::Index f = 0; f < tree.frame_count(); ++f) {
        const auto frame = frames[static_cast<std::size_t>(f)];
        const Eigen::Matrix4d pose = tree.pose(icat::FrameId(f)).matrix();
        worst_pose = std::max(worst_pose,
                              (pose - data.oMf[frame].toHomogeneousMatrix()).cwiseAbs().maxCoeff());
        J.setZero();
        pinocchio::getFrameJacobian(model, data, frame, pinocchio::LOCAL_WORLD_ALIGNED, J);
        const auto& mine = tree.jacobian(icat::FrameId(f));
        const auto compare = [&](Eigen::Index c, const Eigen::VectorXd& column) {
          worst_jacobian = std::max(worst_jacobian, (column - mine.col(c)).cwiseAbs().maxCoeff());
        };
        for (const auto& joint : tree.joints()) {
          compare(joint.column, judge.column(J, joint.name));
        }
        for (Eigen::Index c = 0; c < tree.base_columns().count; ++c) {
          compare(tree.base_columns().first + c, J.col(c));
        }
      }
    }
  }
  EXPECT_EQ(compared + robot_data::refused().size(), files.size());
  EXPECT_LT(worst_pose, 1e-10);
  EXPECT_LT(worst_jacobian, 1e-10);
  EXPECT_LT(worst_snapshot, 1e-10);
  std::printf(
      "%zu files, %zu links, %zu mimics (coupled by hand in %zu files), 100 states each: "
      "worst pose %.1e, Jacobian %.1e; between the versions of urdfdom %.1e\n",
      compared, links, mimics, coupled, worst_pose, worst_jacobian, worst_snapshot);
}

// The same of the adapter, mimics and all.
TEST(Pinocchio, ModelsAreTheTreesForEveryFileOfExampleRobotData) {
  std::mt19937 generator(2);
  double worst = 0, center = 0;
  int compared = 0;
  for (const auto& file : robot_data::files(ICAT_ROBOT_DATA)) {
    if (robot_data::refused().contains(file)) continue;
    SCOPED_TRACE(file);
    const std::string text = content(std::string(ICAT_ROBOT_DATA) + "/" + file);
    auto tree = icat::parse_urdf<double>(text, {.base = icat::Base<double>::free()});
    const Judge judge(text, true);
    if (!judge.followers.empty()) continue;  // Pinocchio has no model of it with mimics
    ++compared;
    Robot robot(judge.model);
    torso::expect_same_joints(tree, robot);
    for (int k = 0; k < 3; ++k) {
      const Eigen::VectorXd q = robot_data::random_positions(tree, generator);
      const auto base = torso::states(tree, 1, static_cast<unsigned>(k))[0].base;
      ASSERT_EQ(tree.update(q, base), Status::ok);
      ASSERT_EQ(robot.update(torso::positions(tree, robot, q), base), Status::ok);
      worst = std::max(worst, torso::difference(tree, robot));
      if (tree.mass() > 0) center = std::max(center, torso::center_difference(tree, robot));
    }
  }
  EXPECT_LT(worst, 1e-10);
  EXPECT_LT(center, 1e-10);
  std::printf("%d files: worst difference to the tree %.1e, of the centre of mass %.1e\n", compared,
              worst, center);
}

struct PinocchioTorso : testing::Test {
  torso::Tree tree = icat::parse_urdf(torso::urdf, {.base = icat::Base<double>::free()});
  torso::Tree bolted = icat::parse_urdf(torso::urdf);
  Robot robot{model_of(torso::urdf, true)};
  Robot fixed{model_of(torso::urdf)};

  void move(Robot& to, const torso::State& s) {
    ASSERT_EQ(to.update(torso::positions(tree, to, s.q), s.base), Status::ok);
  }
};

TEST_F(PinocchioTorso, IsTheTree) {
  torso::expect_same_joints(tree, robot);
  torso::expect_same_joints(bolted, fixed);
  EXPECT_EQ(robot.base_columns().first, 0);
  EXPECT_EQ(robot.base_columns().count, 6);
  EXPECT_EQ(fixed.base_columns().count, 0);
  EXPECT_EQ(fixed.frame_name(fixed.base()), "universe");
  double worst = 0;
  for (const auto& s : torso::states(tree, 50, 1)) {
    ASSERT_EQ(tree.update(s.q, s.base), Status::ok);
    move(robot, s);
    worst =
        std::max({worst, torso::difference(tree, robot), torso::center_difference(tree, robot)});
  }
  for (const auto& s : torso::states(tree, 50, 2, false)) {
    ASSERT_EQ(bolted.update(s.q, s.base), Status::ok);
    move(fixed, s);
    worst = std::max(
        {worst, torso::difference(bolted, fixed), torso::center_difference(bolted, fixed)});
  }
  EXPECT_LT(worst, 1e-13);
  std::printf("worst difference to the tree %.1e\n", worst);
}

TEST_F(PinocchioTorso, AsThePageShows) {
  const std::string text = torso::urdf;
  const auto [q, base_pose] = torso::states(robot, 1, 1)[0];
  //! [robot]
  pinocchio::Model model;
  pinocchio::urdf::buildModelFromXML(text, pinocchio::JointModelFreeFlyer(), model);
  icat::PinocchioRobot<double> torso(model);
  torso.set_limits("left_elbow", {.max_acceleration = 5});  // not in the model
  icat::Status status = torso.update(q, base_pose);
  //! [robot]
  EXPECT_EQ(status, Status::ok);
}

TEST_F(PinocchioTorso, TheSameTasksGiveTheSameVelocities) {
  torso::expect_same_velocities(
      bolted, fixed, [&](Robot& r, const auto& s) { move(r, s); }, false);
  torso::expect_same_velocities(
      tree, robot, [&](Robot& r, const auto& s) { move(r, s); }, true);
}

TEST_F(PinocchioTorso, BadInputIsRefusedAndNothingAllocates) {
  torso::expect_refusals_and_no_allocation(robot);
  const auto s = torso::states(tree, 1, 3)[0];
  EXPECT_EQ(fixed.update(s.q, s.base), Status::out_of_range);  // it cannot be there
  const icat::FrameId tip = robot.frame("left_tip");
  const Eigen::Matrix4d before = robot.pose(tip).matrix();
  Eigen::VectorXd q = robot.configuration();
  q(3) += 0.5;
  EXPECT_EQ(robot.update_configuration(q), Status::not_a_rotation);
  q(3) = NAN;
  EXPECT_EQ(robot.update_configuration(q), Status::non_finite);
  EXPECT_EQ(robot.update_configuration(s.q), Status::wrong_size);
  EXPECT_EQ(robot.pose(tip).matrix(), before);
  // Rounding is taken out, also of the robot's own configuration.
  q = robot.configuration();
  q.segment(3, 4) *= 1.0001;
  EXPECT_EQ(robot.update_configuration(q), Status::ok);
  EXPECT_EQ(robot.update_configuration(robot.configuration()), Status::ok);
  EXPECT_LT((robot.pose(tip).matrix() - before).norm(), 1e-14);
}

// ẏ is the velocity that Pinocchio integrates, and its configurations are read.
void expect_derivatives(Robot& robot) {
  const Eigen::VectorXd q = robot.configuration();
  torso::expect_derivatives(
      robot, icat::FrameId(robot.frame_count() - 1), [&](icat::Index j, double h) {
        const Eigen::VectorXd step = h * Eigen::VectorXd::Unit(robot.dof(), j);
        ASSERT_EQ(robot.update_configuration(pinocchio::integrate(robot.model(), q, step)),
                  Status::ok);
      });
}
TEST_F(PinocchioTorso, JacobiansAreTheDerivativesOfPinocchiosIntegration) {
  for (const auto& s : torso::states(tree, 10, 5)) {
    move(robot, s);
    expect_derivatives(robot);
  }
}

// A model built by hand: a planar base that does not stand at the origin, and joints that URDF does
// not have.
TEST(PinocchioRobot, PlanarBase) {
  pinocchio::Model model;
  const pinocchio::SE3 placement = pinocchio::SE3::Random();
  auto joint = model.addJoint(0, pinocchio::JointModelPlanar(), placement, "platform");
  model.appendBodyToJoint(joint, pinocchio::Inertia::Random());
  joint = model.addJoint(joint, pinocchio::JointModelRUBX(), pinocchio::SE3::Random(), "turn");
  joint = model.addJoint(joint, pinocchio::JointModelHZ(0.2), pinocchio::SE3::Random(), "screw");
  model.addFrame(pinocchio::Frame("tip", joint, pinocchio::SE3::Random(), pinocchio::OP_FRAME));
  Robot robot(model);
  ASSERT_EQ(robot.dof(), 5);
  EXPECT_EQ(robot.base_columns().first, 0);
  EXPECT_EQ(robot.base_columns().count, 3);
  EXPECT_EQ(robot.frame_name(robot.base()), "platform");
  EXPECT_TRUE(robot.joints()[0].continuous);
  EXPECT_EQ(robot.joints()[0].column, 3);

  icat::Pose<double> on_plane = icat::Pose<double>::Identity();
  on_plane.translation() << 0.7, -0.3, 0;
  on_plane.linear() = icat::axis_rotation<double>(Eigen::Vector3d::UnitZ(), 2.5);
  const icat::Pose<double> root(placement.toHomogeneousMatrix());
  ASSERT_EQ(robot.update(Eigen::Vector2d(0.4, -0.8), root * on_plane), Status::ok);
  EXPECT_LT((robot.pose(robot.base()).matrix() - (root * on_plane).matrix()).norm(), 1e-14);
  EXPECT_EQ(robot.position(0), 0.4);
  expect_derivatives(robot);
  EXPECT_NEAR(robot.position(0), 0.4, 2e-6);  // also from cosine and sine
  // The base's columns are its twist on itself.
  ASSERT_EQ(robot.update(Eigen::Vector2d(0.4, -0.8), root * on_plane), Status::ok);
  const Eigen::MatrixXd J = robot.jacobian(robot.base()).leftCols(3);
  const Eigen::Matrix3d R = robot.pose(robot.base()).linear();
  Eigen::MatrixXd twist(6, 3);
  twist << R * robot.base_motion().topRows(3), R * robot.base_motion().bottomRows(3);
  EXPECT_LT((J - twist).norm(), 1e-14);
  on_plane.translation().z() = 0.01;
  EXPECT_EQ(robot.update(Eigen::Vector2d(0, 0), root * on_plane), Status::out_of_range);
}

// The measure of a frame that mimics move is that of the tree, with its gradient.
TEST(PinocchioRobot, ManipulabilityWithMimics) {
  std::string xml = "<robot name='arm'><link name='link0'/>";
  for (int i = 1; i <= 6; ++i) {
    const std::string number = std::to_string(i), before = std::to_string(i - 1);
    const std::string mimic = i == 3   ? "<mimic joint='joint1' multiplier='-0.7' offset='0.2'/>"
                              : i == 5 ? "<mimic joint='joint2' multiplier='0.5'/>"
                                       : "";
    xml +=
        "<link name='link" + number + "'/><joint name='joint" + number + "' type='" +
        (i == 5 ? "prismatic" : "revolute") + "'><parent link='link" + before +
        "'/><child link='link" + number + "'/><origin xyz='0.3 0.1 -0.2' rpy='0." + number +
        " 0.7 -0.3'/><axis xyz='0 0.6 0.8'/><limit lower='-2' upper='2' velocity='1' effort='1'/>" +
        mimic + "</joint>";
  }
  xml += "</robot>";
  torso::Tree tree = icat::parse_urdf(xml, {.base = icat::Base<double>::free()});
  Robot robot(model_of(xml, true));
  ASSERT_EQ(robot.joints().size(), 4u);
  const auto map = torso::columns(tree, robot);
  const auto objective = icat::Objective<double>::equal_to(1);
  icat::task::Manipulability<torso::Tree> expected(tree, tree.frame("link6"), objective);
  icat::task::Manipulability<Robot> mu(robot, robot.frame("link6"), objective);
  for (const auto& s : torso::states(tree, 20, 7)) {
    ASSERT_EQ(tree.update(s.q, s.base), Status::ok);
    ASSERT_EQ(robot.update(torso::positions(tree, robot, s.q), s.base), Status::ok);
    expected.update();
    mu.update();
    EXPECT_NEAR(mu.value(), expected.value(), 1e-12);
    EXPECT_LT((torso::ordered(mu.jacobian(), map) - expected.jacobian()).norm(), 1e-12);
    EXPECT_GT(mu.jacobian().norm(), 1e-3);
  }
}

TEST(PinocchioRobot, WhatIsRefusedAndHow) {
  const auto refusal = [](const pinocchio::Model& model) {
    try {
      Robot robot(model);
    } catch (const std::invalid_argument& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  const auto identity = pinocchio::SE3::Identity();
  EXPECT_EQ(refusal(pinocchio::Model()), "PinocchioRobot: nothing can move");
  pinocchio::Model ball;
  ball.addJoint(0, pinocchio::JointModelSpherical(), identity, "shoulder");
  EXPECT_EQ(
      refusal(ball),
      "PinocchioRobot: joint 'shoulder' is a JointModelSpherical: write it as joints with one "
      "degree of freedom");
  pinocchio::Model late;
  const auto first = late.addJoint(0, pinocchio::JointModelRX(), identity, "first");
  late.addJoint(first, pinocchio::JointModelFreeFlyer(), identity, "late");
  EXPECT_EQ(refusal(late),
            "PinocchioRobot: joint 'late' is a JointModelFreeFlyer, and not the first: only the "
            "root's may be");
}

}  // namespace
