// SPDX-License-Identifier: BSD-3-Clause
// What configurations accept, what they refuse and what they say then; the schema and the page.
#include <gtest/gtest.h>

#include <filesystem>
#include <icat/adapters/yaml.hpp>
#include <icat/adapters/yaml_schema.hpp>

namespace {

const std::string root = ICAT_ROOT;
const std::string here = root + "tests/hardware/yaml/";

std::string read(const std::string& path) {
  std::ifstream stream(path);
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}
std::vector<std::string> files_in(const std::string& folder) {
  std::vector<std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() == ".yaml") files.push_back(entry.path().string());
  }
  return files;
}
/// What it is refused with; empty: it is not.
std::string refusal(const std::string& text) {
  try {
    (void)icat::parse_yaml(text, here + "text");
  } catch (const std::invalid_argument& error) {
    return std::string(error.what()).substr(here.size());
  }
  return "";
}
/// `small.yaml` with `from` in place of `to`.
std::string small_with(const std::string& from, const std::string& to) {
  std::string text = read(here + "small.yaml");
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

TEST(Yaml, WrongFilesSayWhereAndWhat) {
  const auto files = files_in(here + "wrong");
  ASSERT_GE(files.size(), 20u);
  for (const std::string& path : files) {
    std::istringstream text(read(path));
    std::string line;
    std::getline(text, line);  // for validate.py
    std::getline(text, line);
    const std::string head = "# says: ";
    ASSERT_EQ(line.substr(0, head.size()), head) << path;
    try {
      (void)icat::load_yaml(path);
      ADD_FAILURE() << path << " is accepted";
    } catch (const std::invalid_argument& error) {
      std::string said = error.what();
      ASSERT_EQ(said.substr(0, path.size() + 1), path + ":");
      said.erase(0, path.size() + 1);
      const std::size_t folder = said.find(here + "wrong/");
      if (folder != std::string::npos) said.erase(folder, here.size() + 6);
      EXPECT_EQ(said, line.substr(head.size())) << path;
    }
  }
}

// Every key of every table stands in everything.yaml or in robots/, and all of them load.
void collect(const icat::detail::ConfigSection& s, const icat::detail::ConfigNode& node,
             std::set<const icat::detail::ConfigKey*>& seen) {
  using icat::detail::ConfigNode;
  if (node.is(ConfigNode::Kind::list)) {
    for (const ConfigNode& item : node.items) collect(s, item, seen);
    return;
  }
  for (std::size_t i = 0; i < s.count; ++i) {
    const auto& key = s.keys[i];
    const ConfigNode* value = node.find(key.name);
    if (!value) continue;
    seen.insert(&key);
    const bool named = key.value == icat::detail::Value::named;
    if (key.section && named) {
      for (const ConfigNode& item : value->items) collect(*key.section, item, seen);
    } else if (key.section) {
      collect(*key.section, *value, seen);
    } else if (key.value == icat::detail::Value::tasks) {
      for (const ConfigNode& task : value->items) {
        for (const auto& table : icat::detail::task_sections) {
          if (task.find("type")->text == table.name) collect(table, task, seen);
        }
      }
    } else if (key.value == icat::detail::Value::pose) {
      collect(icat::detail::pose_section, *value, seen);
    } else if (key.value == icat::detail::Value::objective) {
      collect(icat::detail::objective_section, *value, seen);
    }
  }
}
void expect_all(const icat::detail::ConfigSection& s,
                const std::set<const icat::detail::ConfigKey*>& seen) {
  for (std::size_t i = 0; i < s.count; ++i) {
    EXPECT_TRUE(seen.count(s.keys + i))
        << "no good file has '" << s.keys[i].name << "' of '" << s.name << "'";
    if (s.keys[i].section) expect_all(*s.keys[i].section, seen);
  }
}

TEST(Yaml, EveryKeyIsAccepted) {
  std::set<const icat::detail::ConfigKey*> seen;
  auto files = files_in(here + "robots");
  files.push_back(here + "everything.yaml");
  for (const std::string& file : files) {
    EXPECT_NO_THROW((void)icat::load_yaml(file)) << file;
    collect(icat::detail::top_section, icat::detail::config_file(file).root, seen);
  }
  expect_all(icat::detail::top_section, seen);
  for (const auto& table : icat::detail::task_sections) expect_all(table, seen);
  expect_all(icat::detail::pose_section, seen);
  expect_all(icat::detail::objective_section, seen);
}

TEST(Yaml, SchemaAndPageAreThoseOfTheTables) {
  EXPECT_EQ(read(root + "examples/icat_run/icat.schema.json"), icat::configuration_schema())
      << "run: icat_run --schema > examples/icat_run/icat.schema.json";
  const std::string page = read(root + "docs/configuration.md");
  EXPECT_NE(page.find(icat::configuration_tables()), std::string::npos)
      << "docs/configuration.md does not have what icat_run --keys prints";
  // The messages on the page are those of the wrong files.
  std::string said;
  for (const std::string& path : files_in(here + "wrong")) said.append(read(path));
  const std::string head = "\nmission.yaml:";
  int messages = 0;
  for (std::size_t at = 0; (at = page.find(head, at)) != std::string::npos; ++messages) {
    at += head.size();
    std::string line = page.substr(at, page.find('\n', at) - at);
    const std::size_t cut = line.find(", …");
    if (cut != std::string::npos) line.erase(cut);
    EXPECT_NE(said.find("# says: " + line), std::string::npos) << line;
  }
  EXPECT_EQ(messages, 6);
}

TEST(Yaml, RobotOfTheFile) {
  icat::Configuration config = icat::load_yaml(here + "everything.yaml");
  const auto& robot = config.robot();
  ASSERT_EQ(robot.dof(), 10);  // shoulder, elbow, wrist, slide; the other slide follows; the base
  EXPECT_DOUBLE_EQ(robot.q()(0), 20 * std::numbers::pi / 180);
  EXPECT_DOUBLE_EQ(robot.q()(3), 0.025);
  EXPECT_DOUBLE_EQ(robot.mass(), 304);
  EXPECT_DOUBLE_EQ(robot.joints()[0].max_velocity, std::numbers::pi / 3);
  // 30 degrees about y take z to (sin, 0, cos); the base is turned about z by 0.1.
  const icat::Vector3<double> z = robot.pose(robot.frame("camera")).linear().col(2);
  EXPECT_NEAR(z.x(), 0.5 * std::cos(0.1), 1e-15);
  EXPECT_NEAR(z.y(), 0.5 * std::sin(0.1), 1e-15);
  // 90 degrees about y, said by a quaternion and by an axis.
  const icat::Vector3<double> x = robot.pose(robot.frame("sonar")).linear().col(0);
  EXPECT_NEAR(x.z(), -1, 1e-15);
  EXPECT_TRUE(config.controller().parallel());
  EXPECT_TRUE(config.controller().parallel()->first().given(4 + 3));
  EXPECT_EQ(config.controller().parallel()->limits().reaction_time(), 0.1);
  EXPECT_EQ(config.plant().not_actuated.size(), 2);
  EXPECT_NEAR(config.plant().current_at(2.5).x(), 0.02, 1e-15);
  EXPECT_EQ(config.period(), 0.01);
  EXPECT_EQ(config.tasks().size(), 18u);
}

TEST(Yaml, GoalsThatMove) {
  icat::Configuration config = icat::load_yaml(here + "everything.yaml");
  auto& pose = config.task<icat::task::FramePose<icat::ConfiguredRobot>>("pose");
  const double before = pose.goal().translation().x();
  pose.update();
  EXPECT_NEAR(pose.position_error(), 0, 1e-12) << "'here' is where it is, seen from the camera";
  config.update(0.5);
  EXPECT_EQ(pose.goal().translation().x(), before);
  config.update(1.5);
  EXPECT_NEAR(pose.goal().translation().x(), before + 0.025, 1e-12);
  config.update(100);
  EXPECT_NEAR(pose.goal().translation().x(), before + 0.05, 1e-12);
  try {
    config.task("poze");
    ADD_FAILURE();
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("did you mean 'pose'?"), std::string::npos);
  }
  EXPECT_THROW(config.task<icat::task::LookAt<icat::ConfiguredRobot>>("pose"),
               std::invalid_argument);
}

