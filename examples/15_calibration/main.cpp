// SPDX-License-Identifier: BSD-3-Clause
// Two cameras behind flat ports are calibrated in air and in water, then relative to the arm by a
// board on its wrist, and measure a pipe: the error under water of parameters calibrated in air.
#include <cstdio>

#include "../14_perception/pictures.hpp"
#include "../support/command_line.hpp"
#include "../support/csv.hpp"
#include "../support/support.hpp"
#include "wrist.hpp"

using namespace calibration;

// A set of parameters, with ᵇT_c that belongs to it.
struct Parameters {
  const char* name;
  StereoCalibration cameras;
  Pose mount = Pose::Identity();
};

void print(const Parameters& p) {
  for (std::size_t k = 0; k < 2; ++k) {
    const cv::Mat &K = p.cameras.cameras[k].matrix, &d = p.cameras.cameras[k].distortion;
    std::printf("%-8s %-6s %8.1f %8.1f %8.1f %8.3f %8.3f %10.3f px\n", p.name, k ? "right" : "left",
                K.at<double>(0, 0), K.at<double>(0, 2), K.at<double>(1, 2), d.at<double>(0),
                d.at<double>(1), p.cameras.cameras[k].error);
  }
  std::printf("%-8s baseline %.1f mm, both %.3f px\n", p.name,
              1e3 * p.cameras.right.translation().norm(), p.cameras.error);
}

struct RangeError {
  double in_camera = 0, in_arm = 0;  ///< m, rms
};

// Of points all over the common view at `range`.
RangeError error_at(const Parameters& p, const PortRig& rig, const Pose& truth, double range) {
  RangeError e;
  int count = 0;
  for (const double x : {-0.3, -0.15, 0.0, 0.15, 0.3}) {
    for (const double y : {-0.2, -0.1, 0.0, 0.1, 0.2}) {
      const Vector3 point(0.125 + x * range, y * range, range);
      std::array<cv::Point2d, 2> pixels;
      bool inside = true;
      for (std::size_t k = 0; k < 2; ++k) {
        pixels[k] = rig.cameras[k].project(rig.poses[k].inverse() * point);
        inside = inside && cv::Rect(cv::Point(), picture_size).contains(cv::Point(pixels[k]));
      }
      if (!inside) continue;
      const Vector3 found = triangulate(p.cameras, pixels);
      e.in_camera += (found - point).squaredNorm();
      e.in_arm += (p.mount * found - truth * point).squaredNorm();
      ++count;
    }
  }
  if (count == 0) return {};
  return {std::sqrt(e.in_camera / count), std::sqrt(e.in_arm / count)};
}

// The pinholes of a set of parameters, for pictures without distortion.
icat::StereoCamera<double> pinholes(const StereoCalibration& c) {
  icat::StereoCamera<double> cameras = icat::parallel_cameras<double>();
  for (std::size_t k = 0; k < 2; ++k) {
    const cv::Mat& K = c.cameras[k].matrix;
    cameras[k] = {K.at<double>(0, 0), K.at<double>(1, 1),         K.at<double>(0, 2),
                  K.at<double>(1, 2), double(picture_size.width), double(picture_size.height)};
  }
  cameras[1].pose = c.right;
  return cameras;
}

// The pipe in rectified pictures, in ⟨b⟩: the error of its axis, m; NaN where it is not found.
double pipe_error(const Parameters& p, const perception::Pair& pictures, const Pose& truth,
                  const Pose& pipe, const Vector3& gravity) {
  perception::Pair straight;
  for (std::size_t k = 0; k < 2; ++k) {
    const Intrinsics& c = p.cameras.cameras[k];
    cv::undistort(pictures[k], straight[k], c.matrix, c.distortion);
  }
  perception::Eyes eyes(pinholes(p.cameras));
  icat::CylinderMeasurement<double> found;
  if (eyes.look(straight, gravity, found) != icat::Status::ok) return std::nan("");
  found.frame = p.mount * found.frame;
  return perception::error_of(found, Pose::Identity(), truth * pipe).across;
}

void report_mount(const char* name, const std::vector<Pose>& each, const Pose& truth) {
  double position = 0, angle = 0;
  for (const Pose& pose : each) {
    const auto d = support::distance(pose, truth);
    position += d.position * d.position / double(each.size());
    angle += d.orientation * d.orientation / double(each.size());
  }
  const auto mean = support::distance(average(each), truth);
  std::printf("%-34s %7.1f mm %6.1f mrad %10.1f mm %6.1f mrad\n", name, 1e3 * std::sqrt(position),
              1e3 * std::sqrt(angle), 1e3 * mean.position, 1e3 * mean.orientation);
}

// The board on the wrist as the left camera sees it, with the corners that were found [Fig. 11].
void write_board(const std::string& folder, const cv::Mat& picture,
                 const std::vector<cv::Point2f>& corners) {
  cv::Mat color;
  cv::cvtColor(picture, color, cv::COLOR_GRAY2BGR);
  cv::drawChessboardCorners(color, board_corners, corners, true);
  cv::imwrite(folder + "/board.png", perception::thumbnail(color, 500));
  std::printf("\nthe board on the wrist: %zu corners found\n", corners.size());
}

