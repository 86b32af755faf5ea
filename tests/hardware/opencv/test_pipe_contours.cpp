// SPDX-License-Identifier: BSD-3-Clause
// The image pipeline on rendered pictures: lines, poses, turbidity, the arm, the rate.
#include <gtest/gtest.h>

#include <ctime>

#include "examples/14_perception/eyes.hpp"

namespace {

using namespace perception;
using icat::ContourKind;
using icat::Status;
constexpr double floor_depth = 3.5;

icat::StereoCamera<double> cameras() { return icat::parallel_cameras<double>(); }

Rig& rig() {
  static Rig instance(cameras());
  return instance;
}

Pool pool_of(const Pose& pipe) { return {.floor = floor_depth, .rods = {pipe_rod(pipe)}}; }

// How far the line is from the pipe's contour of its kind that is nearest, beside the middle of it,
// px.
double distance_from_truth(const icat::ContourLine<double>& line, const Pose& pipe) {
  double best = 1e9;
  for (int side = 0; side < 2; ++side) {
    const auto truth = line.kind == ContourKind::edge
                           ? icat::edge_segment<double>(cameras(), line.camera, {}, pipe, side)
                           : icat::end_segment<double>(cameras(), line.camera, {}, pipe, side);
    if (!truth) continue;
    const double turn = std::remainder(line.theta - truth->line.theta, 2 * CV_PI);
    if (std::abs(turn) > 0.2) continue;
    best = std::min(best, std::abs(line.distance((truth->from + truth->to) / 2)));
  }
  return best;
}

// The same for an end: the two points where the contours touch the rim, on both of its sides.
double distance_from_rim(const icat::ContourLine<double>& line, const Pose& pipe) {
  double best = 1e9;
  const auto k = cameras()[std::size_t(line.camera)];
  for (const double end : {-0.5, 0.5}) {
    icat::Pixel<double> middle;
    if (!k.project(k.from_rig(pipe * Vector3(0, end, 0)), middle)) continue;
    best = std::min(best, std::abs(line.distance(middle)));
  }
  return best;
}

// The edges of pixels of a lens that blurs by 0.6 px are found to 0.25 px, the finder's deviation;
// three of them.
constexpr double line_bound = 0.75;

// ρ and θ are correlated as the middle of the line is far from the corner of the picture: there the
// line is as certain as σ²/2 and some noise, while ρ alone is off by pixels.
void expect_certain_at_its_middle(const icat::ContourLine<double>& line, const Eyes& eyes) {
  const auto& finder = eyes.finder(std::size_t(line.camera));
  for (const auto& segment : finder.segments()) {
    if (segment.line.theta != line.theta || segment.line.rho != line.rho) continue;
    const icat::Pixel<double> middle = (segment.from + segment.to) / 2;
    const double t = std::cos(line.theta) * middle(1) - std::sin(line.theta) * middle(0);
    const auto& P = line.covariance;
    const double variance = P(1, 1) - 2 * t * P(0, 1) + t * t * P(0, 0);
    const double own = finder.options().deviation * finder.options().deviation / 2;
    EXPECT_GT(variance, own * 0.99);
    EXPECT_LT(variance, 2 * own);
  }
}

TEST(PipeContours, LinesAreThoseOfThePipe) {
  int edges = 0, ends = 0;
  for (const double range : {1.5, 2.0, 2.5}) {
    for (const double yaw : {0.5, 1.0, 1.4}) {
      const View view = look_at_pipe(floor_depth, range, yaw, 0.05, -0.05);
      const Pose pipe = view.camera.inverse() * view.pipe;
      // By headlights a contour is dark: an edge of brightness would be off by 0.8 px.
      const Pair pair =
          rig().take(pool_of(view.pipe), view.camera, yaw == 1.0 ? clear_night : clear_day);
      Eyes eyes(cameras());
      icat::CylinderMeasurement<double> found;
      ASSERT_EQ(eyes.look(pair, gravity_on(view.camera), found), Status::ok);
      for (const auto& line : eyes.lines()) {
        EXPECT_GT(line.covariance(0, 0), 0);
        EXPECT_GT(line.covariance.determinant(), 0);
        expect_certain_at_its_middle(line, eyes);
        if (line.kind == ContourKind::edge) {
          ++edges;
          EXPECT_LT(distance_from_truth(line, pipe), line_bound) << range << " m, yaw " << yaw;
        } else {
          ++ends;
          // The line passes the middle of the rim at r²/D, seen at a slant of a/D at most: 0.05² /
          // 1.5 · 0.6 m, 1 px there. An end has a tenth of the edge pixels of a contour.
          EXPECT_LT(distance_from_rim(line, pipe), 1 + 2 * line_bound)
              << range << " m, yaw " << yaw;
        }
      }
    }
  }
  EXPECT_EQ(edges, 4 * 9);
  EXPECT_GE(ends, 18);  // half of those there are: some lie at the border of a picture
}

// Depth of a stereo rig is as good as Z² / (f b) per pixel: 4 / (1200 · 0.25) m at 2 m; across the
// view it is better.
TEST(PipeContours, PoseAtTwoMetresInClearWater) {
  const double bound = line_bound * 4 / (1200 * 0.25);  // 10 mm
  cv::RNG random(4);
  double worst = 0, worst_along = 0, worst_angle = 0;
  for (int i = 0; i < 6; ++i) {
    const double yaw = random.uniform(0.4, 1.6);
    const View view =
        look_at_pipe(floor_depth, 2, yaw, random.uniform(-0.1, 0.1), random.uniform(-0.1, 0.1));
    const bool night = i % 3 == 2;
    const Pair pair = rig().take(pool_of(view.pipe), view.camera, night ? clear_night : clear_day);
    Eyes eyes(cameras());
    icat::CylinderMeasurement<double> found;
    ASSERT_EQ(eyes.look(pair, gravity_on(view.camera), found), Status::ok);
    const PoseError e = error_of(found, view.camera, view.pipe);
    worst = std::max(worst, e.across), worst_angle = std::max(worst_angle, e.angle);
    if (found.end_seen) worst_along = std::max(worst_along, e.along);
    // Angle: both ends of a pipe of 1 m off by the bound, apart.
    EXPECT_LT(e.angle, 2 * bound) << "yaw " << yaw;
  }
  std::printf("pose at 2 m: across %.1f mm, along %.1f mm, %.1f mrad at worst\n", 1e3 * worst,
              1e3 * worst_along, 1e3 * worst_angle);
  EXPECT_LT(worst, bound);
  EXPECT_LT(worst_along, bound);
}

TEST(PipeContours, SeesLessThroughTurbidWaterAndAtLastNothing) {
  std::array<int, 4> found{};
  for (const double range : {1.4, 2.3}) {
    const View view = look_at_pipe(floor_depth, range, 0.9);
    const auto all = conditions();
    const auto pairs = rig().take(pool_of(view.pipe), view.camera, all);
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      Eyes eyes(cameras());
      icat::CylinderMeasurement<double> pipe;
      found[i] += eyes.look(pairs[i], gravity_on(view.camera), pipe) == Status::ok;
      EXPECT_TRUE(i < 3 || eyes.lines().empty());
    }
  }
  EXPECT_EQ(found, (std::array<int, 4>{2, 2, 1, 0}));
}

