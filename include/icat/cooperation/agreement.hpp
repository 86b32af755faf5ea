// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// One agent's side of the exchange [Coop, IV-B]: what it said, what it heard, what was agreed on,
/// and what to do when nothing is heard.
///
/// A round is complete, and a velocity agreed on, when this agent has sent and heard from all the
/// others since the last round. Both sides fuse the same float32 numbers, their own included, in
/// the same order, so they agree to the last bit. The velocity is held until the next round; after
/// `hold` seconds without one the agent falls back. Between agreed and fallen back the velocity
/// fades, in either direction.
#pragma once

#include <algorithm>
#include <limits>
#include <vector>

#include "icat/cooperation/fusion.hpp"
#include "icat/cooperation/message.hpp"
#include "icat/math/smooth_step.hpp"

namespace icat {

/// What an agent does that has heard nothing for too long.
enum class Fallback {
  stop,   ///< tool velocity 0
  alone,  ///< its own proposal, as if it were the only one
};

/// Settings of an exchange, with defaults. All agents need the same but `index`.
template <class Scalar>
struct AgreementOptions {
  std::size_t agents{2};                                ///< how many, this one included, ≥ 2
  std::size_t index{0};                                 ///< which of them this one is
  FusionPolicy<Scalar> policy{fusion::mean<Scalar>()};  ///< f of Eq. (29)
  bool spans{false};                                    ///< exchange them, see fusion.hpp
  Scalar hold{1};                                       ///< s, > 0
  Fallback fallback{Fallback::stop};                    ///< after that
  Scalar fade{1};                                       ///< s, > 0: into the fallback and back
};

/// See the file comment. Time is the caller's.
template <class Scalar>
class Agreement {
 public:
  /// @throws std::invalid_argument on settings out of range. Allocates; nothing else here does.
  explicit Agreement(const AgreementOptions<Scalar>& options)
      : options_(options),
        velocities_(options.agents, Vector6<Scalar>::Zero()),
        spans_(options.spans ? options.agents : 0, Matrix6<Scalar>::Identity()),
        heard_(options.agents, false),
        intersection_(options.spans ? options.agents : 1),
        message_(message_size(options.spans ? 42 : 6)) {
    if (options.agents < 2) detail::invalid("Agreement: agents must be >= 2, got ", options.agents);
    if (options.index >= options.agents) {
      detail::invalid("Agreement: index must be < ", options.agents, ", got ", options.index);
    }
    if (!options.policy) detail::invalid("Agreement: the policy is empty");
    detail::require_positive("Agreement", "hold", options.hold);
    detail::require_positive("Agreement", "fade", options.fade);
  }

  /// As given at construction.
  const AgreementOptions<Scalar>& options() const noexcept { return options_; }

  /// This agent's proposal: ẋ_i, ẋ̄_t and, where spans are exchanged, T_i. NaN, infinity or what
  /// float32 cannot hold: refused, the last proposal stays.
  Status propose(const Vector6<Scalar>& velocity, const Vector6<Scalar>& desired,
                 const Matrix6<Scalar>& span = Matrix6<Scalar>::Identity()) noexcept {
    Said said;
    said << velocity, span;
    if (const Status status = encode(said.leftCols(columns()), message_); status != Status::ok) {
      return status;
    }
    proposed_ = true;
    own_ = said.col(0);
    desired_ = desired;
    return Status::ok;
  }

  /// The proposal as 24 bytes (168 with spans), to be sent to all the others now. Valid until the
  /// next `propose`; empty before the first.
  std::span<const std::byte> send() noexcept {
    if (!proposed_) return {};
    const std::span<const std::byte> bytes(message_);
    (void)store(options_.index, bytes);
    return bytes;
  }

  /// A message of agent `sender`. Refused, with the status saying why, it counts as not heard.
  Status receive(std::size_t sender, std::span<const std::byte> bytes) noexcept {
    if (sender >= options_.agents || sender == options_.index) return Status::unknown_agent;
    return store(sender, bytes);
  }

  /// The tool velocity to command at `time`, components on ⟨t⟩. Always finite.
  const Vector6<Scalar>& update(Scalar time) noexcept {
    if (!std::isfinite(time)) return velocity_;
    if (fresh_) agreed_until_ = time + options_.hold;
    fresh_ = false;
    const bool agreed = time <= agreed_until_;
    if (agreed != agreed_) {
      agreed_ = agreed;
      from_ = velocity_;
      begin_ = time;
    }
    const Vector6<Scalar>& target = agreed_                                ? fused_
                                    : options_.fallback == Fallback::alone ? own_
                                                                           : zero_;
    const Scalar s = smooth_step((time - begin_) / options_.fade);
    const Vector6<Scalar> next = (Scalar(1) - s) * from_ + s * target;
    if (next.allFinite()) velocity_ = next;
    return velocity_;
  }

  /// Of the last `update`.
  const Vector6<Scalar>& velocity() const noexcept { return velocity_; }
  /// There is an agreement that is not too old; otherwise the agent falls back.
  bool agreed() const noexcept { return agreed_; }

 private:
  using Said = Eigen::Matrix<Scalar, 6, 7>;  // [ẋ_i T_i]

  Index columns() const noexcept { return options_.spans ? 7 : 1; }

  Status store(std::size_t agent, std::span<const std::byte> bytes) noexcept {
    Said said;
    auto sent = said.leftCols(columns());
    if (const Status status = decode(bytes, sent); status != Status::ok) return status;
    velocities_[agent] = said.col(0);
    if (options_.spans) spans_[agent] = said.template rightCols<6>();
    heard_[agent] = true;
    for (const bool heard : heard_) {
      if (!heard) return Status::ok;
    }
    std::fill(heard_.begin(), heard_.end(), false);
    fuse();
    return Status::ok;
  }

  void fuse() noexcept {
    const Proposals<Scalar> proposals{velocities_, spans_, desired_};
    Vector6<Scalar> fused = options_.policy(proposals);
    if (options_.spans && fused.allFinite()) fused = intersection_.nearest(fused, proposals);
    if (!fused.allFinite()) return;  // as if nothing had been heard
    fused_ = fused;
    fresh_ = true;
  }

  AgreementOptions<Scalar> options_;
  std::vector<Vector6<Scalar>> velocities_;
  std::vector<Matrix6<Scalar>> spans_;
  std::vector<bool> heard_;
  SpanIntersection<Scalar> intersection_;
  std::vector<std::byte> message_;
  const Vector6<Scalar> zero_{Vector6<Scalar>::Zero()};
  Vector6<Scalar> own_{zero_}, desired_{zero_}, fused_{zero_}, velocity_{zero_}, from_{zero_};
  Scalar agreed_until_{-std::numeric_limits<Scalar>::infinity()};
  Scalar begin_{-std::numeric_limits<Scalar>::infinity()};
  bool agreed_{false}, proposed_{false}, fresh_{false};
};

}  // namespace icat
