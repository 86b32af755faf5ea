// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// An iteration of Eq. (22) with memory of its own.
#pragma once

#include <type_traits>

#include "icat/tpik/priority_iteration.hpp"

namespace icat::detail {

/// With memory of its own, for `N` degrees of freedom. Construction of dynamic size allocates;
/// nothing else does.
template <class Scalar, int N, int Sides, class Regularization>
class StoredIteration : public PriorityIteration<Scalar, Regularization> {
  using Base = PriorityIteration<Scalar, Regularization>;

 public:
  using Square = Eigen::Matrix<Scalar, N, N>;

  [[gnu::cold]] StoredIteration(Index dof, const Regularization& regularization,
                                Scalar projection_weight)
      : Base(regularization, projection_weight), projector_(dof, dof) {
    require_strict_arithmetic<Scalar>();
    if constexpr (N == Eigen::Dynamic) memory_ = zeros<Memory>(size(dof));
    this->bind(dof, Sides, memory_.data());
    this->start().reset();
  }
  StoredIteration(const StoredIteration& other)
      : Base(other), memory_(other.memory_), projector_(other.projector_) {
    this->bind(other.dof(), Sides, memory_.data());
  }
  StoredIteration& operator=(const StoredIteration& other) {
    Base::operator=(other);
    memory_ = other.memory_;
    projector_ = other.projector_;
    this->bind(other.dof(), Sides, memory_.data());
    return *this;
  }

  /// Q, n × n: formed when asked for.
  [[gnu::cold]] const Square& projector_matrix() const noexcept {
    for (Index j = 0; j < this->dof(); ++j) {
      const Scalar* column = this->projector_column(j);
      copy(this->dof(), column, projector_.data() + j * this->dof());
    }
    return projector_;
  }

 private:
  static constexpr Index size(Index n) { return Base::columns(n, Sides) * padded<Scalar>(n); }
  struct Fixed {
    alignas(typename Simd<Scalar>::Packet) Scalar values[N == Eigen::Dynamic ? 1 : size(N)]{};
    Scalar* data() noexcept { return values; }
  };
  using Memory = std::conditional_t<N == Eigen::Dynamic, Vector<Scalar, Eigen::Dynamic>, Fixed>;

  Memory memory_;
  mutable Square projector_;
};

}  // namespace icat::detail
