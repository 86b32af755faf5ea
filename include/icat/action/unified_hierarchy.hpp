// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// One priority list from which every action's own can be extracted by switching entries off
/// [Coop, III-B].
///
/// Each action's k-th level must lie, whole, on one level of the unified list, and these in the
/// action's order. Shortest means: fewest entries, and among those lists fewest levels, and among
/// those the smallest upper levels. With P1: A ≺ B,C,D and P2: A ≺ D ≺ C,E that is the paper's
/// A ≺ D ≺ B,C,D,E. Where two actions order the same tasks differently, a task stands twice.
#pragma once

#include <algorithm>
#include <cstddef>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "icat/action/action.hpp"

namespace icat {

/// One task on one unified level, and which actions it is part of there.
template <Robot R>
struct HierarchyEntry {
  /// Never null.
  Task<R>* task;
  std::vector<bool> in_action;  ///< one for each action
};

/// Levels of entries, the highest priority first.
template <Robot R>
using UnifiedHierarchy = std::vector<std::vector<HierarchyEntry<R>>>;

namespace detail {

/// An action, its tasks as numbers.
struct NumberedAction {
  using Level = std::vector<std::size_t>;  // ascending
  std::string name;
  std::vector<Level> levels;
};

/// An exact search (A*) over how many levels of each action are placed already, from the lowest
/// level of the list up. In that direction only conflicts leave a choice: any other task lies as
/// low as it can, because a shortest list has the smallest upper levels.
class HierarchySearch {
 public:
  [[gnu::cold]] HierarchySearch(std::vector<NumberedAction> actions, std::size_t tasks)
      : all_(std::move(actions)), actions_(all_), found_(tasks) {
    // A list that holds an action holds those within it too.
    for (std::size_t a = actions_.size(); a-- > 0;) {
      const auto holds = [&](const NumberedAction& b) {
        return &b != &actions_[a] && is_within(actions_[a], b);
      };
      if (std::any_of(actions_.begin(), actions_.end(), holds)) {
        actions_.erase(actions_.begin() + static_cast<std::ptrdiff_t>(a));
      }
    }
    for (std::size_t a = 0; a < actions_.size(); ++a) {
      auto& levels = actions_[a].levels;
      std::reverse(levels.begin(), levels.end());
      for (std::size_t k = 0; k < levels.size(); ++k) {
        for (const std::size_t task : levels[k]) found_[task].push_back({a, k});
      }
    }
  }

  /// For each unified level, the highest first, which actions place their next level there.
  [[gnu::cold]] std::vector<std::string> solve() const {
    std::vector<State> moves;
    std::vector<std::size_t> placed(all_.size(), 0);
    for (const Level& level : shortest()) {
      State& move = moves.emplace_back();
      move.assign(all_.size(), 0);
      for (std::size_t a = 0; a < all_.size(); ++a) {
        if (!fits(all_[a], placed[a], level)) continue;
        move[a] = 1;
        ++placed[a];
      }
    }
    return moves;
  }

  /// Puts what `level` lacks of `tasks` in its place.
  static void merge(const NumberedAction::Level& tasks, NumberedAction::Level& level) {
    for (const std::size_t task : tasks) {
      const auto at = std::lower_bound(level.begin(), level.end(), task);
      if (at == level.end() || *at != task) level.insert(at, task);
    }
  }

 private:
  using Level = NumberedAction::Level;
  using Counts = std::vector<std::size_t>;
  /// How many levels of each action are placed.
  using State = std::string;  // which compilers have at hand
  /// A level of a list; its parent is the level below. Cost and bound are (entries, levels).
  struct Node {
    std::size_t entries_bound{0}, levels_bound{0}, entries{0}, levels{0}, parent{0};
    Level level;
    State placed;
  };
  /// The tasks still to come, divided into strongly connected components: the tasks of a part share
  /// levels, or come both before and after each other, and then one of them must stand twice.
  struct Parts {
    Counts part_of;  ///< of each task; none if it is placed
    State waits;     ///< Is a level of the part not the next of its action?
    State conflicts;
    Counts visit, stack;  ///< of Tarjan's algorithm
    std::size_t visits{0};
  };
  static constexpr std::size_t none = static_cast<std::size_t>(-1);

  static std::size_t count(const State& placed, std::size_t a) {
    return static_cast<unsigned char>(placed[a]);
  }
  /// Does the k-th level of `a` exist and lie in `level`?
  static bool fits(const NumberedAction& a, std::size_t k, const Level& level) {
    return k < a.levels.size() &&
           std::includes(level.begin(), level.end(), a.levels[k].begin(), a.levels[k].end());
  }
  static bool is_within(const NumberedAction& a, const NumberedAction& b) {
    std::size_t k = 0;
    for (const Level& level : b.levels) k += fits(a, k, level) ? 1 : 0;
    return k == a.levels.size();
  }

