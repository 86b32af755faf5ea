// SPDX-License-Identifier: BSD-3-Clause
// The page of a running loop: a browser that reads, one that does not, one that dies. The loop does
// not notice any of them.
#include <gtest/gtest.h>

#include <icat/adapters/live.hpp>
#include <icat/icat.hpp>
#include <icat/sim/kinematic_plant.hpp>
#include <optional>

#include "tests/hardware/support/loop.hpp"
#include "tests/hardware/support/process.hpp"
#include "tests/hardware/support/tcp.hpp"

namespace {

using Robot = icat::KinematicTree<double, 13>;

// A controller at work, and 2000 numbers more, so that a browser that does not read is full in a
// second or two.
class Loop {
 public:
  Loop() {
    icat::Log& log = log_;
    for (int k = 0; k < 2000; ++k) extra_.push_back(log.add("extra/" + std::to_string(k)));
    icat::ReplayRun run{.name = "live", .title = "", .log = &log};
    run.shapes = {{.form = icat::ReplayForm::box, .frame = "frame/base", .size = {1, 0.6, 0.7}},
                  {.form = icat::ReplayForm::axes, .frame = "frame/tool", .size = {0.2, 0, 0}}};
    //! [live]
    live_.emplace(icat::ReplayFiles{.folder = ICAT_REPLAY_FOLDER, .three = ICAT_THREE_JS}, run,
                  icat::ReplayOptions{.title = "a loop", .z_down = true},
                  icat::LiveOptions{.port = 0});
    //! [live]
  }
  /// A cycle at `t`, s.
  void cycle(double t) {
    icat::Pose<double> goal = goal_;
    goal.translation().x() += 0.3 * std::sin(t);
    ok_ = ok_ && robot_.update(plant_.q(), plant_.base()) == icat::Status::ok;
    ok_ = ok_ && reach_.set_goal(goal) == icat::Status::ok;
    ok_ = ok_ && controller_.switch_to("reach", t, 1) == icat::Status::ok;
    ok_ = ok_ && controller_.step(t) == icat::Status::ok;
    plant_.step(controller_.command(), t, 0.01);
    (void)log_.begin(t);
    recorder_.record();
    for (const auto& c : extra_) log_.set(c, t);
    //! [publish]
    live().publish();
    //! [publish]
    if (static_cast<long>(t * 100) % 100 == 0) live().text(icat::LogTopic::event, t, "a second");
  }
  bool ok() const { return ok_; }
  icat::Live& live() { return *live_; }

