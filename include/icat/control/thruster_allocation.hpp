// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// From a wrench to thrusts, in order of priority [MARIS, III-D]: torque before force, the force
/// scaled as a whole, so that its direction is kept.
///
///     w = B f,   column i of B: [dᵢ; pᵢ × dᵢ],   fᵢ in [minimumᵢ, maximumᵢ]
///
/// Groups of components of w are allocated one after the other. S is the set of values that a group
/// can take, over all thrusts within limits that keep the values of the groups before it. It gets s
/// r, r its request, s the largest factor in [0, 1] with s r in S. S includes the whole null space
/// of the groups before. The half-spaces of S are listed when the layout changes (zonotope.hpp), so
/// that the linear program s = max is one pass. Among all thrusts that give the allocated values,
/// the vector of least norm is chosen (bounded_least_norm.hpp). [MARIS] prints the scheme and
/// neither formulas nor a geometry.
///
/// Continuity. S changes continuously with the values of the groups before. If 0 is inside S, then
/// so does s. But where S is flat or does not contain 0, the largest factor jumps (to 0, if the
/// request leaves a flat S), for example when the largest yaw moment also causes a force. So there
/// the components are allocated one after the other, each as near to its request as possible, which
/// is continuous; with λ = Sat₀₁(20 depth/width) the group gets λ times the former plus 1 − λ times
/// the latter. Depth is the distance from 0 to the nearest facet of S, width its largest extent;
/// components are measured by the most that the thrusters can do.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "icat/core/error.hpp"
#include "icat/core/status.hpp"
#include "icat/core/types.hpp"
#include "icat/math/bounded_least_norm.hpp"
#include "icat/math/zonotope.hpp"
#include "icat/model/thruster.hpp"

namespace icat {

/// A component of a wrench [force; torque], by the motion that it causes.
enum class WrenchComponent { surge, sway, heave, roll, pitch, yaw };

/// Groups of components, the most important first; a group keeps its direction.
using WrenchPriority = std::vector<std::vector<WrenchComponent>>;

/// The order of [MARIS, III-D]: yaw, then surge and sway, then heave, which has thrusters of its
/// own. Roll and pitch are not controlled: the moments that the other groups cause are accepted.
[[gnu::cold]] inline WrenchPriority torque_before_force() {
  return {{WrenchComponent::yaw},
          {WrenchComponent::surge, WrenchComponent::sway},
          {WrenchComponent::heave}};
}

/// Allocates a wrench to `N` thrusters, see the file comment.
template <class Scalar, int N = Eigen::Dynamic>
class ThrusterAllocation {
 public:
  /// One number for each thruster.
  using VectorN = Vector<Scalar, N>;

  /// Allocates.
  /// @param thrusters  their order is that of the thrusts
  /// @param priority   each component at most once. One that is in no group is not controlled. To
  ///                   hold one at zero, put it into the first group that may not disturb it.
  /// @throws std::invalid_argument on a thruster without direction, with numbers that are not
  /// finite, or with limits other than minimum <= 0 <= maximum, one of them not 0; on a number of
  /// them other than `N`; on no group, an empty one, a component that stands twice; on more
  /// thrusters than 100,000 half-spaces can describe: 26 for six components, 83 for four.
  [[gnu::cold]] explicit ThrusterAllocation(const std::vector<Thruster<Scalar>>& thrusters,
                                            const WrenchPriority& priority = torque_before_force())
      : n_(check(thrusters)),
        wrenches_(detail::zeros<Eigen::Matrix<Scalar, 6, N>>(6, n_)),
        scaled_(wrenches_),
        columns_(wrenches_),
        minimum_(detail::zeros<VectorN>(n_)),
        maximum_(minimum_),
        lower_(minimum_),
        upper_(minimum_),
        shortest_(n_),
        zonotopes_(order_components(priority, n_)) {
    for (const auto& group : priority) {
      groups_.push_back(Group{});
      groups_.back().size = static_cast<Index>(group.size());
      for (const WrenchComponent component : group) {
        components_[controlled_++] = static_cast<Index>(component);
      }
    }
    detail::fill(request_, Scalar(0));
    for (Index i = 0; i < n_; ++i) {
      const Thruster<Scalar>& thruster = thrusters[static_cast<std::size_t>(i)];
      const Vector3<Scalar>&p = thruster.position, &d = thruster.direction;
      const Scalar norm = std::sqrt(d(0) * d(0) + d(1) * d(1) + d(2) * d(2));
      for (Index j = 0; j < 3; ++j) {
        const Index k = (j + 1) % 3, l = (j + 2) % 3;
        wrenches_(j, i) = d(j) / norm;
        wrenches_(3 + j, i) = (p(k) * d(l) - p(l) * d(k)) / norm;
        arm_ = std::max(arm_, std::abs(p(j)));
      }
      minimum_(i) = lower_(i) = thruster.minimum;
      maximum_(i) = upper_(i) = thruster.maximum;
    }
    configure();
    distribute();
  }

