// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Sensors of an underwater vehicle: attitude and heading unit, DVL, depth sensor, GPS.
///
/// Each samples the true motion at the times k / rate, adds its errors, and yields the measurement
/// `latency` later, with the time of the sample. Noise is white; a bias is drawn once, from the
/// seed, with the given standard deviation. [MARIS, V] names the sensors and prints no numbers: the
/// defaults are ours, of the order of data sheets.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "icat/control/sample_hold.hpp"
#include "icat/math/rigid_motion.hpp"
#include "icat/navigation/dvl.hpp"
#include "icat/sim/noise.hpp"

namespace icat {

/// How a vehicle moves: what sensors see.
template <class Scalar>
struct VehicleMotion {
  Pose<Scalar> pose = IdentityPose{};    ///< ⟨v⟩ in ⟨0⟩
  Vector6<Scalar> velocity = Filled{0};  ///< [v; ω] over ground, on ⟨v⟩, m/s, rad/s
};

/// A value, and when it was measured, s.
template <class Value>
struct Timed {
  double time{0};  ///< s
  Value value{};   ///< at that time
};

namespace detail {

/// When a sensor samples, and what is on its way.
template <class Value>
class SensorLine {
 public:
  SensorLine(const char* owner, double rate, double latency) : rate_(rate), latency_(latency) {
    require_positive(owner, "rate", rate);
    if (!(latency >= 0) || !(latency * rate < 1e6)) {
      invalid(owner, ": latency must be >= 0 and below a million slots, got ", latency, " s at ",
              rate, " Hz");
    }
    waiting_.resize(static_cast<std::size_t>(latency * rate) + 2);
  }
  /// A slot has come since the last time. A clock that goes back begins anew, with nothing on its
  /// way; a time that is none changes nothing.
  bool due(double time) noexcept {
    if (!is_time(time)) return false;
    const long long slot = slot_at(time, rate_);
    if (slot == slot_) return false;
    if (slot < slot_) count_ = 0;
    slot_ = slot;
    return true;
  }
  void send(double time, const Value& value) noexcept {
    if (count_ == waiting_.size()) drop();  // nobody asks
    waiting_[(first_ + count_++) % waiting_.size()] = {time, value};
  }
  /// The oldest that has arrived.
  std::optional<Timed<Value>> receive(double time) noexcept {
    if (count_ == 0 || !is_time(time)) return std::nullopt;
    if (waiting_[first_].time + latency_ > time + 1e-6 / rate_) return std::nullopt;
    const Timed<Value> value = waiting_[first_];
    drop();
    return value;
  }

 private:
  // Its slots can be counted.
  bool is_time(double time) const noexcept { return std::abs(time) * rate_ < 1e15; }
  void drop() noexcept {
    first_ = (first_ + 1) % waiting_.size();
    --count_;
  }

  double rate_, latency_;
  std::vector<Timed<Value>> waiting_;
  std::size_t first_{0}, count_{0};
  long long slot_{std::numeric_limits<long long>::min()};
};

}  // namespace detail

/// Attitude and heading reference system: gyros, and an attitude from gravity and a magnetometer.
template <class Scalar>
class Ahrs {
 public:
  /// What it yields.
  struct Measurement {
    Vector3<Scalar> gyro = Filled{0};             ///< on ⟨v⟩, rad/s
    Matrix3<Scalar> attitude = IdentityMatrix{};  ///< from ⟨v⟩ to ⟨0⟩
  };
  /// Standard deviations in rad and s.
  struct Options {
    double rate = 100;             ///< Hz, > 0
    double latency = 0;            ///< s
    double gyro_noise = 5e-4;      ///< rad/s/√Hz
    double gyro_bias = 0.002;      ///< of each axis, rad/s
    double bias_noise = 1e-5;      ///< its random walk, rad/s/√s
    double tilt_noise = 0.005;     ///< of each measurement
    double heading_noise = 0.01;   ///< of each measurement
    double tilt_bias = 0.005;      ///< constant
    double heading_bias = 0.0175;  ///< constant
    std::uint64_t seed = 1;        ///< of noise and biases
  };

  /// @throws std::invalid_argument on a rate that is not > 0 or another number that is not >= 0.
  explicit Ahrs(const Options& options = Options())
      : options_(options), line_("Ahrs", options.rate, options.latency), noise_(options.seed) {
    for (const double deviation :
         {options.gyro_noise, options.gyro_bias, options.bias_noise, options.tilt_noise,
          options.heading_noise, options.tilt_bias, options.heading_bias}) {
      detail::require_non_negative("Ahrs", "a deviation", deviation);
    }
    bias_ = noise_.vector<Scalar, 3>(options.gyro_bias);
    offset_ = noise_.vector<Scalar, 3>(options.tilt_bias);
    offset_(2) = static_cast<Scalar>(options.heading_bias * noise_.normal());
  }

