// SPDX-License-Identifier: BSD-3-Clause
// MCAP files of ours, read by @mcap/core.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <icat/adapters/mcap.hpp>
#include <memory>

namespace {

namespace fs = std::filesystem;

class Mcap : public ::testing::Test {
 protected:
  Mcap()
      : path_(fs::temp_directory_path() / ("icat_test_" + std::to_string(::getpid()) + ".mcap")) {}
  ~Mcap() override { fs::remove(path_); }
  std::string read() const {
    const std::string command = "NODE_PATH='" ICAT_NODE_MODULES "' '" ICAT_NODE "' '" ICAT_PEERS
                                "/read.js' '" +
                                path_.string() + "' 2>&1";
    std::unique_ptr<FILE, int (*)(FILE*)> pipe(popen(command.c_str(), "r"), pclose);
    std::string text;
    char block[4096];
    for (std::size_t n; (n = std::fread(block, 1, sizeof block, pipe.get())) > 0;) {
      text.append(block, n);
    }
    return text;
  }
  static bool has(const std::string& text, const std::string& part) {
    return text.find(part) != std::string::npos;
  }
  fs::path path_;
};

icat::Log recorded(std::size_t samples) {
  icat::Log log({.samples = samples, .full = icat::LogFull::newest});
  const auto a = log.add("left/activation/joint limits"),
             b = log.add("left/activation/joint_limits"),
             p = log.add("tip", "m", icat::LogKind::point),
             f = log.add("left/frame/tool", "m", icat::LogKind::pose);
  icat::Pose<double> pose = icat::IdentityPose{};
  log.event(-1, "before \"all\" <b>\n ünd");
  for (std::size_t k = 0; k < samples + 3; ++k) {
    (void)log.begin(0.01 * double(k));
    log.set(a, 0.1 * double(k));
    if (k % 2 == 0) log.set(b, 1);
    if (k % 3 == 0) log.set(p, 1, 2, 3);
    pose.translation().x() = double(k);
    if (k % 5 != 4) log.set(f, pose);
    if (k % 100 == 0) log.phase(0.01 * double(k), "phase " + std::to_string(k / 100));
  }
  log.explain(1e6, "after all");
  return log;
}

TEST_F(Mcap, IsReadByMcapCoreWithEveryChecksumAndSchema) {
  ASSERT_TRUE(icat::write_mcap(recorded(10000), path_.string(), {.start = 1e9}));
  const std::string found = read();
  ASSERT_FALSE(has(found, "WRONG")) << found;
  // All samples of each topic; 10003 cycles have 101 phases.
  EXPECT_TRUE(has(found, R"("/tf":10000)")) << found;
  EXPECT_TRUE(has(found, R"("/left/activation":10000)")) << found;
  EXPECT_TRUE(has(found, R"("/log":10000)")) << found;
  EXPECT_TRUE(has(found, R"("/phase":101)")) << found;
  EXPECT_TRUE(has(found, R"("/event":1,)")) << found;
  EXPECT_TRUE(has(found, R"("message":"before \"all\" <b>\n ünd")")) << found;
  EXPECT_TRUE(has(found, R"("joint_limits_1":1)")) << found;
  // A year of 1e9 s and 0.03 s: the first sample that is left.
  EXPECT_TRUE(has(found, R"("timestamp":{"sec":1000000000,"nsec":30000000})")) << found;
  EXPECT_TRUE(has(found, R"("child_frame_id":"left/frame/tool")")) << found;
  EXPECT_FALSE(has(found, R"("chunks":1})")) << found;  // several, or nothing of them is tested
}

TEST_F(Mcap, AnEmptyLogIsAFileToo) {
  ASSERT_TRUE(icat::write_mcap(icat::Log(), path_.string()));
  const std::string found = read();
  EXPECT_TRUE(has(found, R"("topics":{})")) << found;
}

// Groups that would be called like topics of another kind.
TEST_F(Mcap, ATopicHasOneSchema) {
  icat::Log log({.samples = 3});
  std::vector<icat::LogChannel> all;
  for (const char* name : {"tf/x", "tf_/x", "event/x", "phase/x", "explanation/x", "/x", "x/"}) {
    all.push_back(log.add(name));
  }
  const auto pose = log.add("frame/tool", "m", icat::LogKind::pose);
  for (int k = 0; k < 3; ++k) {
    (void)log.begin(k);
    for (const auto& c : all) log.set(c, k);
    log.set(pose, icat::Pose<double>(icat::IdentityPose{}));
    log.event(k, "an event");
  }
  ASSERT_TRUE(icat::write_mcap(log, path_.string()));
  const std::string found = read();
  ASSERT_FALSE(has(found, "WRONG")) << found;
  for (const char* topic : {"/tf", "/tf_", "/event", "/event_", "/phase_", "/explanation_", "/_"}) {
    EXPECT_TRUE(has(found, std::string("\"") + topic + "\":3")) << topic << found;
  }
}

TEST_F(Mcap, ASwappedByteIsSeen) {
  ASSERT_TRUE(icat::write_mcap(recorded(100), path_.string()));
  FILE* file = std::fopen(path_.c_str(), "r+b");
  ASSERT_TRUE(file);
  std::fseek(file, static_cast<long>(fs::file_size(path_)) / 2, SEEK_SET);
  std::fputc('#', file);
  std::fclose(file);
  EXPECT_TRUE(has(read(), "WRONG"));
}

TEST(WriteMcap, SaysWhereAFileCannotBeWritten) {
  EXPECT_FALSE(icat::write_mcap(icat::Log(), "/nowhere/at/all.mcap"));
}

}  // namespace