  /// Computes the thrusts for a request. With NaN or infinity in it all thrusts are 0, whatever
  /// they were: a vehicle without thrust comes to rest, one that keeps its last thrust does not. No
  /// allocation; the time is bounded by the number of half-spaces and 6 n exchanges of thrusters at
  /// their limits.
  /// @param request  [force; torque] at the origin of ⟨v⟩, components on ⟨v⟩, N and N m; those in
  /// no
  ///                 group have no effect
  Status allocate(const Vector6<Scalar>& request) noexcept {
    Status status = Status::ok;
    for (Index j = 0; j < 6; ++j) {
      if (!std::isfinite(request(j))) status = Status::non_finite;
    }
    if (status == Status::ok) {
      request_ = request;
    } else {
      detail::fill(request_, Scalar(0));
    }
    distribute();
    for (Index g = 0; status != Status::ok && g < groups(); ++g) group(g).scale = Scalar(0);
    return status;
  }

  /// From now on a thruster gives no thrust, and the others take over: thrusts for the last request
  /// are computed again. `out_of_range` if there is none of this index. No allocation; it takes far
  /// longer than `allocate` (the table in docs/vehicle.md).
  Status fail(Index thruster) noexcept { return set_limits(thruster, false); }
  /// It works again, as `fail`.
  Status restore(Index thruster) noexcept { return set_limits(thruster, true); }
  /// Whether a thruster, one that there is, has failed.
  bool failed(Index thruster) const noexcept {
    return !(lower_(thruster) < Scalar(0)) && !(upper_(thruster) > Scalar(0));
  }

  /// f, N; never beyond a limit, not even by rounding.
  const VectorN& thrust() const noexcept { return shortest_.x(); }
  /// B f: all six components, those that are not controlled too.
  const Vector6<Scalar>& achieved() const noexcept { return achieved_; }
  /// Number of groups.
  Index groups() const noexcept { return static_cast<Index>(groups_.size()); }
  /// The share of a group's request that it got along the request, in [0, 1]: s where
  /// `direction_kept`. 1 where it asks for nothing.
  Scalar scale(Index group) const noexcept {
    return groups_[static_cast<std::size_t>(group)].scale;
  }
  /// Whether a group got `scale` times its request and nothing beside it, to rounding.
  bool direction_kept(Index group) const noexcept {
    return groups_[static_cast<std::size_t>(group)].direction_kept;
  }
  /// Whether a thruster that works is at a limit other than 0, to rounding.
  bool saturated(Index thruster) const noexcept {
    const Scalar f = shortest_.x()(thruster);
    const Scalar near = rounding * (upper_(thruster) - lower_(thruster));
    return (upper_(thruster) > Scalar(0) && f >= upper_(thruster) - near) ||
           (lower_(thruster) < Scalar(0) && f <= lower_(thruster) + near);
  }
  /// Number of thrusters.
  Index size() const noexcept { return n_; }
  /// B, 6 × n, with the columns of those that have failed.
  const Eigen::Matrix<Scalar, 6, N>& wrenches() const noexcept { return wrenches_; }
  /// Half-spaces of the present layout: the time of `allocate` grows with them.
  Index half_spaces() const noexcept { return zonotopes_.size(); }

 private:
  using Set = typename detail::Zonotopes<Scalar>::Set;

  struct Group {
    Index size = 0, first = 0, rows = 0;  // of its components; the first and number of its rows
    Set chain[6], single[6];  // of the rows before and its first i + 1; and its i-th alone
    Scalar scale = 1;
    bool direction_kept = true;
  };

  // Of what is compared with the most that the thrusters can do.
  static constexpr Scalar rounding = Scalar(1e5) * std::numeric_limits<Scalar>::epsilon();