  /// To be called in each step of the simulation: what has arrived at `time`, s. Nothing where that
  /// is not finite; where it is earlier than the last sample the schedule begins anew. No
  /// allocation.
  std::optional<Timed<Measurement>> measure(double time,
                                            const VehicleMotion<Scalar>& truth) noexcept {
    if (line_.due(time)) {
      Measurement m;
      const Vector3<Scalar> white =
          noise_.vector<Scalar, 3>(options_.gyro_noise * std::sqrt(options_.rate));
      const Vector3<Scalar> angular = detail::column3(truth.velocity, 3, 0);
      m.gyro = detail::plus(detail::plus(angular, bias_), white);
      bias_ = detail::plus(
          bias_, noise_.vector<Scalar, 3>(options_.bias_noise / std::sqrt(options_.rate)));
      Vector3<Scalar> error = noise_.vector<Scalar, 3>(options_.tilt_noise);
      error(2) = static_cast<Scalar>(options_.heading_noise * noise_.normal());
      m.attitude = detail::times(rotation_exp<Scalar>(detail::plus(error, offset_)),
                                 detail::rotation(truth.pose));
      line_.send(time, m);
    }
    return line_.receive(time);
  }

  /// Of the gyros, now, rad/s.
  const Vector3<Scalar>& bias() const noexcept { return bias_; }

 private:
  Options options_;
  detail::SensorLine<Measurement> line_;
  Noise noise_;
  Vector3<Scalar> bias_, offset_;
};

/// Doppler velocity log over a flat floor: four beams as in navigation/dvl.hpp, each of which may
/// find no ground. A beam is lost for certain nearer to the floor than `minimum_altitude` or
/// further along itself than `range`, and with a probability that falls in proportion to zero at
/// twice the minimum altitude.
template <class Scalar>
class Dvl {
 public:
  /// m, s, rad.
  struct Options {
    double rate = 8;                 ///< Hz, > 0
    double latency = 0;              ///< s
    double beam_noise = 0.01;        ///< of each beam, m/s
    double bias = 0.002;             ///< of each axis, m/s
    double scale = 0.003;            ///< of the error in proportion to the velocity
    double floor = 10;               ///< z of the sea floor in ⟨0⟩
    double minimum_altitude = 0.5;   ///< of the instrument
    double range = 80;               ///< of a beam
    double loss = 0;                 ///< probability for each beam, anywhere
    DvlGeometry<Scalar> geometry{};  ///< place and beams
    std::uint64_t seed = 2;          ///< of noise, biases and losses
  };

  /// @throws std::invalid_argument on numbers out of range.
  explicit Dvl(const Options& options = Options())
      : options_(options), line_("Dvl", options.rate, options.latency), noise_(options.seed) {
    detail::check_geometry("Dvl", options.geometry);
    detail::require_non_negative("Dvl", "beam_noise", options.beam_noise);
    detail::require_non_negative("Dvl", "bias", options.bias);
    detail::require_non_negative("Dvl", "scale", options.scale);
    detail::require_positive("Dvl", "minimum_altitude", options.minimum_altitude);
    detail::require_positive("Dvl", "range", options.range);
    if (!(options.loss >= 0 && options.loss <= 1)) {
      detail::invalid("Dvl: loss must be in [0, 1], got ", options.loss);
    }
    if (!std::isfinite(options.floor)) detail::invalid("Dvl: floor must be finite");
    bias_ = noise_.vector<Scalar, 3>(options.bias);
    factor_ = static_cast<Scalar>(1 + options.scale * noise_.normal());
  }

  /// As `Ahrs::measure`. A measurement of fewer than three beams comes too, and says so.
  std::optional<Timed<DvlMeasurement<Scalar>>> measure(
      double time, const VehicleMotion<Scalar>& truth) noexcept {
    if (line_.due(time)) line_.send(time, sample(truth));
    return line_.receive(time);
  }