TEST(Yaml, NumbersAndTheirUnits) {
  const auto gain = [](const std::string& text) {
    return small_with("gain: 0.5", "gain: " + text);
  };
  for (const char* good : {"0.5", "+0.5", "5.0e-1", ".5", "0.5 1/s", "0.5   1/s", "\"0.5\""}) {
    EXPECT_EQ(refusal(gain(good)), "") << good;
    auto config = icat::parse_yaml(gain(good), here + "text");
    EXPECT_EQ((config.task<icat::task::FramePosition<icat::ConfiguredRobot>>("hand").gain()), 0.5);
  }
  for (const char* bad :
       {"0", "-1",  ".nan",   "nan",   "inf", ".inf", "0x1", "1 2",  "1,5", "1 Hz", "",
        "~", "[1]", "{a: 1}", "1e999", "-",   "+",    ".",   "true", "+-1", "--1"}) {
    EXPECT_NE(refusal(gain(bad)), "") << bad;
  }
}

TEST(Yaml, NamesOfAWrongKindOfValue) {
  EXPECT_EQ(refusal("{}"), "text:1:1: 'robot' is missing");
  EXPECT_EQ(refusal(""), "text:1:1: a configuration begins with keys such as 'robot:'");
  EXPECT_EQ(refusal("[1, 2]"), "text:1:1: a configuration begins with keys such as 'robot:'");
  EXPECT_NE(refusal("a: 1\n---\nb: 2\n").find("a second document"), std::string::npos);
  // Of the rest of these yaml-cpp makes documents without end.
  EXPECT_EQ(refusal("\"a\", b\n"), "text:1:4: a second document; a configuration is one");
  EXPECT_NE(refusal("a, b\n"), "");
  EXPECT_NE(refusal("[1], 2\n"), "");
  EXPECT_NE(refusal("? [a]\n: 1\n").find("a key must be a word"), std::string::npos);
  EXPECT_NE(refusal("a: *b").find("text:1:"), std::string::npos);
  // An alias of aliases grows by ten each line.
  std::string bomb = "a0: &a0 [1]\n";
  for (int i = 1; i < 12; ++i) {
    const std::string n = std::to_string(i), b = "*a" + std::to_string(i - 1);
    bomb.append("a" + n + ": &a" + n + " [" + b);
    for (int k = 0; k < 9; ++k) bomb.append(", " + b);
    bomb.append("]\n");
  }
  EXPECT_NE(refusal(bomb).find("more than 100000 values"), std::string::npos);
  const std::string phase = "until: {task: hand, position: 1 cm}";
  EXPECT_NE(refusal(small_with(phase, "until: {task: hand}")).find("nothing has to be met"),
            std::string::npos);
  EXPECT_NE(refusal(small_with(phase, "until: {settled: false}")).find("can only be true"),
            std::string::npos);
  EXPECT_NE(refusal(small_with("tasks:", "limits: {unlimited: true, max_velocity: 1}\ntasks:"))
                .find("'unlimited' stands alone"),
            std::string::npos);
  EXPECT_NE(refusal(small_with("tasks:", "start: {q: [1]}\ntasks:"))
                .find("'q' has 1 numbers for 2 joints"),
            std::string::npos);
  EXPECT_NE(refusal(small_with("tasks:", "controller: {given: [heave]}\ntasks:"))
                .find("no column 'heave'; there are 'lift', 'elbow', 'surge', 'sway', 'yaw'"),
            std::string::npos);
  EXPECT_NE(refusal(small_with("goal: [1, 1, 0.5]", "goal: [1, 1, 0.5], axes: []")), "");
  EXPECT_NE(refusal(small_with("origin: {position: [0.3, 0, 0]}", "origin: {rpy: [0, 0, 0]}"))
                .find("'position' is missing"),
            std::string::npos);
  for (const char* period : {".inf", "0.2", "0"}) {
    EXPECT_NE(refusal(small_with("tasks:", std::string("period: ") + period + "\ntasks:")), "");
  }
  EXPECT_NE(refusal(std::string(100000, '[')), "");
  // What the robot says of a joint stands at the joint.
  EXPECT_EQ(refusal(small_with("upper: 1 m", "upper: -1 m")).substr(0, 29),
            "text:6:9: KinematicTree: join");
  EXPECT_EQ(refusal(small_with("lower: -2,", "lower: -2, axis: [0, 0, 2],")).substr(0, 29),
            "text:7:9: KinematicTree: join");
  EXPECT_THROW((void)icat::load_yaml(here + "no such file"), std::invalid_argument);
}

