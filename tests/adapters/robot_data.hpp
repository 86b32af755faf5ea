// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The URDF files of example-robot-data (PyPI): which there are, which are refused, and a state of
/// each on which two programs agree.
#pragma once

#include <algorithm>
#include <filesystem>
#include <icat/adapters/urdf.hpp>
#include <map>
#include <ostream>
#include <random>
#include <string>
#include <vector>

namespace robot_data {

/// All below `folder`, sorted, relative to it.
inline std::vector<std::string> files(const std::string& folder) {
  std::vector<std::string> files;
  if (!std::filesystem::is_directory(folder)) return files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.path().extension() == ".urdf") {
      files.push_back(std::filesystem::relative(entry.path(), folder).string());
    }
  }
  std::sort(files.begin(), files.end());
  return files;
}

/// Sentences of refusal.
inline const std::map<std::string, std::string>& refused() {
  static const std::map<std::string, std::string> sentences{
      {"alex_description/urdf/alex_psyonic_hands.urdf",
       "joint 'Left_index_q2' follows 'index_q1', and there is no such joint"},
      {"ur_description/urdf/ur3.urdf", "is no URDF: No name given for the robot."}};
  return sentences;
}

/// Two files have no moving joint: nothing moves unless the base does.
inline icat::UrdfOptions<double> options(const std::string& file) {
  icat::UrdfOptions<double> options;
  for (const char* const still : {"quadrotor_base.urdf", "iris_simple.urdf"}) {
    if (file.ends_with(still)) options.base = icat::Base<double>::free();
  }
  return options;
}

/// Inside the limits; what has none turns up to ±3.
inline Eigen::VectorXd random_positions(const icat::KinematicTree<double>& tree,
                                        std::mt19937& generator) {
  Eigen::VectorXd q(static_cast<Eigen::Index>(tree.joints().size()));
  for (Eigen::Index i = 0; i < q.size(); ++i) {
    const auto& joint = tree.joints()[static_cast<std::size_t>(i)];
    const double lower = std::max(joint.lower, -3.0), upper = std::min(joint.upper, 3.0);
    const double share = static_cast<double>(generator()) / 4294967295.0;
    q(i) = lower + share * (upper - lower);
  }
  return q;
}

/// Poses and Jacobians of all links at one random state, as numbers.
inline std::vector<double> snapshot(icat::KinematicTree<double>& tree) {
  std::mt19937 generator(1);
  if (tree.update(random_positions(tree, generator)) != icat::Status::ok) return {};
  std::vector<double> numbers;
  for (Eigen::Index i = 0; i < tree.frame_count(); ++i) {
    const Eigen::Matrix4d pose = tree.pose(icat::FrameId(i)).matrix();
    const auto& J = tree.jacobian(icat::FrameId(i));
    numbers.insert(numbers.end(), pose.data(), pose.data() + pose.size());
    numbers.insert(numbers.end(), J.data(), J.data() + J.size());
  }
  return numbers;
}
inline void write(std::ostream& stream, icat::KinematicTree<double>& tree) {
  const auto numbers = snapshot(tree);
  stream.write(reinterpret_cast<const char*>(numbers.data()),
               static_cast<std::streamsize>(numbers.size() * sizeof(double)));
}

}  // namespace robot_data
