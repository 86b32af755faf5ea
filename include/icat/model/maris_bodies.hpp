// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Masses and hydrodynamics of the papers' bodies. Of [Coop, V-B]: a vehicle of 1 m³ and 300 kg
/// with Table II, the arm's links as cuboids, and the pipe of 3 m. Of [MARIS, II-A, VI-A]: the
/// vehicle R2 and a pipe of 1 m.
///
/// The links' cuboids lie along z of ⟨b⟩, at q = 0: links 1 and 2 end and start at the shoulder,
/// 2 + 3 span shoulder to elbow, 4 + 5 elbow to wrist, 6 wrist to end-effector, 7 beyond it. Link
/// 3, which carries the elbow's offset, lies half-way between both axes. Not given in the papers
/// and chosen here: weight is 1 % less than buoyancy, links and the pipe of 3 m have neither added
/// mass nor drag (Table II is of the vehicle), and a vehicle's centre of buoyancy is 5 cm above its
/// centre of mass. [MARIS] prints the size and mass of R2 and no hydrodynamics: they are Table II,
/// scaled from 1 m³ to its box as said at `r2_vehicle_body`.
#pragma once

#include <array>
#include <cmath>

#include "icat/model/maris.hpp"
#include "icat/model/rigid_body.hpp"

namespace icat {

/// Displaced mass over mass: slightly positive.
inline constexpr double maris_buoyancy = 1.01;

/// The vehicle, ⟨v⟩ at the centre of the hull.
template <class Scalar>
RigidBody<Scalar> maris_vehicle_body() {
  RigidBody<Scalar> body = cuboid<Scalar>(Scalar(300), Vector3<Scalar>::Ones());
  body.added_mass << Scalar(158.4), Scalar(137.1), Scalar(171.3), Scalar(15), Scalar(20),
      Scalar(20);
  body.linear_drag << Scalar(50), Scalar(50), Scalar(44), Scalar(20), Scalar(20), Scalar(24);
  body.quadratic_drag << Scalar(320), Scalar(320), Scalar(430), Scalar(40), Scalar(40), Scalar(31);
  body.displaced_mass = static_cast<Scalar>(maris_buoyancy) * body.mass;
  body.centre_of_buoyancy << Scalar(0), Scalar(0), Scalar(-0.05);
  return body;
}

/// The links, in ⟨b⟩.
template <class Scalar>
std::array<RigidBody<Scalar>, 7> maris_link_bodies() {
  const auto arm = maris_arm<Scalar>();
  const auto up = [](double z) {
    return Vector3<Scalar>(Scalar(0), Scalar(0), static_cast<Scalar>(z));
  };
  const Vector3<Scalar> shoulder = arm.joints[1].point, elbow = arm.joints[3].point,
                        wrist = arm.joints[5].point, end = arm.end_effector.translation();
  // Where one link ends and the next begins.
  const std::array<Vector3<Scalar>, 8> ends{
      shoulder - up(0.108), shoulder, shoulder + up(0.105), elbow, elbow + up(0.095), wrist, end,
      end + up(0.021)};
  const std::array<Scalar, 7> mass{8, 6, 4, 3, 3, 3, 2};
  const Scalar side = static_cast<Scalar>(0.1);
  std::array<RigidBody<Scalar>, 7> links;
  for (std::size_t i = 0; i < 7; ++i) {
    links[i] = cuboid<Scalar>(mass[i], {side, side, ends[i + 1].z() - ends[i].z()});
    links[i].displaced_mass = static_cast<Scalar>(maris_buoyancy) * mass[i];
    links[i].pose.translation() = (ends[i] + ends[i + 1]) / Scalar(2);
  }
  return links;
}

/// The pipe: 28 kg, 3 m along x of ⟨o⟩, of 0.1 m radius.
template <class Scalar>
RigidBody<Scalar> maris_pipe_body() {
  RigidBody<Scalar> body = tube<Scalar>(Scalar(28), static_cast<Scalar>(0.1), Scalar(3));
  body.displaced_mass = static_cast<Scalar>(maris_buoyancy) * body.mass;
  return body;
}

/// The vehicle R2 [MARIS, II-A], an open frame of 1.3 × 0.9 × 1.0 m, ⟨v⟩ at its centre; roll and
/// pitch, which it does not actuate, have a righting moment. Table II is of a vehicle of 1 m³ with
/// faces of 1 m²; of this box, with faces A and sides s,
///
///     along an axis   added mass ∝ A³ᐟ² of the face that the axis pierces, drag ∝ A
///     about an axis   added mass and drag ∝ s₁ s₂ s₃ (s² + s²)/2 of the two other sides, as
///     inertia
/// @param mass  kg; published are 350 to 500
template <class Scalar>
RigidBody<Scalar> r2_vehicle_body(Scalar mass = Scalar(400)) {
  const Vector3<Scalar> size(static_cast<Scalar>(1.3), static_cast<Scalar>(0.9), Scalar(1));
  RigidBody<Scalar> body = cuboid<Scalar>(mass, size);
  const RigidBody<Scalar> cube = maris_vehicle_body<Scalar>();
  for (Index i = 0; i < 3; ++i) {
    const Scalar a = size((i + 1) % 3), b = size((i + 2) % 3);
    const Scalar along = std::sqrt(a * b), about = size(i) * a * b * (a * a + b * b) / Scalar(2);
    body.added_mass(i) = along * a * b * cube.added_mass(i);
    body.linear_drag(i) = a * b * cube.linear_drag(i);
    body.quadratic_drag(i) = a * b * cube.quadratic_drag(i);
    body.added_mass(3 + i) = about * cube.added_mass(3 + i);
    body.linear_drag(3 + i) = about * cube.linear_drag(3 + i);
    body.quadratic_drag(3 + i) = about * cube.quadratic_drag(3 + i);
  }
  body.displaced_mass = static_cast<Scalar>(maris_buoyancy) * body.mass;
  body.centre_of_buoyancy = cube.centre_of_buoyancy;
  return body;
}

/// The links of R2's arm with its gripper, in ⟨b⟩: those of [Coop], and on the last one, 0.1 m
/// beyond the end-effector, 4.5 daN in air and 1 daN in water [MARIS, II-C]. Unlike those of [Coop]
/// they have added mass, ours: a long cylinder takes as much water along across its axis as it
/// displaces, and none along it.
template <class Scalar>
std::array<RigidBody<Scalar>, 7> r2_link_bodies() {
  std::array<RigidBody<Scalar>, 7> links = maris_link_bodies<Scalar>();
  const auto add_water = [](RigidBody<Scalar>& body, Scalar length) {
    const Scalar water = body.displaced_mass, about = water * length * length / Scalar(12);
    body.added_mass << water, water, Scalar(0), about, about, Scalar(0);
  };
  const auto length = [](const RigidBody<Scalar>& body) {  // of a cuboid, from its inertia
    return std::sqrt(Scalar(6) / body.mass *
                     (body.inertia(0, 0) + body.inertia(1, 1) - body.inertia(2, 2)));
  };
  for (std::size_t i = 0; i < 6; ++i) add_water(links[i], length(links[i]));
  // Link 7 and the gripper, a cuboid of 0.2 m, as one body at their common centre.
  const RigidBody<Scalar> palm = links[6];
  const Scalar side = static_cast<Scalar>(0.1), size = Scalar(2) * side;
  RigidBody<Scalar> hand = cuboid<Scalar>(static_cast<Scalar>(4.59), {side, side, size});
  hand.displaced_mass = static_cast<Scalar>(3.57);
  const Scalar apart = side + length(palm) / Scalar(2);  // centre to centre, along z of ⟨b⟩
  RigidBody<Scalar>& both = links[6];
  both.mass = palm.mass + hand.mass;
  both.displaced_mass = palm.displaced_mass + hand.displaced_mass;
  const Scalar centre = hand.mass / both.mass * apart;  // from the palm's
  const Scalar steiner = palm.mass * hand.mass / both.mass * apart * apart;
  both.inertia += hand.inertia;
  both.inertia(0, 0) += steiner;
  both.inertia(1, 1) += steiner;
  both.pose.translation().z() += centre;
  both.centre_of_buoyancy.z() = hand.displaced_mass / both.displaced_mass * apart - centre;
  add_water(both, size + length(palm));
  return links;
}

/// A pipe of the trials [MARIS, VI-A], along x of ⟨o⟩: 1 m, 5 cm radius, as published. Ours: PVC of
/// 3 mm, open at its ends, so that it sinks. Across its axis it takes the water in it along, and
/// as much again outside; a cylinder's drag coefficient is 1.1.
template <class Scalar>
RigidBody<Scalar> r2_pipe_body() {
  const auto number = [](double x) { return static_cast<Scalar>(x); };
  RigidBody<Scalar> body = tube<Scalar>(number(1.32), number(0.05), Scalar(1));
  body.displaced_mass = number(0.94);
  // π r² per metre, twice; about the ends m l²/12. Drag: 1.1 ρ/2 · 0.1 m; ∫ |x|³ dx = l⁴/32.
  body.added_mass << Scalar(0), number(15.7), number(15.7), Scalar(0), number(1.31), number(1.31);
  body.quadratic_drag << Scalar(0), Scalar(55), Scalar(55), Scalar(0), number(1.72), number(1.72);
  return body;
}

}  // namespace icat