TEST(Yaml, ColumnsAreCharactersAndTabsAreNamed) {
  const std::string hand = "  hand: {type: frame_position, frame: tool,";
  std::string text = read(here + "small.yaml");
  for (std::size_t at; (at = text.find("hand")) != text.npos;) text.replace(at, 4, "Häßé");
  const std::string tool = "frame: tool,", other = "frame: tol,";
  text.replace(text.find(tool), tool.size(), other);
  const std::string says = "text:12:39: task 'Häßé': no frame 'tol'";
  EXPECT_EQ(refusal(text).substr(0, says.size()), says);
  EXPECT_EQ(refusal("\xef\xbb\xbf" + text).substr(0, says.size()), says);
  EXPECT_EQ(refusal("about: \xc3\xa4 \xe4\n"), "text:1:10: this is no UTF-8");
  EXPECT_EQ(refusal("about: \xc3"), "text:1:8: this is no UTF-8");
  const std::string tab = refusal(small_with(hand, "\t" + hand.substr(2)));
  EXPECT_EQ(tab.substr(0, 8), "text:12:") << tab;
  EXPECT_NE(tab.find("; a tab cannot indent in YAML, blanks can"), std::string::npos) << tab;
  // Values far out in a line: no time is lost for their columns.
  std::string wide = "about: [";
  for (int k = 0; k < 20000; ++k) wide += "1,";
  EXPECT_NE(refusal(wide + "1]\n"), "");
}

// Whatever is cut off or changed, it is a configuration or an error, never a crash.
TEST(Yaml, DamagedFiles) {
  const std::string whole = read(here + "small.yaml");
  for (std::size_t i = 0; i < whole.size(); i += 7) {
    (void)refusal(whole.substr(0, i));
    for (const char c : {':', '[', '{', '-', '\n', '9', '&'}) {
      std::string text = whole;
      text[i] = c;
      (void)refusal(text);
    }
  }
}

}  // namespace
