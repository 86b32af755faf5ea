// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Communication with a ROS 2 robot without ROS: Eclipse Cyclone DDS with the names and types that
/// ROS 2 gives its topics [design.ros2.org, Topic and Service name mapping to DDS]. The program
/// links `CycloneDDS::ddsc` and nothing else; docs/ros2.md has the lines of CMake.
///
///     DdsJointStates    rt/joint_states           sensor_msgs::msg::dds_::JointState_         in
///     DdsOdometry       rt/odom                   nav_msgs::msg::dds_::Odometry_              in
///     DdsTwist          rt/cmd_vel                geometry_msgs::msg::dds_::Twist_            out
///     DdsJointCommands  rt/<controller>/commands  std_msgs::msg::dds_::Float64MultiArray_     out
///
/// Subscriptions are best effort, volatile, the last 10, as ROS 2's for sensors: they match any
/// publisher, and what is lost is not sent again late. Publishers are reliable and volatile, as all
/// of ROS 2's by default, and match any subscription; they keep the last message only, so that no
/// command follows a newer one, and never wait.
///
/// A publisher that restarts is a different publisher to DDS: with the first message of a new one
/// the stamps of the one before are forgotten, for any clock. After a clock of a running publisher
/// is set back one message is lost (`StampOrder`).
///
/// Cyclone DDS has threads of its own, which receive. `read` and `write` work in the caller's,
/// without waiting; the header allocates nothing in them, Cyclone DDS may.
///
/// The age of a message counts from when Cyclone DDS had it, not from `read`: where a loop stood
/// still, what waited for it is old. Of several that waited it is the newest one's.
#pragma once

#include <dds/dds.h>
#include <dds/ddsi/ddsi_serdata.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "icat/adapters/dds_types.hpp"
#include "icat/adapters/robot_messages.hpp"
#include "icat/adapters/ros2_cdr.hpp"
#include "icat/core/error.hpp"
#include "icat/core/received.hpp"
#include "icat/core/status.hpp"

namespace icat::detail::dds {

// Owns a thing of Cyclone DDS.
class Entity {
 public:
  Entity() = default;
  // Throws where `handle` is an error.
  [[gnu::cold]] Entity(dds_entity_t handle, const char* what, std::string_view name)
      : handle_(handle) {
    if (handle < 0) invalid("DDS: ", what, " '", name, "': ", dds_strretcode(-handle));
  }
  Entity(Entity&& other) noexcept : handle_(std::exchange(other.handle_, 0)) {}
  Entity& operator=(Entity&& other) noexcept {
    std::swap(handle_, other.handle_);
    return *this;
  }
  ~Entity() {
    if (handle_ > 0) dds_delete(handle_);
  }
  dds_entity_t get() const noexcept { return handle_; }

 private:
  dds_entity_t handle_{0};
};

// "joint_states" and "/joint_states" are "rt/joint_states".
[[gnu::cold]] inline std::string topic_name(std::string_view topic) {
  const std::string_view name = topic.substr(topic.starts_with('/') ? 1 : 0);
  if (name.empty() || name.starts_with('/') || name.ends_with('/')) {
    invalid("DDS: '", topic, "' is no name of a topic");
  }
  return std::string("rt/").append(name);
}

// The topic of a reader or writer, and that.
struct Endpoint {
  Entity topic;
  Entity end;

  [[gnu::cold]] Endpoint(dds_entity_t participant, const dds_topic_descriptor_t& type,
                         std::string_view name, bool writes,
                         const dds_listener_t* listener = nullptr) {
    const std::string full = topic_name(name);
    topic =
        Entity(dds_create_topic(participant, &type, full.c_str(), nullptr, nullptr), "topic", full);
    dds_qos_t* qos = dds_create_qos();
    dds_qset_durability(qos, DDS_DURABILITY_VOLATILE);
    dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, writes ? 1 : history);
    // A writer waits for at most this long.
    dds_qset_reliability(qos, writes ? DDS_RELIABILITY_RELIABLE : DDS_RELIABILITY_BEST_EFFORT, 0);
    dds_qset_writer_data_lifecycle(qos, false);
    const dds_entity_t handle = writes ? dds_create_writer(participant, topic.get(), qos, nullptr)
                                       : dds_create_reader(participant, topic.get(), qos, listener);
    dds_delete_qos(qos);
    end = Entity(handle, writes ? "publisher" : "subscription", full);
  }