TEST(PipeContours, AnEmptyPoolHasNoPipe) {
  const View view = look_at_pipe(floor_depth, 2, 0.9);
  for (const Condition& c : conditions()) {
    const Pair pair = rig().take({.floor = floor_depth, .rods = {}}, view.camera, c);
    Eyes eyes(cameras());
    icat::CylinderMeasurement<double> pipe;
    EXPECT_EQ(eyes.look(pair, gravity_on(view.camera), pipe), Status::not_measured) << c.name;
  }
}

// The arm from below over the pipe; its forearm is as yellow as the pipe.
struct ArmScene {
  ArmScene() : robot(make_robot()), mask(robot, robot.frame("camera"), cameras(), boxes()) {
    icat::Vector<double, 7> q;
    q << 0, 0.7, 0, -1.8, 0, 1.1, 0;
    Pose base = Pose::Identity();
    base.translation() = Vector3(0, 0.02, 1.6);
    EXPECT_EQ(robot.update(q, base), Status::ok);
    EXPECT_EQ(mask.update(), Status::ok);
    camera = robot.pose(robot.frame("camera"));
  }
  std::vector<icat::FrameBox<double>> boxes() const { return arm_boxes(robot); }
  Robot robot;
  icat::ArmMask<Robot> mask;
  Pose camera;
};

