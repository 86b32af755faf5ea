// SPDX-License-Identifier: BSD-3-Clause
// What robot middleware brings, however wrong: messages of joints and of odometry with any names,
// sizes, numbers and stamps. What is held is finite, of norm 1, and was in a message; its age grows
// unless something newer came.
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include "icat/adapters/robot_frames.hpp"
#include "icat/adapters/ros1.hpp"

namespace {

// Bytes as numbers, zeros when they end.
class Input {
 public:
  Input(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {}
  bool empty() const { return size_ == 0; }
  std::uint8_t byte() {
    if (size_ == 0) return 0;
    --size_;
    return *data_++;
  }
  // All bits of a double, or a small number, which meets others.
  double number() {
    const std::uint8_t kind = byte();
    if (kind < 128) return kind / 16.0;
    if (kind < 136) return std::numeric_limits<double>::quiet_NaN();
    if (kind < 144) return std::numeric_limits<double>::infinity();
    std::uint64_t bits = 0;
    for (int i = 0; i < 8; ++i) bits = bits << 8 | byte();
    double value;
    std::memcpy(&value, &bits, sizeof value);
    return value;
  }
  std::vector<double> numbers(std::size_t n) {
    std::vector<double> values(n);
    for (double& value : values) value = number();
    return values;
  }

 private:
  const std::uint8_t* data_;
  std::size_t size_;
};

void require(bool holds) {
  if (!holds) __builtin_trap();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  namespace ros1 = icat::detail::ros1;
  using icat::Status;
  Input input(data, size);
  icat::JointStates joints({"a", "bb", "a_name_that_is_longer_than_a_short_string"});
  icat::Received<icat::Odometry> odometry;
  icat::StampOrder order;
  const std::string known[] = {"a", "bb", "a_name_that_is_longer_than_a_short_string", "", "c"};
  double now = 0;
  while (!input.empty()) {
    now += input.byte() / 64.0;
    const std::uint8_t what = input.byte();
    const double stamp = input.number();
    const double waited = input.number();
    if (what % 8 == 0) {
      joints.restart();
    } else if (what % 2 == 0) {
      std::vector<std::string> names;
      for (int n = input.byte() % 6; n > 0; --n) {
        const std::uint8_t which = input.byte();
        names.push_back(which < 240 ? known[which % 5]
                                    : std::string(which - 238, static_cast<char>(input.byte())));
      }
      const auto count = [&] {
        const std::uint8_t n = input.byte();
        return n < 192 ? names.size() : n % 8;
      };
      const auto positions = input.numbers(count());
      const auto velocities = input.numbers(count());
      const auto efforts = input.numbers(count());
      const ros1::JointStateView message{
          names.data(),     positions.data(),  velocities.data(), efforts.data(), names.size(),
          positions.size(), velocities.size(), efforts.size(),    stamp,          waited};
      const icat::JointStates before = joints;
      const Status status = ros1::take(message, joints, stamp, now);
      for (std::size_t i = 0; i < joints.size(); ++i) {
        if (joints[i].count == before[i].count) {
          require(joints[i].time == before[i].time);
          require(joints[i].value.position == before[i].value.position);
          continue;
        }
        require(status != Status::wrong_size && std::isfinite(stamp));
        require(joints[i].count == before[i].count + 1);  // once for each message at most
        bool said = false;
        for (std::size_t k = 0; k < names.size(); ++k) {
          said = said || (names[k] == joints.name(i) && positions[k] == joints[i].value.position);
        }
        require(said);
        require(joints[i].time <= now);
      }
    } else {
      ros1::OdometryView message{};
      for (double& x : message.position) x = input.number();
      for (double& x : message.orientation) x = input.number() * ((what & 16) != 0 ? 0.25 : 1);
      for (double& x : message.twist) x = input.number();
      message.waited = waited;
      const auto before = odometry;
      const Status status = ros1::take(message, odometry, order, stamp, now);
      require(odometry.count == before.count + (status == Status::ok ? 1 : 0));
      if (status != Status::ok) require(odometry.time == before.time);
    }
    for (std::size_t i = 0; i < joints.size(); ++i) {
      const icat::JointSample& sample = joints[i].value;
      require(std::isfinite(sample.position) && std::isfinite(sample.velocity) &&
              std::isfinite(sample.effort));
    }
    require(joints.age(now) >= 0 && odometry.age(now) >= 0);
    for (const icat::Odometry& value : {odometry.value, icat::other_world(odometry.value)}) {
      double square = 0;
      for (const double x : value.orientation) square += x * x;
      require(std::abs(square - 1) < 1e-14);
      for (const double x : value.position) require(std::isfinite(x));
      for (const double x : value.twist) require(std::isfinite(x));
    }
  }
  return 0;
}
