// SPDX-License-Identifier: BSD-3-Clause
// A pair of cameras sees a yellow pipe in a pool, by day and night, through clear and turbid water,
// with the arm in view. Images are rendered; the library does the rest.
#include <chrono>
#include <cstdio>
#include <ctime>
#include <numbers>

#include "../support/command_line.hpp"
#include "../support/csv.hpp"
#include "../support/support.hpp"
#include "pictures.hpp"

using namespace perception;
constexpr double floor_depth = 3.5;
const cv::Scalar yellow_ink(0, 255, 255), purple(220, 40, 160), green(60, 220, 60);

// The four conditions of [MARIS, Fig. 13], from some ranges; the picture is that from 2 m. How
// often the pipe is found in each.
std::array<int, 4> show_conditions(Rig& rig, const std::string& folder) {
  constexpr std::array ranges{1.4, 1.7, 2.0, 2.3};
  const auto all = conditions();
  std::array<int, 4> found{};
  std::array<double, 4> across{}, along{};
  std::array<cv::Mat, 4> small;
  constexpr int width = 400;
  for (const double range : ranges) {
    const View view = look_at_pipe(floor_depth, range, 0.9, 0.05, -0.2);
    const Pool pool{.floor = floor_depth, .rods = {pipe_rod(view.pipe)}};
    const auto pairs = rig.take(pool, view.camera, all);
    for (std::size_t i = 0; i < all.size(); ++i) {
      Eyes eyes(rig.cameras());
      icat::CylinderMeasurement<double> pipe;
      if (eyes.look(pairs[i], gravity_on(view.camera), pipe) == icat::Status::ok) {
        const PoseError e = error_of(pipe, view.camera, view.pipe);
        ++found[i];
        across[i] = std::max(across[i], e.across);
        if (pipe.end_seen) along[i] = std::max(along[i], e.along);
      }
      if (range != 2) continue;
      cv::imwrite(folder + "/" + all[i].file + ".png", pairs[i][0]);
      small[i] = thumbnail(pairs[i][0], width);
      for (auto s : eyes.finder(0).segments()) {
        const double scale = width / rig.cameras()[0].width;
        s.from *= scale, s.to *= scale;
        draw_segment(small[i], s, yellow_ink, 1);
      }
      write_title(small[i], all[i].name);
    }
  }
  std::printf("%-26s %-8s %20s %12s\n", "the pipe at 1.4 … 2.3 m", "found", "worst: across",
              "along");
  for (std::size_t i = 0; i < all.size(); ++i) {
    std::printf("%-26s %d of %zu ", all[i].name, found[i], ranges.size());
    if (found[i]) std::printf("%18.1f mm %9.1f mm", 1e3 * across[i], 1e3 * along[i]);
    std::printf("\n");
  }
  cv::Mat top, bottom, sheet;
  cv::hconcat(small[0], small[1], top);
  cv::hconcat(small[2], small[3], bottom);
  cv::vconcat(top, bottom, sheet);
  cv::imwrite(folder + "/conditions.png", sheet);
  return found;
}

