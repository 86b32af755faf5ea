// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The pose of a cylinder from its contour lines in one or two cameras [MARIS, IV].
///
/// A contour is the image of a plane that touches the cylinder. The paper says in words that these
/// planes, moved inwards by the radius, intersect in the axis, that the plane of an end gives the
/// origin, and gravity the direction of z; the equations are the geometry of this:
///
///     n = R_k Kᵀ l / |·|,  c = −nᵀ C             plane of the line l through the camera's centre C
///     d: n₁ × n₂, or of more planes the eigenvector of Σ n nᵀ with the smallest eigenvalue
///     nᵀ p = r − c                               p on the axis: least squares, with dᵀ p = 0
///     n_tᵀ (p + s d) = |n_tᵀ d| L/2 − c_t        s from the planes of ends
///     y = d,  z = (g − (gᵀ d) d) / |·|,  x = y × z
///
/// Ends move the origin only along the axis, so an error of a rim does not affect the axis. The
/// plane of an end would be exact if the camera were beside it. Else the contour of the rim, an
/// ellipse, is not the picture of its centre; with D the distance of the axis from the camera and a
/// how far the end is along it, the origin is off by |a| r / (D − r) at most: `rim_error`. Without
/// an end the origin is the point of the axis nearest to ⟨c⟩, five degrees of freedom are measured,
/// and the variance along y is infinite.
///
/// The covariance is that of the lines carried through to first order. Limits and gates are ours.
#pragma once

#include <algorithm>
#include <span>

#include "icat/core/status.hpp"
#include "icat/navigation/kalman.hpp"
#include "icat/perception/cylinder_contours.hpp"

namespace icat {

/// The pose of a cylinder from the lines of one pair of images.
template <class Scalar>
struct CylinderMeasurement {
  Pose<Scalar> frame = IdentityPose{};  ///< ⟨o⟩ in ⟨c⟩, m: y along the axis, z down
  bool end_seen{false};  ///< false: five degrees of freedom, the origin is anywhere on the axis
  /// Of [δp; δφ], a shift and a small turn of ⟨o⟩, both on ⟨o⟩, m² and rad². Without an end row and
  /// column 1 are zero, and infinite where they cross.
  Matrix6<Scalar> covariance = Filled{0};
  Scalar rim_error{0};  ///< by which the origin may be off along y, beyond the covariance, m
  Scalar residual{0};   ///< of the worst of the long planes: how far from an end of the axis, m
};

namespace detail {

/// Eigenvalues, rising, and eigenvectors (columns of V) of a symmetric A by Jacobi's rotations.
/// Eight sweeps: three suffice for 3 × 3 in double.
template <class Scalar>
void eigen3(Matrix3<Scalar> A, Vector3<Scalar>& values, Matrix3<Scalar>& V) noexcept {
  set_identity(V);
  for (int sweep = 0; sweep < 8; ++sweep) {
    for (Index p = 0; p < 2; ++p) {
      for (Index q = p + 1; q < 3; ++q) {
        if (A(p, q) == Scalar(0)) continue;
        const Scalar h = (A(q, q) - A(p, p)) / (Scalar(2) * A(p, q));
        const Scalar t =
            (h < Scalar(0) ? Scalar(-1) : Scalar(1)) / (std::abs(h) + std::hypot(h, Scalar(1)));
        const Scalar c = Scalar(1) / std::hypot(t, Scalar(1)), s = t * c;
        for (Index k = 0; k < 3; ++k) {
          const Scalar a = A(k, p), b = A(k, q);
          A(k, p) = c * a - s * b, A(k, q) = s * a + c * b;
        }
        for (Index k = 0; k < 3; ++k) {
          const Scalar a = A(p, k), b = A(q, k);
          A(p, k) = c * a - s * b, A(q, k) = s * a + c * b;
          const Scalar v = V(k, p), w = V(k, q);
          V(k, p) = c * v - s * w, V(k, q) = s * v + c * w;
        }
      }
    }
  }
  Index order[3] = {0, 1, 2};
  std::sort(order, order + 3, [&](Index i, Index j) { return A(i, i) < A(j, j); });
  const Matrix3<Scalar> found = V;
  for (Index i = 0; i < 3; ++i) {
    values(i) = A(order[i], order[i]);
    set_column3(V, 0, i, column3(found, 0, order[i]));
  }
}

/// The plane of a line, in ⟨c⟩, and its derivatives by θ and ρ.
template <class Scalar>
struct LinePlane {
  Vector3<Scalar> n, dn[2];
  Scalar c, dc[2];
  const ContourLine<Scalar>* line;

