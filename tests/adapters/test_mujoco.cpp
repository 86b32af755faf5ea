// SPDX-License-Identifier: BSD-3-Clause
// Models of MuJoCo as robots, against the same robot as a kinematic tree and against MuJoCo's own
// integration.
#include <icat/adapters/mujoco.hpp>
#include <icat/adapters/urdf.hpp>
#include <sstream>

#include "torso.hpp"

namespace {

using icat::MujocoRobot;
using icat::Status;

static_assert(icat::FramedRobot<MujocoRobot> && icat::JointedRobot<MujocoRobot> &&
              icat::MobileRobot<MujocoRobot> && icat::MassiveRobot<MujocoRobot>);

template <class V>
std::string text(const V& v) {
  std::ostringstream s;
  s.precision(17);
  for (Eigen::Index i = 0; i < v.size(); ++i) s << v(i) << ' ';
  return s.str();
}

// The bodies that hang on `parent`.
std::string bodies(const torso::Tree::Description& description, const std::string& parent) {
  std::ostringstream xml;
  xml.precision(17);
  for (const auto& joint : description.joints) {
    if (joint.parent != parent) continue;
    const Eigen::Quaterniond q(joint.origin.linear());
    xml << "<body name='" << joint.link << "' pos='" << text(joint.origin.translation())
        << "' quat='" << text(Eigen::Vector4d(q.w(), q.x(), q.y(), q.z())) << "'>\n";
    for (const auto& mass : description.masses) {
      if (mass.link != joint.link) continue;
      xml << "<inertial pos='" << text(mass.center) << "' mass='" << mass.mass
          << "' diaginertia='1 1 1'/>\n";
    }
    if (joint.type != icat::JointType::fixed) {
      const bool limited = joint.upper < icat::infinity<double>;
      xml << "<joint name='" << joint.name << "' type='"
          << (joint.type == icat::JointType::prismatic ? "slide" : "hinge") << "' axis='"
          << text(joint.axis) << "'";
      if (limited) xml << " limited='true' range='" << joint.lower << ' ' << joint.upper << "'";
      xml << "/>\n";
    }
    xml << "<site name='" << joint.link << " site' pos='0.1 0.2 0.3' euler='0.1 0.2 0.3'/>\n"
        << bodies(description, joint.link) << "</body>\n";
  }
  return xml.str();
}

std::string mjcf(const std::string& world) {
  return "<mujoco><compiler angle='radian' inertiafromgeom='false'/><worldbody>\n" + world +
         "</worldbody></mujoco>";
}
// A ball before and behind the robot, so that the robot is in the middle of every array.
std::string ball(const std::string& name) {
  return "<body name='" + name +
         "'><freejoint/><inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/></body>\n";
}
// MuJoCo wants a mass of what floats; the tree's root has none.
std::string floating(const torso::Tree::Description& description) {
  return "<body name='world_link'><freejoint/><inertial pos='0 0 0' mass='1e-14' diaginertia='1 1 "
         "1'/>\n" +
         bodies(description, "world_link") + "</body>\n";
}

using Model = std::unique_ptr<mjModel, void (*)(mjModel*)>;
Model compile(const std::string& xml) {
  mjVFS files;
  mj_defaultVFS(&files);
  mj_makeEmptyFileVFS(&files, "robot.xml", static_cast<int>(xml.size()));
  std::copy(xml.begin(), xml.end(), static_cast<char*>(files.filedata[0]));
  char error[1000] = "";
  Model model(mj_loadXML("robot.xml", &files, error, sizeof error), mj_deleteModel);
  mj_deleteVFS(&files);
  EXPECT_TRUE(model) << error << '\n' << xml;
  return model;
}

struct Mujoco : testing::Test {
  torso::Tree tree = icat::parse_urdf(torso::urdf, {.base = icat::Base<double>::free()});
  torso::Tree bolted = icat::parse_urdf(torso::urdf);
  torso::Tree::Description description =
      icat::detail::urdf_description<double>(torso::urdf, {}, "test");
  Model free_model = compile(mjcf(ball("first") + floating(description) + ball("last")));
  Model fixed_model =
      compile(mjcf("<body name='world_link'>" + bodies(description, "world_link") + "</body>"));
  MujocoRobot robot{*free_model, "world_link"};
  MujocoRobot fixed{*fixed_model};

