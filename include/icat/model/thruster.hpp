// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A thruster and where it sits: what pushes a vehicle with f along `direction` at `position`,
/// wrench [f d; f (p × d)] at the origin of ⟨v⟩, components on ⟨v⟩.
#pragma once

#include "icat/core/types.hpp"

namespace icat {

/// Describes one thruster; name the fields. Limits of both directions, since most propellers push
/// better than they pull; one that cannot turn round has `minimum` 0.
template <class Scalar>
struct Thruster {
  Vector3<Scalar> position = Filled{0};  ///< of the propeller in ⟨v⟩, m
  Vector3<Scalar> direction = Filled{0};  ///< of positive thrust, components on ⟨v⟩, any length > 0
  Scalar minimum = 0;                     ///< largest thrust backwards, N, <= 0
  Scalar maximum = 0;                     ///< largest thrust forwards, N, >= 0
};

}  // namespace icat
