// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// One agent's side of the exchange [Coop, IV-B]: its proposals, the received ones, the agreed
/// velocity, and the fallback without messages.
///
/// Messages belong to rounds, numbered by the caller: control cycles on a fast channel, pairs of
/// slots on a half-duplex one. The number is no part of the message; it follows from the schedule,
/// or from the modem's own header. A round in which all messages have arrived yields the agreed
/// velocity. Every agent fuses the same float32 numbers, its own included, in the same order, so
/// all results agree in every bit. A lost, late or doubled message affects only its own round.
///
/// The velocity is held until the next round; after `hold` seconds without one the agent falls
/// back. Between agreed and fallen back the velocity fades, in either direction. An agent cannot
/// know whether its own messages arrive: choose `hold` shorter than the time that the object can
/// wait.
///
/// **Rounds.** The last round this agent sent is its own round. Messages up to `ahead` rounds
/// ahead of it and less than `open_rounds` behind it count, others are refused. Its own count is
/// the caller's, who may set it back or move it on at any time. If no schedule gives the number,
/// `next_round` does: one more than the last, or a later one that another agent has begun. An agent
/// that is behind follows the one that is ahead, never the other way round, so both reach the same
/// round: an agent far behind follows after `open_rounds` messages of one sender that are out of
/// its range and count up, so a few wrong numbers have no effect.
///
/// **Latest.** On a half-duplex channel the agents send in turns, so their proposals of one round
/// belong to different instants [Coop, V-B]. With the option `latest` an agent does not wait for a
/// round to be complete: in every `update` it fuses its own present proposal with the last one it
/// heard of each of the others. The velocity has no delay, but the agents' velocities differ, and
/// the difference loads the object. It is held while each of the others is heard again within
/// `hold`.
///
/// **Pace** (beyond the paper, an option). If one agent does not follow the agreed velocity, the
/// grippers pull the object apart. Each agent sends with its proposal the fraction of it that it
/// can follow, 1 as long as it can, and
///
///     ẋ̂_t = f(ẋ_1, …, ẋ_N) min_i pace_i
///
/// If an agent could follow only a fraction c of ẋ̂_t, `achieved` makes its pace c times the agreed
/// one. Each later round that is followed in full raises the pace, in steps of 1 / `pace_steps`
/// that double up to `recovery`. With f and c steady, and d rounds until the others receive it, the
/// tools differ by (1 − c)‖ẋ̂_t‖ for d rounds, and later by d `recovery` ‖f‖ at most. It is off by
/// default because the pace takes bits of the numbers of the plain message (message.hpp): plain
/// messages would be misread.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "icat/cooperation/agreement_options.hpp"
#include "icat/cooperation/message.hpp"
#include "icat/math/smooth_step.hpp"

namespace icat {

/// See the file comment. Time is the caller's.
template <class Scalar>
class Agreement {
 public:
  /// Rounds that may be open at once: a message may come up to 7 rounds late. After a silence, a
  /// restart of either count, or wrong numbers, all agree again within `open_rounds` + 2 rounds in
  /// which messages arrive, plus the rounds they take there and back (at most 7 where `next_round`
  /// is used).
  static constexpr std::size_t open_rounds = detail::agreement_rounds;
  /// Rounds are numbers between −`largest_round` and this, without both.
  static constexpr long long largest_round = 1LL << 62;

  /// @throws std::invalid_argument on settings out of range. Allocates; nothing else here does.
  explicit Agreement(const AgreementOptions<Scalar>& options)
      : options_(detail::validated(options)),
        policy_(options.policy ? *options.policy : fusion::mean<Scalar>()),
        rounds_(open_rounds, Round(options)),
        latest_(options),
        latest_numbers_(options.agents, -largest_round),
        strays_(options.agents),
        intersection_(options.spans ? options.agents : 1),
        message_(message_size(static_cast<std::size_t>(numbers()))) {}

  /// As given at construction.
  const AgreementOptions<Scalar>& options() const noexcept { return options_; }

  /// This agent's proposal: ẋ_i, ẋ̄_t and, where spans are exchanged, T_i, components on ⟨t⟩. NaN,
  /// infinity, what float32 cannot hold, or what all the others would refuse as implausible:
  /// refused, and there is nothing to send until a better one comes.
  Status propose(const Vector6<Scalar>& velocity, const Vector6<Scalar>& desired,
                 const Matrix6<Scalar>& span = Matrix6<Scalar>::Identity()) noexcept {
    Said said;
    said.template head<6>() = velocity;
    if (policy_.difficulties) {
      said(6) = (desired - velocity).norm();
      // A distant goal is no fault: its difficulty is reduced to the limit.
      if (std::isfinite(said(6)) && said(6) > max_difficulty()) said(6) = max_difficulty();
    }
    if (options_.spans) {
      for (Index k = 0; k < 36; ++k) said(numbers() - 36 + k) = span.data()[k];
    }
    Status status = encode(said.head(numbers()), message_);
    if (status == Status::ok && !plausible(said)) status = Status::implausible;
    proposed_ = status == Status::ok;
    if (proposed_) {
      own_ = velocity;
      put(latest_, options_.index, said, message_);
    }
    return status;
  }

