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
#include <map>
#include <queue>
#include <set>
#include <tuple>
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

/// A search over how many levels of each action are placed already (A*, exact). Cost and bound of a
/// state are (entries, levels); ties go to the path with the smaller upper levels.
template <Robot R>
class HierarchySearch {
 public:
  explicit HierarchySearch(const std::vector<Action<R>>& actions) {
    for (const auto& action : actions) {
      auto& sequence = sequences_.emplace_back();
      for (const auto& level : action.levels) {
        auto& ids = sequence.emplace_back();
        for (const Task<R>& task : level) ids.insert(id_of(&task));
      }
    }
  }

  /// For each unified level, which actions place their next level there (a bit mask).
  std::vector<std::size_t> solve() const {
    const State start(sequences_.size(), 0);
    std::priority_queue<Node, std::vector<Node>, std::greater<>> open;
    std::set<State> closed;
    open.push({bound(start, 0, 0), {}, {}, start, 0});
    // Orders that agree need one state for each level; many that conflict grow without bound.
    constexpr std::size_t most = 100'000;
    while (true) {
      const Node node = open.top();
      open.pop();
      if (!closed.insert(node.state).second) continue;
      if (open.size() > most) {
        invalid("unified_hierarchy: the orders of ", sequences_.size(),
                " actions conflict too much for a shortest list; use fewer actions");
      }
      const std::size_t unfinished = unfinished_mask(node.state);
      if (unfinished == 0) return node.moves;
      // Every nonempty subset of the unfinished actions may put its next level here.
      for (std::size_t move = unfinished; move != 0; move = (move - 1) & unfinished) {
        Node next = node;
        const std::size_t size = united(node.state, move).size();
        for (std::size_t a = 0; a < next.state.size(); ++a) next.state[a] += (move >> a) & 1;
        if (closed.contains(next.state)) continue;
        next.entries += size;
        next.sizes.push_back(size);
        next.moves.push_back(move);
        next.bound = bound(next.state, next.entries, next.moves.size());
        open.push(std::move(next));
      }
    }
  }

 private:
  using State = std::vector<std::size_t>;
  using Bound = std::pair<std::size_t, std::size_t>;
  struct Node {
    Bound bound;
    std::vector<std::size_t> sizes;
    std::vector<std::size_t> moves;
    State state;
    std::size_t entries;
    bool operator>(const Node& o) const {
      return std::tie(bound, sizes, moves) > std::tie(o.bound, o.sizes, o.moves);
    }
  };

  std::size_t id_of(const Task<R>* task) { return ids_.emplace(task, ids_.size()).first->second; }
  std::size_t unfinished_mask(const State& state) const {
    std::size_t mask = 0;
    for (std::size_t a = 0; a < state.size(); ++a) {
      if (state[a] < sequences_[a].size()) mask |= std::size_t{1} << a;
    }
    return mask;
  }
  std::set<std::size_t> united(const State& state, std::size_t move) const {
    std::set<std::size_t> all;
    for (std::size_t a = 0; a < state.size(); ++a) {
      if ((move >> a) & 1)
        all.insert(sequences_[a][state[a]].begin(), sequences_[a][state[a]].end());
    }
    return all;
  }
  /// Every task still to come needs one entry more, the longest rest its levels.
  Bound bound(const State& state, std::size_t entries, std::size_t levels) const {
    std::set<std::size_t> rest;
    std::size_t longest = 0;
    for (std::size_t a = 0; a < state.size(); ++a) {
      longest = std::max(longest, sequences_[a].size() - state[a]);
      for (std::size_t k = state[a]; k < sequences_[a].size(); ++k) {
        rest.insert(sequences_[a][k].begin(), sequences_[a][k].end());
      }
    }
    return {entries + rest.size(), levels + longest};
  }

  std::vector<std::vector<std::set<std::size_t>>> sequences_;
  std::map<const Task<R>*, std::size_t> ids_;
};

template <Robot R>
void check_actions(const std::vector<Action<R>>& actions) {
  if (actions.empty()) invalid("unified_hierarchy: there are no actions");
  // The search tries every subset of the actions at every step.
  constexpr std::size_t most = 16;
  if (actions.size() > most) {
    invalid("unified_hierarchy: at most ", most, " actions, got ", actions.size());
  }
  std::set<std::string> names;
  for (const auto& action : actions) {
    if (!names.insert(action.name).second) {
      invalid("unified_hierarchy: two actions are called '", action.name, "'");
    }
    std::set<const Task<R>*> seen;
    for (std::size_t k = 0; k < action.levels.size(); ++k) {
      if (action.levels[k].empty()) {
        invalid("action '", action.name, "': level ", k, " has no tasks");
      }
      for (const Task<R>& task : action.levels[k]) {
        if (!seen.insert(&task).second) {
          invalid("action '", action.name, "': task '", task.name(), "' stands in it twice");
        }
      }
    }
  }
}

}  // namespace detail

/// The shortest unified list of up to 16 actions. Fast where their orders agree; grows with the
/// number of conflicts, and gives up with an exception rather than take minutes. For configuration,
/// not for the control step. Allocates.
/// @throws std::invalid_argument on no actions, two of the same name, an empty level, or a task
/// that
///         stands twice in one action.
template <Robot R>
UnifiedHierarchy<R> unified_hierarchy(const std::vector<Action<R>>& actions) {
  detail::check_actions(actions);
  UnifiedHierarchy<R> levels;
  std::vector<std::size_t> placed(actions.size(), 0);
  for (const std::size_t move : detail::HierarchySearch<R>(actions).solve()) {
    auto& level = levels.emplace_back();
    for (std::size_t a = 0; a < actions.size(); ++a) {
      if (!((move >> a) & 1)) continue;
      for (Task<R>& task : actions[a].levels[placed[a]++]) {
        auto entry = std::find_if(level.begin(), level.end(),
                                  [&](const auto& e) { return e.task == &task; });
        if (entry == level.end()) {
          entry = level.insert(level.end(), {&task, std::vector<bool>(actions.size(), false)});
        }
        entry->in_action[a] = true;
      }
    }
  }
  return levels;
}

}  // namespace icat
