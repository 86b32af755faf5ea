// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A vehicle that ArduSub flies (BlueROV2 and its kind), over MAVLink: bytes in, bytes out. The
/// messages are those of common.xml [mavlink.io, "MAVLINK Common Message Set"]; what ArduSub does
/// with them was read in its source; docs/mavlink.md names the files. Frames are
/// the library's marine ones on both sides: a local world of north, east, down, its origin that of
/// the vehicle's filter; a body of ahead, starboard, down. No number changes its sign.
///
///     in    HEARTBEAT, ATTITUDE or ATTITUDE_QUATERNION, LOCAL_POSITION_NED, COMMAND_ACK
///     out   HEARTBEAT at 1 Hz, SET_POSITION_TARGET_LOCAL_NED (velocity in the world, yaw rate),
///           COMMAND_LONG (arm, mode, rates of telemetry), MANUAL_CONTROL with the sticks at rest
///
/// **When communication is lost.** No messages from the vehicle: it is not `healthy`, and velocity
/// zero is sent, whatever velocity is set. No call of `set_velocity` for 0.25 s: the same. No
/// messages from us: ArduSub sets the velocity to zero after 3 s, *not* the yaw rate; after 3 s
/// without MANUAL_CONTROL (FS_PILOT_INPUT, as delivered) or 5 s without our heartbeat
/// (FS_GCS_ENABLE, as delivered) it disarms.
#pragma once

#include <cmath>

#include "icat/adapters/mavlink_frames.hpp"
#include "icat/adapters/mavlink_requests.hpp"
#include "icat/adapters/robot_messages.hpp"

namespace icat {

/// ArduSub's modes, as in `custom_mode` of its heartbeat [ArduSub/mode.h].
enum class ArduSubMode : std::uint32_t {
  stabilize = 0,     ///< roll and pitch kept, depth by hand
  acro = 1,          ///< angular rates by hand
  alt_hold = 2,      ///< depth kept
  auto_mission = 3,  ///< a mission of its own
  guided = 4,        ///< obeys set-points: ours
  circle = 7,        ///< goes round in circles
  surface = 9,       ///< comes up
  poshold = 16,      ///< position kept
  manual = 19,       ///< thrusters by hand
  motor_detect = 20  ///< finds out how its thrusters turn
};

/// Addresses, rates and time limits.
struct MavlinkOptions {
  /// Ours. ArduSub's failsafes and its sticks listen to the system of its parameter MAV_GCS_SYSID
  /// (SYSID_MYGCS before 4.7), 255 as delivered.
  std::uint8_t system{255};
  std::uint8_t component{MAV_COMP_ID_ONBOARD_COMPUTER};   ///< ours
  std::uint8_t target_system{1};                          ///< the vehicle's; others are ignored
  std::uint8_t target_component{MAV_COMP_ID_AUTOPILOT1};  ///< its autopilot's
  double telemetry_rate{50};  ///< Hz, of attitude and position, asked of the vehicle; 0: not asked
  double max_age{0.5};        ///< s, of attitude and position in a healthy vehicle
  bool sticks{true};  ///< send sticks at rest while in GUIDED; false where a pilot's joystick sends
};

/// From HEARTBEAT.
struct MavlinkHeartbeat {
  ArduSubMode mode{ArduSubMode::stabilize};  ///< as sent: may be one that has no name here
  bool armed{false};                         ///< the thrusters may turn
  bool failsafe{false};                      ///< one of its failsafes acts, or it is worse
};

/// From ATTITUDE or ATTITUDE_QUATERNION.
struct MavlinkAttitude {
  std::array<double, 4> orientation{0, 0, 0, 1};  ///< of the body in NED: x, y, z, w, of norm 1
  std::array<double, 3> rates{};                  ///< angular velocity on the body, rad/s
};

/// From LOCAL_POSITION_NED.
struct MavlinkPosition {
  std::array<double, 3> position{};  ///< in NED, m
  std::array<double, 3> velocity{};  ///< on NED, m/s
};

/// See the file comment. No call but the construction throws; none waits or allocates. Copies are
/// vehicles of their own.
class MavlinkVehicle {
 public:
  /// @throws std::invalid_argument on a rate that is not in [0, 1000], an age that is not > 0, or
  ///         the same address for both ends.
  explicit MavlinkVehicle(const MavlinkOptions& options = {})
      : options_(options), out_(options.system, options.component) {
    const double rate = options.telemetry_rate;
    if (!(rate >= 0 && rate <= 1000)) {
      detail::invalid("MavlinkVehicle: telemetry_rate must be in [0, 1000], got ", rate);
    }
    detail::require_positive("MavlinkVehicle", "max_age", options.max_age);
    if (options.system == options.target_system && options.component == options.target_component) {
      detail::invalid("MavlinkVehicle: system ", int{options.system}, ", component ",
                      int{options.component}, " is both ours and the vehicle's");
    }
  }

