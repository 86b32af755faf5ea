// SPDX-License-Identifier: BSD-3-Clause
// One mission on four back-ends: the plant without dynamics, MuJoCo, CANopen drives for the arm,
// ArduSub for the vehicle. Writes CSV and, where gnuplot is found, a picture.
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <icat/sim/kinematic_plant.hpp>
#include <icat/sim/plant_back_end.hpp>
#include <memory>
#include <stdexcept>
#include <thread>

#include "../support/command_line.hpp"
#include "../support/csv.hpp"
#include "../support/robot_replay.hpp"
#include "../support/support.hpp"
#include "mission.hpp"

#if __has_include(<linux/can/raw.h>)
#include "canopen_arm.hpp"
#define ICAT_WITH_CAN
#endif
#if defined(ICAT_WITH_MAVLINK)
#include "ardusub_vehicle.hpp"
#endif
#if defined(ICAT_WITH_MUJOCO)
#include <icat/adapters/mujoco_plant.hpp>

#include "../support/mujoco/maris.hpp"
#endif

namespace {

using reach::Robot;

// Cycles one after the other, or each at its time.
double simulated(long cycle) { return reach::period * static_cast<double>(cycle); }
auto real_time() {
  using Clock = std::chrono::steady_clock;
  return [start = Clock::now()](long cycle) {
    const std::chrono::duration<double> due(simulated(cycle));
    std::this_thread::sleep_until(start + std::chrono::duration_cast<Clock::duration>(due));
    return std::chrono::duration<double>(Clock::now() - start).count();
  };
}
void entered(double t, const std::string& phase, const std::string& why = "") {
  std::printf("%7.2f s  %s%s%s\n", t, phase.c_str(), why.empty() ? "" : "  ", why.c_str());
  std::fflush(stdout);
}

void write_csv(const std::string& folder, const reach::Result& result) {
  support::Csv csv(folder, "run.csv",
                   "t,phase,healthy,position_error,orientation_error,q1,q2,q3,q4,q5,q6,q7,"
                   "vehicle_x,vehicle_y,vehicle_z,tool_x,tool_y,tool_z,c1,c2,c3,c4,c5,c6,c7,"
                   "surge,sway,heave,roll_rate,pitch_rate,yaw_rate");
  for (const auto& s : result.samples) {
    csv.row(s.t, static_cast<double>(s.phase), s.healthy ? 1.0 : 0.0, s.position_error,
            s.orientation_error, s.q, s.vehicle, s.tool, s.command);
  }
}

reach::Result run(const std::string& name, const std::string& can, const std::string& udp,
                  support::Replay& replay) {
  const Robot robot = reach::make_robot();
  icat::KinematicPlant<Robot> plant(robot,
                                    {.q = support::folded_arm(), .not_actuated = reach::given});
  icat::PlantBackEnd kinematic(robot, plant);
  const auto log = [](double t, const std::string& phase) { entered(t, phase); };
  // The robot as the back-end reads it.
  using View = support::RobotReplay<icat::Controller<Robot>>;
  const auto observe = [&](const icat::Controller<Robot>& controller) {
    auto view = std::make_shared<View>(replay, controller,
                                       support::RobotReplayOptions{.frames = {"tool"},
                                                                   .name = name,
                                                                   .title = "back-end " + name,
                                                                   .base = {1.0, 0.6, 0.7},
                                                                   .base_at = {0, 0, 0.07},
                                                                   .ground = 2.6});
    return [view](auto... now) { view->record(now...); };
  };
  if (name == "kinematic") return reach::run(kinematic, simulated, log, observe);
#if defined(ICAT_WITH_MUJOCO)
  if (name == "mujoco") {
    const auto model =
        support::load_mujoco(support::mjcf(icat::maris_dynamics<double>(), support::pool()));
    icat::MujocoPlant<Robot> simulation(robot, *model, {.q = support::folded_arm()});
    icat::PlantBackEnd back_end(robot, simulation);
    return reach::run(back_end, simulated, log, observe);
  }
#endif
#if defined(ICAT_WITH_CAN)
  if (name == "canopen") {
    reach::CanopenArm back_end(kinematic, can);
    const auto say = [&](double t, const std::string& phase) {
      entered(t, phase, phase == "standby" ? back_end.why() : "");
    };
    return reach::run(back_end, real_time(), say, observe);
  }
#endif
#if defined(ICAT_WITH_MAVLINK)
  if (name == "ardusub") {
    const std::size_t colon = udp.rfind(':');
    const std::string address = colon == std::string::npos ? "127.0.0.1" : udp.substr(0, colon);
    const int port = std::atoi(udp.c_str() + (colon == std::string::npos ? 0 : colon + 1));
    if (port < 1 || port > 65535) throw std::runtime_error("--udp: no port in '" + udp + "'");
    reach::ArduSubVehicle back_end(robot, kinematic, address, static_cast<std::uint16_t>(port));
    return reach::run(back_end, real_time(), log, observe);
  }
#endif
  (void)can, (void)udp;
  throw std::runtime_error("this program was built without " + name +
                           ": docs/hardware.md says what that needs");
}

}  // namespace

int main(int argc, char** argv) {
  std::string name = "kinematic", can = "vcan0", udp = "14550";
  const auto arguments = support::parse(
      argc, argv, "Brings the tool to a goal, on the chosen back-end.", "out/13_hardware", {}, {},
      {{"--back-end", "what moves the robot", &name, {"kinematic", "mujoco", "canopen", "ardusub"}},
       {"--can", "interface that the drives of the arm are on", &can},
       {"--udp", "port, or address:port, that ArduSub listens at", &udp}});
  try {
    support::Replay replay("A vehicle with an arm brings its tool to a goal", true);
    const reach::Result result = run(name, can, udp, replay);
    write_csv(arguments.output, result);
    const auto& last = result.samples.back();
    std::printf("%s: tool error %.3f mm, %.4f deg at the end\n", name.c_str(),
                1e3 * last.position_error, last.orientation_error * 180 / std::numbers::pi);
    if (arguments.pictures) support::draw(arguments.output, {{"back_end", name}});
    replay.write(arguments.output, arguments.logs);
    return result.held ? 0 : 1;
  } catch (const std::exception& error) {  // a port or an interface that there is not
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
}