  void SetUp() override {
    for (const auto& joint : tree.joints()) {
      robot.set_limits(joint.name, {.max_velocity = joint.max_velocity});
      fixed.set_limits(joint.name, {.max_velocity = joint.max_velocity});
    }
  }
  void move(MujocoRobot& to, const torso::State& s) {
    ASSERT_EQ(to.update(torso::positions(tree, to, s.q), s.base), Status::ok);
  }
};

TEST_F(Mujoco, PosesJacobiansAndTheCentreOfMassAreTheTrees) {
  torso::expect_same_joints(tree, robot);
  torso::expect_same_joints(bolted, fixed);
  EXPECT_EQ(robot.base_columns().first, 0);
  EXPECT_EQ(robot.base_columns().count, 6);
  EXPECT_EQ(fixed.base_columns().count, 0);
  EXPECT_EQ(robot.frame_name(robot.base()), "world_link");
  double worst = 0, center = 0;
  for (const auto& s : torso::states(tree, 50, 1)) {
    ASSERT_EQ(tree.update(s.q, s.base), Status::ok);
    move(robot, s);
    worst = std::max(worst, torso::difference(tree, robot));
    center = std::max(center, torso::center_difference(tree, robot));
  }
  for (const auto& s : torso::states(tree, 50, 2, false)) {
    ASSERT_EQ(bolted.update(s.q, s.base), Status::ok);
    move(fixed, s);
    worst = std::max(worst, torso::difference(bolted, fixed));
    center = std::max(center, torso::center_difference(bolted, fixed));
  }
  EXPECT_LT(worst, 1e-13);
  EXPECT_LT(center, 1e-13);
  std::printf("worst difference to the tree %.1e, of the centre of mass %.1e\n", worst, center);
}

TEST_F(Mujoco, SitesAreFrames) {
  const auto s = torso::states(tree, 1, 4)[0];
  ASSERT_EQ(tree.update(s.q, s.base), Status::ok);
  move(robot, s);
  icat::Pose<double> at = icat::Pose<double>::Identity();
  at.translation() << 0.1, 0.2, 0.3;
  at.linear() = (Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitX()) *
                 Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitY()) *
                 Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitZ()))
                    .toRotationMatrix();
  const auto mine = tree.add_frame("site", tree.frame("left_hand"), at);
  const auto other = robot.frame("left_hand site");
  EXPECT_LT((tree.pose(mine).matrix() - robot.pose(other).matrix()).norm(), 1e-14);
  EXPECT_LT(
      (tree.jacobian(mine) - torso::ordered(robot.jacobian(other), torso::columns(tree, robot)))
          .norm(),
      1e-14);
}

// ẏ is what MuJoCo integrates, and the state of a simulation is read.
TEST_F(Mujoco, JacobiansAreTheDerivativesOfMujocosIntegration) {
  std::unique_ptr<mjData, void (*)(mjData*)> simulation(mj_makeData(free_model.get()),
                                                        mj_deleteData);
  for (const auto& s : torso::states(tree, 10, 5)) {
    move(robot, s);
    const Eigen::VectorXd qpos =
        Eigen::Map<const Eigen::VectorXd>(robot.data().qpos, free_model->nq);
    torso::expect_derivatives(robot, robot.frame("left_tip"), [&](icat::Index j, double h) {
      Eigen::VectorXd qvel = Eigen::VectorXd::Zero(free_model->nv);
      move(robot, s);
      ASSERT_EQ(robot.write_qvel(Eigen::VectorXd::Unit(robot.dof(), j), qvel.data()), Status::ok);
      mju_copy(simulation->qpos, qpos.data(), free_model->nq);
      mj_integratePos(free_model.get(), simulation->qpos, qvel.data(), h);
      ASSERT_EQ(robot.update(*simulation), Status::ok);
    });
  }
  simulation->qpos[3] = NAN;
  EXPECT_EQ(robot.update(*simulation), Status::non_finite);
  Eigen::VectorXd qvel = Eigen::VectorXd::Constant(free_model->nv, 5);
  EXPECT_EQ(robot.write_qvel(Eigen::VectorXd::Zero(3), qvel.data()), Status::wrong_size);
  EXPECT_EQ(robot.write_qvel(Eigen::VectorXd::Constant(robot.dof(), NAN), qvel.data()),
            Status::non_finite);
  EXPECT_EQ(robot.write_qvel(Eigen::VectorXd::Zero(robot.dof()), qvel.data()), Status::ok);
  EXPECT_EQ(qvel.head(6), Eigen::VectorXd::Constant(6, 5));  // of the first ball
  EXPECT_EQ(qvel.tail(6), Eigen::VectorXd::Constant(6, 5));
  EXPECT_EQ(qvel.segment(6, robot.dof()), Eigen::VectorXd::Zero(robot.dof()));
}