  [[gnu::cold]] static Index check(const std::vector<Thruster<Scalar>>& thrusters) {
    constexpr const char* where = "ThrusterAllocation: thruster ";
    const Index n = static_cast<Index>(thrusters.size());
    if (n == 0 || (N != Eigen::Dynamic && n != N)) {
      detail::invalid("ThrusterAllocation: ", n, " thrusters, expected ", N > 0 ? N : 1,
                      N > 0 ? "" : " or more");
    }
    for (Index i = 0; i < n; ++i) {
      const Thruster<Scalar>& t = thrusters[static_cast<std::size_t>(i)];
      Scalar square(0);
      for (Index j = 0; j < 3; ++j) {
        if (!std::isfinite(t.position(j))) {
          detail::invalid(where, i, ": position ", j, " must be finite, got ", t.position(j));
        }
        square += t.direction(j) * t.direction(j);
      }
      if (!(square > Scalar(0)) || !std::isfinite(square)) {
        detail::invalid(where, i, ": direction must be finite and not 0, got (", t.direction(0),
                        ", ", t.direction(1), ", ", t.direction(2), ")");
      }
      if (!(t.minimum <= Scalar(0)) || !(t.maximum >= Scalar(0)) ||
          !(t.maximum - t.minimum > Scalar(0)) || !std::isfinite(t.maximum - t.minimum)) {
        detail::invalid(where, i, ": limits must be finite, minimum <= 0 <= maximum, not both 0, ",
                        "got ", t.minimum, " and ", t.maximum);
      }
    }
    return n;
  }

  /// Checks the priority. The room that half-spaces need, whichever thrusters fail.
  [[gnu::cold]] static std::size_t order_components(const WrenchPriority& priority, Index n) {
    bool used[6] = {};
    // Choices of p out of n; of those up to p the largest, since rows may be lost.
    double choices = 1, largest = 1, sum = 0;
    Index rows = 0;
    if (priority.empty()) detail::invalid("ThrusterAllocation: the priority has no group");
    for (std::size_t g = 0; g < priority.size(); ++g) {
      if (priority[g].empty()) detail::invalid("ThrusterAllocation: group ", g, " is empty");
      sum += static_cast<double>(priority[g].size() - 1) * largest;
      for (const WrenchComponent component : priority[g]) {
        const auto c = static_cast<std::size_t>(component);
        if (c >= 6) detail::invalid("ThrusterAllocation: group ", g, ": no component ", c);
        if (used[c]) {
          constexpr const char* names[] = {"surge", "sway", "heave", "roll", "pitch", "yaw"};
          detail::invalid("ThrusterAllocation: group ", g, ": ", names[c], " stands twice");
        }
        used[c] = true;
        sum += choices;
        choices *= static_cast<double>(n > rows ? n - rows : 0) / static_cast<double>(rows + 1);
        largest = std::max(largest, choices);
        ++rows;
      }
    }
    if (sum > 100'000) {
      detail::invalid("ThrusterAllocation: ", n, " thrusters and ", rows, " components need ", sum,
                      " half-spaces, at most 100000");
    }
    return static_cast<std::size_t>(sum + 0.5);
  }

  Group& group(Index g) noexcept { return groups_[static_cast<std::size_t>(g)]; }

  Status set_limits(Index thruster, bool works) noexcept {
    if (thruster < 0 || thruster >= n_) return Status::out_of_range;
    lower_(thruster) = works ? minimum_(thruster) : Scalar(0);
    upper_(thruster) = works ? maximum_(thruster) : Scalar(0);
    configure();
    distribute();
    return Status::ok;
  }

  /// Rows that determine each other no further, measured by the most that the thrusters can do; the
  /// zonotopes that they span.
  void configure() noexcept {
    shortest_.clear();
    zonotopes_.clear();
    Scalar force(0);
    for (Index i = 0; i < n_; ++i) force += std::max(-lower_(i), upper_(i));
    Index component = 0, rows = 0;
    for (Index g = 0; g < groups(); ++g) {
      Group& at = group(g);
      at.first = rows;
      for (Index k = 0; k < at.size; ++k, ++component) {
        const Index c = components_[component];
        Scalar above(0), below(0);
        for (Index i = 0; i < n_; ++i) {
          above += std::max(wrenches_(c, i) * lower_(i), wrenches_(c, i) * upper_(i));
          below += std::max(-wrenches_(c, i) * lower_(i), -wrenches_(c, i) * upper_(i));
        }
        reach_[component] = std::max(above, below);
        row_of_[component] = -1;
        negligible_[component] = rounding * force * (c < 3 ? Scalar(1) : arm_);
        if (!(reach_[component] > negligible_[component])) continue;
        VectorN& row = shortest_.x();  // is computed anew by `distribute`
        for (Index i = 0; i < n_; ++i) {
          const bool works = !failed(i);
          row(i) = works ? wrenches_(c, i) / reach_[component] : Scalar(0);
          scaled_(rows, i) = row(i);
        }
        if (shortest_.add_row(row.data())) row_of_[component] = rows++;
      }
      at.rows = rows - at.first;
      for (Index k = 0; k < at.rows; ++k) {
        at.single[k] = add_zonotope(at.first, at.first + k, at.first + k + 1);
        at.chain[k] = k == 0 ? at.single[0] : add_zonotope(at.first + k + 1, 0, 0);
      }
    }
  }

