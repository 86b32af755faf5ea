// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Records a control loop in memory: named channels of numbers, one sample per cycle, and texts
/// with their times. All of it is reserved at configuration; recording allocates, locks and writes
/// nothing. Files are written afterwards: adapters/csv.hpp, adapters/mcap.hpp, adapters/replay.hpp;
/// a page that follows the loop is adapters/live.hpp.
///
/// A channel's name is a path, `velocity/elbow`: the part before the last `/` is its group, and a
/// group is drawn in one plot. controller_log.hpp adds the channels of a robot and its tasks.
#pragma once

#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <string_view>

#include "icat/core/error.hpp"
#include "icat/core/list.hpp"
#include "icat/math/rigid_motion.hpp"

namespace icat {

/// What the numbers of a channel are together.
enum class LogKind {
  number,  ///< one
  point,   ///< x, y, z in ⟨0⟩, m
  pose     ///< x, y, z in ⟨0⟩, m, then the unit quaternion x, y, z, w
};

/// A channel of a log, as `Log::add` gave it.
struct LogChannel {
  std::size_t index{static_cast<std::size_t>(-1)};  ///< in the order of `add`
};

/// What a text is about.
enum class LogTopic {
  event,       ///< something happened: a grasp, a refused input, a lost message
  phase,       ///< of the mission; holds until the next one
  explanation  ///< why the robot moves as it does; holds until the next one
};

/// Which samples are kept when the memory is full.
enum class LogFull {
  stop,   ///< the first ones: recording stops
  newest  ///< the last ones: each new sample takes the place of the oldest, texts that of older
          ///< ones
};

/// See the file comment. One thread.
class Log {
 public:
  /// Memory, with defaults.
  struct Options {
    std::size_t samples = 6000;        ///< a minute at 100 Hz
    LogFull full = LogFull::stop;      ///< what happens after them
    std::size_t texts = 2000;          ///< how many
    std::size_t characters = 1 << 17;  ///< of all texts together
  };
  /// A text of the log.
  struct Text {
    double time;            ///< s
    LogTopic topic;         ///< what it is about
    std::string_view text;  ///< in the log's memory, until the next text is recorded
  };

  /// With the defaults.
  Log() : Log(Options{}) {}
  /// Reserves the memory of times and texts.
  /// @throws std::invalid_argument on no samples.
  [[gnu::cold]] explicit Log(const Options& options)
      : full_(options.full),
        times_(options.samples),
        texts_(options.texts),
        characters_(options.characters) {
    if (options.samples == 0) detail::invalid("log: needs one sample at least");
  }

  /// Adds a channel and reserves its memory, 8 bytes for each number and sample. For configuration.
  /// `unit`: such as "rad/s"; empty: none.
  /// @throws std::invalid_argument on an empty name, one that stands twice, and after the first
  ///         sample.
  [[gnu::cold]] LogChannel add(std::string_view name, std::string_view unit = {},
                               LogKind kind = LogKind::number) {
    if (name.empty()) detail::invalid("log: a channel needs a name");
    if (size_ > 0 || lost_ > 0) {
      detail::invalid("log: channel '", name, "' comes after the first sample");
    }
    for (const Channel& c : channels_) {
      if (c.name == name) detail::invalid("log: channel '", name, "' stands twice");
    }
    Channel c;
    c.name.assign(name.data(), name.size());
    c.unit.assign(unit.data(), unit.size());
    c.kind = kind;
    c.values = List<double>(times_.size() * width(kind));
    channels_.push_back(std::move(c));
    return {channels_.size() - 1};
  }

  /// Opens the next sample, s; what is not set in it stays NaN. False, and nothing is recorded
  /// until the next call: the memory is full, or the time is not finite or not after the last one.
  /// No allocation.
  bool begin(double time) noexcept {
    open_ = false;
    if (!std::isfinite(time) || (size_ > 0 && !(time > times_[place(size_ - 1)]))) {
      ++refused_;
      return false;
    }
    if (size_ == times_.size()) {
      ++lost_;
      if (full_ == LogFull::stop) return false;
      first_ = first_ + 1 == times_.size() ? 0 : first_ + 1;
    } else {
      ++size_;
    }
    row_ = place(size_ - 1);
    times_[row_] = time;
    open_ = true;
    for (Channel& c : channels_) {
      const std::size_t n = width(c.kind);
      for (std::size_t i = 0; i < n; ++i) c.values[row_ * n + i] = nan;
    }
    return true;
  }
  /// The number of a channel of kind `number` in the open sample; without one, or of another kind:
  /// nothing. No allocation.
  void set(LogChannel channel, double value) noexcept { put(channel, LogKind::number, &value); }
  /// The same for a point.
  void set(LogChannel channel, double x, double y, double z) noexcept {
    const double values[] = {x, y, z};
    put(channel, LogKind::point, values);
  }
  /// The same for a pose.
  template <class Scalar>
  void set(LogChannel channel, const Pose<Scalar>& pose) noexcept {
    const auto& T = pose.matrix();
    Matrix3<double> R;
    for (Index j = 0; j < 3; ++j) {
      for (Index i = 0; i < 3; ++i) R(i, j) = static_cast<double>(T(i, j));
    }
    const auto q = detail::UnitQuaternion<double>::of(R);
    const double values[] = {static_cast<double>(T(0, 3)),
                             static_cast<double>(T(1, 3)),
                             static_cast<double>(T(2, 3)),
                             q.v(0),
                             q.v(1),
                             q.v(2),
                             q.w};
    put(channel, LogKind::pose, values);
  }