  void set(const PinholeCamera<Scalar>& k, const ContourLine<Scalar>& l) noexcept {
    line = &l;
    const Scalar cosine = std::cos(l.theta), sine = std::sin(l.theta);
    const Vector3<Scalar> m(k.fx * cosine, k.fy * sine, k.cx * cosine + k.cy * sine - l.rho);
    const Vector3<Scalar> dm[2] = {{-k.fx * sine, k.fy * cosine, k.cy * cosine - k.cx * sine},
                                   {Scalar(0), Scalar(0), Scalar(-1)}};
    const Matrix3<Scalar> R = rotation(k.pose);
    const Vector3<Scalar> center = origin(k.pose);
    const Scalar length = norm(m);
    const Vector3<Scalar> unit = scaled(m, Scalar(1) / length);
    n = times(R, unit);
    c = -dot(n, center);
    for (int i = 0; i < 2; ++i) {
      const Vector3<Scalar> across = plus(dm[i], -dot(unit, dm[i]), unit);
      dn[i] = times(R, scaled(across, Scalar(1) / length));
      dc[i] = -dot(dn[i], center);
    }
  }
};

}  // namespace detail

/// See the file comment. No allocation, no memory: each picture by itself.
template <class Scalar>
class CylinderPose {
 public:
  /// Known quantities, and limits of accepted measurements.
  struct Options {
    CylinderShape<Scalar> shape{};  ///< radius and length, m
    /// d has a component >= 0 along this, on ⟨c⟩; any length. A cylinder has two directions.
    Vector3<Scalar> towards{Scalar(-1), Scalar(0), Scalar(0)};
    Scalar gravity_noise = static_cast<Scalar>(0.01);  ///< deviation of a tilt, rad, >= 0
    Scalar max_deviation = static_cast<Scalar>(0.05);  ///< across the axis, m, > 0: refused beyond
    Scalar max_tilt = static_cast<Scalar>(0.1);        ///< of the axis, rad, > 0: refused beyond
    Scalar max_residual = static_cast<Scalar>(0.03);   ///< m, > 0: an outlier beyond
  };

  /// Lines of each kind at most: two in each camera.
  static constexpr int most = 4;

  /// @throws std::invalid_argument on cameras or options out of range.
  explicit CylinderPose(const StereoCamera<Scalar>& cameras, const Options& options = Options())
      : cameras_(cameras), options_(options) {
    const char* const owner = "CylinderPose";
    detail::check_cameras(owner, cameras);
    detail::require_positive(owner, "radius", options.shape.radius);
    detail::require_positive(owner, "length", options.shape.length);
    detail::require_non_negative(owner, "gravity_noise", options.gravity_noise);
    detail::require_positive(owner, "max_deviation", options.max_deviation);
    detail::require_positive(owner, "max_tilt", options.max_tilt);
    detail::require_positive(owner, "max_residual", options.max_residual);
    if (!detail::all_finite(options.towards) || !(detail::norm(options.towards) > Scalar(0))) {
      detail::invalid(owner, ": towards must be finite and not zero");
    }
  }