TEST_F(Mujoco, AsThePageShows) {
  const Model model = compile(mjcf(ball("first") + floating(description)));
  std::unique_ptr<mjData, void (*)(mjData*)> data(mj_makeData(model.get()), mj_deleteData);
  const Eigen::VectorXd velocity = Eigen::VectorXd::Ones(robot.dof());
  //! [robot]
  icat::MujocoRobot torso(*model, "world_link");  // the part of the scene below this body
  icat::Status status = torso.update(*data);      // the state of a simulation
  status = torso.write_qvel(velocity, data->qvel);
  //! [robot]
  EXPECT_EQ(status, Status::ok);
  EXPECT_EQ(data->qvel[5], 0);
  EXPECT_EQ(data->qvel[11], 1);
}

TEST_F(Mujoco, TheSameTasksGiveTheSameVelocities) {
  torso::expect_same_velocities(
      bolted, fixed, [&](MujocoRobot& r, const auto& s) { move(r, s); }, false);
  torso::expect_same_velocities(
      tree, robot, [&](MujocoRobot& r, const auto& s) { move(r, s); }, true);
}

TEST_F(Mujoco, BadInputIsRefusedAndNothingAllocates) {
  torso::expect_refusals_and_no_allocation(robot);
  const auto s = torso::states(tree, 1, 3)[0];
  EXPECT_EQ(fixed.update(s.q, s.base), Status::out_of_range);  // it cannot be there
}

TEST_F(Mujoco, WhatIsRefusedAndHow) {
  const auto refusal = [](const mjModel& model, const std::string& root) {
    try {
      MujocoRobot refused(model, root);
    } catch (const std::invalid_argument& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  EXPECT_EQ(refusal(*free_model, "world"),
            "MujocoRobot: body 'world_link' floats and is not all that moves: say which body is "
            "the root of the robot, as in MujocoRobot(model, \"world_link\")");
  EXPECT_NE(refusal(*free_model, "robot").find("no body 'robot'; there are 'world', 'first', "),
            std::string::npos);
  EXPECT_EQ(refusal(*free_model, "trunk"),
            "MujocoRobot: body 'trunk' hangs on 'world_link', not on the world");
  // A ball first, then what is bolted down.
  const Model before = compile(mjcf(ball("ball") + "<body name='world_link'>" +
                                    bodies(description, "world_link") + "</body>"));
  EXPECT_NE(refusal(*before, "world").find("body 'ball' floats and is not all that moves"),
            std::string::npos);
  const MujocoRobot named(*before, "world_link");
  EXPECT_EQ(named.dof(), 6);
  EXPECT_EQ(named.frame_name(named.base()), "world_link");
  const Model balls = compile(
      mjcf("<body name='arm'><joint name='shoulder' type='ball'/><inertial pos='0 0 0' mass='1' "
           "diaginertia='1 1 1'/></body>"));
  EXPECT_EQ(refusal(*balls, "world"),
            "MujocoRobot: joint 'shoulder' of body 'arm' is a ball: write it as three hinges");
  const Model still = compile(mjcf("<body name='table'/>"));
  EXPECT_EQ(refusal(*still, "world"), "MujocoRobot: nothing can move");
}

}  // namespace