// The vehicle comes down on the pipe at night, the arm before it [MARIS, Fig. 16]: measured
// contours yellow, tracked ones purple and green, the mask dark. Pictures in which a line was
// taken that is none of the pipe.
int follow(Rig& rig, const std::string& folder) {
  Robot robot = make_robot();
  icat::Vector<double, 7> q;
  q << 0, 0.7, 0, -1.8, 0, 1.1, 0;
  Pose base = Pose::Identity(), pipe = Pose::Identity();
  const icat::FrameId camera = robot.frame("camera");
  icat::ArmMask<Robot> mask(robot, camera, rig.cameras(), arm_boxes(robot));
  pipe.linear() = icat::axis_rotation<double>(Vector3(0, 0, 1), 0.15);
  pipe.translation() = Vector3(0.37, 0, floor_depth - 0.08);
  using Tracker = icat::LineTracker<double>;
  std::vector<Tracker> trackers;
  for (int k = 0; k < 2; ++k) {
    for (int side = 0; side < 2; ++side) {
      trackers.emplace_back(rig.cameras(), k, icat::ContourKind::edge);
    }
  }
  Eyes eyes(rig.cameras());
  int wrong = 0;
  double worst = 0;
  cv::Mat sheet;
  constexpr int pictures = 6;
  for (int i = 0; i < pictures; ++i) {
    base.translation() = Vector3(0.01 * i - 0.05, 0.02, 1.39 + 0.06 * i);
    if (robot.update(q, base) != icat::Status::ok || mask.update() != icat::Status::ok) return 99;
    Pool pool{.floor = floor_depth, .rods = {pipe_rod(pipe)}};
    add_arm(pool, robot);
    Pair pair = rig.take(pool, robot.pose(camera), clear_night);
    eyes.mask(mask.outline());
    icat::CylinderMeasurement<double> measured;
    const icat::Status status = eyes.look(pair, gravity_on(robot.pose(camera)), measured);
    if (status == icat::Status::ok) {
      const PoseError e = error_of(measured, robot.pose(camera), pipe);
      worst = std::max(worst, e.across);
      if (e.across > 0.03) ++wrong;
    } else {
      ++wrong;
    }
    for (std::size_t k = 0; k < trackers.size(); k += 2) {
      const bool second_first = trackers[k + 1].life() > trackers[k].life();
      Tracker& one = trackers[k + second_first];
      Tracker& other = trackers[k + !second_first];
      const int taken = one.step(0.1, eyes.lines());
      (void)other.step(0.1, eyes.lines(), taken);
    }
    if (i != 2 && i != pictures - 1) continue;
    cv::Mat both;
    for (std::size_t k = 0; k < 2; ++k) {
      draw_mask(pair[k], eyes.finder(k).mask());
      for (std::size_t side = 0; side < 2; ++side) {
        const Tracker& t = trackers[2 * k + side];
        if (t.alive()) draw_line(pair[k], t.line(), side == 0 ? purple : green);
      }
      for (const auto& s : eyes.finder(k).segments()) draw_segment(pair[k], s, yellow_ink);
    }
    cv::imwrite(folder + "/tracked_" + std::to_string(i) + "_left.png", pair[0]);
    cv::imwrite(folder + "/tracked_" + std::to_string(i) + "_right.png", pair[1]);
    cv::hconcat(thumbnail(pair[0], 380), thumbnail(pair[1], 380), both);
    sheet.empty() ? both.copyTo(sheet) : cv::vconcat(sheet, both, sheet);
  }
  cv::imwrite(folder + "/tracked.png", sheet);
  std::printf("with the arm in view, at night: %d of %d images give the axis, within %.1f mm\n",
              pictures - wrong, pictures, 1e3 * worst);
  return wrong;
}

// How often a pair of pictures can be worked through, on one core.
double measure_rate(Rig& rig) {
  const View view = look_at_pipe(floor_depth, 1.5, 0.9);
  const Pool pool{.floor = floor_depth, .rods = {pipe_rod(view.pipe)}};
  const Pair pair = rig.take(pool, view.camera);
  Eyes eyes(rig.cameras());
  icat::CylinderMeasurement<double> pipe;
  const int threads = cv::getNumThreads();
  cv::setNumThreads(1);
  (void)eyes.look(pair, gravity_on(view.camera), pipe);
  constexpr int times = 40;
  const std::clock_t cpu = std::clock();
  const auto start = std::chrono::steady_clock::now();
  for (int i = 0; i < times; ++i) (void)eyes.look(pair, gravity_on(view.camera), pipe);
  const double used = double(std::clock() - cpu) / CLOCKS_PER_SEC / times;
  const std::chrono::duration<double> passed = std::chrono::steady_clock::now() - start;
  cv::setNumThreads(threads);
  std::printf(
      "a pair of 1292 x 964 pictures: %.1f ms, %.1f ms of the processor, %.0f pairs a second on\n"
      "one core\n",
      1e3 * passed.count() / times, 1e3 * used, 1 / used);
  return 1 / used;
}