  /// The cylinder of these lines. Anything but `ok` leaves `result` as it was:
  /// - `wrong_size`: more than four long contours, or ends
  /// - `non_finite`, `out_of_range`: NaN in a line or gravity; a camera that is not 0 or 1, a
  ///   covariance with a negative variance, no gravity
  /// - `implausible`: ρ beyond 1e6 px
  /// - `not_measured`: fewer than two long contours; planes that are nearly one, as of two contours
  ///   that lie along the baseline, so that a deviation is beyond `max_deviation` or `max_tilt`; an
  ///   axis within 0.1 rad of the vertical, about which gravity says nothing
  /// - `outlier`: more than two long contours that do not belong to one cylinder
  ///
  /// Ends whose plane is within 0.2 rad of the axis are not used. No allocation.
  /// @param lines    of one pair of pictures
  /// @param gravity  g on ⟨c⟩, pointing down, of any length (`gravity_in_camera`)
  /// @param result   the cylinder
  Status measure(std::span<const ContourLine<Scalar>> lines, const Vector3<Scalar>& gravity,
                 CylinderMeasurement<Scalar>& result) const noexcept {
    Work w;
    Status status = read(lines, w);
    if (status != Status::ok) return status;
    if (!detail::all_finite(gravity)) return Status::non_finite;
    const Scalar weight = detail::norm(gravity);
    if (!(weight > Scalar(0)) || !std::isfinite(weight)) return Status::out_of_range;
    w.g = detail::scaled(gravity, Scalar(1) / weight);
    if (w.edges < 2 || !find_axis(w)) return Status::not_measured;
    Vector3<Scalar> z = detail::plus(w.g, -detail::dot(w.g, w.d), w.d);
    w.level = detail::norm(z);
    if (!(w.level > Scalar(0.1))) return Status::not_measured;
    w.z = detail::scaled(z, Scalar(1) / w.level);
    w.x = detail::cross(w.d, w.z);
    place_origin(w);

    CylinderMeasurement<Scalar> m;
    m.end_seen = w.ends > 0;
    Matrix3<Scalar> R;
    detail::set_column3(R, 0, 0, w.x);
    detail::set_column3(R, 0, 1, w.d);
    detail::set_column3(R, 0, 2, w.z);
    m.frame = detail::make_pose(R, w.p);
    m.residual = w.edges > 2 ? residual(w) : Scalar(0);
    m.rim_error = rim_error(w);
    for (int k = 0; k < w.edges + w.ends; ++k) add_line(w, k, m.covariance);
    m.covariance(4, 4) += options_.gravity_noise * options_.gravity_noise / (w.level * w.level);
    if (!detail::all_finite(m.frame.matrix()) || !detail::all_finite(m.covariance)) {
      return Status::numerical_failure;
    }
    const Matrix6<Scalar>& P = m.covariance;
    if (!(std::max(P(0, 0), P(2, 2)) <= options_.max_deviation * options_.max_deviation) ||
        !(std::max(P(3, 3), P(5, 5)) <= options_.max_tilt * options_.max_tilt)) {
      return Status::not_measured;
    }
    if (!(m.residual <= options_.max_residual)) return Status::outlier;
    if (!m.end_seen) {
      for (Index i = 0; i < 6; ++i) m.covariance(1, i) = m.covariance(i, 1) = Scalar(0);
      m.covariance(1, 1) = infinity<Scalar>;
    }
    result = m;
    return Status::ok;
  }

  /// The rig.
  const StereoCamera<Scalar>& cameras() const noexcept { return cameras_; }
  /// As given at construction.
  const Options& options() const noexcept { return options_; }

 private:
  // Long contours first, then ends.
  struct Work {
    std::array<detail::LinePlane<Scalar>, 2 * most> planes;
    int edges{0}, ends{0};
    Vector3<Scalar> g, d, x, z, across, p;  // across: the point of the axis with dᵀ p = 0
    Vector3<Scalar> values;
    Matrix3<Scalar> vectors, inverse;      // of Σ n nᵀ; of Σ n nᵀ + d dᵀ
    Scalar level{0}, along{0}, weight{0};  // |g − (gᵀ d) d|, s, Σ (n_tᵀ d)²
  };

