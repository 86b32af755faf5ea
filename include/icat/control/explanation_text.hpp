// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Explanations as text. On plain data, so that one body serves all robots.
#pragma once

#include <cmath>
#include <cstdio>
#include <string>
#include <string_view>

#include "icat/control/explanation.hpp"
#include "icat/core/status.hpp"

namespace icat::detail {

/// Why a command may be a part of the answer.
enum class Fading { starts, stops, recovers };

/// A column of ẏ as a person calls it.
struct ColumnWords {
  std::string name = {};                   ///< of the joint, or its place in the base
  bool ranged{false};                      ///< a joint with a range
  double position{0}, lower{0}, upper{0};  ///< then; rad or m
};

/// A text that grows.
class Words {
 public:
  Words& operator<<(std::string_view more) {
    text.append(more);
    return *this;
  }
  /// Three digits.
  Words& operator<<(double number) {
    char digits[32];
    const int count = std::snprintf(digits, sizeof digits, "%.3g", number);
    text.append(digits, static_cast<std::size_t>(count));
    return *this;
  }
  Words& operator<<(Index number) { return *this << static_cast<double>(number); }
  /// A part of 1 in per cent, whole.
  Words& percent(double part) {
    char digits[32];  // no exponent where a share is many times the loss
    const double whole = std::round(100 * part) + 0.0;
    const int count =
        std::snprintf(digits, sizeof digits, std::abs(whole) < 1e9 ? "%.0f" : "%.3g", whole);
    text.append(digits, static_cast<std::size_t>(count));
    return *this << " %";
  }
  Words& quoted(std::string_view name) { return *this << "'" << name << "'"; }

  std::string text;
};

/// " (0.52 m and 31° to go)"; nothing where nothing is left, or it is not known.
[[gnu::cold]] inline void append_left(Words& out, const TaskExplanation<double>& t) {
  const bool far = t.position_left > 1e-4, turned = t.angle_left > 1e-3;
  if (!far && !turned) return;
  out << " (";
  if (far) out << t.position_left << " m";
  if (far && turned) out << " and ";
  if (turned) out << t.angle_left * 57.29577951308232 << "°";
  out << " to go)";
}

/// "joint3 (at 1.97, range -2 to 2)".
[[gnu::cold]] inline void append_column(Words& out, const ColumnWords& column) {
  out << column.name;
  if (!column.ranged) return;
  out << " (at " << column.position << ", range " << column.lower << " to " << column.upper << ")";
}

/// Why a cycle was refused, or what is the matter with it.
[[gnu::cold]] inline void append_ramp(Words& out, Status status, Fading fading) {
  if (status != Status::ok) {
    out << "the controller stops, for this reason: " << describe(status);
  } else if (fading == Fading::stops) {
    out << "the controller was told to stop";
  } else if (fading == Fading::recovers) {
    out << "the command comes back after a fault";
  } else {
    out << "the command is fading in";
  }
}

/// Who takes most, as the end of a sentence.
[[gnu::cold]] inline void append_reason(Words& out, const TaskExplanation<double>& t,
                                        const LossShare<double>& share, const ColumnWords& column,
                                        Status status, Fading fading) {
  const bool named = share.column >= 0;
  switch (share.cause) {
    case LossCause::singular:
      out << "the robot cannot move that way in this posture; it is stretched or folded, or the "
             "goal is out of reach";
      return;
    case LossCause::regularization:
      out << "the robot can hardly move that way in this posture; it is nearly stretched or "
             "folded, or the goal is out of reach";
      return;
    case LossCause::activation:
      out << "it is near its threshold and acts in part";
      return;
    case LossCause::transition:
      out << "the action is changing; its phase activation is " << t.phase;
      return;
    case LossCause::given:
      out << (named ? column.name : "a joint") << " is not commanded, and the others cannot make "
          << "up for it";
      return;
    case LossCause::level:
    case LossCause::equal:
      out.quoted(share.task) << (share.cause == LossCause::level
                                     ? ", which has priority, "
                                     : ", which has the same priority, ");
      if (named && share.alone) {
        out << "decides how ";
        append_column(out, column);
        out << " moves";
      } else {
        out << "asks for another motion";
        if (named) out << ", most of all of " << column.name;
      }
      return;
    case LossCause::below:
      out << "tasks of less priority move it, as it acts in part or is near a singular posture";
      return;
    case LossCause::refused:
      out << "the input of ";
      out.quoted(share.task) << " is bad";
      if (share.row >= 0) out << " in row " << share.row;
      out << ", and the controller goes on without it and without all tasks of less priority";
      return;
    case LossCause::base:
      out << "the joints cannot make up for what the base does";
      if (named) out << ", most of all for " << column.name;
      return;
    case LossCause::bound:
    case LossCause::limit:
      if (!named) {
        out << "a limit of motion holds the command back";
        return;
      }
      if (share.limit == LimitKind::position) {
        append_column(out, column);
        out << " is near the end of its range";
      } else {
        out << column.name
            << (share.limit == LimitKind::acceleration ? " cannot speed up or brake faster"
                                                       : " is as fast as it may be");
      }
      return;
    case LossCause::held:
      if (status == Status::ok) {
        out << "the command is of an older cycle";
      } else {
        out << "the command is an old one, for this reason: " << describe(status);
      }
      return;
    case LossCause::ramp:
      return append_ramp(out, status, fading);
  }
}

/// A task in a sentence. `column`: of the largest share.
[[gnu::cold]] inline std::string sentence_of(const TaskExplanation<double>& t,
                                             const ColumnWords& column, Status status,
                                             Fading fading, std::string_view action) {
  Words out;
  out.quoted(t.task);
  const LossShare<double>* most = t.most();
  if (t.verdict == Verdict::off) {
    out << " is not part of the action ";
    out.quoted(action);
  } else if (t.verdict == Verdict::faulty && !most) {
    out << " has bad input, and nothing is done for it";
  } else if (t.verdict == Verdict::idle) {
    out << " has nothing to do";
    append_left(out, t);
  } else if (t.verdict == Verdict::met) {
    out << (t.fraction() > 0.995 || !(t.wanted > t.loss) ? " gets what it wants"
                                                         : " gets nearly what it wants");
    append_left(out, t);
  } else {
    if (!(t.wanted > 0.01 * t.loss)) {
      out << " asks for no motion, and moves all the same: ";
    } else {
      out << " gets ";
      out.percent(t.fraction()) << " of what it wants";
      append_left(out, t);
      out << ": ";
    }
    if (most) append_reason(out, t, *most, column, status, fading);
  }
  out << ".";
  if (t.half_turn) out << " It is half a turn away: both ways round are as long, one was chosen.";
  return out.text;
}

/// A share in a line of a list.
[[gnu::cold]] inline void append_share(Words& out, const LossShare<double>& share, double loss,
                                       const std::string& column) {
  out << "    " << share.amount << " (";
  out.percent(share.amount / loss) << ") " << describe(share.cause);
  if (!share.task.empty()) {
    out << " ";
    out.quoted(share.task);
    if (share.row >= 0) out << ", row " << share.row;
  }
  if (share.activation > 0) out << ", activation " << share.activation;
  constexpr const char* kinds[] = {"", "position of ", "velocity of ", "acceleration of "};
  if (share.column >= 0) out << ", " << kinds[static_cast<int>(share.limit)] << column;
  out << "\n";
}

}  // namespace icat::detail
