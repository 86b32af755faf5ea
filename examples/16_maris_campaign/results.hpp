// SPDX-License-Identifier: BSD-3-Clause
// Results in a file that a run may go on with, parts that are joined, and what the table needs of
// statistics.
#pragma once

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "parameters.hpp"

namespace campaign {

/// Set and seed.
using Key = std::pair<int, int>;
using Results = std::map<Key, Result>;

/// The first line of a file.
inline std::string heading() {
  return "revision " + std::to_string(revision) +
         ",seed,outcome,time,position,angle,lag,shake,seen";
}
inline std::string line(const Key& key, const Result& r) {
  char text[256];
  std::snprintf(text, sizeof text, "%d,%d,%s,%.2f,%.6f,%.6f,%.6f,%.6f,%.6f", key.first, key.second,
                r.outcome.c_str(), r.time, r.position, r.angle, r.lag, r.shake, r.seen);
  return text;
}
inline bool parse(const std::string& text, Key& key, Result& r) {
  std::istringstream in(text);
  std::string field[9];
  for (auto& f : field) {
    if (!std::getline(in, f, ',')) return false;
  }
  try {
    key = {std::stoi(field[0]), std::stoi(field[1])};
    r.outcome = field[2];
    double* const number[] = {&r.time, &r.position, &r.angle, &r.lag, &r.shake, &r.seen};
    for (std::size_t i = 0; i < 6; ++i) *number[i] = std::stod(field[3 + i]);
  } catch (const std::exception&) {
    return false;
  }
  return key.first >= 0 && key.first < set_count && key.second > 0;
}

/// What a file holds; nothing of one of another revision. The last line of a run that was killed
/// may be cut off: without its end it does not count.
inline Results read(const std::string& file) {
  std::ifstream in(file);
  std::string text;
  Results results;
  if (!std::getline(in, text) || text != heading()) return results;
  while (std::getline(in, text) && !in.eof()) {
    Key key;
    Result r;
    if (parse(text, key, r)) results[key] = r;
  }
  return results;
}
/// A file with something in it that `read` takes for nothing.
inline bool foreign(const std::string& file) {
  std::ifstream in(file);
  std::string text;
  return std::getline(in, text) && text != heading();
}
/// All of it anew, in order.
inline bool write(const std::string& file, const Results& results) {
  {
    std::ofstream out(file + ".new");
    out << heading() << '\n';
    for (const auto& [key, r] : results) out << line(key, r) << '\n';
    if (!out.flush()) return false;
  }
  std::error_code error;
  std::filesystem::rename(file + ".new", file, error);
  return !error;
}
/// One more, at once in the file. For several threads.
class Journal {
 public:
  explicit Journal(const std::string& file) : out_(file, std::ios::app) {}
  /// False where the file did not take it, as of a full disk.
  bool add(const Key& key, const Result& r) {
    const std::lock_guard lock(mutex_);
    ++count_;
    return bool(out_ << line(key, r) + "\n" << std::flush);
  }
  int count() {
    const std::lock_guard lock(mutex_);
    return count_;
  }

 private:
  std::mutex mutex_;
  std::ofstream out_;
  int count_ = 0;
};

// --- parts ---------------------------------------------------------------------------------------

/// All of `text` as a number that is not below `least`.
inline std::optional<int> number(std::string_view text, int least) {
  int value = 0;
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);
  if (error != std::errc() || stop != end || value < least) return std::nullopt;
  return value;
}
/// Of "2/4".
struct Part {
  int index = 1, count = 1;
};
inline std::optional<Part> part(std::string_view text, std::string_view between = "/") {
  const auto at = text.find(between);
  if (at == std::string_view::npos) return std::nullopt;
  const auto index = number(text.substr(0, at), 1);
  const auto count = number(text.substr(at + between.size()), 1);
  if (!index || !count || *index > *count) return std::nullopt;
  return Part{*index, *count};
}
inline std::string part_file(const Part& p) {
  return "shard-" + std::to_string(p.index) + "-of-" + std::to_string(p.count) + ".csv";
}