// Detection and error over range and turbidity.
void sweep(Rig& rig, const std::string& folder, int poses) {
  constexpr std::array ranges{1.0, 1.5, 2.0, 2.5, 3.0, 4.0};
  constexpr std::array scatterings{clear, 0.2, 0.4, 0.55, 0.8, 1.8};
  support::Csv csv(folder, "sweep.csv", "range,scattering,rate,across,along,angle");
  support::ProgressBar bar("pictures");
  std::vector<Condition> waters(scatterings.size(), clear_day);
  for (std::size_t w = 0; w < waters.size(); ++w) waters[w].water = turbid(scatterings[w]);
  struct Cell {
    std::vector<double> across, along, angle;
  };
  std::vector<Cell> cells(ranges.size() * scatterings.size());
  cv::RNG random(11);
  for (std::size_t r = 0; r < ranges.size(); ++r) {
    for (int n = 0; n < poses; ++n) {
      const double yaw = random.uniform(0.4, 1.6), right = random.uniform(-0.1, 0.1);
      const View view = look_at_pipe(floor_depth, ranges[r], yaw, right, random.uniform(-0.1, 0.1));
      // The camera stays in the water: with more range the pool is deeper.
      View deeper = view;
      const double down = std::max(0.0, 0.3 - view.camera.translation().z());
      deeper.camera.translation().z() += down, deeper.pipe.translation().z() += down;
      const Pool pool{.floor = floor_depth + down, .rods = {pipe_rod(deeper.pipe)}};
      const auto pairs = rig.take(pool, deeper.camera, waters);
      for (std::size_t w = 0; w < pairs.size(); ++w) {
        Eyes eyes(rig.cameras());
        icat::CylinderMeasurement<double> pipe;
        if (eyes.look(pairs[w], gravity_on(deeper.camera), pipe) != icat::Status::ok) continue;
        const PoseError e = error_of(pipe, deeper.camera, deeper.pipe);
        Cell& cell = cells[w * ranges.size() + r];
        cell.across.push_back(e.across);
        cell.angle.push_back(e.angle);
        if (pipe.end_seen) cell.along.push_back(e.along);
      }
      bar.show(double(r * std::size_t(poses) + std::size_t(n)) / double(ranges.size()) / poses);
    }
  }
  const auto rms = [](const std::vector<double>& values) {
    double sum = 0;
    for (const double v : values) sum += v * v / double(values.size());
    return values.empty() ? std::nan("") : std::sqrt(sum);
  };
  std::printf("\ndetected, and error across the axis (mm, rms), of %d pairs each\n%-14s", poses,
              "scattering");
  for (const double r : ranges) std::printf(" %8.1f m ", r);
  for (std::size_t w = 0; w < scatterings.size(); ++w) {
    std::printf("\n%5.2f /m      ", scatterings[w]);
    for (std::size_t r = 0; r < ranges.size(); ++r) {
      const Cell& c = cells[w * ranges.size() + r];
      const double rate = double(c.across.size()) / poses;
      csv.row({ranges[r], scatterings[w], rate, rms(c.across), rms(c.along), rms(c.angle)});
      std::printf(" %3.0f %%", 100 * rate);
      if (c.across.empty()) std::printf("      ");
      if (!c.across.empty()) std::printf(" %4.1f ", 1e3 * rms(c.across));
    }
  }
  std::printf("\n\n");
}

int main(int argc, char** argv) {
  const auto arguments = support::parse(
      argc, argv,
      "Two cameras see a pipe: four conditions, past the arm, over range and turbidity.",
      "out/14_perception", {}, {"--long", "ten pairs of pictures for each range and turbidity"});
  { support::Csv folder(arguments.output, "run.csv", "made by 14_perception"); }
  Rig rig(icat::parallel_cameras<double>());
  const auto found = show_conditions(rig, arguments.output);
  const int wrong = follow(rig, arguments.output);
  const double rate = measure_rate(rig);
  sweep(rig, arguments.output, arguments.extended ? 10 : 1);
  if (arguments.pictures) support::draw(arguments.output);
  const bool as_published =
      found[0] == 4 && found[1] == 4 && found[2] > 0 && found[2] < 4 && found[3] == 0;
  return as_published && wrong <= 1 && rate > 10 ? 0 : 1;
}