// Lines of edges and ends that are none of the pipe's.
int false_lines(const Eyes& eyes, const Pose& pipe) {
  int count = 0;
  for (const auto& line : eyes.lines()) {
    const double off = line.kind == ContourKind::edge ? distance_from_truth(line, pipe)
                                                      : distance_from_rim(line, pipe);
    count += off > 5;
  }
  return count;
}

TEST(PipeContours, TheMaskRemovesContoursOfTheArm) {
  ArmScene scene;
  Pose pipe = Pose::Identity();
  // The forearm is longer in the picture than the part of the pipe that is in it.
  pipe.linear() = icat::axis_rotation<double>(Vector3(0, 0, 1), 0.3);
  pipe.translation() = Vector3(0.45, -0.68, floor_depth - 0.08);
  Pool pool = pool_of(pipe);
  add_arm(pool, scene.robot, true);
  const Pair pair = rig().take(pool, scene.camera);
  const Pose seen = scene.camera.inverse() * pipe;
  Eyes eyes(cameras());
  icat::CylinderMeasurement<double> found;

  (void)eyes.look(pair, gravity_on(scene.camera), found);
  EXPECT_GT(false_lines(eyes, seen), 0) << "the scene is too easy";

  eyes.mask(scene.mask.outline());
  ASSERT_EQ(eyes.look(pair, gravity_on(scene.camera), found), Status::ok);
  EXPECT_EQ(false_lines(eyes, seen), 0);
  for (std::size_t k = 0; k < 2; ++k) EXPECT_GE(eyes.finder(k).lines().size(), 2u);

  eyes.mask({});  // forgotten again
  (void)eyes.look(pair, gravity_on(scene.camera), found);
  EXPECT_GT(false_lines(eyes, seen), 0);
}

TEST(PipeContours, AnArmAcrossThePipeLeavesItsContours) {
  ArmScene scene;
  Pose pipe = Pose::Identity();
  pipe.linear() = icat::axis_rotation<double>(Vector3(0, 0, 1), 0.3);
  pipe.translation() = Vector3(0.30, 0, floor_depth - 0.08);
  Pool pool = pool_of(pipe);
  add_arm(pool, scene.robot);
  const Pair pair = rig().take(pool, scene.camera);
  Eyes eyes(cameras());
  eyes.mask(scene.mask.outline());
  icat::CylinderMeasurement<double> found;
  ASSERT_EQ(eyes.look(pair, gravity_on(scene.camera), found), Status::ok);
  EXPECT_EQ(false_lines(eyes, scene.camera.inverse() * pipe), 0);
}

// [MARIS, II-B]: about 10 Hz, of what the rest of a period leaves.
TEST(PipeContours, TenPairsASecondOnOneCore) {
  const View view = look_at_pipe(floor_depth, 1.5, 0.9);
  const Pair pair = rig().take(pool_of(view.pipe), view.camera);
  Eyes eyes(cameras());
  icat::CylinderMeasurement<double> found;
  const int threads = cv::getNumThreads();
  cv::setNumThreads(1);
  ASSERT_EQ(eyes.look(pair, gravity_on(view.camera), found), Status::ok);
  constexpr int times = 20;
  const std::clock_t start = std::clock();
  for (int i = 0; i < times; ++i) (void)eyes.look(pair, gravity_on(view.camera), found);
  const double each = double(std::clock() - start) / CLOCKS_PER_SEC / times;
  cv::setNumThreads(threads);
  std::printf("latency of a pair of 1292 x 964 pictures: %.1f ms of the processor, %.0f Hz\n",
              1e3 * each, 1 / each);
  EXPECT_LT(each, 0.1);
}