/// What was joined, and each reason why it is not the whole.
struct Joined {
  Results results;
  std::vector<std::string> missing;
};
/// All parts in a folder, and what has been joined there before. Parts may overlap, such as those
/// of 2 and of 4; what is there twice has to be the same.
inline Joined join(const std::string& folder) {
  Joined all;
  std::map<int, std::set<int>> parts;
  std::vector<std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with("shard-") || !name.ends_with(".csv")) continue;
    const auto p = part(std::string_view(name).substr(6, name.size() - 10), "-of-");
    if (!p) continue;
    parts[p->count].insert(p->index);
    files.push_back(entry.path().string());
  }
  if (parts.empty()) all.missing.push_back("no part in " + folder);
  files.push_back(folder + "/attempts.csv");
  std::sort(files.begin(), files.end());
  for (const std::string& file : files) {
    if (foreign(file)) all.missing.push_back(file + " is of another revision");
    for (const auto& [key, r] : read(file)) {
      const auto [at, added] = all.results.emplace(key, r);
      if (!added && line(key, at->second) != line(key, r)) {
        all.missing.push_back("attempt " + std::to_string(key.second) + " of " +
                              sets[key.first].name + " ended in two ways: programs differ");
      }
    }
  }
  const auto whole = [](const auto& entry) {
    return static_cast<int>(entry.second.size()) == entry.first;
  };
  if (std::none_of(parts.begin(), parts.end(), whole)) {
    for (const auto& [count, there] : parts) {
      for (int i = 1; i <= count; ++i) {
        if (!there.contains(i)) all.missing.push_back("no part " + part_file({i, count}));
      }
    }
  }
  // A part that was stopped: of each set the same attempts, from 1 on.
  int most = 0;
  for (const auto& [key, r] : all.results) most = std::max(most, key.second);
  const int expected = most * set_count - static_cast<int>(all.results.size());
  if (expected > 0) all.missing.push_back(std::to_string(expected) + " attempts are not done");
  return all;
}

// --- statistics ----------------------------------------------------------------------------------

struct Count {
  int successes = 0, attempts = 0;
  double rate() const { return attempts > 0 ? double(successes) / attempts : 0; }
  int failures() const { return attempts - successes; }
};
struct Interval {
  double lower, upper;
};
/// 95 %, Wilson's.
inline Interval wilson(const Count& c) {
  if (c.attempts == 0) return {0, 1};
  const double n = c.attempts, p = c.rate(), z = 1.959964, d = 1 + z * z / n;
  const double middle = (p + z * z / (2 * n)) / d;
  const double half = z / d * std::sqrt(p * (1 - p) / n + z * z / (4 * n * n));
  return {std::max(middle - half, 0.0), std::min(middle + half, 1.0)};
}
/// Fisher's exact test, two-sided: the probability of tables no more likely than this one.
inline double fisher(const Count& a, const Count& b) {
  const int n = a.attempts + b.attempts, k = a.successes + b.successes;
  const auto choose = [](int m, int i) {
    return std::lgamma(m + 1) - std::lgamma(i + 1) - std::lgamma(m - i + 1);
  };
  const auto chance = [&](int i) {
    return std::exp(choose(a.attempts, i) + choose(b.attempts, k - i) - choose(n, k));
  };
  double sum = 0;
  for (int i = std::max(0, k - b.attempts); i <= std::min(k, a.attempts); ++i) {
    if (chance(i) <= chance(a.successes) * (1 + 1e-7)) sum += chance(i);
  }
  return std::min(sum, 1.0);
}

inline constexpr Count paper[3] = {{4, 16}, {4, 13}, {12, 17}};  // [MARIS, Table I]
inline constexpr const char* reasons[] = {"not found", "lost",   "not converged", "empty grasp",
                                          "slipped",   "bounds", "not held",      "fault"};