  /// Of the first `rows` rows and of those from `begin` to `end`.
  Set add_zonotope(Index rows, Index begin, Index end) noexcept {
    for (Index i = 0; i < n_; ++i) {
      for (Index j = 0; j < rows; ++j) columns_(j, i) = scaled_(j, i);
      for (Index j = begin; j < end; ++j) columns_(rows + j - begin, i) = scaled_(j, i);
    }
    return zonotopes_.add(rows + end - begin, n_, 6, columns_.data(), lower_.data(), upper_.data());
  }

  void distribute() noexcept {
    Scalar got[6], wanted[6];  // rows in order, measured by `reach_`
    for (Index g = 0, component = 0; g < groups(); ++g) {
      Group& at = group(g);
      for (Index k = 0; k < at.size; ++k, ++component) {
        const Index row = row_of_[component];
        if (row >= 0) wanted[row] = request_(components_[component]) / reach_[component];
      }
      serve(at, got, wanted);
    }
    shortest_.solve(got, lower_.data(), upper_.data());
    for (Index j = 0; j < 6; ++j) {
      achieved_(j) = Scalar(0);
      for (Index i = 0; i < n_; ++i) achieved_(j) += wrenches_(j, i) * shortest_.x()(i);
    }
    for (Index g = 0, component = 0; g < groups(); component += group(g++).size) {
      report(group(g), component, got, wanted);
    }
  }

  /// What a group gets, after those before it.
  void serve(const Group& at, Scalar* got, const Scalar* wanted) const noexcept {
    // Each component by itself, as near to its request as it can be.
    for (Index k = 0; k < at.rows; ++k) {
      Scalar lower, upper;
      zonotopes_.interval(at.chain[k], got, lower, upper);
      got[at.first + k] = std::min(std::max(wanted[at.first + k], lower), upper);
    }
    // In direction of the request.
    Scalar largest(0), width(0), direction[6];
    for (Index k = 0; k < at.rows; ++k) {
      largest = std::max(largest, std::abs(wanted[at.first + k]));
      Scalar lower, upper;
      zonotopes_.interval(at.single[k], got, lower, upper);
      width = std::max(width, upper - lower);
    }
    if (at.rows < 2 || !(largest > Scalar(0)) || !(width > Scalar(0))) return;
    for (Index k = 0; k < at.rows; ++k) direction[k] = wanted[at.first + k] / largest;
    const auto ray = zonotopes_.ray(at.chain[at.rows - 1], at.first, got, direction);
    const Scalar along = std::min(Scalar(20) * ray.depth / width, Scalar(1));
    const Scalar length = along * std::min(ray.exit, largest);
    for (Index k = 0; k < at.rows; ++k) {
      Scalar& value = got[at.first + k];
      value = length * direction[k] + (Scalar(1) - along) * value;
    }
  }

  void report(Group& at, Index component, const Scalar* got, const Scalar* wanted) noexcept {
    Scalar largest(0), along(0), square(0);
    for (Index k = at.first; k < at.first + at.rows; ++k) {
      largest = std::max(largest, std::abs(wanted[k]));
    }
    for (Index k = at.first; largest > Scalar(0) && k < at.first + at.rows; ++k) {
      const Scalar w = wanted[k] / largest;
      square += w * w;
      along += w * (got[k] / largest);
    }
    bool kept = true;
    at.scale =
        square > Scalar(0) ? std::min(std::max(along / square, Scalar(0)), Scalar(1)) : Scalar(1);
    for (Index k = component; k < component + at.size; ++k) {
      const Scalar request = request_(components_[k]);
      if (row_of_[k] >= 0) {
        const Index row = row_of_[k];
        kept = kept && std::abs(got[row] - at.scale * wanted[row]) <= rounding;
      } else if (std::abs(request) > negligible_[k] && !(square > Scalar(0))) {
        at.scale = Scalar(0);  // nothing moves what it asks for
        kept = false;
      } else {
        kept = kept && std::abs(achieved_(components_[k]) - at.scale * request) <= negligible_[k];
      }
    }
    at.direction_kept = kept;
  }

  Index n_;
  Eigen::Matrix<Scalar, 6, N> wrenches_, scaled_, columns_;  // B; its rows by `reach_`; of a set
  VectorN minimum_, maximum_, lower_, upper_;                // as built; without those that failed
  detail::BoundedLeastNorm<Scalar, N> shortest_;
  detail::Zonotopes<Scalar> zonotopes_;
  std::vector<Group> groups_;
  Index controlled_{0};
  Index components_[6] = {}, row_of_[6] = {};  // in order of priority; −1 where others determine it
  Scalar reach_[6] = {}, negligible_[6] = {};  // of components: the most; what counts as nothing
  Scalar arm_{0};
  Vector6<Scalar> request_, achieved_;
};

}  // namespace icat