  /// What came at `now`, s: any part of a stream, or datagrams one by one. What is damaged,
  /// foreign, doubled, late or nonsense changes `counts` alone.
  void receive(std::span<const std::uint8_t> bytes, double now) noexcept {
    frames_.push(bytes, counts_, [&](const mavlink_message_t& m) { take(m, now); });
  }

  /// What is to be sent at `now`, s, a datagram's worth, often nothing: valid until the next call.
  /// Call it in each cycle, after `set_velocity`, in GUIDED or not: the heartbeat is in it.
  std::span<const std::uint8_t> send(double now) noexcept {
    using detail::mavlink::is_due;
    out_.clear();
    if (is_due(heartbeat_sent_, now, 1)) {
      heartbeat_sent_ = now;
      out_.heartbeat();
    }
    const bool guided =
        recent(heartbeat_.age(now), 3) && heartbeat_.value.mode == ArduSubMode::guided;
    if (options_.sticks && guided && is_due(sticks_sent_, now, 0.2)) {
      sticks_sent_ = now;
      out_.sticks(options_.target_system);
    }
    detail::mavlink::Command command;
    if (requests_.due(now, command)) {
      out_.command(options_.target_system, options_.target_component, command);
    }
    if (wish_.count > 0) append_set_point(now);
    return out_.bytes();
  }

  /// The velocity from now on: surge, sway, heave (m/s) and the angular velocity about the body's z
  /// (rad/s), on the body. It holds for 0.25 s, then zero is sent. Before the first call no
  /// set-point is sent. `non_finite`, or `implausible` beyond 20 m/s or 20 rad/s: the velocity
  /// becomes zero.
  Status set_velocity(const std::array<double, 4>& on_body, double now) noexcept {
    Status status = Status::ok;
    for (const double v : on_body) {
      if (!std::isfinite(v)) status = Status::non_finite;
      if (status == Status::ok && std::fabs(v) > 20) status = Status::implausible;
    }
    wish_.put(status == Status::ok ? on_body : std::array<double, 4>{}, now);
    return status;
  }

  /// Asks for a mode: `send` repeats it each half second until the vehicle answers, five times.
  void set_mode(ArduSubMode mode) noexcept {
    requests_.ask(Requests::mode, MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, static_cast<float>(mode));
  }
  /// Asks for the thrusters to be enabled, after a mode that was asked for; where that one is
  /// refused or unanswered this is, too, and is not sent. The vehicle refuses while its own checks
  /// fail.
  void arm() noexcept { requests_.ask(Requests::arming, 1, 0); }
  /// Asks for the thrusters to be disabled, before anything else that was asked.
  void disarm() noexcept { requests_.ask(Requests::arming, 0, 0); }
  /// State of the last `set_mode`.
  MavlinkRequest mode_request() const noexcept { return requests_.state(Requests::mode); }
  /// State of the last `arm` or `disarm`.
  MavlinkRequest arm_request() const noexcept { return requests_.state(Requests::arming); }

