// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Detects a grasp from the currents, speeds and positions of the hand's motors alone.
///
/// [MARIS, III-A]: the hand motors' current is monitored to detect a successful grasp. No threshold
/// is printed; the rules are ours. With the filtered current i and the angle θ of a motor that
/// closes, limit i_max, commanded speed ω, and the cables' mean stretch of n joints taken off,
///
///     stopped    i ≥ 0.6 i_max and |θ̇| < 0.01 ω, for 0.2 s
///     at its end q̂ = θ − τ_g(i) / (n k_c) > end stop − margin
///     grasped    all that close have stopped, not all at their ends
///     empty      all have stopped at their ends
///     slipped    after grasped: θ has gone on by more than `travel`, or all are at their ends
///     fault      told to move, nothing moves and no current tells why; blocked while it opens;
///     more
///                current than allowed; readings that are none
///
/// Worm gears hold without current, so the currents carry no information while the hand holds:
/// every `squeeze_period` the motors close again for a moment, a test squeeze. Not detectable: a
/// pipe that slides along its axis and has not left the hand yet, and a motor that jams on its way,
/// which looks like a grasp.
///
///     open ── preshape, open ──> moving ──> open
///     open ── close ──> moving ──> grasped ──> slipped        any ──> fault
///                              └─> empty
#pragma once

#include <string_view>

#include "icat/core/step_clock.hpp"
#include "icat/model/maris_hand.hpp"

namespace icat {

/// See the file comment.
enum class GraspState { open, moving, grasped, empty, slipped, fault };

/// One word for a log. No allocation.
constexpr const char* describe(GraspState state) noexcept {
  switch (state) {
    case GraspState::open:
      return "open";
    case GraspState::moving:
      return "moving";
    case GraspState::grasped:
      return "grasped";
    case GraspState::empty:
      return "empty";
    case GraspState::slipped:
      return "slipped";
    case GraspState::fault:
      return "fault";
  }
  return "unknown state";
}

/// Thresholds. rad, s, A.
template <class Scalar>
struct GraspDetectorOptions {
  HandMotor<Scalar> motor{};                        ///< of each group
  double filter = 0.03;                             ///< time constant of the current's filter
  Scalar share = static_cast<Scalar>(0.6);          ///< of the limit, in (0, 1)
  Scalar still = static_cast<Scalar>(0.01);         ///< share of the speed, in (0, 1)
  double settle = 0.2;                              ///< so long both hold, > 0
  Scalar end_margin = static_cast<Scalar>(0.0012);  ///< before the end stop
  Scalar travel = static_cast<Scalar>(0.05);        ///< after the grasp: it settles
  double squeeze_period = 2;                        ///< between two test squeezes
  double no_response = 1;                           ///< until a motor without an answer is a fault
  Scalar open_speed = static_cast<Scalar>(0.3);     ///< of preshapes
  Scalar open_current = static_cast<Scalar>(0.5);   ///< of preshapes
  double max_step = 0.2;                            ///< longest period of `step`
};

/// Commands the hand's motors and detects grasps. Construction throws, nothing allocates.
template <class ScalarType>
class GraspDetector {
 public:
  /// Scalar type.
  using Scalar = ScalarType;
  /// Model of the links.
  using Hand = MarisHand<Scalar>;
  /// Indexed by `HandGroup`.
  using Angles = typename Hand::Angles;
  /// Thresholds.
  using Options = GraspDetectorOptions<Scalar>;

  /// Motors off, state `open`.
  /// @throws std::invalid_argument on numbers out of range.
  [[gnu::cold]] explicit GraspDetector(const Hand& hand = Hand(),
                                       const Options& options = Options())
      : hand_(hand), options_(options), clock_(options.max_step) {
    detail::check_motor(options.motor);
    for (const double x : {options.settle, options.squeeze_period, options.no_response}) {
      detail::require_positive("GraspDetector", "a time", x);
    }
    if (!(options.filter >= 0) || !std::isfinite(options.filter)) {
      detail::invalid("GraspDetector: filter must be finite and >= 0, got ", options.filter);
    }
    if (!(options.no_response > options.settle)) {
      detail::invalid("GraspDetector: no_response must be longer than settle, got ",
                      options.no_response);
    }
    for (const Scalar x : {options.share, options.still}) {
      if (!(x > Scalar(0)) || !(x < Scalar(1))) {
        detail::invalid("GraspDetector: share and still must be in (0, 1), got ", x);
      }
    }
    for (const Scalar x :
         {options.end_margin, options.travel, options.open_speed, options.open_current}) {
      detail::require_positive("GraspDetector", "a threshold", x);
    }
  }

