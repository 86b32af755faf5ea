// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// What the page of replay.hpp and live.hpp shows: shapes that move with poses and points of a log,
/// and plots of its numbers.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "icat/control/log.hpp"

namespace icat {

/// What is drawn of a robot or of its world.
enum class ReplayForm {
  box,       ///< size: along x, y, z
  sphere,    ///< size: radius
  cylinder,  ///< size: radius, length along z
  capsule,   ///< the same with half spheres at its ends
  cone,      ///< size: half angle (rad), length; from the origin along z: what a camera sees
  axes,      ///< size: length; of a goal
  bone,      ///< size: radius; from the origin of `frame` to that of `to`: a link
  path,      ///< the way of the origin of `frame`
  ground     ///< size: edge; a grid of 1 m in the x-y plane
};

/// A thing that is drawn. Sizes in m.
struct ReplayShape {
  ReplayForm form;                           ///< what it is
  std::string frame = {};                    ///< a pose or point of the log; empty: ⟨0⟩
  Pose<double> at = IdentityPose{};          ///< its place in the frame
  std::array<double, 3> size = {0.1, 0, 0};  ///< see `ReplayForm`
  std::string to = {};                       ///< of a bone: the other pose or point
  std::string color = "#e08e1b";             ///< as in CSS
  double opacity = 1;                        ///< in [0, 1]
};

/// A picture below: numbers of the log over time.
struct ReplayPlot {
  std::string title;                  ///< above it
  std::vector<std::string> channels;  ///< all whose names begin with one of these, "activation/"
  std::string unit = {};              ///< empty: of the first channel
  double least = 0;                   ///< of the axis
  double most = 0;                    ///< of the axis; both equal: what the numbers need
  bool logarithmic = false;           ///< only numbers > 0
};

/// A column of the page.
struct ReplayRun {
  std::string name;                      ///< short, on a button; unique
  std::string title;                     ///< above its picture
  const Log* log;                        ///< not null, lives until the page is written
  std::vector<ReplayShape> shapes = {};  ///< the robot and its world
  std::vector<ReplayPlot> plots = {};    ///< none: activations and errors, velocities
};

/// The page as a whole.
struct ReplayOptions {
  std::string title = "icat replay";    ///< of the page
  bool z_down = false;                  ///< ⟨0⟩ is NED
  std::vector<std::string> shown = {};  ///< runs that are shown at first; none: the first two
  double azimuth = -0.9;    ///< rad, from where one looks at first: 0 along −x of ⟨0⟩
  double elevation = 0.45;  ///< rad, above the horizon
  double period = 0.05;     ///< s, between samples of the page; less than the log's: all
};

}  // namespace icat
