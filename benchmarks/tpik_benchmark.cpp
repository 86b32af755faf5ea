// SPDX-License-Identifier: BSD-3-Clause
// The solver on the hierarchy of the reference mission's grasping action, beside a plain QR of the
// same rows: 13 degrees of freedom, 7, 1, 1, 1, 1, 6 and 6 rows, then the closing level.
#include <benchmark/benchmark.h>

#include <Eigen/QR>
#include <icat/icat.hpp>
#include <memory>
#include <vector>

namespace {

using Robot = icat::Uvms<double, 7>;
using Objective = icat::Objective<double>;

struct Grasp {
  Robot robot{Robot::Description{.arm = icat::maris_arm<double>(),
                                 .arm_mount = icat::maris_arm_mount<double>()}};
  std::vector<std::unique_ptr<icat::Task<Robot>>> tasks;

  Grasp() {
    icat::Vector<double, 7> q;
    q << 0, 0.7, 0, -1.8, 0, 1.1, 0;
    if (robot.update(q, icat::Pose<double>::Identity()) != icat::Status::ok) std::abort();
    icat::Pose<double> goal = robot.tool();
    goal.translation() += icat::Vector3<double>(0.2, 0.1, 0.1);
    using namespace icat::task;
    const auto add = [&](auto task) { tasks.push_back(std::move(task)); };
    add(std::make_unique<JointLimits<Robot>>(robot, JointLimits<Robot>::Options{.margin = 0.3}));
    add(std::make_unique<VehicleDistance<Robot>>(
        robot, VehicleDistance<Robot>::Options{.other = {2, 0, 0}, .minimum = 1, .margin = 0.3}));
    add(std::make_unique<Manipulability<Robot>>(
        robot, Manipulability<Robot>::Options{.minimum = 0.1, .margin = 0.03}));
    add(std::make_unique<CameraCentering<Robot>>(
        robot, CameraCentering<Robot>::Options{.target = goal.translation(),
                                               .norm = Objective::at_most(0.3, 0.2)}));
    add(std::make_unique<HorizontalAttitude<Robot>>(
        robot, HorizontalAttitude<Robot>::Options{.norm = Objective::at_most(0.3, 0.1)}));
    add(std::make_unique<ToolPose<Robot>>(robot, PoseTaskOptions<double>{.goal = goal}));
    add(std::make_unique<VehicleMotionMinimality<Robot>>(robot));
    for (auto& t : tasks) t->update(robot);
  }
};

template <class Solver>
void solve(Solver& tpik, const Grasp& grasp) {
  tpik.reset();
  for (const auto& t : grasp.tasks) {
    benchmark::DoNotOptimize(tpik.add_level(t->jacobian(), t->activation(), t->reference()));
  }
  benchmark::DoNotOptimize(tpik.minimize_velocity());
}

void plain_qr_28x13(benchmark::State& state) {
  const Eigen::MatrixXd m = Eigen::MatrixXd::Random(28, 13);
  Eigen::HouseholderQR<Eigen::MatrixXd> qr(28, 13);
  for (auto _ : state) benchmark::DoNotOptimize(qr.compute(m).matrixQR().data());
}
BENCHMARK(plain_qr_28x13);

void tpik_static(benchmark::State& state) {
  const Grasp grasp;
  icat::Tpik<double, 13> tpik;
  for (auto _ : state) solve(tpik, grasp);
}
BENCHMARK(tpik_static);

void tpik_dynamic(benchmark::State& state) {
  const Grasp grasp;
  icat::Tpik<double> tpik(13);
  for (auto _ : state) solve(tpik, grasp);
}
BENCHMARK(tpik_dynamic);

void arm_law(benchmark::State& state) {
  const Grasp grasp;
  icat::ParametricTpik<double, 7> law;
  for (auto _ : state) solve(law, grasp);
}
BENCHMARK(arm_law);

void arm_law_evaluated(benchmark::State& state) {
  const Grasp grasp;
  icat::ParametricTpik<double, 7> law;
  solve(law, grasp);
  icat::Vector6<double> v = icat::Vector6<double>::Constant(0.1);
  for (auto _ : state) {
    benchmark::DoNotOptimize(v.data());
    benchmark::DoNotOptimize(law.evaluate(v));
  }
}
BENCHMARK(arm_law_evaluated);

void tasks_of_the_grasp(benchmark::State& state) {
  const Grasp grasp;
  for (auto _ : state) {
    for (const auto& t : grasp.tasks) t->update(grasp.robot);
    benchmark::ClobberMemory();
  }
}
BENCHMARK(tasks_of_the_grasp);

}  // namespace

BENCHMARK_MAIN();
