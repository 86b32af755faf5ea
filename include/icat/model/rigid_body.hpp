// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// One rigid body in still water: inertia, added mass, drag, weight and buoyancy.
///
/// With the twist V = [v; ω] of the body's frame (at its centre of mass, components on itself):
///
///     M V̇ + V ×* (M V) = w_weight + w_drag + w,     M = diag(m I, I_c) + diag(added mass)
///     V ×* [h; l] = [ω × h; ω × l + v × h]                          (Kirchhoff's equations)
///     w_drag  = −(d + D |V|) V, each component by itself
///     w_weight = [(m − m_d) g; −m_d c_b × g],       m_d the mass of the displaced water
#pragma once

#include <cmath>

#include "icat/core/error.hpp"
#include "icat/math/rigid_motion.hpp"

namespace icat {

/// What one body is made of. All but `pose` is in the body's own frame, whose origin is the centre
/// of mass. By default in vacuum.
template <class Scalar>
struct RigidBody {
  Scalar mass{1};                                  ///< kg, > 0
  Matrix3<Scalar> inertia = IdentityMatrix{};      ///< at the centre of mass, kg m²
  Vector6<Scalar> added_mass = Filled{0};          ///< kg, kg m²
  Vector6<Scalar> linear_drag = Filled{0};         ///< d: N s/m, N m s/rad
  Vector6<Scalar> quadratic_drag = Filled{0};      ///< D: N s²/m², N m s²/rad²
  Scalar displaced_mass{0};                        ///< m_d, kg; > mass: it floats
  Vector3<Scalar> centre_of_buoyancy = Filled{0};  ///< c_b, m
  /// The body's frame in the frame it is fixed to: ⟨v⟩ for a vehicle, ⟨o⟩ for an object, and for a
  /// link of an arm the arm's base ⟨b⟩ at q = 0.
  Pose<Scalar> pose = IdentityPose{};
};

/// Homogeneous cuboid; `size` (m) along x, y and z. In vacuum.
template <class Scalar>
RigidBody<Scalar> cuboid(Scalar mass, const Vector3<Scalar>& size) {
  const Vector3<Scalar> sq = size.cwiseAbs2();
  RigidBody<Scalar> body;
  body.mass = mass;
  body.inertia = (mass / Scalar(12) * Vector3<Scalar>(sq(1) + sq(2), sq(0) + sq(2), sq(0) + sq(1)))
                     .asDiagonal();
  return body;
}

/// Homogeneous thin tube along x; `radius` and `length` in m. In vacuum.
template <class Scalar>
RigidBody<Scalar> tube(Scalar mass, Scalar radius, Scalar length) {
  const Scalar along = mass * radius * radius;
  const Scalar across = along / Scalar(2) + mass * length * length / Scalar(12);
  RigidBody<Scalar> body;
  body.mass = mass;
  body.inertia = Vector3<Scalar>(along, across, across).asDiagonal();
  return body;
}

namespace detail {

/// A 6-vector in two halves: twist, acceleration, momentum or wrench.
template <class Scalar>
struct Spatial {
  Vector3<Scalar> linear, angular;

  static Spatial zero() noexcept { return {Vector3<Scalar>::Zero(), Vector3<Scalar>::Zero()}; }
  static Spatial of(const Vector6<Scalar>& v) noexcept {
    return {v.template head<3>(), v.template tail<3>()};
  }
  Vector6<Scalar> vector() const noexcept {
    Vector6<Scalar> v;
    v.template head<3>() = linear;
    v.template tail<3>() = angular;
    return v;
  }
  Spatial& operator+=(const Spatial& other) noexcept {
    linear += other.linear;
    angular += other.angular;
    return *this;
  }
  Scalar dot(const Spatial& other) const noexcept {
    return linear.dot(other.linear) + angular.dot(other.angular);
  }
};

/// V × S for a twist and a motion.
template <class Scalar>
Spatial<Scalar> cross_motion(const Spatial<Scalar>& V, const Spatial<Scalar>& S) noexcept {
  return {V.angular.cross(S.linear) + V.linear.cross(S.angular), V.angular.cross(S.angular)};
}

/// V ×* W for a twist and a momentum.
template <class Scalar>
Spatial<Scalar> cross_force(const Spatial<Scalar>& V, const Spatial<Scalar>& W) noexcept {
  return {V.angular.cross(W.linear), V.angular.cross(W.angular) + V.linear.cross(W.linear)};
}

/// Symmetric 6 × 6 [A Gᵀ; G I] that maps a twist at the common origin to the momentum there.
template <class Scalar>
struct SpatialInertia {
  Matrix3<Scalar> A, G, I;

