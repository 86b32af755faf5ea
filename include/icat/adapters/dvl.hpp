// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A Teledyne Doppler velocity log: `Pd0Decoder` and `Pd6Decoder` take its bytes, and what they
/// yield goes into a `VelocityEstimator` or `Navigation` through `dvl_measurement`.
#pragma once

#include "icat/adapters/dvl_sample.hpp"
#include "icat/adapters/pd0.hpp"
#include "icat/adapters/pd6.hpp"
#include "icat/navigation/dvl.hpp"

namespace icat {

/// The velocity over ground of `sample`, as the estimators want it. Without bottom track, or on the
/// earth's axes, no beam has found the ground: `correct_dvl` answers `not_measured`. Each beam of
/// `DvlGeometry` is the instrument's nearest to it; with beam 3 straight ahead they are 45° apart,
/// and the covariance of three beams is turned by so much.
template <class Scalar>
DvlMeasurement<Scalar> dvl_measurement(const DvlSample& sample) noexcept {
  DvlMeasurement<Scalar> m;
  m.beams = {false, false, false, false};
  if (!sample.bottom.valid || sample.frame != DvlFrame::vehicle) return m;
  for (std::size_t i = 0; i < 3; ++i) {
    m.velocity(static_cast<Index>(i)) = static_cast<Scalar>(sample.bottom.velocity[i]);
  }
  // Seen from above, clockwise from beam 3: 3, 2, 4, 1. Of `DvlGeometry`: 45°, 135°, 225°, 315°.
  constexpr std::array<std::size_t, 4> clockwise{2, 1, 3, 0};
  const double quarters = (sample.beam_3 - std::numbers::pi / 4) / (std::numbers::pi / 2);
  const int shift = std::isfinite(quarters) && std::abs(quarters) < 1e6
                        ? static_cast<int>(std::lround(quarters))
                        : 0;
  for (int i = 0; i < 4; ++i) {
    const int turned = ((i - shift) % 4 + 4) % 4;
    m.beams[static_cast<std::size_t>(i)] =
        sample.bottom.beams[clockwise[static_cast<std::size_t>(turned)]];
  }
  return m;
}

}  // namespace icat
