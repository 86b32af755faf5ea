// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// One agent's side of the exchange [Coop, IV-B]: what it said, what it heard, what was agreed on,
/// and what to do when nothing is heard.
///
/// Messages belong to rounds, numbered by the caller: control cycles on a fast channel, pairs of
/// slots on a half-duplex one. The number is no part of the message; it follows from the schedule,
/// or from the modem's own header. A round in which all were heard yields the velocity agreed on.
/// Every agent fuses the same float32 numbers, its own included, in the same order, so all come to
/// the same bits. A message that is lost, late or doubled spoils its own round only.
///
/// The velocity is held until the next round; after `hold` seconds without one the agent falls
/// back. Between agreed and fallen back the velocity fades, in either direction. An agent cannot
/// know that the others do not hear it: choose a `hold` after which the object may be in danger.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>
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
  std::size_t agents{2};  ///< how many, this one included, 2 … 1000
  std::size_t index{0};   ///< which of them this one is
  std::optional<FusionPolicy<Scalar>> policy = std::nullopt;  ///< f of Eq. (29); none: the mean
  bool spans{false};                                          ///< exchange them, see fusion.hpp
  double hold{1};                                             ///< s, > 0
  Fallback fallback{Fallback::stop};                          ///< after that
  double fade{1};  ///< s, > 0: into the fallback and back
};

/// See the file comment. Time is the caller's.
template <class Scalar>
class Agreement {
 public:
  /// Rounds that may be open at once: a message may come so many rounds late.
  static constexpr std::size_t open_rounds = 8;

  /// @throws std::invalid_argument on settings out of range. Allocates; nothing else here does.
  explicit Agreement(const AgreementOptions<Scalar>& options)
      : options_(validated(options)),
        policy_(options.policy ? *options.policy : fusion::mean<Scalar>()),
        rounds_(open_rounds, Round(options)),
        intersection_(options.spans ? options.agents : 1),
        message_(message_size(static_cast<std::size_t>(numbers()))) {}

  /// As given at construction.
  const AgreementOptions<Scalar>& options() const noexcept { return options_; }

  /// This agent's proposal: ẋ_i, ẋ̄_t and, where spans are exchanged, T_i. NaN, infinity or what
  /// float32 cannot hold: refused, and there is nothing to send until a better one comes.
  Status propose(const Vector6<Scalar>& velocity, const Vector6<Scalar>& desired,
                 const Matrix6<Scalar>& span = Matrix6<Scalar>::Identity()) noexcept {
    Said said;
    said.template head<6>() = velocity;
    if (policy_.difficulties) said(6) = (desired - velocity).norm();
    if (options_.spans) {
      said.segment(numbers() - 36, 36) = Eigen::Map<const Vector<Scalar, 36>>(span.data());
    }
    const Status status = encode(said.head(numbers()), message_);
    proposed_ = status == Status::ok;
    if (proposed_) own_ = velocity;
    return status;
  }

  /// There is nothing to send until the next proposal.
  void withdraw() noexcept { proposed_ = false; }
  /// The proposal as bytes, to be sent to all the others now, as this agent's part of `round`: 24,
  /// 4 more with difficulties, 144 more with spans. Valid until the next `propose`; empty where
  /// there is none.
  std::span<const std::byte> send(long long round) noexcept {
    if (!proposed_) return {};
    const std::span<const std::byte> bytes(message_);
    (void)store(options_.index, round, bytes);
    return bytes;
  }

  /// What agent `sender` sent as its part of `round`. Refused, with the status saying why, it
  /// counts as not heard. Of a round that is long gone it is ignored.
  Status receive(std::size_t sender, long long round, std::span<const std::byte> bytes) noexcept {
    if (sender >= options_.agents || sender == options_.index) return Status::unknown_agent;
    return store(sender, round, bytes);
  }

  /// The tool velocity to command at `time`, components on ⟨t⟩. Always finite; a time that is not,
  /// or runs backwards, changes nothing.
  const Vector6<Scalar>& update(double time) noexcept {
    if (!std::isfinite(time) || time < last_time_) return velocity_;
    last_time_ = time;
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
    const Scalar s = static_cast<Scalar>(smooth_step((time - begin_) / options_.fade));
    const Vector6<Scalar> next = (Scalar(1) - s) * from_ + s * target;
    if (next.allFinite()) velocity_ = next;
    return velocity_;
  }

