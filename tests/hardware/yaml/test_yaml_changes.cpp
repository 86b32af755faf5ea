// SPDX-License-Identifier: BSD-3-Clause
// Gains and goals that are read again while it runs.
#include <gtest/gtest.h>

#include <map>
#include <optional>
#include <random>

#include "examples/icat_run/run.hpp"
#include "tests/support/allocation_counter.hpp"

namespace {

const std::string here = std::string(ICAT_ROOT) + "tests/hardware/yaml/";

std::string read(const std::string& path) {
  std::ifstream stream(path);
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}
std::string with(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}
std::string refusal(const icat::Configuration& config, const std::string& text) {
  try {
    (void)config.parse_changes(text, here + "text");
  } catch (const std::invalid_argument& error) {
    return std::string(error.what()).substr(here.size());
  }
  return "";
}

/// Commands of `cycles` cycles of `config`; `between(k)` before the k-th.
template <class Between>
std::vector<Eigen::VectorXd> commands(icat::Configuration& config, const char* action, int cycles,
                                      Between between) {
  run::Plant plant = run::make_plant(config);
  icat::PlantBackEnd back_end(config.robot(), plant);
  icat::RobotState<run::Robot> state(config.robot());
  std::vector<Eigen::VectorXd> all;
  EXPECT_EQ(config.controller().switch_to(action, 0, 0.1), icat::Status::ok);
  for (int k = 0; k < cycles; ++k) {
    between(k);
    const double t = k * config.period();
    config.update(t);
    EXPECT_EQ(back_end.read(t, state), icat::Status::ok);
    EXPECT_EQ(config.robot().update(state.q, state.base), icat::Status::ok);
    EXPECT_EQ(config.controller().step(t, state.velocity), icat::Status::ok);
    EXPECT_EQ(back_end.write(t, config.controller().command()), icat::Status::ok);
    all.push_back(config.controller().velocity());
  }
  return all;
}

// Changed before the first cycle, it commands what a configuration of the new file does; changed
// later, what the old one does until then.
TEST(YamlChanges, AreThoseOfTheNewFile) {
  const std::string text = read(here + "small.yaml");
  const std::string other =
      with(with(text, "gain: 0.5", "gain: 0.9, max_rate: 0.2"), "[1, 1, 0.5]", "[1, -1, 0.6]");
  icat::Configuration old = icat::parse_yaml(text, here + "old"),
                      fresh = icat::parse_yaml(other, here + "new"),
                      changed = icat::parse_yaml(text, here + "text"),
                      late = icat::parse_yaml(text, here + "text");
  icat::ConfigurationChanges changes = changed.parse_changes(other, here + "text");
  EXPECT_EQ(changes.size(), 3u);
  EXPECT_EQ(changed.apply(changes), icat::Status::ok);
  EXPECT_EQ(changes.size(), 0u);
  EXPECT_EQ(changed.parse_changes(other, here + "text").size(), 0u) << "it is the new one now";

  const auto nothing = [](int) {};
  const auto before = commands(old, "reach", 300, nothing),
             wanted = commands(fresh, "reach", 300, nothing),
             is = commands(changed, "reach", 300, nothing);
  for (std::size_t k = 0; k < is.size(); ++k) EXPECT_EQ(is[k], wanted[k]) << k;
  ASSERT_GT((wanted[100] - before[100]).norm(), 0.01);

  icat::ConfigurationChanges in_the_middle = late.parse_changes(other, here + "text");
  const auto switched = commands(late, "reach", 300, [&](int k) {
    if (k == 150) {
      EXPECT_EQ(count_allocations([&] { (void)late.apply(in_the_middle); }), 0);
      EXPECT_EQ(in_the_middle.size(), 0u);
    }
  });
  for (std::size_t k = 0; k < 150; ++k) EXPECT_EQ(switched[k], before[k]) << k;
  EXPECT_GT((switched[160] - before[160]).norm(), 0.01);
}

/// The largest difference of what two tasks yield.
double apart(const icat::Task<icat::ConfiguredRobot>& a,
             const icat::Task<icat::ConfiguredRobot>& b) {
  return std::max({(a.reference() - b.reference()).cwiseAbs().maxCoeff(),
                   (a.activation() - b.activation()).cwiseAbs().maxCoeff(),
                   (a.jacobian() - b.jacobian()).cwiseAbs().maxCoeff()});
}

// Every live key of every type of task, one at a time, against a configuration that has it so from
// the start.
TEST(YamlChanges, EveryLiveKey) {
  const std::map<std::string, std::pair<std::string, std::string>> changes{
      {"joint_limits gain", {"to_middle: false, gain: 0.5", "to_middle: false, gain: 0.6"}},
      {"joint_limits margin", {"margin: [0.1, 6 deg]", "margin: [0.1, 7 deg]"}},
      {"joint_limits max_rate",
       {"gain: 0.5, max_rate: 1}\n  shape", "gain: 0.5, max_rate: 0.01}\n  shape"}},
      {"joint_position gain", {"gain: 0.3", "gain: 0.35"}},
      {"joint_position goal", {"{elbow: 0.8, wrist: 0}", "{elbow: 0.9, wrist: 0.1}"}},
      {"joint_position norm",
       {"{at_most: 0.2, margin: 0.1, toward: 0}", "{at_most: 0.3, margin: 0.1}"}},
      {"joint_position max_rate", {"max_rate: [0.5, 0.5]", "max_rate: 0.4"}},
      {"frame_pose gain",
       {"max_angular_rate: 10 deg/s\n    gain: 0.4", "max_angular_rate: 10 deg/s\n    gain: 0.5"}},
      {"frame_pose norms", {"{at_most: 5 deg, margin: 2 deg}", "{at_most: 6 deg, margin: 2 deg}"}},
      {"frame_pose max_linear_rate", {"max_linear_rate: 0.1", "max_linear_rate: 0.01"}},
      {"frame_pose max_angular_rate", {"max_angular_rate: 10 deg/s", "max_angular_rate: 1 deg/s"}},
      {"frame_position gain", {"margin: 0.05}\n    gain: 0.4", "margin: 0.05}\n    gain: 0.5"}},
      {"frame_position norm", {"{at_most: 10 cm, margin: 0.05}", "{at_most: 20 cm, margin: 0.05}"}},
      {"frame_position max_rate", {"max_rate: 0.1\n    moves", "max_rate: 0.2\n    moves"}},
      {"frame_orientation gain",
       {"margin: 5 deg}\n    gain: 0.4", "margin: 5 deg}\n    gain: 0.5"}},
      {"frame_orientation goal", {"goal: {rpy: [0, 0, 0]}", "goal: {rpy: [0.3, 0, 0]}"}},
      {"frame_orientation norm",
       {"{at_most: 10 deg, margin: 5 deg}", "{at_most: 2 deg, margin: 1 deg}"}},
      {"frame_orientation max_rate", {"max_rate: 0.1\n  drive", "max_rate: 0.05\n  drive"}},
      {"frame_velocity linear_velocity", {"[0.01 m/s, 0, 0]", "[0.02 m/s, 0, 0]"}},
      {"frame_velocity angular_velocity",
       {"angular_velocity: [0, 0, 0]", "angular_velocity: [0.1, 0, 0]"}},
      {"attitude gain",
       {"margin: 0.1}, gain: 0.5, max_rate: 0.2}\n  look:",
        "margin: 0.1}, gain: 0.6, max_rate: 0.2}\n  look:"}},
      {"attitude max_rate",
       {"gain: 0.5, max_rate: 0.2}\n  look:", "gain: 0.5, max_rate: 0.3}\n  look:"}},
      {"attitude world_axis", {"world_axis: [0, 0, 1]", "world_axis: [0.6, 0, 0.8]"}},
      {"attitude norm",
       {"norm: {at_most: 0.2, margin: 0.1}", "norm: {at_most: 0.1, margin: 0.05}"}},
      {"look_at gain",
       {"gain: 0.5, max_rate: 0.2}\n  look at", "gain: 0.6, max_rate: 0.2}\n  look at"}},
      {"look_at target", {"target: [2, 0, 3]", "target: [2, 1, 3]"}},
      {"look_at norm", {"norm: {at_most: 0.3, margin: 0.1}", "norm: {at_most: 0.2, margin: 0.1}"}},
      {"look_at max_rate",
       {"gain: 0.5, max_rate: 0.2}\n  look at", "gain: 0.5, max_rate: 0.1}\n  look at"}},
      {"occlusion gain",
       {"gain: 0.5, max_rate: 0.2}\n  keep", "gain: 0.6, max_rate: 0.2}\n  keep"}},
      {"occlusion max_rate",
       {"gain: 0.5, max_rate: 0.2}\n  keep", "gain: 0.5, max_rate: 0.1}\n  keep"}},
      {"occlusion objective",
       {"objective: {at_least: 1.5, margin: 0.5}", "objective: {at_least: 1.4, margin: 0.5}"}},
      {"frame_distance gain",
       {"gain: 0.5, max_rate: 0.2}\n  short", "gain: 0.6, max_rate: 0.2}\n  short"}},
      {"frame_distance max_rate",
       {"gain: 0.5, max_rate: 0.2}\n  short", "gain: 0.5, max_rate: 0.1}\n  short"}},
      {"frame_distance point", {"point: [3, 0, 2]", "point: [3, 0, 1]"}},
      {"frame_distance objective", {"{at_least: 1, margin: 0.3}", "{at_least: 4, margin: 0.3}"}},
      {"center_of_mass gain", {"gain: 0.2", "gain: 0.3"}},
      {"center_of_mass max_rate", {"gain: 0.2, max_rate: 0.1", "gain: 0.2, max_rate: 0.2"}},
      {"center_of_mass goal", {"goal: here, axes: [x, y]", "goal: [0.1, 0, 2], axes: [x, y]"}},
      {"manipulability gain",
       {"gain: 0.5, max_rate: 1}\n  obstacles", "gain: 0.6, max_rate: 1}\n  obstacles"}},
      {"manipulability max_rate",
       {"gain: 0.5, max_rate: 1}\n  obstacles", "gain: 0.5, max_rate: 0.01}\n  obstacles"}},
      {"manipulability objective", {"{at_least: 2, margin: 0.5}", "{at_least: 2.5, margin: 0.5}"}},
      {"clearance gain",
       {"gain: 0.5\n    max_rate: 0.2\n  itself", "gain: 0.6\n    max_rate: 0.2\n  itself"}},
      {"clearance max_rate", {"max_rate: 0.2\n  itself", "max_rate: 0.3\n  itself"}},
      {"clearance obstacles", {"center: [2, 1, 2]", "center: [1.5, 0.3, 2]"}},
      {"clearance objective", {"{at_least: 0.05, margin: 0.1}", "{at_least: 2, margin: 0.1}"}},
      {"self_clearance gain",
       {"gain: 0.5\n    max_rate: 0.2\n  still", "gain: 0.6\n    max_rate: 0.2\n  still"}},
      {"self_clearance max_rate", {"max_rate: 0.2\n  still", "max_rate: 0.01\n  still"}},
      {"self_clearance objective", {"{equal_to: 0.4}", "{equal_to: 0.5}"}},
      {"given_velocity velocity", {"velocity: [0, 0]", "velocity: [0, 0.1]"}}};
  // Those that `here` and `moves` keep from changing.
  const std::map<std::string, std::pair<std::string, std::string>> exceptions{
      {"frame_pose goal", {"goal: here\n    linear", "goal: {position: [1, 0, 0]}\n    linear"}},
      {"frame_position goal", {"goal: [1, 0.2, 0.3]", "goal: [1, 0.3, 0.3]"}}};
  const std::string text = read(here + "everything.yaml");
  for (const auto& table : icat::detail::task_sections) {
    for (std::size_t i = 0; i < table.count; ++i) {
      if (!table.keys[i].live) continue;
      const std::string name = std::string(table.name) + " " + table.keys[i].name;
      const auto found = changes.find(name);
      if (found == changes.end()) {
        EXPECT_TRUE(exceptions.count(name)) << name << " is not tried";
        continue;
      }
      const std::string other = with(text, found->second.first, found->second.second);
      icat::Configuration config = icat::parse_yaml(text, here + "text"),
                          fresh = icat::parse_yaml(other, here + "text");
      icat::ConfigurationChanges one = config.parse_changes(other, here + "text");
      EXPECT_EQ(one.size(), 1u) << name;
      EXPECT_EQ(count_allocations([&] { (void)config.apply(one); }), 0) << name;
      double difference = 0, by = 0;
      icat::Configuration old = icat::parse_yaml(text, here + "text");
      const auto state = [&](icat::Configuration& c, const Eigen::VectorXd& q,
                             const icat::Pose<double>& base) {
        EXPECT_EQ(c.robot().update(q, base), icat::Status::ok);
      };
      // In some of so many places each value shows.
      std::mt19937 random(1);
      std::uniform_real_distribution<double> share(-1, 1);
      for (int place = 0; place < 100; ++place) {
        Eigen::VectorXd q(4);
        q << 3.1 * share(random), 2.6 * share(random), 3 * share(random), 0.025;
        icat::Pose<double> base = icat::Pose<double>::Identity();
        base.linear() = icat::rotation_exp<double>(
            {0.5 * share(random), 0.5 * share(random), 0.5 * share(random)});
        for (icat::Index k = 0; k < 3; ++k) base.matrix()(k, 3) = 2 + 2 * share(random);
        for (auto* c : {&config, &fresh, &old}) state(*c, q, base);
        for (const std::string& task : config.tasks()) {
          auto &a = config.task(task), &b = fresh.task(task), &c = old.task(task);
          for (auto* t : {&a, &b, &c}) t->update();
          difference = std::max({difference, apart(a, b)});
          by = std::max({by, apart(a, c)});
        }
      }
      EXPECT_EQ(difference, 0) << name << " is not as in the new file";
      EXPECT_GT(by, 0) << name << " changes nothing";
    }
  }
  for (const auto& [name, change] : exceptions) {
    icat::Configuration config = icat::parse_yaml(text, here + "text");
    EXPECT_NE(refusal(config, with(text, change.first, change.second)).find("'goal'"),
              std::string::npos)
        << name;
  }
}

TEST(YamlChanges, AsThePageShowsIt) {
  const std::string file = here + "small.yaml";
  //! [load]
  icat::Configuration config = icat::load_yaml(file);
  auto& hand = config.task<icat::task::FramePosition<icat::ConfiguredRobot>>("hand");
  icat::Status status = hand.set_goal({1, 0.5, 0.4});  // set by the program
  //! [load]
  EXPECT_EQ(status, icat::Status::ok);
  //! [changes]
  icat::ConfigurationChanges changes = config.read_changes(file);  // throws on any error
  status = config.apply(changes);  // between two steps; allocates nothing
  //! [changes]
  EXPECT_EQ(status, icat::Status::ok);
  EXPECT_EQ(hand.goal().y(), 0.5) << "what did not change in the file stays as the program set it";
}

// As a whole: a good change beside a bad one is not made.
TEST(YamlChanges, AreRefusedAsAWhole) {
  const std::string text = read(here + "small.yaml");
  icat::Configuration config = icat::parse_yaml(text, here + "text");
  auto& hand = config.task<icat::task::FramePosition<icat::ConfiguredRobot>>("hand");
  const std::string good = with(text, "gain: 0.5", "gain: 0.9");
  const std::pair<std::string, std::string> refused[] = {
      {with(good, "goal: [1, 1, 0.5]", "goal: [1, 1, .nan]"),
       "text:12:58: task 'hand': 'goal' must "
       "be a number, in m, got '.nan'"},
      {with(good, "frame: tool,", "frame: arm,"),
       "text:12:39: task 'hand': 'frame' may not change while it runs; 'gain', 'goal', 'norm', "
       "'max_rate' may"},
      {with(good, "upper: 2}", "upper: 2.1}"),
       "text:7:99: 'robot' may not change while it runs; gains and goals of tasks may"},
      {with(good, "time_limit: 20", "time_limit: 30"),
       "text:17:94: 'mission' may not change while it runs; gains and goals of tasks may"},
      {with(good, "gain: 0.9", "gain: 0.9, norm: {at_most: 0.1, margin: 0.05}"),
       "text:12:81: task 'hand': 'norm' may change while it runs, not come or go"},
      {with(good, "  limits: {type: joint_limits}\n",
            "  limits: {type: joint_limits}\n  more: {type: joint_limits}\n"),
       "text:12:3: task 'more' is new, and may not come while it runs; there are 'limits', 'hand'"},
      {with(good, "tasks:", "period: 0.02\ntasks:"),
       "text:10:9: 'period' may not change while it runs; gains and goals of tasks may"},
      {with(good, "tasks:", "tusks:"), ""},
      {"", ""}};
  for (const auto& [other, says] : refused) {
    const std::string said = refusal(config, other);
    EXPECT_NE(said, "");
    if (!says.empty()) {
      EXPECT_EQ(said, says);
    }
    EXPECT_EQ(hand.gain(), 0.5);
  }
  // Another way to write the same is no change.
  EXPECT_EQ(config.parse_changes(with(text, "gain: 0.5", "gain: 0.50"), here + "text").size(), 0u);
  icat::ConfigurationChanges one = config.parse_changes(good, here + "text"),
                             stale = config.parse_changes(good, here + "text");
  icat::Configuration other = icat::parse_yaml(text, here + "text");
  EXPECT_EQ(other.apply(one), icat::Status::out_of_range) << "of another configuration";
  EXPECT_EQ(hand.gain(), 0.5);
  EXPECT_EQ(config.apply(one), icat::Status::ok);
  EXPECT_EQ(hand.gain(), 0.9);
  EXPECT_EQ(config.apply(stale), icat::Status::out_of_range) << "of a file that is not the last";
  // Gone is back to the default.
  icat::ConfigurationChanges gone =
      config.parse_changes(with(text, ", gain: 0.5", ""), here + "text");
  EXPECT_EQ(config.apply(gone), icat::Status::ok);
  EXPECT_EQ(hand.gain(), 1);
  EXPECT_EQ(config.apply(gone), icat::Status::out_of_range) << "twice";
  // Where a configuration is moved, nothing in it moves.
  icat::Configuration moved = std::move(config);
  icat::ConfigurationChanges back = moved.parse_changes(text, here + "text");
  EXPECT_EQ(moved.apply(back), icat::Status::ok);
  EXPECT_EQ(hand.gain(), 0.5);
}

// A file of later changes may lie where an earlier one was freed.
TEST(YamlChanges, ThatAreStaleStayRefused) {
  const std::string text = read(here + "small.yaml");
  const auto gain = [&](const char* value) {
    return with(text, "gain: 0.5", std::string("gain: ") + value);
  };
  icat::Configuration config = icat::parse_yaml(text, here + "text");
  icat::ConfigurationChanges stale = config.parse_changes(gain("0.7"), here + "text");
  for (int k = 0; k < 50; ++k) {
    {
      auto changes = config.parse_changes(gain(k % 2 ? "0.5" : "0.6"), here + "text");
      ASSERT_EQ(config.apply(changes), icat::Status::ok);
    }
    ASSERT_EQ(config.apply(stale), icat::Status::out_of_range) << k;
  }
  // Nor are they those of a configuration that came after the one that is gone.
  std::optional<icat::Configuration> other(icat::parse_yaml(text, here + "text"));
  icat::ConfigurationChanges orphan = other->parse_changes(gain("0.7"), here + "text");
  for (int k = 0; k < 50; ++k) {
    other.reset();
    other.emplace(icat::parse_yaml(text, here + "text"));
    ASSERT_EQ(other->apply(orphan), icat::Status::out_of_range) << k;
  }
}

// Conditions, goals that move, both controllers: no cycle allocates.
TEST(YamlChanges, CyclesAllocateNothing) {
  for (const char* file : {"everything.yaml", "small.yaml"}) {
    icat::Configuration config = icat::load_yaml(here + file);
    icat::Mission& mission = *config.mission();
    run::Plant plant = run::make_plant(config);
    icat::PlantBackEnd back_end(config.robot(), plant);
    icat::RobotState<run::Robot> state(config.robot());
    std::size_t phases = 0;
    const long count = count_allocations([&] {
      for (int k = 0; k < 2000 && mission.end() == icat::PhaseEnd::none; ++k) {
        const double t = k * config.period();
        config.update(t);
        (void)back_end.read(t, state);
        (void)config.robot().update(state.q, state.base);
        (void)mission.step(t);
        (void)mission.drive(config.controller(), t);
        (void)config.controller().step(t, state.velocity);
        (void)back_end.write(t, config.controller().command());
        phases += mission.entered();
      }
    });
    EXPECT_EQ(count, 0) << file;
    EXPECT_GE(phases, 2u) << file;
  }
}

}  // namespace