  Status read(std::span<const ContourLine<Scalar>> lines, Work& w) const noexcept {
    for (const ContourKind kind : {ContourKind::edge, ContourKind::end}) {
      int count = 0;
      for (const ContourLine<Scalar>& line : lines) {
        if (line.kind != kind) continue;
        if (++count > most) return Status::wrong_size;
        if (!std::isfinite(line.theta) || !std::isfinite(line.rho) ||
            !detail::all_finite(line.covariance)) {
          return Status::non_finite;
        }
        if (line.camera < 0 || line.camera > 1 || line.covariance(0, 0) < Scalar(0) ||
            line.covariance(1, 1) < Scalar(0)) {
          return Status::out_of_range;
        }
        if (!(std::abs(line.rho) <= Scalar(detail::implausible_measurement))) {
          return Status::implausible;
        }
        w.planes[static_cast<std::size_t>(w.edges + w.ends)].set(
            cameras_[static_cast<std::size_t>(line.camera)], line);
        ++(kind == ContourKind::edge ? w.edges : w.ends);
      }
    }
    return Status::ok;
  }
  const detail::LinePlane<Scalar>& plane(const Work& w, int k) const noexcept {
    return w.planes[static_cast<std::size_t>(k)];
  }

  // d and the point of the axis with dᵀ p = 0.
  bool find_axis(Work& w) const noexcept {
    Matrix3<Scalar> N = Filled{0};
    Vector3<Scalar> right(Scalar(0), Scalar(0), Scalar(0));
    for (int k = 0; k < w.edges; ++k) {
      const auto& pl = plane(w, k);
      for (Index i = 0; i < 3; ++i) {
        for (Index j = 0; j < 3; ++j) N(i, j) += pl.n(i) * pl.n(j);
      }
      right = detail::plus(right, options_.shape.radius - pl.c, pl.n);
    }
    detail::eigen3(N, w.values, w.vectors);
    // Of planes that are one, to rounding, no line is common.
    if (!(w.values(1) > Scalar(64) * std::numeric_limits<Scalar>::epsilon())) return false;
    w.d = detail::column3(w.vectors, 0, 0);
    if (w.edges == 2) {  // the same, without squares: exact to rounding in float, too
      w.d = detail::cross(plane(w, 0).n, plane(w, 1).n);
      w.d = detail::scaled(w.d, Scalar(1) / detail::norm(w.d));
      detail::set_column3(w.vectors, 0, 0, w.d);
    }
    if (detail::dot(w.d, options_.towards) < Scalar(0)) w.d = detail::scaled(w.d, Scalar(-1));
    for (Index i = 0; i < 3; ++i) {
      for (Index j = 0; j < 3; ++j) N(i, j) += w.d(i) * w.d(j);
    }
    if (!detail::invert<Scalar, 3>(N, w.inverse)) return false;
    w.across = detail::times(w.inverse, right);
    return true;
  }

  // Moves it along the axis to where the ends say, and drops those that say nothing.
  void place_origin(Work& w) const noexcept {
    int used = 0;
    Scalar sum(0);
    for (int k = 0; k < w.ends; ++k) {
      const auto pl = plane(w, w.edges + k);
      const Scalar a = detail::dot(pl.n, w.d);
      if (!(std::abs(a) > Scalar(0.2))) continue;
      w.planes[static_cast<std::size_t>(w.edges + used++)] = pl;
      w.weight += a * a;
      sum += a * end_offset(w, pl, a);
    }
    w.ends = used;
    w.along = used > 0 ? sum / w.weight : Scalar(0);
    w.p = detail::plus(w.across, w.along, w.d);
  }
  // By which n_tᵀ s d must make up.
  Scalar end_offset(const Work& w, const detail::LinePlane<Scalar>& pl, Scalar a) const noexcept {
    return std::abs(a) * options_.shape.length / Scalar(2) - pl.c - detail::dot(pl.n, w.across);
  }

  Scalar residual(const Work& w) const noexcept {
    Scalar worst(0);
    for (int k = 0; k < w.edges; ++k) {
      const auto& pl = plane(w, k);
      const Scalar middle = detail::dot(pl.n, w.p) + pl.c - options_.shape.radius;
      const Scalar slope = detail::dot(pl.n, w.d) * options_.shape.length / Scalar(2);
      worst = std::max(worst, std::abs(middle) + std::abs(slope));
    }
    return worst;
  }
  Scalar rim_error(const Work& w) const noexcept {
    Scalar worst(0);
    for (int k = 0; k < w.ends; ++k) {
      const auto& pl = plane(w, w.edges + k);
      const Vector3<Scalar> from = detail::minus(
          w.p, detail::origin(cameras_[static_cast<std::size_t>(pl.line->camera)].pose));
      const Scalar middle = detail::dot(from, w.d);
      const Scalar distance = detail::norm(detail::plus(from, -middle, w.d));
      const Scalar half = options_.shape.length / Scalar(2);
      const Scalar a = middle + (detail::dot(pl.n, w.d) > Scalar(0) ? -half : half);
      const Scalar r = options_.shape.radius;
      worst = std::max(worst, distance > r ? std::abs(a) * r / (distance - r) : infinity<Scalar>);
    }
    return worst;
  }