  static constexpr int history = 10;
};

// A subscription: bytes, and whether their sender is a new one.
class Subscription {
 public:
  [[gnu::cold]] Subscription(dds_entity_t participant, const dds_topic_descriptor_t& type,
                             std::string_view topic)
      : came_(std::make_unique<std::atomic<Clock::rep>>(ticks())),
        taken_(*came_),
        ends_(participant, type, topic, false, Listener(came_.get()).listener) {}

  // Calls `message(bytes, is_new, came)` for each that came, the oldest first, where `came` is
  // when, on the caller's clock, whose time is `now`. Returns how many.
  template <class F>
  int take(double now, F message) noexcept {
    ddsi_serdata* data[2 * Endpoint::history] = {};  // also what says that a publisher left
    dds_sample_info_t info[2 * Endpoint::history];
    const int count =
        dds_takecdr(ends_.end.get(), data, 2 * Endpoint::history, info, DDS_ANY_STATE);
    // What was not there before came after that, also where its arrival is not yet written down.
    const Clock::rep here = ticks(), last = std::max(came_->load(), taken_);
    const double waited = std::chrono::duration<double>(Clock::duration(here - last)).count();
    taken_ = here;
    int messages = 0;
    for (int i = 0; i < count; ++i) {
      if (info[i].valid_data) {
        ddsrt_iovec_t bytes;
        ddsi_serdata* held =
            ddsi_serdata_to_ser_ref(data[i], 0, ddsi_serdata_size(data[i]), &bytes);
        message(ros2::Bytes(static_cast<const std::uint8_t*>(bytes.iov_base), bytes.iov_len),
                is_new(info[i].publication_handle), waited > 0 ? now - waited : now);
        ddsi_serdata_to_ser_unref(held, &bytes);
        ++messages;
      }
      ddsi_serdata_unref(data[i]);
    }
    return messages;
  }
  int publishers() const noexcept {
    dds_subscription_matched_status_t status;
    return dds_get_subscription_matched_status(ends_.end.get(), &status) == 0
               ? static_cast<int>(status.current_count)
               : 0;
  }

 private:
  using Clock = std::chrono::steady_clock;
  static Clock::rep ticks() noexcept { return Clock::now().time_since_epoch().count(); }

  // In the thread that receives: writes down when.
  struct Listener {
    dds_listener_t* listener{dds_create_listener(nullptr)};
    [[gnu::cold]] explicit Listener(std::atomic<Clock::rep>* came) {
      dds_lset_data_available_arg(
          listener,
          [](dds_entity_t, void* at) { static_cast<std::atomic<Clock::rep>*>(at)->store(ticks()); },
          came, false);
    }
    Listener(const Listener&) = delete;
    Listener& operator=(const Listener&) = delete;
    ~Listener() { dds_delete_listener(listener); }
  };

  bool is_new(dds_instance_handle_t publisher) noexcept {
    if (std::find(known_.begin(), known_.end(), publisher) != known_.end()) return false;
    known_[next_] = publisher;
    next_ = (next_ + 1) % known_.size();
    return true;
  }

  std::unique_ptr<std::atomic<Clock::rep>> came_;  // the last message
  Clock::rep taken_;                               // the last time that `take` looked
  Endpoint ends_;                                  // goes first, and its thread with it
  std::array<dds_instance_handle_t, 16> known_{};  // publishers; the newest take the oldest's place
  std::size_t next_{0};
};

// A publisher.
class Publication {
 public:
  [[gnu::cold]] Publication(dds_entity_t participant, const dds_topic_descriptor_t& type,
                            std::string_view topic)
      : ends_(participant, type, topic, true) {}

  Status write(const void* sample) noexcept {
    return dds_write(ends_.end.get(), sample) == DDS_RETCODE_OK ? Status::ok : Status::not_sent;
  }
  int subscribers() const noexcept {
    dds_publication_matched_status_t status;
    return dds_get_publication_matched_status(ends_.end.get(), &status) == 0
               ? static_cast<int>(status.current_count)
               : 0;
  }

