// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Accepts or refuses measurements, and counts the time since the last accepted one.
///
/// Of an innovation y with the covariance S that the estimator expects of it, the squared
/// Mahalanobis distance is
///
///     d² = yᵀ S⁻¹ y,    χ²-distributed with as many degrees of freedom as y has components
///
/// and a measurement is an outlier where d² reaches the gate: 9, 11.8, 16.3 in one, two, three
/// dimensions, which one good measurement of 370, 365, 1000 does too. [MARIS] prints no gate; these
/// are ours.
///
/// No gate stays closed for ever. If the estimate is wrong, all measurements are outliers, but they
/// agree with each other: after 2 s and five outliers in a row, each within the gate of the one
/// before, the estimator adds y² to the variance of what is measured and takes the measurement.
/// Outliers that do not agree, as of a sensor with random errors, are never accepted.
#pragma once

namespace icat {

/// The gate and the clock of one sensor. No allocation, no exception.
class MeasurementGate {
 public:
  /// Without a measurement for so long, s, a sensor counts as lost.
  static constexpr double stale_after = 1;
  /// Outliers that agree with each other are believed after so long, s …
  static constexpr double patience = 2;
  /// … and so many of them.
  static constexpr int witnesses = 5;

  /// Answer to a measurement.
  enum class Verdict {
    take,
    refuse,  ///< an outlier
    restart  ///< the estimate is what is wrong
  };

  /// Gate of d² for one to three dimensions.
  static constexpr double threshold(int dimension) noexcept {
    return dimension == 1 ? 9.0 : dimension == 2 ? 11.8 : 16.3;
  }

  /// `dt` s, >= 0, have passed.
  void advance(double dt) noexcept {
    age_ += dt;
    refused_for_ += dt;
  }

  /// @param distance   d² of the innovation
  /// @param change     d² of its difference from the innovation before; NaN counts as far
  /// @param dimension  of the measurement, 1 … 3
  Verdict judge(double distance, double change, int dimension) noexcept {
    distance_ = distance;
    if (distance < threshold(dimension)) {
      taken();
      return Verdict::take;
    }
    if (refused_ == 0 || !(change < threshold(dimension))) {
      refused_ = 0;
      refused_for_ = 0;
    }
    if (++refused_ > witnesses && refused_for_ >= patience) {
      ++restarts_;
      taken();
      return Verdict::restart;
    }
    ++outliers_;
    return Verdict::refuse;
  }

  /// Since the last measurement that was taken, or since the start, s.
  double age() const noexcept { return age_; }
  /// No measurement was taken for longer than a second, or none yet.
  bool stale() const noexcept { return !started_ || age_ > stale_after; }
  /// d² of the last measurement, taken or not: the normalized innovation squared (NIS).
  double distance() const noexcept { return distance_; }
  /// How many were refused.
  long outliers() const noexcept { return outliers_; }
  /// Number of restarts of the estimate.
  long restarts() const noexcept { return restarts_; }

 private:
  void taken() noexcept {
    age_ = 0;
    refused_ = 0;
    started_ = true;
  }

  double age_{0}, refused_for_{0}, distance_{0};
  long outliers_{0}, restarts_{0};
  int refused_{0};
  bool started_{false};
};

}  // namespace icat