int main(int argc, char** argv) {
  const auto arguments = support::parse(
      argc, argv, "Cameras behind flat ports: calibration in air, in water, on the arm.",
      "out/15_calibration");
  // The same cameras in two media.
  const PortRig in_water = port_rig({}), in_air = port_rig({.water_index = 1});
  Parameters air{"in air", calibrate(in_air, 12, 5)}, water{"in water", calibrate(in_water, 12, 5)};
  std::printf("%-8s %-6s %8s %8s %8s %8s %8s %13s\n", "", "", "f", "cx", "cy", "k1", "k2",
              "reprojection");
  print(air), print(water);

  // On the arm, both sets in the water; then with a board that is not where it was measured to be.
  WristBoard wrist;
  const auto views = wrist.take(in_water.cameras[0], 15, 21);
  const auto with_water = camera_in_arm(views, wrist.board(), water.cameras.cameras[0]);
  const auto with_air = camera_in_arm(views, wrist.board(), air.cameras.cameras[0]);
  Pose by_hand = wrist.board();
  by_hand.translation() += Vector3(0.002, -0.001, 0.001);
  by_hand.linear() *= icat::rotation_exp<double>(Vector3(0.005, 0.003, -0.004));
  std::printf("\n%-34s %-25s %s\n", "the cameras on the arm", "one posture (rms)", "average of 15");
  report_mount("in-water parameters", with_water, wrist.camera());
  report_mount("board wrong by 2.4 mm and 7 mrad",
               camera_in_arm(views, by_hand, water.cameras.cameras[0]), wrist.camera());
  report_mount("in-air parameters", with_air, wrist.camera());
  water.mount = average(with_water), air.mount = average(with_air);

  std::printf(
      "\npoints, rms (mm)     in-air parameters            in-water parameters\n"
      "range      in the camera   on the arm     in the camera   on the arm\n");
  double near_error = 0;
  {
    support::Csv csv(arguments.output, "range.csv",
                     "range,air_camera,air_arm,water_camera,water_arm");
    for (double range = 0.5; range < 4.01; range += 0.25) {
      const RangeError a = error_at(air, in_water, wrist.camera(), range);
      const RangeError w = error_at(water, in_water, wrist.camera(), range);
      csv.row({range, a.in_camera, a.in_arm, w.in_camera, w.in_arm});
      if (range == 2) near_error = w.in_arm;
      if (std::fmod(range, 1) > 0.01 && range != 0.5) continue;
      std::printf("%4.1f m %13.1f %14.1f %15.1f %14.1f\n", range, 1e3 * a.in_camera, 1e3 * a.in_arm,
                  1e3 * w.in_camera, 1e3 * w.in_arm);
    }
  }

  if (!views.empty()) write_board(arguments.output, wrist.picture(), views.front().corners);

  // A pipe through the ports; the left picture as it is and rectified by both sets [Fig. 12].
  std::printf("\nthe axis of a pipe (mm)   in-air parameters   in-water parameters\n");
  perception::Renderer renderer;
  perception::Sensor sensor(9);
  double pipe_off = 1;
  for (const double range : {1.0, 2.0, 3.0}) {
    const auto view = perception::look_at_pipe(3.5, range, 0.9);
    const double down = std::max(0.0, 0.3 - view.camera.translation().z());
    Pose camera = view.camera, pipe = view.pipe;
    camera.translation().z() += down, pipe.translation().z() += down;
    const perception::Pool pool{.floor = 3.5 + down, .rods = {perception::pipe_rod(pipe)}};
    perception::Pair pictures;
    for (std::size_t k = 0; k < 2; ++k) {
      const auto& seen =
          renderer.render(pool, camera * in_water.poses[k], picture_size, in_water.cameras[k]);
      pictures[k] = sensor.take(seen, picture_size, camera.translation().z(),
                                perception::turbid(perception::clear), {});
    }
    const Vector3 gravity = perception::gravity_on(camera);
    const Pose in_camera = camera.inverse() * pipe;
    const double a = pipe_error(air, pictures, wrist.camera(), in_camera, gravity);
    const double w = pipe_error(water, pictures, wrist.camera(), in_camera, gravity);
    std::printf("%4.1f m %30.1f %21.1f\n", range, 1e3 * a, 1e3 * w);
    if (range != 2) continue;
    pipe_off = w;
    cv::Mat sheet = perception::thumbnail(pictures[0], 380);
    perception::write_title(sheet, "original");
    for (const Parameters* p : {&air, &water}) {
      cv::Mat straight;
      const Intrinsics& c = p->cameras.cameras[0];
      cv::undistort(pictures[0], straight, c.matrix, c.distortion);
      straight = perception::thumbnail(straight, 380);
      perception::write_title(straight, p->name);
      cv::hconcat(sheet, straight, sheet);
    }
    cv::imwrite(arguments.output + "/rectified.png", sheet);
  }
  if (arguments.pictures) support::draw(arguments.output);
  return water.cameras.error < 0.1 && near_error < 0.01 && pipe_off < 0.01 ? 0 : 1;
}