  /// Whether a set velocity moves the vehicle at `now`: it is armed, in GUIDED, in no failsafe, its
  /// heartbeat at most 3 s old (it comes each second: two may be lost), attitude and position at
  /// most `max_age`.
  bool healthy(double now) const noexcept {
    const MavlinkHeartbeat& h = heartbeat_.value;
    return recent(heartbeat_.age(now), 3) && h.armed && h.mode == ArduSubMode::guided &&
           !h.failsafe && recent(attitude_.age(now), options_.max_age) &&
           recent(position_.age(now), options_.max_age);
  }
  /// Of attitude and position, the older one's, s at `now`; infinite until both came.
  double age(double now) const noexcept {
    return std::fmax(attitude_.age(now), position_.age(now));
  }
  /// The base in the vehicle's local NED, and its twist on itself, of the last attitude and
  /// position. The identity and zero until they came.
  Odometry odometry() const noexcept {
    Odometry o;
    o.position = position_.value.position;
    o.orientation = attitude_.value.orientation;
    const Rotation R = rotation();
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t j = 0; j < 3; ++j) o.twist[i] += R[j][i] * position_.value.velocity[j];
      o.twist[i + 3] = attitude_.value.rates[i];
    }
    return o;
  }
  /// The last one.
  const Received<MavlinkHeartbeat>& heartbeat() const noexcept { return heartbeat_; }
  /// The last one.
  const Received<MavlinkAttitude>& attitude() const noexcept { return attitude_; }
  /// The last one.
  const Received<MavlinkPosition>& position() const noexcept { return position_; }
  /// What came, and what of it was of no use. After a reboot (`reboots` grows) the world's origin
  /// may be another.
  const MavlinkCounts& counts() const noexcept { return counts_; }

 private:
  using Rotation = std::array<std::array<double, 3>, 3>;
  using Requests = detail::mavlink::Requests;
  using Stamps = detail::mavlink::Stamps;
  static constexpr double never_ = -std::numeric_limits<double>::infinity();

  void take(const mavlink_message_t& m, double now) noexcept {
    if (m.sysid != options_.target_system || m.compid != options_.target_component) {
      ++counts_.foreign;
      return;
    }
    // What carries a stamp is told old from new by that; the rest by its number.
    const bool next = numbering_.next(m.seq, now, counts_);
    switch (m.msgid) {
      case MAVLINK_MSG_ID_HEARTBEAT:
        if (next) take_heartbeat(m, now);
        break;
      case MAVLINK_MSG_ID_COMMAND_ACK:
        if (next) take_answer(m, now);
        break;
      case MAVLINK_MSG_ID_ATTITUDE:
        take_angles(m, now);
        break;
      case MAVLINK_MSG_ID_ATTITUDE_QUATERNION:
        take_quaternion(m, now);
        break;
      case MAVLINK_MSG_ID_LOCAL_POSITION_NED:
        take_position(m, now);
        break;
      default:
        break;
    }
  }

  void take_heartbeat(const mavlink_message_t& m, double now) noexcept {
    mavlink_heartbeat_t h;
    mavlink_msg_heartbeat_decode(&m, &h);
    if (h.autopilot != MAV_AUTOPILOT_ARDUPILOTMEGA || h.type != MAV_TYPE_SUBMARINE) {
      ++counts_.refused;  // the numbers of its modes mean something else
      return;
    }
    // Heard of anew, or it has forgotten the rates or never heard of them.
    const bool asking = requests_.state(Requests::attitude_rate) == MavlinkRequest::pending ||
                        requests_.state(Requests::position_rate) == MavlinkRequest::pending;
    if (!recent(heartbeat_.age(now), 3)) ask_rates();
    if (!asking && !(age(now) <= 1 + 2 / options_.telemetry_rate)) ask_rates();
    MavlinkHeartbeat value;
    value.mode = static_cast<ArduSubMode>(h.custom_mode);
    value.armed = (h.base_mode & MAV_MODE_FLAG_SAFETY_ARMED) != 0;
    value.failsafe = h.system_status >= MAV_STATE_CRITICAL;
    heartbeat_.put(value, now);
    requests_.heard(h.custom_mode, value.armed);
  }

  void take_answer(const mavlink_message_t& m, double now) noexcept {
    mavlink_command_ack_t a;
    mavlink_msg_command_ack_decode(&m, &a);
    // Older senders leave out whom they answer.
    if (a.target_system != 0 && a.target_system != options_.system) return;
    if (a.target_component != 0 && a.target_component != options_.component) return;
    requests_.answered(a.command, a.result, now);
  }

  void take_angles(const mavlink_message_t& m, double now) noexcept {
    mavlink_attitude_t a;
    mavlink_msg_attitude_decode(&m, &a);
    const double roll = a.roll, pitch = a.pitch, yaw = a.yaw;
    // Not NaN, and no degrees: a turn more than the message allows.
    if (!within(roll, 3 * pi_) || !within(pitch, 3 * pi_) || !within(yaw, 3 * pi_)) {
      ++counts_.refused;
      return;
    }
    const double cr = std::cos(roll / 2), cp = std::cos(pitch / 2), cy = std::cos(yaw / 2);
    const double sr = std::sin(roll / 2), sp = std::sin(pitch / 2), sy = std::sin(yaw / 2);
    put_attitude({sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy,
                  cr * cp * sy - sr * sp * cy, cr * cp * cy + sr * sp * sy},
                 {a.rollspeed, a.pitchspeed, a.yawspeed}, a.time_boot_ms, now);
  }

  void take_quaternion(const mavlink_message_t& m, double now) noexcept {
    mavlink_attitude_quaternion_t a;
    mavlink_msg_attitude_quaternion_decode(&m, &a);
    put_attitude({a.q2, a.q3, a.q4, a.q1}, {a.rollspeed, a.pitchspeed, a.yawspeed}, a.time_boot_ms,
                 now);
  }

  void put_attitude(std::array<double, 4> q, const std::array<double, 3>& rates,
                    std::uint32_t stamp, double now) noexcept {
    double square = 0;
    for (const double x : q) square += x * x;
    const double norm = std::sqrt(square);
    bool well = std::fabs(norm - 1) < 1e-3;  // of four floats; false for NaN
    for (const double rate : rates) well = well && within(rate, 50);
    if (!well) {
      ++counts_.refused;
      return;
    }
    if (!newer(attitude_stamps_, stamp, now)) return;
    for (double& x : q) x /= norm;
    attitude_.put({q, rates}, now);
  }

  void take_position(const mavlink_message_t& m, double now) noexcept {
    mavlink_local_position_ned_t p;
    mavlink_msg_local_position_ned_decode(&m, &p);
    const MavlinkPosition value{{p.x, p.y, p.z}, {p.vx, p.vy, p.vz}};
    bool well = true;
    for (const double x : value.position) well = well && within(x, 1e6);
    for (const double v : value.velocity) well = well && within(v, 50);
    if (!well) {
      ++counts_.refused;
      return;
    }
    if (newer(position_stamps_, p.time_boot_ms, now)) position_.put(value, now);
  }

  // Where the caller's clock jumped back, what came before it is as old as what is far ahead of it.
  static bool recent(double age, double limit) noexcept { return std::fabs(age) <= limit; }
  static bool within(double x, double bound) noexcept { return std::fabs(x) <= bound; }

  bool newer(Stamps& stamps, std::uint32_t stamp, double now) noexcept {
    switch (stamps.place(stamp, now)) {
      case Stamps::Place::newer:
        return true;
      case Stamps::Place::repeated:
      case Stamps::Place::older:
        return false;
      case Stamps::Place::rebooted:
        break;
    }
    ++counts_.reboots;
    (&stamps == &attitude_stamps_ ? position_stamps_ : attitude_stamps_).forget();
    ask_rates();  // it has forgotten them
    return true;
  }

  void ask_rates() noexcept {
    if (options_.telemetry_rate == 0) return;
    const auto interval = static_cast<float>(1e6 / options_.telemetry_rate);  // µs
    requests_.ask(Requests::attitude_rate, MAVLINK_MSG_ID_ATTITUDE, interval);
    requests_.ask(Requests::position_rate, MAVLINK_MSG_ID_LOCAL_POSITION_NED, interval);
  }

  // Of the body in NED, rows first.
  Rotation rotation() const noexcept {
    const auto& [x, y, z, w] = attitude_.value.orientation;
    return {{{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
             {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
             {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)}}};
  }

  void append_set_point(double now) noexcept {
    const bool wished = recent(wish_.age(now), 0.25);
    if (wish_.count == wishes_sent_ &&
        (wished || !detail::mavlink::is_due(set_point_sent_, now, 0.1))) {
      return;
    }
    wishes_sent_ = wish_.count;
    set_point_sent_ = now;
    std::array<double, 3> v{};  // on NED
    double turn = 0;
    if (wished && healthy(now)) {
      const Rotation R = rotation();
      const auto& wish = wish_.value;
      for (std::size_t i = 0; i < 3; ++i) {
        v[i] = R[i][0] * wish[0] + R[i][1] * wish[1] + R[i][2] * wish[2];
      }
      // ArduSub's is the rate of the yaw angle, and it keeps roll and pitch: r = rate · cos(roll)
      // cos(pitch). None where it lies on its side or stands on its head.
      if (R[2][2] > 0.1) turn = wish[3] / R[2][2];
    }
    out_.set_point(options_.target_system, options_.target_component, v, turn);
  }

  static constexpr double pi_ = 3.14159265358979323846;

  MavlinkOptions options_;
  detail::mavlink::FrameReader frames_;
  detail::mavlink::Numbering numbering_;
  Stamps attitude_stamps_;
  Stamps position_stamps_;
  MavlinkCounts counts_;
  Received<MavlinkHeartbeat> heartbeat_;
  Received<MavlinkAttitude> attitude_;
  Received<MavlinkPosition> position_;
  Requests requests_;
  detail::mavlink::FrameWriter out_;
  Received<std::array<double, 4>> wish_;
  std::uint32_t wishes_sent_{0};
  double set_point_sent_{never_};
  double heartbeat_sent_{never_};
  double sticks_sent_{never_};
};

}  // namespace icat