  /// A text at `time`, s. A phase or an explanation that is the same as the last one of its topic
  /// takes no memory. Where the memory of texts is full, it is lost, or with `LogFull::newest` the
  /// older half of the texts is, but for the phase and the explanation that hold since then. Lost,
  /// too, where the time is not finite. No allocation.
  void text(LogTopic topic, double time, std::string_view words) noexcept {
    if (topic != LogTopic::event) {
      for (std::size_t i = text_count_; i > 0; --i) {
        if (texts_[i - 1].topic != topic) continue;
        if (words_of(texts_[i - 1]) == words) return;
        break;
      }
    }
    if (!std::isfinite(time) || words.size() > characters_.size()) {
      ++texts_lost_;
      return;
    }
    while (text_count_ == texts_.size() || words.size() > characters_.size() - used_) {
      if (full_ == LogFull::stop || !drop_older_texts()) {
        ++texts_lost_;
        return;
      }
    }
    for (std::size_t i = 0; i < words.size(); ++i) characters_[used_ + i] = words[i];
    texts_[text_count_++] = {time, topic, used_, words.size()};
    used_ += words.size();
  }
  /// Something happened.
  void event(double time, std::string_view words) noexcept { text(LogTopic::event, time, words); }
  /// The mission is in this phase.
  void phase(double time, std::string_view words) noexcept { text(LogTopic::phase, time, words); }
  /// Why the robot moves as it does.
  void explain(double time, std::string_view words) noexcept {
    text(LogTopic::explanation, time, words);
  }
  /// Forgets samples and texts, keeps channels and memory. No allocation.
  void clear() noexcept {
    first_ = size_ = lost_ = refused_ = text_count_ = used_ = texts_lost_ = 0;
    open_ = false;
  }

  /// Samples that it has, the oldest first.
  std::size_t size() const noexcept { return size_; }
  /// Samples that were not kept: the memory was full, or a newer one replaced them.
  std::size_t lost() const noexcept { return lost_; }
  /// Samples that `begin` refused because of their time.
  std::size_t refused() const noexcept { return refused_; }
  /// Time of sample `i` < size(), s.
  double time(std::size_t i) const noexcept { return times_[place(i)]; }
  /// Texts that it has, in the order they came.
  std::size_t text_count() const noexcept { return text_count_; }
  /// Texts that were not kept: the memory was full, or newer ones replaced them.
  std::size_t texts_lost() const noexcept { return texts_lost_; }
  /// Text `i` < text_count().
  Text text(std::size_t i) const noexcept {
    return {texts_[i].time, texts_[i].topic, words_of(texts_[i])};
  }

  /// How many channels.
  std::size_t channel_count() const noexcept { return channels_.size(); }
  /// Of channel `c` < channel_count().
  const std::string& name(std::size_t c) const noexcept { return channels_[c].name; }
  /// Its unit; empty: none.
  const std::string& unit(std::size_t c) const noexcept { return channels_[c].unit; }
  /// What its numbers are.
  LogKind kind(std::size_t c) const noexcept { return channels_[c].kind; }
  /// How many there are, and they are contiguous.
  static constexpr std::size_t width(LogKind kind) noexcept {
    return kind == LogKind::number ? 1 : kind == LogKind::point ? 3 : 7;
  }
  /// Those of channel `c` in sample `i` < size(); NaN: not set.
  const double* values(std::size_t c, std::size_t i) const noexcept {
    return channels_[c].values.data() + place(i) * width(channels_[c].kind);
  }

 private:
  static constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  struct Channel {
    std::string name, unit;
    LogKind kind{LogKind::number};
    List<double> values;
  };
  struct Stored {
    double time{0};
    LogTopic topic{LogTopic::event};
    std::size_t first{0}, length{0};
  };

  std::size_t place(std::size_t i) const noexcept {
    const std::size_t k = first_ + i;
    return k < times_.size() ? k : k - times_.size();
  }
  std::string_view words_of(const Stored& t) const noexcept {
    return {characters_.data() + t.first, t.length};
  }
  // The older half, but for the last phase and explanation in it. False: there was none to drop.
  bool drop_older_texts() noexcept {
    const std::size_t count = text_count_, half = (count + 1) / 2;
    std::size_t phase = count, explanation = count;
    for (std::size_t i = 0; i < half; ++i) {
      if (texts_[i].topic == LogTopic::phase) phase = i;
      if (texts_[i].topic == LogTopic::explanation) explanation = i;
    }
    text_count_ = used_ = 0;
    for (std::size_t i = 0; i < count; ++i) {
      if (i < half && i != phase && i != explanation) continue;
      Stored kept = texts_[i];
      for (std::size_t c = 0; c < kept.length; ++c) {
        characters_[used_ + c] = characters_[kept.first + c];
      }
      kept.first = used_;
      used_ += kept.length;
      texts_[text_count_++] = kept;
    }
    texts_lost_ += count - text_count_;
    return text_count_ < count;
  }
  void put(LogChannel channel, LogKind kind, const double* values) noexcept {
    if (!open_ || channel.index >= channels_.size()) return;
    Channel& c = channels_[channel.index];
    if (c.kind != kind) return;
    const std::size_t n = width(kind);
    for (std::size_t i = 0; i < n; ++i) c.values[row_ * n + i] = values[i];
  }

  LogFull full_;
  List<double> times_;
  List<Channel> channels_;
  List<Stored> texts_;
  List<char> characters_;
  std::size_t first_{0}, size_{0}, row_{0}, lost_{0}, refused_{0};
  std::size_t text_count_{0}, used_{0}, texts_lost_{0};
  bool open_{false};
};

}  // namespace icat
