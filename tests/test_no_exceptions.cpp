// SPDX-License-Identifier: BSD-3-Clause
// Compiled without exceptions and run-time type information: the control step works, and an error
// of configuration ends in the user's handler.
#include <cstdio>
#include <cstdlib>
#include <icat/icat.hpp>
#include <icat/sim/kinematic_plant.hpp>
#include <string_view>

#if defined(__cpp_exceptions) || defined(__cpp_rtti)
#error "this test must be compiled with -fno-exceptions -fno-rtti"
#endif

namespace {

int fail(const char* what) {
  std::fprintf(stderr, "failed: %s\n", what);
  return 1;
}

[[noreturn]] void expected(const char* text) {
  std::fprintf(stderr, "%s\n", text);
  std::_Exit(
      std::string_view(text) == "task 'frame pose': gain must be finite and > 0, got -0.5" ? 0 : 1);
}

}  // namespace

int main() {
  using Robot = icat::KinematicTree<double, 13>;
  Robot robot = icat::uvms(icat::maris_arm<double>());
  icat::KinematicPlant<Robot> plant(robot, {.q = icat::Vector<double, 7>::Constant(-0.4)});
  if (robot.update(plant.q(), plant.base()) != icat::Status::ok) return fail("first update");
  const icat::FrameId hand = robot.frame("tool");
  icat::Pose<double> goal = robot.pose(hand);
  goal.translation().x() += 0.1;
  icat::task::JointLimits limits(robot, {.margin = 0.1, .gain = 0.5});
  icat::task::FramePose tool(robot, hand, goal, {.gain = 1.0});
  icat::Controller controller(robot, {{"reach", {{limits}, {tool}}}});
  icat::Status status = controller.switch_to("reach", 0.0, 1.0);
  for (int k = 0; k < 1000 && status == icat::Status::ok; ++k) {
    status = robot.update(plant.q(), plant.base());
    if (status == icat::Status::ok) status = controller.step(0.01 * k);
    plant.step(controller.command(), 0.01 * k, 0.01);
  }
  if (status != icat::Status::ok) return fail(icat::describe(status));
  if (!((robot.pose(hand).translation() - goal.translation()).norm() < 1e-3))
    return fail("no reach");
  if (controller.switch_to("no such action", 10.0, 1.0) != icat::Status::unknown_action) {
    return fail("an unknown action is refused");
  }

  icat::set_error_handler(expected);
  const icat::task::FramePose bad(robot, hand, goal, {.gain = -0.5});
  return fail("the handler was not called");
}