  /// The tool velocity `asked` for by step 3, and the tool `velocity` within the limits of this
  /// robot, both on ⟨t⟩. To be called once after each `update`; without it the pace stays. What was
  /// lost of the linear or the angular speed along `asked` makes the agent slow down all the
  /// others, see the file comment; less than 1e-5 m/s or rad/s, or 1e-4 of it, is rounding. NaN or
  /// infinity: refused, the pace stays.
  Status achieved(const Vector6<Scalar>& asked, const Vector6<Scalar>& velocity) noexcept {
    if (!asked.allFinite() || !velocity.allFinite()) return Status::non_finite;
    if (!agreed_ || !options_.pace) return Status::ok;
    double followed = 1;
    for (Index part = 0; part < 6; part += 3) {
      double square = 0, along = 0;
      for (Index i = part; i < part + 3; ++i) {
        square += static_cast<double>(asked(i)) * static_cast<double>(asked(i));
        along += static_cast<double>(asked(i)) * static_cast<double>(velocity(i));
      }
      const double lost = square - along, speed = std::sqrt(square);
      if (!(lost > speed * std::max(1e-5, 1e-4 * speed))) continue;
      followed = std::min(followed, std::max(along, 0.0) / square);
    }
    if (followed < 1) {
      pace_ = std::min(pace_, commanded_pace_ * followed);
      regain_ = 1.0 / pace_steps;
      may_regain_ = false;
    } else if (may_regain_) {
      pace_ = std::min(1.0, pace_ + std::min(regain_, options_.recovery));
      regain_ = std::min(2 * regain_, options_.recovery);
      may_regain_ = false;
    }
    return Status::ok;
  }

  /// There is nothing to send until the next proposal.
  void withdraw() noexcept { proposed_ = false; }
  /// The proposal as bytes, to be sent to all the others now, as this agent's part of `round`: 24,
  /// 4 more with difficulties, 144 more with spans. Valid until the next `propose` or `send`; empty
  /// where there is none. `round` is the agent's own from now on, also where nothing is sent; one
  /// before the last begins the count anew. A number that is no round: empty, nothing changes.
  std::span<const std::byte> send(long long round) noexcept {
    if (!is_round(round)) return {};
    move_to(round);
    if (!proposed_) return {};
    if (options_.pace) (void)encode_pace(pace_, message_);
    const std::span<const std::byte> bytes(message_);
    Said said;
    if (!options_.latest && decode_said(bytes, said) == Status::ok) {
      store(options_.index, round, said, bytes);
    }
    return bytes;
  }
  /// The number to give to `send` where it does not follow from a schedule: one more than the last,
  /// or that of a later round that the others have begun. All agents must take theirs from here,
  /// and the modem's header must carry it.
  long long next_round() const noexcept {
    const long long next = std::max(newest_, own_round_ + 1);
    return next < largest_round ? next : 0;
  }

  /// What agent `sender` sent as its part of `round`. Refused, with the status saying why, it
  /// counts as not heard: `unknown_agent`, `wrong_size`, `non_finite`, `implausible` or
  /// `round_out_of_range`. Of a round that was agreed on already it is ignored.
  Status receive(std::size_t sender, long long round, std::span<const std::byte> bytes) noexcept {
    if (sender >= options_.agents || sender == options_.index) return Status::unknown_agent;
    Said said;
    if (const Status status = decode_said(bytes, said); status != Status::ok) return status;
    if (!is_round(round)) return Status::round_out_of_range;
    const bool near = in_reach(round);
    if (near) {
      strays_[sender].count = 0;
      newest_ = std::max(newest_, round);
    } else {
      follow(strays_[sender], round);
      if (sent_) return Status::round_out_of_range;
    }
    // Before the first round of its own an agent knows no better than to put everything aside.
    store(sender, round, said, bytes);
    return Status::ok;
  }