 private:
  DvlMeasurement<Scalar> sample(const VehicleMotion<Scalar>& truth) noexcept {
    const DvlGeometry<Scalar>& g = options_.geometry;
    const Vector3<Scalar> velocity =
        detail::plus(bias_, factor_, detail::velocity_at(truth.velocity, Index(0), g.position));
    const Matrix3<Scalar> R = detail::rotation(truth.pose);
    const Vector3<Scalar> place = detail::transform(truth.pose, g.position);
    const double altitude = options_.floor - double(place(2));
    const double near = 2 - altitude / options_.minimum_altitude;  // 1 at the minimum, 0 at twice
    DvlMeasurement<Scalar> m;
    Vector3<Scalar> sum = Filled{0};
    for (int k = 0; k < 4; ++k) {
      // The same number of draws whatever happens.
      const double along = options_.beam_noise * noise_.normal(), chance = noise_.uniform();
      const Vector3<Scalar> b = g.beam(k);
      const double down = double(detail::times(R, b)(2));
      const bool found = down > 0 && altitude > options_.minimum_altitude &&
                         altitude < options_.range * down &&
                         chance >= std::max(near, options_.loss);
      m.beams[static_cast<std::size_t>(k)] = found;
      if (found) sum = detail::plus(sum, detail::dot(b, velocity) + static_cast<Scalar>(along), b);
    }
    Matrix3<Scalar> inverse;
    if (detail::dvl_covariance(g, m.beams, inverse)) m.velocity = detail::times(inverse, sum);
    return m;
  }

  Options options_;
  detail::SensorLine<DvlMeasurement<Scalar>> line_;
  Noise noise_;
  Vector3<Scalar> bias_;
  Scalar factor_;
};

/// Pressure as a depth: z of ⟨v⟩ in ⟨0⟩, m.
template <class Scalar>
class DepthSensor {
 public:
  /// m, s.
  struct Options {
    double rate = 10;        ///< Hz, > 0
    double latency = 0;      ///< s
    double noise = 0.02;     ///< of each measurement
    double bias = 0.01;      ///< constant
    std::uint64_t seed = 3;  ///< of noise and bias
  };

  /// @throws std::invalid_argument on a rate that is not > 0 or another number that is not >= 0.
  explicit DepthSensor(const Options& options = Options())
      : options_(options),
        line_("DepthSensor", options.rate, options.latency),
        noise_(options.seed) {
    detail::require_non_negative("DepthSensor", "noise", options.noise);
    detail::require_non_negative("DepthSensor", "bias", options.bias);
    bias_ = options.bias * noise_.normal();
  }

  /// As `Ahrs::measure`.
  std::optional<Timed<Scalar>> measure(double time, const VehicleMotion<Scalar>& truth) noexcept {
    if (line_.due(time)) {
      line_.send(time, truth.pose.matrix()(2, 3) +
                           static_cast<Scalar>(bias_ + options_.noise * noise_.normal()));
    }
    return line_.receive(time);
  }

 private:
  Options options_;
  detail::SensorLine<Scalar> line_;
  Noise noise_;
  double bias_;
};

/// North and east of ⟨v⟩ in ⟨0⟩, m, while it is at the surface.
template <class Scalar>
class Gps {
 public:
  /// m, s.
  struct Options {
    double rate = 4;         ///< Hz, > 0
    double latency = 0;      ///< s
    double noise = 1;        ///< of each measurement, north and east
    double bias = 0.5;       ///< constant
    double surface = 0.2;    ///< a fix for z below this depth
    std::uint64_t seed = 4;  ///< of noise and bias
  };

  /// @throws std::invalid_argument on a rate that is not > 0 or another number that is not >= 0.
  explicit Gps(const Options& options = Options())
      : options_(options), line_("Gps", options.rate, options.latency), noise_(options.seed) {
    detail::require_non_negative("Gps", "noise", options.noise);
    detail::require_non_negative("Gps", "bias", options.bias);
    if (!std::isfinite(options.surface)) detail::invalid("Gps: surface must be finite");
    bias_ = noise_.vector<Scalar, 2>(options.bias);
  }

  /// As `Ahrs::measure`. Under water nothing comes.
  std::optional<Timed<Vector<Scalar, 2>>> measure(double time,
                                                  const VehicleMotion<Scalar>& truth) noexcept {
    if (line_.due(time)) {
      Vector<Scalar, 2> fix = noise_.vector<Scalar, 2>(options_.noise);
      for (Index i = 0; i < 2; ++i) fix(i) += bias_(i) + truth.pose.matrix()(i, 3);
      if (double(truth.pose.matrix()(2, 3)) < options_.surface) line_.send(time, fix);
    }
    return line_.receive(time);
  }

 private:
  Options options_;
  detail::SensorLine<Vector<Scalar, 2>> line_;
  Noise noise_;
  Vector<Scalar, 2> bias_;
};

}  // namespace icat