  // What an error of one line does to ⟨o⟩, to first order, times its covariance.
  void add_line(const Work& w, int k, Matrix6<Scalar>& P) const noexcept {
    const auto& pl = plane(w, k);
    Eigen::Matrix<Scalar, 6, 2> G;
    for (int j = 0; j < 2; ++j) {
      const Vector3<Scalar>& dn = pl.dn[j];
      Vector3<Scalar> dd(Scalar(0), Scalar(0), Scalar(0)), moved = dd;
      if (k < w.edges) {
        const Scalar a = detail::dot(pl.n, w.d);
        const Vector3<Scalar> v =
            detail::plus(detail::scaled(dn, a), detail::dot(dn, w.d), pl.n);  // δ(n nᵀ) d
        for (Index i = 1; i < 3; ++i) {
          const Vector3<Scalar> e = detail::column3(w.vectors, 0, i);
          dd = detail::plus(dd, detail::dot(e, v) / (w.values(0) - w.values(i)), e);
        }
        const Scalar left = options_.shape.radius - pl.c - detail::dot(pl.n, w.across);
        const Scalar change = -pl.dc[j] - detail::dot(dn, w.across);
        Vector3<Scalar> right = detail::plus(detail::scaled(dn, left), change, pl.n);
        right = detail::plus(right, -detail::dot(dd, w.across), w.d);  // of dᵀ p = 0
        right = detail::plus(right, -detail::dot(w.d, w.across), dd);
        moved = detail::times(w.inverse, right);
      }
      Scalar slid(0);  // δs, of each end
      for (int t = 0; t < w.ends; ++t) {
        const auto& end = plane(w, w.edges + t);
        const bool own = k == w.edges + t;
        const Scalar a = detail::dot(end.n, w.d);
        const Scalar da = detail::dot(end.n, dd) + (own ? detail::dot(dn, w.d) : Scalar(0));
        Scalar change = (a > Scalar(0) ? da : -da) * options_.shape.length / Scalar(2) -
                        detail::dot(end.n, moved);
        if (own) change -= pl.dc[j] + detail::dot(dn, w.across);
        slid += (da * (end_offset(w, end, a) - Scalar(2) * a * w.along) + a * change) / w.weight;
      }
      const Vector3<Scalar> dp = detail::plus(detail::plus(moved, slid, w.d), w.along, dd);
      G(0, j) = detail::dot(w.x, dp);
      G(1, j) = detail::dot(w.d, dp);
      G(2, j) = detail::dot(w.z, dp);
      G(3, j) = detail::dot(w.z, dd);
      G(4, j) = -detail::dot(w.g, w.d) * detail::dot(w.x, dd) / w.level;
      G(5, j) = -detail::dot(w.x, dd);
    }
    const Matrix6<Scalar> more = detail::congruence<Scalar, 2, 6>(G, pl.line->covariance);
    for (Index i = 0; i < 36; ++i) P.data()[i] += more.data()[i];
  }

  StereoCamera<Scalar> cameras_;
  Options options_;
};

/// Down on ⟨c⟩, of length 1, by the attitude of the vehicle's inertial sensor. No allocation.
/// @param vehicle  ⟨v⟩ in ⟨0⟩, of which z points down
/// @param camera   ⟨c⟩ in ⟨v⟩
template <class Scalar>
Vector3<Scalar> gravity_in_camera(const Pose<Scalar>& vehicle,
                                  const Pose<Scalar>& camera) noexcept {
  const Vector3<Scalar> down(Scalar(0), Scalar(0), Scalar(1));
  return detail::transposed_times(detail::rotation(camera),
                                  detail::transposed_times(detail::rotation(vehicle), down));
}

}  // namespace icat