inline Count count(const Results& results, int set) {
  Count c;
  for (const auto& [key, r] : results) {
    if (key.first != set) continue;
    ++c.attempts;
    c.successes += r.outcome == "done";
  }
  return c;
}
inline int count(const Results& results, int set, const std::string& outcome) {
  return static_cast<int>(std::count_if(results.begin(), results.end(), [&](const auto& entry) {
    return entry.first.first == set && entry.second.outcome == outcome;
  }));
}
/// Of the attempts of a set that have one.
inline double median(const Results& results, int set, double Result::*value) {
  std::vector<double> values;
  for (const auto& [key, r] : results) {
    if (key.first == set && r.*value > 0) values.push_back(r.*value);
  }
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// What is asked of the rates, and whether it is so.
struct Claim {
  std::string text;
  bool holds;
};
inline std::vector<Claim> claims(const Results& results) {
  Count c[set_count];
  for (int i = 0; i < set_count; ++i) c[i] = count(results, i);
  const auto inside = [](double rate, const Count& of) {
    return rate >= wilson(of).lower && rate <= wilson(of).upper;
  };
  std::vector<Claim> all;
  for (int i = 0; i < 3; ++i) {
    all.push_back({std::string(sets[i].name) + ": rate in the interval of the paper's",
                   inside(c[i].rate(), paper[i])});
  }
  const double dec = c[1].rate(), apr = c[2].rate();
  all.push_back({"October < December < April", c[0].rate() < dec && dec < apr});
  all.push_back({"April is 1.5 to 3 times December", apr >= 1.5 * dec && apr <= 3 * dec});
  all.push_back({"without compensation April falls into the interval of December",
                 inside(c[3].rate(), paper[1])});
  all.push_back({"without filter April falls by more than 15 points", apr - c[4].rate() > 0.15});
  all.push_back({"without DVL April is as December (Fisher p > 0.05)", fisher(c[5], c[1]) > 0.05});
  return all;
}

inline std::string table(const Results& results) {
  std::string text;
  char buffer[256];
  const auto print = [&](const char* format, auto... values) {
    std::snprintf(buffer, sizeof buffer, format, values...);
    text += buffer;
  };
  const auto put = [&](const Count& c) {
    const Interval i = wilson(c);
    print("  %4d of %4d %6.1f %%  %5.1f ... %5.1f", c.successes, c.attempts, 100 * c.rate(),
          100 * i.lower, 100 * i.upper);
  };
  print("%-28s%s%33s\n", "grasps, 95 % by Wilson", "  [MARIS, Table I]", "here");
  for (int i = 0; i < set_count; ++i) {
    print("%-28s", sets[i].name);
    if (i < 3) {
      put(paper[i]);
    } else {
      print("%38s", "");
    }
    put(count(results, i));
    text += '\n';
  }
  const Count oct = count(results, 0), dec = count(results, 1), apr = count(results, 2);
  const auto both = [](const Count& a, const Count& b) {
    return Count{a.successes + b.successes, a.attempts + b.attempts};
  };
  print("Fisher, two-sided: December or April  p = %.3f in the paper, %.2g here\n",
        fisher(paper[1], paper[2]), fisher(dec, apr));
  print("            both of 2015 or April  p = %.3f in the paper, %.2g here\n\nwhy not%21s",
        fisher(both(paper[0], paper[1]), paper[2]), fisher(both(oct, dec), apr), "");
  for (const char* reason : reasons) print("%14s", reason);
  text += '\n';
  for (int i = 0; i < set_count; ++i) {
    print("%-28s", sets[i].name);
    for (const char* reason : reasons) print("%14d", count(results, i, reason));
    text += '\n';
  }
  print("\n%-28s%10s%10s%12s%12s%8s\n", "medians", "off, mm", "off, deg", "lag, mm/s",
        "joints, 1/s", "seen");
  for (int i = 0; i < set_count; ++i) {
    const auto middle = [&](double Result::*value) { return median(results, i, value); };
    print("%-28s%10.1f%10.2f%12.1f%12.3f%6.0f %%\n", sets[i].name, 1e3 * middle(&Result::position),
          57.29578 * middle(&Result::angle), 1e3 * middle(&Result::lag), middle(&Result::shake),
          100 * middle(&Result::seen));
  }
  text += '\n';
  for (const Claim& claim : claims(results)) {
    print("%s  %s\n", claim.holds ? "holds        " : "does NOT hold", claim.text.c_str());
  }
  return text;
}

}  // namespace campaign