  /// The caller's clock was set back to `time`, finite: what was agreed on counts as too old.
  void restart(double time) noexcept {
    agreed_until_ = -infinity<double>;
    agreed_ = false;
    from_ = velocity_;
    begin_ = last_time_ = time;
  }

  /// Of the last `update`.
  const Vector6<Scalar>& velocity() const noexcept { return velocity_; }
  /// There is an agreement that is not too old; otherwise the agent falls back.
  bool agreed() const noexcept { return agreed_; }

 private:
  using Said = Vector<Scalar, 43>;  // [ẋ_i; difficulty; T_i], of which what is exchanged
  struct Round {
    explicit Round(const AgreementOptions<Scalar>& o)
        : velocities(o.agents, Vector6<Scalar>::Zero()),
          spans(o.spans ? o.agents : 0, Matrix6<Scalar>::Identity()),
          difficulties(o.agents, Scalar(0)),
          heard(o.agents, false) {}
    long long number{-1};
    std::vector<Vector6<Scalar>> velocities;
    std::vector<Matrix6<Scalar>> spans;
    std::vector<Scalar> difficulties;
    std::vector<bool> heard;
  };

  static const AgreementOptions<Scalar>& validated(const AgreementOptions<Scalar>& o) {
    if (o.agents < 2 || o.agents > 1000) {
      detail::invalid("Agreement: agents must be in [2, 1000], got ", o.agents);
    }
    if (o.index >= o.agents) {
      detail::invalid("Agreement: index must be < ", o.agents, ", got ", o.index);
    }
    if (o.policy && !o.policy->fuse) detail::invalid("Agreement: the policy is empty");
    if (o.policy && o.policy->agents != 0 && o.policy->agents != o.agents) {
      detail::invalid("Agreement: a policy for ", o.policy->agents, " agents, there are ",
                      o.agents);
    }
    detail::require_positive("Agreement", "hold", o.hold);
    detail::require_positive("Agreement", "fade", o.fade);
    return o;
  }

  Index numbers() const noexcept {
    return 6 + (policy_.difficulties ? 1 : 0) + (options_.spans ? 36 : 0);
  }

  Status store(std::size_t agent, long long number, std::span<const std::byte> bytes) noexcept {
    Said said;
    auto sent = said.head(numbers());
    if (const Status status = decode(bytes, sent); status != Status::ok) return status;
    if (number <= fused_round_) return Status::ok;
    Round& round = rounds_[static_cast<std::size_t>(number) % open_rounds];
    if (number < round.number) return Status::ok;
    if (number > round.number) {
      round.number = number;
      std::fill(round.heard.begin(), round.heard.end(), false);
    }
    round.velocities[agent] = said.template head<6>();
    if (policy_.difficulties) round.difficulties[agent] = said(6);
    if (options_.spans) {
      round.spans[agent] = Eigen::Map<const Matrix6<Scalar>>(said.data() + numbers() - 36);
    }
    round.heard[agent] = true;
    if (std::find(round.heard.begin(), round.heard.end(), false) == round.heard.end()) fuse(round);
    return Status::ok;
  }

  void fuse(const Round& round) noexcept {
    fused_round_ = round.number;
    const Proposals<Scalar> proposals{round.velocities, round.spans, round.difficulties};
    Vector6<Scalar> fused = policy_.fuse(proposals);
    if (options_.spans && fused.allFinite()) fused = intersection_.nearest(fused, proposals);
    if (!fused.allFinite()) return;  // as if nothing had been heard
    fused_ = fused;
    fresh_ = true;
  }

  AgreementOptions<Scalar> options_;
  FusionPolicy<Scalar> policy_;
  std::vector<Round> rounds_;
  SpanIntersection<Scalar> intersection_;
  std::vector<std::byte> message_;
  const Vector6<Scalar> zero_{Vector6<Scalar>::Zero()};
  Vector6<Scalar> own_{zero_}, fused_{zero_}, velocity_{zero_}, from_{zero_};
  long long fused_round_{-1};
  double agreed_until_{-infinity<double>}, begin_{-infinity<double>}, last_time_{-infinity<double>};
  bool agreed_{false}, proposed_{false}, fresh_{false};
};

}  // namespace icat