  /// The tool velocity to command at `time`, components on ⟨t⟩. Always finite; a time that is not,
  /// or runs backwards, changes nothing.
  const Vector6<Scalar>& update(double time) noexcept {
    if (!std::isfinite(time) || time < last_time_) return velocity_;
    last_time_ = time;
    if (options_.latest) fuse_latest();
    if (fresh_) {
      agreed_until_ = time + options_.hold;
      commanded_pace_ = fused_pace_;
      may_regain_ = true;
      fresh_ = false;
    }
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

  /// Of the last `update`.
  const Vector6<Scalar>& velocity() const noexcept { return velocity_; }
  /// There is an agreement that is not too old; otherwise the agent falls back.
  bool agreed() const noexcept { return agreed_; }
  /// The fraction of the agreed velocity that this agent can follow, 0 … 1.
  double pace() const noexcept { return pace_; }
  /// The smallest that was said, the one in `velocity`, 0 … 1.
  double agreed_pace() const noexcept { return commanded_pace_; }

 private:
  using Said = Vector<Scalar, 43>;  // [ẋ_i; difficulty; T_i], of which what is exchanged
  struct Round {
    explicit Round(const AgreementOptions<Scalar>& o)
        : velocities(o.agents, Vector6<Scalar>::Zero()),
          spans(o.spans ? o.agents : 0, Matrix6<Scalar>::Identity()),
          difficulties(o.agents, Scalar(0)),
          paces(o.agents, 1),
          heard(o.agents, false) {}
    long long number{0};
    bool open{false};  // there is something of it
    std::vector<Vector6<Scalar>> velocities;
    std::vector<Matrix6<Scalar>> spans;
    std::vector<Scalar> difficulties;
    std::vector<double> paces;
    std::vector<bool> heard;
  };
  /// Rounds of one sender out of reach, one after the other.
  struct Stray {
    long long number{0};
    std::size_t count{0};
  };

  Index numbers() const noexcept {
    return 6 + (policy_.difficulties ? 1 : 0) + (options_.spans ? 36 : 0);
  }

  static bool is_round(long long number) noexcept {
    return -largest_round < number && number < largest_round;
  }
  bool in_reach(long long number) const noexcept {
    const long long ahead = number - own_round_;
    return ahead <= static_cast<long long>(options_.ahead) &&
           ahead > -static_cast<long long>(open_rounds);
  }
  /// A number out of reach. Doubled and overtaken ones do not count and spoil nothing.
  void follow(Stray& stray, long long number) noexcept {
    constexpr auto near = static_cast<long long>(open_rounds);
    // Both are rounds, so the difference is none that overflows.
    const long long on = number - stray.number;
    stray.number = number;
    if (stray.count > 0 && -near <= on && on <= 0) return;
    stray.count = stray.count > 0 && 0 < on && on <= near ? stray.count + 1 : 1;
    if (stray.count >= open_rounds) newest_ = std::max(newest_, number);
  }
  /// What is known of rounds that this agent has left is of no use any more.
  void move_to(long long number) noexcept {
    const bool anew = !sent_ || number < own_round_;
    if (sent_ && anew) {
      newest_ = number;
      for (Round& round : rounds_) round.open = false;
      std::fill(latest_numbers_.begin(), latest_numbers_.end(), -largest_round);
    }
    if (anew) fused_round_ = number - 1;
    own_round_ = number;
    sent_ = true;
    for (Round& round : rounds_) round.open = round.open && in_reach(round.number);
  }

  Scalar max_difficulty() const noexcept {
    return Scalar(2) * (options_.max_linear + options_.max_angular);
  }
  /// Sender and receivers judge by this alone; rounded numbers may be at the limit.
  bool plausible(const Vector6<Scalar>& velocity) const noexcept {
    for (Index part = 0; part < 6; part += 3) {
      Scalar square(0);
      for (Index i = part; i < part + 3; ++i) square += velocity(i) * velocity(i);
      const Scalar limit = part == 0 ? options_.max_linear : options_.max_angular;
      if (!(std::sqrt(square) <= Scalar(1 + 1e-6) * limit)) return false;
    }
    return true;
  }
  bool plausible(const Said& said) const noexcept {
    const Vector6<Scalar> velocity = said.template head<6>();
    if (!plausible(velocity)) return false;
    if (policy_.difficulties &&
        !(said(6) >= Scalar(0) && said(6) <= Scalar(1 + 1e-6) * max_difficulty())) {
      return false;
    }
    return !options_.spans || plausible_span(said.data() + numbers() - 36);
  }
  /// ‖2T − I‖₂ ≤ max_span: a Cholesky factorization of max_span² I − (2T − I)ᵀ(2T − I) exists.
  bool plausible_span(const Scalar* T) const noexcept {
    const Scalar limit = options_.max_span + Scalar(1e-5);
    Scalar D[6][6], L[6][6];
    for (int j = 0; j < 6; ++j) {
      for (int i = 0; i < 6; ++i) D[i][j] = Scalar(2) * T[6 * j + i] - Scalar(i == j);
    }
    for (int j = 0; j < 6; ++j) {
      for (int i = j; i < 6; ++i) {
        Scalar left = i == j ? limit * limit : Scalar(0);
        for (int k = 0; k < 6; ++k) left -= D[k][i] * D[k][j];
        for (int k = 0; k < j; ++k) left -= L[i][k] * L[j][k];
        if (i == j && !(left > Scalar(0))) return false;
        L[i][j] = i == j ? std::sqrt(left) : left / L[j][j];
      }
    }
    return true;
  }

  Status decode_said(std::span<const std::byte> bytes, Said& said) const noexcept {
    auto sent = said.head(numbers());
    if (const Status status = decode(bytes, sent); status != Status::ok) return status;
    return plausible(said) ? Status::ok : Status::implausible;
  }

  void store(std::size_t agent, long long number, const Said& said,
             std::span<const std::byte> bytes) noexcept {
    if (options_.latest) {
      if (number <= latest_numbers_[agent]) return;  // doubled or overtaken
      latest_numbers_[agent] = number;
      return put(latest_, agent, said, bytes);
    }
    if (sent_ && number <= fused_round_) return;
    Round& round = rounds_[static_cast<std::size_t>(number) % open_rounds];
    if (!round.open || number != round.number) {
      if (sent_ && round.open && number < round.number) return;
      round.number = number;
      round.open = true;
      std::fill(round.heard.begin(), round.heard.end(), false);
    }
    put(round, agent, said, bytes);
    if (all_heard(round)) {
      fused_round_ = round.number;
      fresh_ = fuse(round) || fresh_;
    }
  }
  /// One's own present proposal with the last ones of the others. There is news once each of them
  /// has been heard again.
  void fuse_latest() noexcept {
    const bool all = all_heard(latest_);
    if (!proposed_ || !(all || complete_)) return;
    if (options_.pace) latest_.paces[options_.index] = pace_;
    if (!fuse(latest_) || !all) return;
    complete_ = fresh_ = true;
    for (std::size_t i = 0; i < options_.agents; ++i) latest_.heard[i] = i == options_.index;
  }

  void put(Round& round, std::size_t agent, const Said& said,
           std::span<const std::byte> bytes) noexcept {
    round.velocities[agent] = said.template head<6>();
    if (policy_.difficulties) round.difficulties[agent] = said(6);
    if (options_.spans) {
      round.spans[agent] = Eigen::Map<const Matrix6<Scalar>>(said.data() + numbers() - 36);
    }
    if (options_.pace) round.paces[agent] = decode_pace(bytes);
    round.heard[agent] = true;
  }
  static bool all_heard(const Round& round) noexcept {
    return std::find(round.heard.begin(), round.heard.end(), false) == round.heard.end();
  }

  /// False: as if nothing had been heard.
  bool fuse(const Round& round) noexcept {
    const Proposals<Scalar> proposals{round.velocities, round.spans, round.difficulties};
    Vector6<Scalar> fused = policy_.fuse(proposals);
    if (options_.spans && plausible(fused)) {
      fused = intersection_.nearest(fused, proposals);
      if (intersection_.status() != Status::ok) return false;
    }
    if (!plausible(fused)) return false;
    fused_pace_ = *std::min_element(round.paces.begin(), round.paces.end());
    for (Index i = 0; i < 6; ++i) fused_(i) = static_cast<Scalar>(fused_pace_) * fused(i);
    return true;
  }

  AgreementOptions<Scalar> options_;
  FusionPolicy<Scalar> policy_;
  std::vector<Round> rounds_;
  Round latest_;                           // of each what it said last, where that is fused
  std::vector<long long> latest_numbers_;  // and in which round
  std::vector<Stray> strays_;
  SpanIntersection<Scalar> intersection_;
  std::vector<std::byte> message_;
  const Vector6<Scalar> zero_{Vector6<Scalar>::Zero()};
  Vector6<Scalar> own_{zero_}, fused_{zero_}, velocity_{zero_}, from_{zero_};
  // The last round that was agreed on, that of the last `send`, and the latest one to join.
  long long fused_round_{-1}, own_round_{-1}, newest_{-1};
  double agreed_until_{-infinity<double>}, begin_{-infinity<double>}, last_time_{-infinity<double>};
  double pace_{1}, fused_pace_{1}, commanded_pace_{1}, regain_{1};
  bool agreed_{false}, proposed_{false}, fresh_{false}, sent_{false}, may_regain_{false};
  bool complete_{false};  // latest_: each was heard once
};

}  // namespace icat