  /// To the open hand of a shape, whatever the state; it ends a fault.
  void preshape(Preshape shape) noexcept {
    shape_ = shape;
    begin(Mode::opening, GraspState::moving);
  }
  /// To the open hand of the present shape.
  void open() noexcept { preshape(shape_); }
  /// Closes as the present shape does, whatever the state, proximal joints at `speed`, rad/s, with
  /// `current_limit`, A. `out_of_range`: not > 0, or a current that does not move the gear; nothing
  /// changes then.
  Status close(Scalar speed, Scalar current_limit) noexcept {
    if (!std::isfinite(speed) || !std::isfinite(current_limit)) return Status::non_finite;
    const Scalar limit = std::min(current_limit, options_.motor.maximum_current);
    // The friction alone must not look like a grasp.
    if (!(speed > Scalar(0)) ||
        !(options_.share * limit > options_.motor.current(Scalar(0)) * static_cast<Scalar>(0.99))) {
      return Status::out_of_range;
    }
    speed_ = std::min(speed, options_.motor.maximum_speed);
    limit_ = limit;
    begin(Mode::closing, GraspState::moving);
    return Status::ok;
  }

  /// A cycle at `time`, s, with what the motors say. Refused readings and times change nothing but
  /// that readings which are none for `no_response` are a fault. No allocation.
  Status step(double time, const HandReading<Scalar>& reading) noexcept {
    event_ = {};
    Status status = clock_.advance(time);
    if (status != Status::ok) return status;
    if (clock_.stalled()) return Status::clock_stalled;
    const double dt = clock_.step();
    if (!detail::all_finite(reading.position) || !detail::all_finite(reading.speed) ||
        !detail::all_finite(reading.current)) {
      silent_ += dt;
      if (silent_ >= options_.no_response - rounding) enter(GraspState::fault);
      return Status::non_finite;
    }
    silent_ = 0;
    const Scalar keep =
        options_.filter > 0 ? static_cast<Scalar>(std::exp(-dt / options_.filter)) : Scalar(0);
    for (Index g = 0; g < 3; ++g) {
      current_(g) = reading.current(g) + keep * (current_(g) - reading.current(g));
    }
    position_ = reading.position;
    if (!started_) {
      started_ = true;
      command_.position = position_;
    }
    switch (mode_) {
      case Mode::off:
        if (state_ == GraspState::grasped) {
          rested_ += dt;
          if (rested_ >= options_.squeeze_period - rounding) begin(Mode::squeezing, state_);
        }
        break;
      case Mode::opening:
        step_opening(reading, dt);
        break;
      case Mode::closing:
      case Mode::squeezing:
        step_closing(reading, dt);
        break;
    }
    return Status::ok;
  }

  /// What to tell the motors now.
  const HandCommand<Scalar>& command() const noexcept { return command_; }
  /// What the hand does or holds.
  GraspState state() const noexcept { return state_; }
  /// The mission's event of the last step, where the state has just changed: "grasp closed", "grasp
  /// empty", "grasp slipped", "fault"; else empty.
  std::string_view event() const noexcept { return event_; }
  /// Raises `event` in a mission, if there is one. After every step.
  template <class Mission>
  Status tell(Mission& mission) const noexcept {
    return event_.empty() ? Status::ok : mission.raise(event_);
  }
  /// A test squeeze is under way.
  bool squeezing() const noexcept { return mode_ == Mode::squeezing; }
  /// Joints of each group in the mean: motors less the cables' stretch, rad.
  Angles joints() const noexcept {
    Angles q;
    for (Index g = 0; g < 3; ++g) q(g) = position_(g) - stretch_(g);
    return q;
  }
  /// Between the fingertips, of `joints`, m.
  Scalar aperture() const noexcept { return hand_.aperture(joints()); }
  /// Filtered, A.
  const Angles& current() const noexcept { return current_; }
  /// The present shape.
  Preshape shape() const noexcept { return shape_; }

 private:
  enum class Mode { off, opening, closing, squeezing };
  static constexpr double rounding = 1e-9;  // s, of times that are sums of steps

  void begin(Mode mode, GraspState state) noexcept {
    mode_ = mode;
    state_ = state;
    event_ = {};
    rested_ = 0;
    for (double& t : stopped_) t = 0;
    for (double& t : idle_) t = 0;
    current_ = Filled{0};
    if (mode == Mode::opening) stretch_ = Filled{0};
  }
  // Motors off, in this state.
  void enter(GraspState state) noexcept {
    const bool news = state_ != state;
    begin(Mode::off, state);
    command_.speed = Filled{0};
    command_.position = position_;
    if (!news) return;
    switch (state) {
      case GraspState::grasped:
        event_ = "grasp closed";
        break;
      case GraspState::empty:
        event_ = "grasp empty";
        break;
      case GraspState::slipped:
        event_ = "grasp slipped";
        break;
      case GraspState::fault:
        event_ = "fault";
        break;
      default:
        break;
    }
  }

