// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The solver's report of its last hierarchy: what each level achieved, and what reduced it.
#pragma once

#include <array>
#include <span>

#include "icat/core/status.hpp"
#include "icat/core/types.hpp"

namespace icat {

/// One priority level of the hierarchy, in the order it was added. The rates are Euclidean norms
/// over the level's rows as they are (not as `row_scale` has them), each weighted by its
/// activation, taken right after the level was solved.
template <class Scalar>
struct LevelReport {
  /// Number of rows.
  Index rows{0};
  Index active_rows{0};        ///< rows with activation > 0
  bool regularized{false};     ///< a singular value of the level's `XᵀAX` lay below the threshold
  Scalar saturation_scale{1};  ///< factor on the level's increment, 1 where the bounds allow it all
  Index saturated{0};          ///< components at a bound that the whole increment would pass
  Index saturation_steps{0};   ///< components held or let go to find those: `redistribute` alone
  Scalar requested_rate{0};    ///< ‖A ẋ̄‖
  Scalar achieved_rate{0};     ///< ‖A J ρ‖
  Scalar tracking_error{0};    ///< ‖A (ẋ̄ − J ρ)‖
  Status status{Status::ok};   ///< not `ok`: the level was refused and changed nothing
  Index bad_row{-1};           ///< first row at fault when refused; −1 if no single row is
};

/// Levels since the last `reset`. No allocation; levels beyond `capacity` are solved but not
/// listed.
template <class Scalar>
class TpikReport {
 public:
  /// Most levels that are listed.
  static constexpr Index capacity = 64;

  /// All levels listed, including a refused one.
  std::span<const LevelReport<Scalar>> levels() const noexcept {
    return {levels_.data(), static_cast<std::size_t>(listed_)};
  }
  /// `ok`, or the status of the first refused level; with its index and row (−1: none).
  Status status() const noexcept { return status_; }
  /// Index of the first refused level, −1: none.
  Index failed_level() const noexcept { return failed_level_; }
  /// Its first row at fault, −1: no single one.
  Index failed_row() const noexcept { return failed_row_; }

  /// For the solver: forgets all.
  void clear() noexcept {
    listed_ = count_ = 0;
    status_ = Status::ok;
    failed_level_ = failed_row_ = -1;
  }
  /// For the solver: one level more.
  void add(const LevelReport<Scalar>& level) noexcept {
    if (level.status != Status::ok) fail(level.status, count_, level.bad_row);
    if (listed_ < capacity) levels_[static_cast<std::size_t>(listed_++)] = level;
    ++count_;
  }
  /// For the solver: keeps the first failure.
  void fail(Status status, Index level, Index row) noexcept {
    if (status_ != Status::ok) return;
    status_ = status;
    failed_level_ = level;
    failed_row_ = row;
  }

 private:
  std::array<LevelReport<Scalar>, capacity> levels_{};
  Index listed_{0};
  Index count_{0};
  Status status_{Status::ok};
  Index failed_level_{-1};
  Index failed_row_{-1};
};

}  // namespace icat
