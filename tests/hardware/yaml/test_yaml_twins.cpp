// SPDX-License-Identifier: BSD-3-Clause
// Missions of YAML files beside the same in C++.
#include <gtest/gtest.h>

#include "examples/01_grasp/mission.hpp"
#include "examples/05_urdf_arm/arm.hpp"
#include "examples/icat_run/run.hpp"

namespace {

const std::string examples = std::string(ICAT_ROOT) + "examples/";

std::string read(const std::string& path) {
  std::ifstream stream(path);
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

struct Velocities {
  std::vector<Eigen::VectorXd> velocity;
  std::vector<std::string> phases;
  icat::Status status;
};

Velocities run_yaml(icat::Configuration config) {
  run::Plant plant = run::make_plant(config);
  icat::PlantBackEnd back_end(config.robot(), plant);
  Velocities result;
  result.status = run::mission(
      config, back_end, [](double) {},
      [&](double, const auto&) {
        result.velocity.push_back(config.controller().velocity());
        const std::string phase(config.mission()->phase());
        if (result.phases.empty() || result.phases.back() != phase) result.phases.push_back(phase);
      });
  result.phases.emplace_back(config.mission()->phase());
  return result;
}

/// The largest difference over the first `count` cycles, and that the two move at all.
double largest_difference(const std::vector<Eigen::VectorXd>& a,
                          const std::vector<Eigen::VectorXd>& b, std::size_t count) {
  double largest = 0, fastest = 0;
  for (std::size_t k = 0; k < count; ++k) {
    largest = std::max(largest, (a[k] - b[k]).cwiseAbs().maxCoeff());
    fastest = std::max(fastest, a[k].cwiseAbs().maxCoeff());
  }
  EXPECT_GT(fastest, 0.1);
  return largest;
}

// The twin is of static size. 1e-12 is asked for; rounding of poses that are written otherwise
// (a turn by 180 degrees in place of two signs) gives some 1e-15, and the loop forgets it.
TEST(YamlTwins, Grasp) {
  const auto is = run_yaml(icat::load_yaml(examples + "01_grasp/mission.yaml"));
  const auto twin = grasp::run({});
  EXPECT_EQ(is.phases, (std::vector<std::string>{"navigate", "grasp", "lift", "lifted"}));
  EXPECT_EQ(twin.outcome, "lifted");
  ASSERT_EQ(is.velocity.size(), twin.samples.size());
  std::vector<Eigen::VectorXd> wanted;
  for (const auto& s : twin.samples) wanted.push_back(s.command);
  const double largest = largest_difference(is.velocity, wanted, wanted.size());
  std::printf("01_grasp: %zu cycles, largest difference %.2e\n", wanted.size(), largest);
  EXPECT_LT(largest, 1e-12);
}

// The variant with two parallel TPIKs in a current, until the conditions of its phases differ.
TEST(YamlTwins, GraspInACurrent) {
  std::string text = read(examples + "01_grasp/mission.yaml");
  const std::string controller = "controller:\n";
  text.replace(text.find(controller), controller.size(),
               "plant:\n  current: {velocity: [0.05, 0, 0], period: 10}\n"
               "controller:\n  kind: parallel\n");
  const auto is = run_yaml(icat::parse_yaml(text, examples + "01_grasp/text"));
  const auto twin = grasp::run({.current = true, .compensation = true});
  ASSERT_GT(twin.phases.size(), 1u);
  // The first phase ends alike.
  const std::size_t count = static_cast<std::size_t>(twin.phases[1].second / 0.01);
  ASSERT_GT(count, 1000u);
  std::vector<Eigen::VectorXd> wanted;
  for (const auto& s : twin.samples) wanted.push_back(s.command);
  ASSERT_GT(is.velocity.size(), count);
  const double largest = largest_difference(is.velocity, wanted, count);
  std::printf("01_grasp, current: %zu cycles, largest difference %.2e\n", count, largest);
  EXPECT_LT(largest, 1e-12);
}

// Both are of run-time size: bit for bit.
TEST(YamlTwins, UrdfArm) {
  const auto is = run_yaml(icat::load_yaml(examples + "05_urdf_arm/mission.yaml"));
  std::vector<Eigen::VectorXd> wanted;
  const icat::Status status =
      arm::run(examples + "05_urdf_arm/arm.urdf",
               [&](const arm::Cycle& cycle) { wanted.push_back(cycle.velocity); });
  EXPECT_EQ(status, icat::Status::ok);
  EXPECT_EQ(is.status, icat::Status::ok);
  EXPECT_EQ(is.phases.back(), "back");
  ASSERT_EQ(wanted.size(), 12000u);
  ASSERT_GE(is.velocity.size(), wanted.size());
  EXPECT_EQ(largest_difference(is.velocity, wanted, wanted.size()), 0);
}

}  // namespace