 private:
  Endpoint ends_;
};

template <class Values>
bool all_finite(const Values& values) noexcept {
  return std::all_of(values.begin(), values.end(), [](double x) { return std::isfinite(x); });
}

}  // namespace icat::detail::dds

namespace icat {

/// The DDS domain of the robot.
struct DdsOptions {
  std::uint32_t domain{0};      ///< ROS_DOMAIN_ID of the robot
  std::string configuration{};  ///< XML for Cyclone DDS; empty: what CYCLONEDDS_URI says
};

/// A program's part in a domain of DDS. Must live longer than what is made with it.
class DdsParticipant {
 public:
  /// Begins to look for others. Allocates, and starts the threads of Cyclone DDS. Two participants
  /// of one domain in one program share the configuration: only the first may give one.
  /// @throws std::invalid_argument with what Cyclone DDS says where it cannot.
  [[gnu::cold]] explicit DdsParticipant(const DdsOptions& options = {}) {
    const std::string number = std::to_string(options.domain);
    if (!options.configuration.empty()) {
      domain_ = detail::dds::Entity(
          dds_create_domain(options.domain, options.configuration.c_str()), "domain", number);
    }
    participant_ = detail::dds::Entity(dds_create_participant(options.domain, nullptr, nullptr),
                                       "participant of domain", number);
  }
  /// Of Cyclone DDS, for topics of your own.
  dds_entity_t handle() const noexcept { return participant_.get(); }

 private:
  detail::dds::Entity domain_;
  detail::dds::Entity participant_;  // goes first
};

/// The joints of a robot, from `sensor_msgs/JointState`.
class DdsJointStates {
 public:
  /// @param participant the program's part in the domain
  /// @param topic as ROS 2 has it, such as "joint_states" or "/left/joint_states"
  /// @param names the robot's joints, in its order. Allocates.
  /// @throws std::invalid_argument as `JointStates` does, and where there can be no such topic.
  [[gnu::cold]] DdsJointStates(const DdsParticipant& participant, std::string_view topic,
                               std::vector<std::string> names)
      : states_(std::move(names)),
        messages_(participant.handle(), detail::dds::joint_state_type, topic) {}

  /// Takes what has come until `now`, s, and returns how many messages: none leaves all as it is.
  /// A joint that a message does not name stays as it is, too. No allocation by us, no waiting.
  int read(double now) noexcept {
    return messages_.take(now, [&](ros2::Bytes bytes, bool is_new, double came) {
      if (is_new) states_.restart();
      ros2::JointStateMessage message;
      if (!ros2::decode(bytes, message) || ros2::put(message, came, states_) != Status::ok) {
        ++refused_;
      }
    });
  }
  /// What is known, with its age.
  const JointStates& states() const noexcept { return states_; }
  /// How many messages were malformed, or had for one of our joints what is not finite or not
  /// newer.
  std::uint32_t refused() const noexcept { return refused_; }
  /// How many publishers there are. One that was killed counts until its lease ends: see the age.
  int publishers() const noexcept { return messages_.publishers(); }

 private:
  JointStates states_;
  detail::dds::Subscription messages_;
  std::uint32_t refused_{0};
};

/// Pose and velocity of the base, from `nav_msgs/Odometry`.
class DdsOdometry {
 public:
  /// @param participant the program's part in the domain
  /// @param topic as ROS 2 has it, such as "odom". Allocates.
  /// @throws std::invalid_argument where there can be no such topic.
  [[gnu::cold]] explicit DdsOdometry(const DdsParticipant& participant,
                                     std::string_view topic = "odom")
      : messages_(participant.handle(), detail::dds::odometry_type, topic) {}