  SpatialInertia& operator+=(const SpatialInertia& other) noexcept {
    A += other.A;
    G += other.G;
    I += other.I;
    return *this;
  }
  Spatial<Scalar> operator*(const Spatial<Scalar>& V) const noexcept {
    return {A * V.linear + G.transpose() * V.angular, G * V.linear + I * V.angular};
  }
  Matrix6<Scalar> matrix() const noexcept {
    Matrix6<Scalar> m;
    m.template topLeftCorner<3, 3>() = A;
    m.template topRightCorner<3, 3>() = G.transpose();
    m.template bottomLeftCorner<3, 3>() = G;
    m.template bottomRightCorner<3, 3>() = I;
    // Symmetric to the last digit.
    for (Index i = 0; i < 6; ++i) {
      for (Index j = 0; j < i; ++j) m(j, i) = m(i, j);
    }
    return m;
  }
};

/// A checked body, as the recursions need it: in the frame it is fixed to.
template <class Scalar>
class Body {
 public:
  /// `owner` and `name` are for the error's text.
  template <class Name>
  Body(const char* owner, const Name& name, const RigidBody<Scalar>& body)
      : mass_(body.mass),
        displaced_mass_(body.displaced_mass),
        linear_drag_(body.linear_drag),
        quadratic_drag_(body.quadratic_drag),
        rotation_(body.pose.linear()),
        centre_(body.pose.translation()) {
    if (!(body.mass > Scalar(0)) || !std::isfinite(body.mass)) {
      invalid(owner, ": mass of ", name, " must be finite and > 0, got ", body.mass);
    }
    if (!(body.displaced_mass >= Scalar(0)) || !std::isfinite(body.displaced_mass)) {
      invalid(owner, ": displaced_mass of ", name, " must be finite and >= 0, got ",
              body.displaced_mass);
    }
    // One below zero would feed energy into the body.
    const auto check = [&](const char* what, const Vector6<Scalar>& values) {
      for (Index i = 0; i < 6; ++i) {
        if (!(values(i) >= Scalar(0)) || !std::isfinite(values(i))) {
          invalid(owner, ": ", what, " ", i, " of ", name, " must be finite and >= 0, got ",
                  values(i));
        }
      }
    };
    check("added_mass", body.added_mass);
    check("linear_drag", body.linear_drag);
    check("quadratic_drag", body.quadratic_drag);
    const Matrix3<Scalar>& I = body.inertia;
    const bool symmetric = (I - I.transpose()).norm() <= Scalar(1e-4) * I.norm();
    // Sylvester's criterion.
    if (!I.allFinite() || !symmetric || !(I(0, 0) > Scalar(0)) ||
        !(I.template topLeftCorner<2, 2>().determinant() > Scalar(0)) ||
        !(I.determinant() > Scalar(0))) {
      invalid(owner, ": inertia of ", name, " must be symmetric and positive");
    }
    if (!body.centre_of_buoyancy.allFinite()) {
      invalid(owner, ": centre_of_buoyancy of ", name, " is not finite");
    }
    if (!is_rigid(body.pose)) {
      invalid(owner, ": pose of ", name, " is not finite or not a rotation");
    }
    const Matrix3<Scalar>& R = rotation_;
    A_ = R * Matrix3<Scalar>(body.added_mass.template head<3>().asDiagonal()) * R.transpose();
    A_.diagonal().array() += body.mass;
    isotropic_ = body.added_mass.template head<3>().isConstant(body.added_mass(0));
    C_ = (I + I.transpose()) / Scalar(2);
    C_.diagonal() += body.added_mass.template tail<3>();
    C_ = (R * C_ * R.transpose()).eval();
    buoyancy_arm_ = R * body.centre_of_buoyancy;
    has_drag_ = !body.linear_drag.isZero(Scalar(0)) || !body.quadratic_drag.isZero(Scalar(0));
  }