  [[gnu::cold]] std::vector<Level> shortest() const {
    std::vector<Node> nodes(1);  // They stay, as parents.
    std::vector<std::size_t> open{0};
    std::set<State> closed;
    nodes[0].placed.assign(actions_.size(), 0);
    const auto worse = [&](std::size_t i, std::size_t j) { return is_worse(nodes, i, j); };
    while (true) {
      std::pop_heap(open.begin(), open.end(), worse);
      std::size_t last = open.back();
      open.pop_back();
      if (!closed.insert(nodes[last].placed).second) continue;
      const State placed = nodes[last].placed;
      const Parts parts = divide(placed);
      if (parts.visits == 0) {
        std::vector<Level> list;
        for (; last != 0; last = nodes[last].parent) list.push_back(nodes[last].level);
        return list;
      }
      Level free;
      std::vector<Level> choices;
      for (std::size_t a = 0; a < actions_.size(); ++a) {
        if (count(placed, a) == actions_[a].levels.size()) continue;
        const Level& level = actions_[a].levels[count(placed, a)];
        const std::size_t part = parts.part_of[*level.begin()];
        if (parts.conflicts[part] &&
            std::find(choices.begin(), choices.end(), level) == choices.end()) {
          choices.push_back(level);
        }
        if (!parts.waits[part]) merge(level, free);
      }
      constexpr std::size_t most = 100'000, most_choices = 16;
      if (nodes.size() > most || choices.size() > most_choices) give_up();
      // Every subset of the choices may lie here, with all levels that cost no more entries.
      for (std::size_t subset = 0; (subset >> choices.size()) == 0; ++subset) {
        Level level = free;
        for (std::size_t bit = 0; bit < choices.size(); ++bit) {
          if ((subset >> bit) & 1) merge(choices[bit], level);
        }
        State next = placed;
        for (std::size_t a = 0; a < actions_.size(); ++a) {
          if (fits(actions_[a], count(placed, a), level)) ++next[a];
        }
        if (closed.count(next) != 0) continue;  // The empty subset may place nothing.
        open.push_back(nodes.size());
        nodes.push_back(on_top_of(nodes[last], last, std::move(level), std::move(next)));
        std::push_heap(open.begin(), open.end(), worse);
      }
    }
  }

  /// Of the same bound, the lists of fewer levels are grown first: then all lists that reach a
  /// state are known when the best of them, the one with the smallest upper levels, is taken.
  static bool is_worse(const std::vector<Node>& nodes, std::size_t i, std::size_t j) {
    const Node &a = nodes[i], &b = nodes[j];
    if (a.entries_bound != b.entries_bound) return a.entries_bound > b.entries_bound;
    if (a.levels_bound != b.levels_bound) return a.levels_bound > b.levels_bound;
    if (a.levels != b.levels) return a.levels > b.levels;
    for (std::size_t k = i, l = j; k != l; k = nodes[k].parent, l = nodes[l].parent) {
      const std::size_t m = nodes[k].level.size(), n = nodes[l].level.size();
      if (m != n) return m > n;
    }
    return i > j;
  }

  /// Every task still to come needs an entry, every part with a conflict one more, and the longest
  /// rest its levels.
  Node on_top_of(const Node& below, std::size_t parent, Level level, State placed) const {
    const Parts parts = divide(placed);
    const auto conflicts = std::count(parts.conflicts.begin(), parts.conflicts.end(), '\1');
    std::size_t longest = 0;
    for (std::size_t a = 0; a < actions_.size(); ++a) {
      longest = std::max(longest, actions_[a].levels.size() - count(placed, a));
    }
    Node node;
    node.entries = below.entries + level.size();
    node.levels = below.levels + 1;
    node.entries_bound = node.entries + parts.visits + static_cast<std::size_t>(conflicts);
    node.levels_bound = node.levels + longest;
    node.parent = parent;
    node.level = std::move(level);
    node.placed = std::move(placed);
    return node;
  }

  Parts divide(const State& placed) const {
    Parts parts;
    parts.part_of.assign(found_.size(), none);
    parts.visit = parts.part_of;
    for (std::size_t a = 0; a < actions_.size(); ++a) {
      std::size_t before = none;
      for (std::size_t k = count(placed, a); k < actions_[a].levels.size(); ++k) {
        const std::size_t task = *actions_[a].levels[k].begin();
        if (parts.visit[task] == none) visit(task, placed, parts);
        const std::size_t part = parts.part_of[task];
        if (k > count(placed, a)) parts.waits[part] = 1;
        if (part == before) parts.conflicts[part] = 1;
        before = part;
      }
    }
    return parts;
  }
  /// Goes from `task` to those of its levels and of the next ones. Returns the earliest visit that
  /// it comes back to.
  std::size_t visit(std::size_t task, const State& placed, Parts& parts) const {
    std::size_t earliest = parts.visit[task] = parts.visits++;
    parts.stack.push_back(task);
    for (const auto& [a, first] : found_[task]) {
      if (first < count(placed, a)) continue;
      for (std::size_t k = first; k < std::min(first + 2, actions_[a].levels.size()); ++k) {
        for (const std::size_t other : actions_[a].levels[k]) {
          if (parts.visit[other] == none) {
            earliest = std::min(earliest, visit(other, placed, parts));
          } else if (parts.part_of[other] == none) {
            earliest = std::min(earliest, parts.visit[other]);
          }
        }
      }
    }
    if (earliest != parts.visit[task]) return earliest;
    while (parts.part_of[task] == none) {
      parts.part_of[parts.stack.back()] = parts.waits.size();
      parts.stack.pop_back();
    }
    parts.waits.push_back(0);
    parts.conflicts.push_back(0);
    return earliest;
  }

