// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A thruster with its pose: it exerts a force f along `direction` d at `position` p, a wrench [f
/// d; f (p × d)] at the origin of ⟨v⟩, components on ⟨v⟩.
#pragma once

#include "icat/core/types.hpp"

namespace icat {

/// Describes one thruster; name the fields. There is a limit in each direction, since most
/// propellers have less thrust backwards than forwards; one that cannot reverse has `minimum` 0.
template <class Scalar>
struct Thruster {
  Vector3<Scalar> position = Filled{0};  ///< of the propeller in ⟨v⟩, m
  Vector3<Scalar> direction = Filled{0};  ///< of positive thrust, components on ⟨v⟩, any length > 0
  Scalar minimum = 0;                     ///< largest thrust backwards, N, <= 0
  Scalar maximum = 0;                     ///< largest thrust forwards, N, >= 0
};

}  // namespace icat