  /// Takes what has come until `now`, s, and returns how many messages: none leaves all as it is.
  /// No allocation by us, no waiting.
  int read(double now) noexcept {
    return messages_.take(now, [&](ros2::Bytes bytes, bool is_new, double came) {
      if (is_new) stamps_.restart();
      ros2::OdometryMessage message;
      if (!ros2::decode(bytes, message) || !std::isfinite(came) ||
          normalize(message.odometry) != Status::ok ||
          stamps_.accept(message.header.stamp()) != Status::ok) {
        ++refused_;
        return;
      }
      last_.put(message.odometry, came);
    });
  }
  /// What is known, with its age.
  const Received<Odometry>& last() const noexcept { return last_; }
  /// How many messages were malformed, not finite, of no orientation, or not newer.
  std::uint32_t refused() const noexcept { return refused_; }
  /// How many publishers there are. One that was killed counts until its lease ends: see the age.
  int publishers() const noexcept { return messages_.publishers(); }

 private:
  detail::dds::Subscription messages_;
  Received<Odometry> last_;
  StampOrder stamps_;
  std::uint32_t refused_{0};
};

/// A velocity of the base, as `geometry_msgs/Twist`.
class DdsTwist {
 public:
  /// @param participant the program's part in the domain
  /// @param topic as ROS 2 has it, such as "cmd_vel". Allocates.
  /// @throws std::invalid_argument where there can be no such topic.
  [[gnu::cold]] explicit DdsTwist(const DdsParticipant& participant,
                                  std::string_view topic = "cmd_vel")
      : messages_(participant.handle(), detail::dds::twist_type, topic) {}

  /// [linear; angular] on the base, m/s, rad/s. `non_finite`: zero is sent instead, as the robot
  /// would go on at the last velocity; `not_sent`: Cyclone DDS took nothing. No allocation by us,
  /// no waiting.
  Status write(const Twist& twist) noexcept {
    const bool good = detail::dds::all_finite(twist);
    detail::dds::TwistSample sample{};
    if (good) std::copy(twist.begin(), twist.end(), sample.numbers);
    const Status status = messages_.write(&sample);
    return good || status != Status::ok ? status : Status::non_finite;
  }
  /// How many subscriptions there are.
  int subscribers() const noexcept { return messages_.subscribers(); }

 private:
  detail::dds::Publication messages_;
};

/// Velocities of joints, as ros2_control's `velocity_controllers/JointGroupVelocityController` and
/// `forward_command_controller` take them: a `std_msgs/Float64MultiArray` with an entry for each
/// joint of the controller, in its order.
class DdsJointCommands {
 public:
  /// @param participant the program's part in the domain
  /// @param topic as ROS 2 has it, such as "arm_controller/commands"
  /// @param joints how many joints the controller has, at least one. Allocates.
  /// @throws std::invalid_argument without a joint, and where there can be no such topic.
  [[gnu::cold]] DdsJointCommands(const DdsParticipant& participant, std::string_view topic,
                                 std::size_t joints)
      : messages_(participant.handle(), detail::dds::multi_array_type, topic), data_(joints) {
    if (joints < 1) detail::invalid("DDS: commands '", topic, "' have no joint");
  }

  /// rad/s or m/s, one for each joint of the controller. `wrong_size`, `non_finite`: zeros are sent
  /// instead, as the joints would go on at the last velocity; `not_sent`: Cyclone DDS took nothing.
  /// No allocation by us, no waiting.
  Status write(std::span<const double> velocity) noexcept {
    const Status judged = velocity.size() != data_.size()     ? Status::wrong_size
                          : detail::dds::all_finite(velocity) ? Status::ok
                                                              : Status::non_finite;
    if (judged == Status::ok) {
      std::copy(velocity.begin(), velocity.end(), data_.begin());
    } else {
      std::fill(data_.begin(), data_.end(), 0.0);
    }
    detail::dds::MultiArraySample sample{};
    sample.data._length = sample.data._maximum = static_cast<std::uint32_t>(data_.size());
    sample.data._buffer = reinterpret_cast<std::uint8_t*>(data_.data());
    const Status status = messages_.write(&sample);
    return status == Status::ok ? judged : status;
  }
  /// How many subscriptions there are.
  int subscribers() const noexcept { return messages_.subscribers(); }

 private:
  detail::dds::Publication messages_;
  std::vector<double> data_;  // Cyclone DDS wants what may be written to
};

}  // namespace icat