 private:
  Robot robot_ = icat::uvms(icat::maris_arm<double>());
  icat::KinematicPlant<Robot> plant_{robot_, {.q = Eigen::VectorXd::Constant(7, -0.4)}};
  icat::Status start_ = robot_.update(plant_.q(), plant_.base());
  icat::Pose<double> goal_ = robot_.pose(robot_.frame("tool"));
  icat::task::FramePose<Robot> reach_{robot_, robot_.frame("tool"), goal_};
  icat::Controller<Robot> controller_{robot_, {{"reach", {{reach_}}}}};
  icat::Log log_{{.samples = 2, .full = icat::LogFull::newest}};
  icat::ControllerLog<icat::Controller<Robot>> recorder_{log_, controller_, {.frames = {"tool"}}};
  std::vector<icat::LogChannel> extra_;
  std::optional<icat::Live> live_;
  bool ok_{true};
};

void send_all(int fd, const std::string& text) {
  for (std::size_t done = 0; done < text.size();) {
    const ssize_t n = ::send(fd, text.data() + done, text.size() - done, MSG_NOSIGNAL);
    if (n > 0) done += static_cast<std::size_t>(n);
  }
}
std::string upgrade(std::uint16_t port, const std::string& origin = "") {
  return "GET / HTTP/1.1\r\nHost: 127.0.0.1:" + std::to_string(port) +
         "\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
         "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n" +
         origin + "\r\n";
}
bool comes_within(double seconds, auto condition) {
  const double end = hardware::now() + seconds;
  while (!condition()) {
    if (hardware::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return true;
}

TEST(Live, ASlowAndADeadBrowserCostTheLoopNothing) {
  Loop loop;
  icat::Live& live = loop.live();
  hardware::Descriptor slow(hardware::connect_within(live.port(), 1));
  hardware::Descriptor dying(hardware::connect_within(live.port(), 1));
  ASSERT_GE(slow.get(), 0);
  const int small = 4096;
  ::setsockopt(slow.get(), SOL_SOCKET, SO_RCVBUF, &small, sizeof small);
  send_all(slow.get(), upgrade(live.port()));
  send_all(dying.get(), upgrade(live.port()));
  ASSERT_TRUE(comes_within(5, [&] { return live.clients() == 2; }));

  const double seconds = hardware::loop_seconds(), start = hardware::now();
  hardware::Latencies work(static_cast<std::size_t>(seconds * 110));
  long cycles = 0;
  const long made = hardware::run_loop(100, seconds, [&](double now) {
    loop.cycle(now - start);
    work.add(hardware::now() - now);
    // It goes without a word, in the middle.
    if (++cycles == static_cast<long>(seconds * 50)) {
      const linger at_once{1, 0};
      ::setsockopt(dying.get(), SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once);
      dying.reset();
    }
  });
  work.print("live, a browser that does not read and one that dies: a cycle takes", 100, seconds,
             made);
  std::printf(
      "live: %zu frames taken by the sender, %zu lost by the ring, %zu dropped for browsers\n",
      live.sent(), live.lost(), live.dropped());
  EXPECT_TRUE(loop.ok());
  EXPECT_EQ(made, 0);
  EXPECT_EQ(cycles, static_cast<long>(seconds * 100 + 0.5));
  // Solver, recorder and the copy of 17 kB take some 50 µs. A busy machine interrupts now and then;
  // a loop that waited for a browser would take its whole period.
  EXPECT_LT(work.quantile(0.9), 2e-3);
  EXPECT_EQ(live.lost(), 0u);  // the sender is not slow, browsers are
  EXPECT_GT(live.dropped(), 100u);
  EXPECT_EQ(live.clients(), 1u);
}

TEST(Live, AFullRingLosesFramesAndCountsThem) {
  icat::Log log({.samples = 1, .full = icat::LogFull::newest});
  const auto a = log.add("a");
  icat::Live live({.folder = ICAT_REPLAY_FOLDER}, {.name = "live", .title = "", .log = &log}, {},
                  {.port = 0, .frames = 3});
  live.publish();    // no sample yet
  log.add("later");  // is not sent, and has no place in the frames
  for (int k = 0; k < 1000; ++k) {
    (void)log.begin(k);
    log.set(a, k);
    live.publish();
  }
  ASSERT_TRUE(comes_within(5, [&] { return live.sent() + live.lost() == 1000; }));
  EXPECT_GT(live.lost(), 900u);  // a tick of 20 ms is far longer than the loop
}

// A phase is said once; the page of who comes later must have it, too.
TEST(Live, WhoComesLateIsToldWhatHolds) {
  icat::Log log({.samples = 1, .full = icat::LogFull::newest});
  const auto a = log.add("a");
  icat::Live live({.folder = ICAT_REPLAY_FOLDER}, {.name = "live", .title = "", .log = &log}, {},
                  {.port = 0});
  std::size_t frames = 0;
  const auto publish = [&] {
    (void)log.begin(double(frames));
    log.set(a, 1);
    live.publish();
    return comes_within(5, [&] { return live.sent() == frames + 1; });
  };
  live.text(icat::LogTopic::phase, 0, "navigate");
  live.text(icat::LogTopic::phase, 0, "grasp");
  live.text(icat::LogTopic::explanation, 0, "all is well");
  live.text(icat::LogTopic::event, 0, "long ago");
  ASSERT_TRUE(publish());  // so the texts have been taken out
  const hardware::Descriptor late(hardware::connect_within(live.port(), 1));
  send_all(late.get(), upgrade(live.port()));
  ASSERT_TRUE(comes_within(5, [&] { return live.clients() == 1; }));
  std::string text;
  EXPECT_TRUE(comes_within(5, [&] {
    ++frames;
    (void)publish();
    char block[4096];
    const ssize_t n = ::recv(late.get(), block, sizeof block, MSG_DONTWAIT);
    if (n > 0) text.append(block, static_cast<std::size_t>(n));
    return text.find(R"([[0,"phase","grasp"],[0,"explanation","all is well"]])") != text.npos;
  })) << text;
  EXPECT_EQ(text.find("navigate"), text.npos);
  EXPECT_EQ(text.find("long ago"), text.npos);
}

TEST(Live, RefusesAnotherSiteAndAnUnknownPath) {
  Loop loop;
  const std::uint16_t port = loop.live().port();
  const auto answer = [&](const std::string& request) {
    const hardware::Descriptor fd(hardware::connect_within(port, 1));
    send_all(fd.get(), request);
    std::string text;
    (void)comes_within(2, [&] {
      char block[4096];
      const ssize_t n = ::recv(fd.get(), block, sizeof block, 0);
      if (n > 0) text.append(block, static_cast<std::size_t>(n));
      return n == 0;
    });
    return text.substr(0, text.find("\r\n"));
  };
  EXPECT_EQ(answer(upgrade(port, "Origin: http://example.org\r\n")), "");
  EXPECT_EQ(answer("GET /etc/passwd HTTP/1.1\r\nHost: x\r\n\r\n"), "HTTP/1.1 404 Not Found");
  EXPECT_EQ(answer("GET / HTTP/1.1\r\nHost: x\r\n\r\n"), "HTTP/1.1 200 OK");
  EXPECT_EQ(loop.live().clients(), 0u);
}

TEST(Live, SaysWhatIsWrong) {
  icat::Log log;
  const icat::ReplayRun run{.name = "live", .title = "", .log = &log};
  EXPECT_THROW(icat::Live({.folder = "/nowhere"}, run, {}, {.port = 0}), std::invalid_argument);
  icat::Live first({.folder = ICAT_REPLAY_FOLDER}, run, {}, {.port = 0});
  try {
    icat::Live({.folder = ICAT_REPLAY_FOLDER}, run, {}, {.port = first.port()});
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("127.0.0.1:" + std::to_string(first.port())),
              std::string::npos);
  }
  EXPECT_THROW(icat::Live({.folder = ICAT_REPLAY_FOLDER}, run, {}, {.address = "here"}),
               std::invalid_argument);
}

TEST(Live, ChromiumFollowsTheLoop) {
  Loop loop;
  ::setenv("NODE_PATH", ICAT_NODE_MODULES, 1);
  hardware::Process browser({ICAT_NODE, ICAT_PEERS "/follow.js",
                             "http://127.0.0.1:" + std::to_string(loop.live().port()) + "/"});
  const double start = hardware::now();
  std::thread reader;
  std::atomic<bool> done{false}, well{false};
  reader = std::thread([&] {
    well = browser.wait_for("ALL WELL", 90);
    done = true;
  });
  while (!done) hardware::run_loop(100, 0.1, [&](double now) { loop.cycle(now - start); });
  reader.join();
  EXPECT_TRUE(well) << browser.output();
  EXPECT_TRUE(loop.ok());
}

}  // namespace