// Pictures that no camera takes: bounded time, no lines that are not finite.
TEST(PipeContours, NoiseAndFlatPicturesHaveNoPipe) {
  cv::RNG random(8);
  icat::PipeContours finder({1292, 964}, 0);
  cv::Mat noise(964, 1292, CV_8UC3), coarse(60, 80, CV_8UC3), blobs;
  random.fill(noise, cv::RNG::UNIFORM, 0, 256);
  EXPECT_EQ(finder.find(noise), Status::not_measured);
  for (const int level : {0, 1, 128, 255}) {
    EXPECT_EQ(finder.find(cv::Mat(964, 1292, CV_8UC3, cv::Scalar::all(level))),
              Status::not_measured);
  }
  // Yellow and grey patches: borders everywhere, few of them straight.
  for (int i = 0; i < 5; ++i) {
    random.fill(coarse, cv::RNG::UNIFORM, 0, 256);
    coarse.forEach<cv::Vec3b>([](cv::Vec3b& p, const int*) {
      p = p[0] < 128 ? cv::Vec3b(20, 160, 230) : cv::Vec3b(230, 140, 110);
    });
    cv::resize(coarse, blobs, {1292, 964}, 0, 0, cv::INTER_CUBIC);
    const std::clock_t start = std::clock();
    const Status status = finder.find(blobs);
    EXPECT_LT(double(std::clock() - start) / CLOCKS_PER_SEC, 0.1);
    EXPECT_TRUE(status == Status::ok || status == Status::not_measured);
    for (const auto& line : finder.lines()) EXPECT_TRUE(line.covariance.allFinite());
  }
}

TEST(PipeContours, RefusesWhatIsNoPicture) {
  icat::PipeContours finder({640, 480}, 1);
  EXPECT_EQ(finder.find({}), Status::wrong_size);
  EXPECT_EQ(finder.find(cv::Mat(480, 640, CV_8U)), Status::wrong_size);
  EXPECT_EQ(finder.find(cv::Mat(480, 640, CV_32FC3)), Status::wrong_size);
  EXPECT_EQ(finder.find(cv::Mat(482, 640, CV_8UC3)), Status::wrong_size);
  EXPECT_TRUE(finder.lines().empty());

  std::vector<icat::Pixel<double>> polygon{{10, 10}, {20, 10}};
  EXPECT_EQ(finder.add_mask(polygon), Status::wrong_size);
  polygon.emplace_back(std::nan(""), 30);
  EXPECT_EQ(finder.add_mask(polygon), Status::non_finite);
  EXPECT_EQ(cv::countNonZero(finder.mask()), 0);
  polygon.back() = {1e300, 1e300};
  EXPECT_EQ(finder.add_mask(polygon), Status::ok);
  polygon.resize(65, {1, 2});
  EXPECT_EQ(finder.add_mask(polygon), Status::wrong_size);
  finder.clear_mask();
  EXPECT_EQ(cv::countNonZero(finder.mask()), 0);
}

TEST(PipeContours, RefusesBadConfigurations) {
  const auto refuses = [](icat::PipeContoursOptions o, cv::Size size = {640, 480}, int camera = 0) {
    EXPECT_THROW(icat::PipeContours(size, camera, o), std::invalid_argument);
  };
  EXPECT_NO_THROW(icat::PipeContours({640, 480}, 0));
  refuses({}, {0, 480});
  refuses({}, {-640, 480});
  refuses({}, {640, 480}, 2);
  refuses({.hue_min = 40});
  refuses({.hue_max = 256});
  refuses({.saturation_min = -1});
  refuses({.max_gain = 0.5});
  refuses({.min_length = 0});
  refuses({.max_convergence = 1});
  refuses({.min_support = 1.1});
  refuses({.min_contrast = std::nan("")});
  refuses({.mask_margin = -1});
  refuses({.deviation = 0});
}

}  // namespace
