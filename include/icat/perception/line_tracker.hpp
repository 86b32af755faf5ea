// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A contour line followed from picture to picture [MARIS, IV: "line contours are tracked in the
/// image"; no equations printed]. An α-β filter on (ρ, θ):
///
///     x⁻ = x + dt v,   r = z − x⁻,   x = x⁻ + α r,   v ← v + β r / dt
///
/// θ wraps at ±π. ρ is taken about the middle of the image, for about its corner a small error of θ
/// would move ρ by hundreds of pixels. A track is valid after `born` hits; each hit adds one to a
/// counter up to `lives`, each miss subtracts one, and at zero the track is deleted. Of several
/// lines the one nearest to the prediction is taken, if it is within the gates. Gains and gates are
/// ours.
#pragma once

#include <numbers>
#include <span>

#include "icat/core/status.hpp"
#include "icat/navigation/kalman.hpp"
#include "icat/perception/camera.hpp"

namespace icat {

/// One contour of one camera. No allocation, no exception after construction.
template <class Scalar>
class LineTracker {
 public:
  /// Gains, gates, lives.
  struct Options {
    Scalar alpha = static_cast<Scalar>(0.5);       ///< α, in (0, 1]
    Scalar beta = static_cast<Scalar>(0.1);        ///< β, in [0, 4 − 2 α)
    Scalar gate = Scalar(100);                     ///< of ρ about the image's middle, px, > 0
    Scalar angle_gate = static_cast<Scalar>(0.3);  ///< of θ, rad, in (0, π)
    int born = 3;                                  ///< hits without a miss, >= 1
    int lives = 15;                                ///< at most, >= born
  };

  /// @param cameras  the rig
  /// @param camera   0 left, 1 right
  /// @param kind     which contours it follows
  /// @param options  gains, gates, lives
  /// @throws std::invalid_argument on cameras or options out of range.
  LineTracker(const StereoCamera<Scalar>& cameras, int camera, ContourKind kind,
              const Options& options = Options())
      : options_(options) {
    const char* const owner = "LineTracker";
    detail::check_cameras(owner, cameras);
    if (camera < 0 || camera > 1) detail::invalid(owner, ": camera must be 0 or 1, got ", camera);
    if (!(options.alpha > Scalar(0) && options.alpha <= Scalar(1))) {
      detail::invalid(owner, ": alpha must be in (0, 1], got ", options.alpha);
    }
    if (!(options.beta >= Scalar(0) && options.beta < Scalar(4) - Scalar(2) * options.alpha)) {
      detail::invalid(owner, ": beta must be in [0, 4 - 2 alpha), got ", options.beta);
    }
    detail::require_positive(owner, "gate", options.gate);
    if (!(options.angle_gate > Scalar(0) && options.angle_gate < std::numbers::pi_v<Scalar>)) {
      detail::invalid(owner, ": angle_gate must be in (0, pi), got ", options.angle_gate);
    }
    if (options.born < 1 || options.lives < options.born) {
      detail::invalid(owner, ": 1 <= born <= lives must hold, got ", options.born, " and ",
                      options.lives);
    }
    line_.camera = camera;
    line_.kind = kind;
    middle_(0) = cameras[static_cast<std::size_t>(camera)].width / Scalar(2);
    middle_(1) = cameras[static_cast<std::size_t>(camera)].height / Scalar(2);
  }

  /// The lines of a picture, `dt` s after the one before (>= 0; more than 1 s counts as 1 s). Those
  /// of the other camera or kind, and those that are not finite, do not count. Returns which one
  /// was taken; −1, a miss, where none was, or where `dt` is none. A tracker without a valid track
  /// takes the first such line other than `excluded`: two trackers follow a pair of contours, and
  /// the second gets the first's choice as `excluded`. Step the one with a valid track first. No
  /// allocation.
  int step(double dt, std::span<const ContourLine<Scalar>> lines, int excluded = -1) noexcept {
    if (detail::check_step(dt) != Status::ok) {
      miss();
      return -1;
    }
    const Scalar h = static_cast<Scalar>(dt);
    if (life_ > 0) {
      offset_ += h * offset_rate_;
      line_.theta = wrap(line_.theta + h * theta_rate_);
    }
    int best = -1;
    Scalar least = infinity<Scalar>;
    for (std::size_t k = 0; k < lines.size(); ++k) {
      const ContourLine<Scalar>& z = lines[k];
      if (static_cast<int>(k) == excluded || z.camera != line_.camera || z.kind != line_.kind ||
          !std::isfinite(z.theta) || !std::isfinite(z.rho) || !detail::all_finite(z.covariance)) {
        continue;
      }
      const Scalar d = life_ == 0 ? static_cast<Scalar>(k) : difference(z);
      if (d < least) {
        least = d;
        best = static_cast<int>(k);
      }
    }
    if (best < 0) {
      miss();
    } else {
      take(lines[static_cast<std::size_t>(best)], h);
    }
    line_.rho = offset_ + about_middle(line_.theta);
    return best;
  }

  /// The track is valid.
  bool alive() const noexcept { return alive_; }
  /// The line as it is now, with the covariance of the last one taken, an upper bound. It means
  /// something only while `alive`.
  const ContourLine<Scalar>& line() const noexcept { return line_; }
  /// Hits less misses, 0 … `lives`.
  int life() const noexcept { return life_; }

 private:
  static Scalar wrap(Scalar angle) noexcept {
    return std::remainder(angle, Scalar(2) * std::numbers::pi_v<Scalar>);
  }
  // ρ of a line through the middle.
  Scalar about_middle(Scalar theta) const noexcept {
    return std::cos(theta) * middle_(0) + std::sin(theta) * middle_(1);
  }
  // Of the gates, the larger of both; infinite beyond 1.
  Scalar difference(const ContourLine<Scalar>& z) const noexcept {
    const Scalar d = std::max(std::abs(z.rho - about_middle(z.theta) - offset_) / options_.gate,
                              std::abs(wrap(z.theta - line_.theta)) / options_.angle_gate);
    return d <= Scalar(1) ? d : infinity<Scalar>;
  }
  void take(const ContourLine<Scalar>& z, Scalar h) noexcept {
    const Scalar offset = z.rho - about_middle(z.theta);
    if (life_ == 0) {
      offset_ = offset;
      line_.theta = wrap(z.theta);
      offset_rate_ = theta_rate_ = Scalar(0);
    } else {
      const Scalar r = offset - offset_, turn = wrap(z.theta - line_.theta);
      offset_ += options_.alpha * r;
      line_.theta = wrap(line_.theta + options_.alpha * turn);
      if (h > static_cast<Scalar>(1e-3)) {  // of one instant no rate
        offset_rate_ += options_.beta * r / h;
        theta_rate_ += options_.beta * turn / h;
      }
    }
    line_.covariance = z.covariance;
    if (++life_ > options_.lives) life_ = options_.lives;
    if (life_ >= options_.born) alive_ = true;
  }
  void miss() noexcept {
    life_ = alive_ && life_ > 0 ? life_ - 1 : 0;  // before birth hits are in a row
    if (life_ == 0) alive_ = false;
  }

  Options options_;
  ContourLine<Scalar> line_;
  Pixel<Scalar> middle_{Scalar(0), Scalar(0)};
  Scalar offset_{0}, offset_rate_{0}, theta_rate_{0};
  int life_{0};
  bool alive_{false};
};

}  // namespace icat