  // How long a motor that is told to move has stood still with high current, and with any.
  void count(Index g, const HandReading<Scalar>& reading, Scalar speed, Scalar limit,
             double dt) noexcept {
    const std::size_t i = static_cast<std::size_t>(g);
    const bool still = std::abs(reading.speed(g)) < options_.still * speed;
    const bool loaded = current_(g) >= options_.share * limit;
    stopped_[i] = still && loaded ? stopped_[i] + dt : 0;
    idle_[i] = still ? idle_[i] + dt : 0;
  }
  bool stopped(Index g) const noexcept {
    return stopped_[static_cast<std::size_t>(g)] >= options_.settle - rounding;
  }
  bool silent(Index g) const noexcept {
    return !stopped(g) && idle_[static_cast<std::size_t>(g)] >= options_.no_response - rounding;
  }

  void step_opening(const HandReading<Scalar>& reading, double dt) noexcept {
    command_.position = hand_.preshape(shape_);
    bool there = true, fault = false;
    for (Index g = 0; g < 3; ++g) {
      command_.speed(g) = options_.open_speed;
      command_.current_limit(g) = options_.open_current;
      // Where the fingers are to be, not to the last digit.
      if (std::abs(reading.position(g) - command_.position(g)) < static_cast<Scalar>(0.002)) {
        continue;
      }
      there = false;
      count(g, reading, options_.open_speed, options_.open_current, dt);
      fault = fault || stopped(g) || silent(g) || too_much(g, options_.open_current);
    }
    if (fault) {
      enter(GraspState::fault);
    } else if (there) {
      enter(GraspState::open);
    }
  }

  void step_closing(const HandReading<Scalar>& reading, double dt) noexcept {
    const bool power = shape_ == Preshape::power, squeeze = mode_ == Mode::squeezing;
    bool all_stopped = true, all_at_end = true, gone_on = false, fault = false;
    for (const Index g : {Index(proximal_group), Index(distal_group)}) {
      if (g == distal_group && !power) break;
      command_.position(g) = hand_.upper()(g) + static_cast<Scalar>(beyond);
      command_.speed(g) = speed_;
      command_.current_limit(g) = limit_;
      count(g, reading, speed_, limit_, dt);
      const Scalar cables = static_cast<Scalar>(g == palm_group ? 2 : 3);
      stretch_(g) = options_.motor.torque(std::min(current_(g), limit_)) /
                    (cables * options_.motor.cable_stiffness);
      all_stopped = all_stopped && stopped(g);
      const Scalar q = reading.position(g) - stretch_(g);
      all_at_end = all_at_end && q > hand_.upper()(g) - options_.end_margin;
      gone_on = gone_on || reading.position(g) - held_at_(g) > options_.travel;
      fault = fault || silent(g) || too_much(g, limit_);
    }
    if (!power) {
      // The distal joints keep the fingertips as they are, and never close on their own.
      const Scalar q = std::min(reading.position(proximal_group) - stretch_(proximal_group),
                                hand_.upper()(proximal_group));
      command_.position(distal_group) = hand_.lean(shape_) - q;
      command_.speed(distal_group) = Scalar(2) * speed_;
      command_.current_limit(distal_group) = limit_;
    }
    command_.speed(palm_group) = Scalar(0);
    if (fault) {
      enter(GraspState::fault);
    } else if (squeeze && gone_on) {
      enter(GraspState::slipped);
    } else if (all_stopped && all_at_end) {
      enter(squeeze ? GraspState::slipped : GraspState::empty);
    } else if (all_stopped) {
      if (!squeeze) held_at_ = reading.position;
      enter(GraspState::grasped);
    }
  }
  bool too_much(Index g, Scalar limit) const noexcept {
    return current_(g) > static_cast<Scalar>(1.5) * limit;
  }

  // rad past the end stop: as far as no cable lets a motor come.
  static constexpr double beyond = 0.3;

  Hand hand_;
  Options options_;
  StepClock clock_;
  HandCommand<Scalar> command_{};
  Angles current_ = Filled{0}, position_ = Filled{0}, stretch_ = Filled{0}, held_at_ = Filled{0};
  std::array<double, 3> stopped_{}, idle_{};
  double rested_{0}, silent_{0};
  Scalar speed_{0}, limit_{0};
  std::string_view event_{};
  Mode mode_{Mode::off};
  GraspState state_{GraspState::open};
  Preshape shape_{Preshape::parallel};
  bool started_{false};
};

}  // namespace icat