  /// Names the two actions that order most pairs of tasks differently.
  [[noreturn]] [[gnu::cold]] void give_up() const {
    std::vector<Counts> rank(actions_.size(), Counts(found_.size(), 0));  // 0: not in the action
    for (std::size_t task = 0; task < found_.size(); ++task) {
      for (const auto& [a, k] : found_[task]) rank[a][task] = k + 1;
    }
    std::size_t most = 0, first = 0, second = 0;
    for (std::size_t a = 0; a < rank.size(); ++a) {
      for (std::size_t b = a + 1; b < rank.size(); ++b) {
        const Counts &in_a = rank[a], &in_b = rank[b];
        std::size_t count = 0;
        for (std::size_t t = 0; t < found_.size(); ++t) {
          for (std::size_t u = 0; u < found_.size(); ++u) {
            if (in_a[t] && in_b[u] && in_a[t] < in_a[u] && in_b[t] >= in_b[u]) ++count;
          }
        }
        if (count > most) most = count, first = a, second = b;
      }
    }
    invalid("unified_hierarchy: the orders conflict too much for a shortest list, most of all '",
            actions_[first].name, "' and '", actions_[second].name, "'; use fewer actions");
  }

  std::vector<NumberedAction> all_;
  std::vector<NumberedAction> actions_;  ///< those to search over, the lowest level first
  /// Of each task, where it stands in `actions_`: action and level.
  std::vector<std::vector<std::pair<std::size_t, std::size_t>>> found_;
};

template <Robot R>
[[gnu::cold]] void check_actions(const std::vector<Action<R>>& actions) {
  if (actions.empty()) invalid("unified_hierarchy: there are no actions");
  constexpr std::size_t most_levels = 255;
  for (std::size_t a = 0; a < actions.size(); ++a) {
    const Action<R>& action = actions[a];
    for (std::size_t b = 0; b < a; ++b) {
      if (actions[b].name == action.name) {
        invalid("unified_hierarchy: two actions are called '", action.name, "'");
      }
    }
    if (action.levels.size() > most_levels) {
      invalid("action '", action.name, "': at most ", most_levels, " levels, got ",
              action.levels.size());
    }
    std::vector<const void*> seen;
    for (std::size_t k = 0; k < action.levels.size(); ++k) {
      if (action.levels[k].empty()) {
        invalid("action '", action.name, "': level ", k, " has no tasks");
      }
      for (const Task<R>& task : action.levels[k]) {
        if (std::find(seen.begin(), seen.end(), &task) != seen.end()) {
          invalid("action '", action.name, "': task '", task.name(), "' stands in it twice");
        }
        seen.push_back(&task);
      }
    }
  }
}

/// The order in which the actions' levels are placed, see `HierarchySearch::solve`.
template <Robot R>
[[gnu::cold]] std::vector<std::string> place_levels(const std::vector<Action<R>>& actions) {
  std::vector<const void*> tasks;  // a task's number is its index here
  std::vector<NumberedAction> numbered;
  for (const auto& action : actions) {
    NumberedAction& mine = numbered.emplace_back();
    mine.name = action.name;
    for (const auto& level : action.levels) {
      NumberedAction::Level& numbers = mine.levels.emplace_back();
      for (const Task<R>& task : level) {
        const auto found = std::find(tasks.begin(), tasks.end(), &task);
        HierarchySearch::merge({static_cast<std::size_t>(found - tasks.begin())}, numbers);
        if (found == tasks.end()) tasks.push_back(&task);
      }
    }
  }
  return HierarchySearch(std::move(numbered), tasks.size()).solve();
}

}  // namespace detail

/// The shortest unified list of the actions. Fast wherever their orders agree, however many they
/// are; grows with the conflicts, and gives up with an exception rather than take minutes. For
/// configuration, not for the control step. Allocates.
/// @throws std::invalid_argument on no actions, two of the same name, an empty level, more than 255
///         levels, a task that stands twice in one action, or orders that conflict too much.
template <Robot R>
[[gnu::cold]] UnifiedHierarchy<R> unified_hierarchy(const std::vector<Action<R>>& actions) {
  detail::check_actions(actions);
  UnifiedHierarchy<R> levels;
  std::vector<std::size_t> placed(actions.size(), 0);
  for (const std::string& move : detail::place_levels(actions)) {
    auto& level = levels.emplace_back();
    for (std::size_t a = 0; a < actions.size(); ++a) {
      if (move[a] == 0) continue;
      for (Task<R>& task : actions[a].levels[placed[a]++]) {
        std::size_t i = 0;
        while (i < level.size() && level[i].task != &task) ++i;
        if (i == level.size()) level.push_back({&task, std::vector<bool>(actions.size(), false)});
        level[i].in_action[a] = true;
      }
    }
  }
  return levels;
}

}  // namespace icat
