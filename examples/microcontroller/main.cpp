// SPDX-License-Identifier: BSD-3-Clause
// icat on a microcontroller without operating system: `Tpik<float, 13>` solves recorded
// hierarchies, then the MARIS vehicle-arm reaches for a goal. All memory is taken at construction.
// The file is the same for the host and for the target; it prints every velocity bit by bit.
#include <algorithm>
#include <array>
#include <bit>
#include <icat/icat.hpp>
#include <icat/sim/kinematic_plant.hpp>
#include <memory>

#include "board.hpp"
#include "recorded.hpp"

namespace {

#ifndef SCALAR
#define SCALAR float
#endif
using Scalar = SCALAR;  // the host runs double, too: it shows what float loses
using Robot = icat::KinematicTree<Scalar, 13>;
using Solver = icat::Tpik<Scalar, 13>;
using Velocity = icat::Vector<Scalar, 13>;

// --- output --------------------------------------------------------------------------------------

/// The bits of each component, in hexadecimal.
void print(const char* what, int index, const Velocity& velocity) {
  board::print(what);
  board::print(" ");
  board::print(static_cast<std::uint32_t>(index));
  for (const Scalar x : velocity) {
    board::print(" ");
    board::print(std::bit_cast<std::uint32_t>(static_cast<float>(x)), 16);
  }
  board::print("\n");
}

/// Median and maximum of counted instructions.
template <std::size_t N>
void print_counts(const char* median, const char* maximum, std::array<std::uint32_t, N>& counts) {
  std::sort(counts.begin(), counts.end());
  board::print_figure(median, counts[N / 2]);
  board::print_figure(maximum, counts.back());
}

void require(icat::Status status) {
  if (status != icat::Status::ok) board::fail(icat::describe(status));
}

// --- the recorded hierarchies --------------------------------------------------------------------

Solver::Options solver_options() {
  Velocity limit = Velocity::Constant(Scalar(0.5));  // rad/s, m/s
  limit.tail<3>().setConstant(Scalar(0.4));          // rad/s, of the vehicle
  return {.bounds = {-limit, limit}};
}

icat::Status solve(Solver& tpik, int hierarchy) {
  using Rows = Eigen::Matrix<float, Eigen::Dynamic, 13, Eigen::RowMajor>;
  using Column = Eigen::Matrix<float, Eigen::Dynamic, 1>;
  const float* jacobian = recorded::jacobians[hierarchy];
  const float* activation = recorded::activations[hierarchy];
  const float* reference = recorded::references[hierarchy];
  tpik.reset();
  icat::Status status = icat::Status::ok;
  for (const int rows : recorded::level_rows) {
    if (status == icat::Status::ok) {
      status = tpik.add_level(Eigen::Map<const Rows>(jacobian, rows, 13).cast<Scalar>(),
                              Eigen::Map<const Column>(activation, rows).cast<Scalar>(),
                              Eigen::Map<const Column>(reference, rows).cast<Scalar>());
    }
    jacobian += 13 * rows;
    activation += rows;
    reference += rows;
  }
  const icat::Status closing = tpik.minimize_velocity();
  return status == icat::Status::ok ? closing : status;
}

// --- the control cycle ---------------------------------------------------------------------------

/// Vehicle and arm reach for a goal 1.6 m away.
struct Reach {
  Robot robot;
  icat::KinematicPlant<Robot> plant;
  icat::task::JointLimits<Robot> limits;
  icat::task::FramePose<Robot> tool;
  icat::task::Minimality<Robot> still_vehicle;
  icat::Controller<Robot> controller;

  Reach()
      : robot(icat::uvms(icat::maris_arm<Scalar>(), {.arm = icat::maris_arm_mount<Scalar>()})),
        plant(robot, {.q = icat::Vector<Scalar, 7>::Constant(Scalar(-0.4))}),
        limits(robot, {.margin = Scalar(0.1), .gain = Scalar(0.5)}),
        tool(robot, robot.frame("tool"), goal(), {.gain = Scalar(0.5)}),
        still_vehicle(robot, robot.base_columns()),
        controller(robot, {{"reach", {{limits}, {tool}, {still_vehicle}}}},
                   {.solver = solver_options()}) {}

  icat::Pose<Scalar> goal() {
    require(robot.update(plant.q(), plant.base()));
    icat::Pose<Scalar> goal = robot.pose(robot.frame("tool"));
    goal.translation() += icat::Vector3<Scalar>(Scalar(1.5), Scalar(-0.5), Scalar(0.3));
    return goal;
  }
};

}  // namespace

int main() {
#if !defined(__cpp_exceptions)
  icat::set_error_handler(board::fail);
#endif
  constexpr int cycles = 400;
  constexpr double dt = 0.01;  // s

  // Construction: all memory is taken here.
  const auto tpik = std::make_unique<Solver>(solver_options());
  const auto reach = std::make_unique<Reach>();
  static std::array<std::uint32_t, recorded::count> solve_counts;
  static std::array<std::uint32_t, cycles> cycle_counts;
  require(reach->controller.switch_to("reach", 0, 1));  // fades in over 1 s
  board::lock_memory();

  constexpr std::uint32_t known = 2'000'000;
  const std::uint32_t begin = board::now();
  board::run_instructions(known);
  board::print_figure("known", known);
  board::print_figure("counted", board::elapsed(begin));

  for (int i = 0; i < recorded::count; ++i) {
    const std::uint32_t start = board::now();
    const icat::Status status = solve(*tpik, i);
    solve_counts[static_cast<std::size_t>(i)] = board::elapsed(start);
    require(status);
    print("solve", i, tpik->velocity());
  }

  for (int i = 0; i < cycles; ++i) {
    auto& [robot, plant, limits, tool, still_vehicle, controller] = *reach;
    const double t = dt * i;
    const std::uint32_t start = board::now();
    icat::Status status = robot.update(plant.q(), plant.base());
    if (status == icat::Status::ok) status = controller.step(t);
    cycle_counts[static_cast<std::size_t>(i)] = board::elapsed(start);
    require(status);
    print("cycle", i, controller.velocity());
    plant.step(controller.command(), t, dt);
  }

  print_counts("solve_median", "solve_maximum", solve_counts);
  print_counts("cycle_median", "cycle_maximum", cycle_counts);
  board::print_figure("recorded", sizeof recorded::jacobians + sizeof recorded::activations +
                                      sizeof recorded::references);
  board::print_figure("solver", sizeof(Solver));
  board::print_figure("controller", sizeof(icat::Controller<Robot>));
  board::print_memory();
  board::finish();
}
