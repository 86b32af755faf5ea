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

/// The tasks of each level of an action, as numbers.
using ActionLevels = std::vector<std::vector<std::size_t>>;

/// A search over how many levels of each action are placed already (A*, exact). Cost and bound of a
/// state are (entries, levels); ties go to the path with the smaller upper levels.
class HierarchySearch {
 public:
  HierarchySearch(std::vector<ActionLevels> actions, std::size_t tasks)
      : actions_(std::move(actions)), tasks_(tasks) {}

  /// For each unified level, which actions place their next level there (a bit mask).
  [[gnu::cold]] std::vector<std::size_t> solve() const {
    std::vector<Node> open(1);
    std::set<State> closed;
    open[0].placed.assign(actions_.size(), 0);
    set_bound(open[0]);
    // Orders that agree need one state for each level; many that conflict grow without bound.
    constexpr std::size_t most = 100'000;
    while (true) {
      std::pop_heap(open.begin(), open.end(), worse);
      const Node node = std::move(open.back());
      open.pop_back();
      if (!closed.insert(node.placed).second) continue;
      if (open.size() > most) {
        invalid("unified_hierarchy: the orders of ", actions_.size(),
                " actions conflict too much for a shortest list; use fewer actions");
      }
      std::size_t unfinished = 0;
      for (std::size_t a = 0; a < actions_.size(); ++a) {
        if (placed(node, a) < actions_[a].size()) unfinished |= std::size_t{1} << a;
      }
      if (unfinished == 0) return node.moves;
      // Every nonempty subset of the unfinished actions may put its next level here.
      for (std::size_t move = unfinished; move != 0; move = (move - 1) & unfinished) {
        Node next = node;
        State seen(tasks_, 0);
        const std::size_t before = next.entries;
        for (std::size_t a = 0; a < actions_.size(); ++a) {
          if (!((move >> a) & 1)) continue;
          next.entries += count_new(actions_[a][placed(node, a)], seen);
          ++next.placed[a];
        }
        if (closed.count(next.placed) != 0) continue;
        next.sizes.push_back(next.entries - before);
        next.moves.push_back(move);
        set_bound(next);
        open.push_back(std::move(next));
        std::push_heap(open.begin(), open.end(), worse);
      }
    }
  }

 private:
  /// How many levels of each action are placed; a character each.
  using State = std::string;
  using Counts = std::vector<std::size_t>;
  struct Node {
    std::size_t entries_bound{0}, levels_bound{0}, entries{0};
    Counts sizes, moves;
    State placed;
  };

  static std::size_t placed(const Node& node, std::size_t a) {
    return static_cast<unsigned char>(node.placed[a]);
  }
  /// Lexicographic: below, at or above 0 as a is before, equal to or after b.
  static int compare(const Counts& a, const Counts& b) {
    for (std::size_t i = 0; i < a.size() && i < b.size(); ++i) {
      if (a[i] != b[i]) return a[i] < b[i] ? -1 : 1;
    }
    return a.size() == b.size() ? 0 : a.size() < b.size() ? -1 : 1;
  }
  static bool worse(const Node& a, const Node& b) {
    if (a.entries_bound != b.entries_bound) return a.entries_bound > b.entries_bound;
    if (a.levels_bound != b.levels_bound) return a.levels_bound > b.levels_bound;
    if (const int c = compare(a.sizes, b.sizes); c != 0) return c > 0;
    return compare(a.moves, b.moves) > 0;
  }
  /// How many of `tasks` are not among those `seen`, to which they are added.
  static std::size_t count_new(const std::vector<std::size_t>& tasks, State& seen) {
    std::size_t count = 0;
    for (const std::size_t task : tasks) {
      if (seen[task] == 0) ++count;
      seen[task] = 1;
    }
    return count;
  }
  /// Every task still to come needs one entry more, the longest rest its levels.
  void set_bound(Node& node) const {
    State seen(tasks_, 0);
    std::size_t rest = 0, longest = 0;
    for (std::size_t a = 0; a < actions_.size(); ++a) {
      longest = std::max(longest, actions_[a].size() - placed(node, a));
      for (std::size_t k = placed(node, a); k < actions_[a].size(); ++k) {
        rest += count_new(actions_[a][k], seen);
      }
    }
    node.entries_bound = node.entries + rest;
    node.levels_bound = node.moves.size() + longest;
  }

  std::vector<ActionLevels> actions_;
  std::size_t tasks_;
};

template <Robot R>
[[gnu::cold]] void check_actions(const std::vector<Action<R>>& actions) {
  if (actions.empty()) invalid("unified_hierarchy: there are no actions");
  // The search tries every subset of the actions at every step.
  constexpr std::size_t most = 16, most_levels = 255;
  if (actions.size() > most) {
    invalid("unified_hierarchy: at most ", most, " actions, got ", actions.size());
  }
  std::set<std::string> names;
  for (const auto& action : actions) {
    if (!names.insert(action.name).second) {
      invalid("unified_hierarchy: two actions are called '", action.name, "'");
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
[[gnu::cold]] std::vector<std::size_t> place_levels(const std::vector<Action<R>>& actions) {
  std::vector<const void*> tasks;  // A task's number is its index here.
  std::vector<ActionLevels> numbered;
  for (const auto& action : actions) {
    ActionLevels& levels = numbered.emplace_back();
    for (const auto& level : action.levels) {
      std::vector<std::size_t>& numbers = levels.emplace_back();
      for (const Task<R>& task : level) {
        const auto found = std::find(tasks.begin(), tasks.end(), &task);
        numbers.push_back(static_cast<std::size_t>(found - tasks.begin()));
        if (found == tasks.end()) tasks.push_back(&task);
      }
    }
  }
  return HierarchySearch(std::move(numbered), tasks.size()).solve();
}

}  // namespace detail

/// The shortest unified list of up to 16 actions. Fast where their orders agree; grows with the
/// number of conflicts, and gives up with an exception rather than take minutes. For configuration,
/// not for the control step. Allocates.
/// @throws std::invalid_argument on no actions, two of the same name, an empty level, more than 255
///         levels, or a task that stands twice in one action.
template <Robot R>
[[gnu::cold]] UnifiedHierarchy<R> unified_hierarchy(const std::vector<Action<R>>& actions) {
  detail::check_actions(actions);
  UnifiedHierarchy<R> levels;
  std::vector<std::size_t> placed(actions.size(), 0);
  for (const std::size_t move : detail::place_levels(actions)) {
    auto& level = levels.emplace_back();
    for (std::size_t a = 0; a < actions.size(); ++a) {
      if (!((move >> a) & 1)) continue;
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
