// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Proportional-integral loops with feed-forward and bounded output, each component by itself:
///
///     e = r − y,   u = Sat( f + k_p e + s ),   ṡ = k_i e unless u is at a bound and e pushes on
///
/// Tuned on an inertia m, m ẏ = u, both poles of the closed loop are at −ω: k_p = 2 m ω, k_i = m
/// ω².
#pragma once

#include <limits>

#include "icat/core/error.hpp"
#include "icat/core/status.hpp"
#include "icat/core/types.hpp"

namespace icat {

/// Velocity loops of a vehicle or an arm [Coop, V-B].
template <class Scalar, int N>
class PiLoop {
 public:
  /// One number per component.
  using VectorN = Vector<Scalar, N>;

  /// Gains and bounds, >= 0.
  struct Options {
    VectorN proportional = Filled{0};          ///< k_p, output per unit of error
    VectorN integral = Filled{0};              ///< k_i, output per unit of error and second
    VectorN bound = Filled{infinity<double>};  ///< of |u|; none by default
  };

  /// Gains for a nominal `inertia` (kg, kg m²) and a `bandwidth` ω (rad/s) of each component.
  static Options tuned(const VectorN& inertia, const VectorN& bandwidth) {
    Options options;
    options.proportional = Scalar(2) * inertia.cwiseProduct(bandwidth);
    options.integral = inertia.cwiseProduct(bandwidth).cwiseProduct(bandwidth);
    return options;
  }

  /// @throws std::invalid_argument on gains that are not finite and >= 0, or bounds below 0.
  explicit PiLoop(const Options& options) {
    retune(options);
    reset();
  }

  /// Other gains and bounds from now on; output and integral stay.
  /// @throws std::invalid_argument as the constructor, and changes nothing then.
  void retune(const Options& options) {
    const auto check = [](const char* name, const VectorN& values, bool finite) {
      for (Index i = 0; i < N; ++i) {
        if (!(values(i) >= Scalar(0)) ||
            (finite && values(i) > std::numeric_limits<Scalar>::max())) {
          detail::invalid("PiLoop: ", name, " ", i, " must be ", finite ? "finite and " : "",
                          ">= 0, got ", values(i));
        }
      }
    };
    check("proportional gain", options.proportional, true);
    check("integral gain", options.integral, true);
    check("bound", options.bound, false);
    options_ = options;
  }

  /// u for the next `dt` s, > 0. What is not finite is refused: `output` and the integral stay. No
  /// allocation.
  /// @param reference     r
  /// @param measured      y
  /// @param feed_forward  f, unit of the output
  /// @param dt            s
  Status update(const VectorN& reference, const VectorN& measured, const VectorN& feed_forward,
                double dt) noexcept {
    const VectorN error = reference - measured;
    const VectorN wanted = feed_forward + options_.proportional.cwiseProduct(error) + integral_;
    const VectorN growth = static_cast<Scalar>(dt) * options_.integral.cwiseProduct(error);
    if (!wanted.allFinite() || !growth.allFinite()) return Status::non_finite;
    for (Index i = 0; i < N; ++i) {
      const Scalar bound = options_.bound(i);
      output_(i) = wanted(i) > bound ? bound : wanted(i) < -bound ? -bound : wanted(i);
      const bool pushes_on =
          output_(i) != wanted(i) && (error(i) > Scalar(0)) == (wanted(i) > Scalar(0));
      if (!pushes_on) integral_(i) += growth(i);
    }
    return Status::ok;
  }

  /// u of the last update; 0 before.
  const VectorN& output() const noexcept { return output_; }
  /// s, unit of the output.
  const VectorN& integral() const noexcept { return integral_; }
  /// Integral and output to 0.
  void reset() noexcept {
    integral_.setZero();
    output_.setZero();
  }

 private:
  Options options_;
  VectorN integral_, output_;
};

}  // namespace icat