  /// Where the body is when the frame it is fixed to is at (R, t) of the common frame.
  struct Placed {
    Matrix3<Scalar> A, C;  // linear and angular inertia at the centre of mass
    Vector3<Scalar> p;     // centre of mass
    bool isotropic;        // A is a multiple of I
  };
  Placed place(const Matrix3<Scalar>& R, const Vector3<Scalar>& t) const noexcept {
    Placed at;
    at.isotropic = isotropic_;
    at.p = R * centre_ + t;
    if (isotropic_) {
      at.A = A_;
    } else {
      at.A = R * A_ * R.transpose();
    }
    at.C = R * C_ * R.transpose();
    return at;
  }
  /// In the frame it is fixed to.
  Placed place() const noexcept { return {A_, C_, centre_, isotropic_}; }

  /// At the common origin.
  static SpatialInertia<Scalar> inertia(const Placed& at) noexcept {
    SpatialInertia<Scalar> m;
    m.A = at.A;
    if (at.isotropic) {  // as links without added mass; a third of the work
      const Scalar a = at.A(0, 0);
      m.G = skew(Vector3<Scalar>(a * at.p));
      for (Index i = 0; i < 3; ++i) {
        const Index j = (i + 1) % 3, k = (i + 2) % 3;
        m.I(i, i) = at.C(i, i) + a * (at.p(j) * at.p(j) + at.p(k) * at.p(k));
        m.I(j, k) = m.I(k, j) = at.C(j, k) - a * at.p(j) * at.p(k);
      }
      return m;
    }
    for (Index i = 0; i < 3; ++i) m.G.col(i) = at.p.cross(at.A.col(i));
    for (Index i = 0; i < 3; ++i) m.I.col(i) = at.C.col(i) + at.p.cross(m.G.row(i).transpose());
    return m;
  }

  /// Wrench at the common origin that the acceleration `a` takes beyond what water and weight give;
  /// `R`: rotation of the frame it is fixed to, `g`: gravity (m/s²), all on the common frame.
  Spatial<Scalar> wrench(const Placed& at, const Matrix3<Scalar>& R, const Spatial<Scalar>& V,
                         const Spatial<Scalar>& a, const Vector3<Scalar>& g) const noexcept {
    const Vector3<Scalar> v = V.linear + V.angular.cross(at.p);
    Spatial<Scalar> momentum{at.A * v, at.C * V.angular};
    momentum.angular += at.p.cross(momentum.linear);
    Spatial<Scalar> w = cross_force(V, momentum);
    Vector3<Scalar> force =
        at.A * (a.linear + a.angular.cross(at.p)) - (mass_ - displaced_mass_) * g;
    w.angular += at.C * a.angular;
    if (displaced_mass_ > Scalar(0)) {
      w.angular += displaced_mass_ * (R * buoyancy_arm_).cross(g);
    }
    if (has_drag_) {
      const Matrix3<Scalar> body = R * rotation_;
      const Vector3<Scalar> vb = body.transpose() * v;
      const Vector3<Scalar> wb = body.transpose() * V.angular;
      const auto drag = [](const auto& d, const auto& D, const Vector3<Scalar>& u) {
        return Vector3<Scalar>(((d + D.cwiseProduct(u.cwiseAbs())).cwiseProduct(u)));
      };
      force += body * drag(linear_drag_.template head<3>(), quadratic_drag_.template head<3>(), vb);
      w.angular +=
          body * drag(linear_drag_.template tail<3>(), quadratic_drag_.template tail<3>(), wb);
    }
    w.linear += force;
    w.angular += at.p.cross(force);
    return w;
  }

  /// −(m − m_d) gᵀ p − m_d gᵀ c_b without the constant, J: as `wrench`.
  Scalar potential_energy(const Vector3<Scalar>& p, const Matrix3<Scalar>& R,
                          const Vector3<Scalar>& g) const noexcept {
    return -(mass_ - displaced_mass_) * g.dot(p) + displaced_mass_ * g.dot(R * buoyancy_arm_);
  }

 private:
  Scalar mass_, displaced_mass_;
  Vector6<Scalar> linear_drag_, quadratic_drag_;
  Matrix3<Scalar> rotation_;
  Vector3<Scalar> centre_;
  Matrix3<Scalar> A_, C_;
  Vector3<Scalar> buoyancy_arm_;
  bool isotropic_, has_drag_;
};

}  // namespace detail
}  // namespace icat
