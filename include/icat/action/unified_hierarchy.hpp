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
#include <utility>
#include <vector>

#include "icat/action/action.hpp"
#include "icat/core/list.hpp"

namespace icat {

/// One task on one unified level, and which actions it is part of there.
template <Robot R>
struct HierarchyEntry {
  /// Never null.
  Task<R>* task;
  List<bool> in_action;  ///< one for each action
};

/// Levels of entries, the highest priority first: two lists to read as `std::vector`.
template <Robot R>
using UnifiedHierarchy = List<List<HierarchyEntry<R>>>;

namespace detail {

/// In which order each action has its tasks. Actions and tasks are numbers, sets of tasks hold a 0
/// or 1 for each, and tables are flat: every program that has a controller compiles the search, and
/// each type of a container is a part of what that costs.
struct ActionOrders {
  using Numbers = List<std::size_t>;

  std::size_t tasks;    ///< how many
  Numbers length = {};  ///< levels of each action
  Numbers height = {};  ///< of each task, action by action: its level, 1 the lowest; 0: not there

  std::size_t size() const noexcept { return length.size(); }
  const std::size_t* heights(std::size_t action) const noexcept {
    return height.data() + action * tasks;
  }
  /// Appends an action by the heights of its tasks.
  [[gnu::cold]] void add(const std::size_t* heights, std::size_t levels) {
    for (std::size_t t = 0; t < tasks; ++t) height.push_back(heights[t]);
    length.push_back(levels);
  }
  /// Is there a level `k` of `action`, and does it lie in `level`?
  [[gnu::noinline]] bool fits(std::size_t action, std::size_t k,
                              const std::size_t* level) const noexcept {
    if (k == 0 || k > length[action]) return false;
    const std::size_t* h = heights(action);
    for (std::size_t t = 0; t < tasks; ++t) {
      if (h[t] == k && !level[t]) return false;
    }
    return true;
  }
  /// Puts level `k` of `action` in `level`.
  [[gnu::noinline]] void merge(std::size_t action, std::size_t k,
                               std::size_t* level) const noexcept {
    const std::size_t* h = heights(action);
    for (std::size_t t = 0; t < tasks; ++t) {
      if (h[t] == k) level[t] = 1;
    }
  }
  /// Does a list that holds `b` hold `a`?
  [[gnu::cold]] bool is_within(std::size_t a, std::size_t b) const {
    std::size_t placed = 0;
    for (std::size_t k = 1; k <= length[b]; ++k) {
      Numbers level(tasks);
      merge(b, k, level.data());
      if (fits(a, placed + 1, level.data())) ++placed;
    }
    return placed == length[a];
  }
};

/// An exact search (A*) over how many levels of each action are placed already, from the lowest
/// level of the list up. In that direction only conflicts leave a choice: any other task lies as
/// low as it can, because a shortest list has the smallest upper levels.
class HierarchySearch {
 public:
  using Numbers = ActionOrders::Numbers;

  [[gnu::cold]] explicit HierarchySearch(const ActionOrders& actions) : actions_{actions.tasks} {
    // A list that holds an action holds those within it too.
    List<bool> idle(actions.size());
    for (std::size_t a = actions.size(); a-- > 0;) {
      for (std::size_t b = 0; b < actions.size() && !idle[a]; ++b) {
        idle[a] = b != a && !idle[b] && actions.is_within(a, b);
      }
    }
    for (std::size_t a = 0; a < actions.size(); ++a) {
      if (!idle[a]) actions_.add(actions.heights(a), actions.length[a]);
    }
    const std::size_t tasks = actions.tasks;
    part_of_ = visit_ = stack_ = waits_ = conflicts_ = Numbers(tasks);
  }

  /// The levels of the shortest list, the highest first, as sets of tasks one after the other.
  /// False where the orders conflict too much.
  [[gnu::cold]] bool solve(Numbers& list) {
    constexpr std::size_t most = 100'000, most_choices = 16;
    const std::size_t count = actions_.size();
    const Numbers nothing(actions_.tasks);
    Numbers free, level, choices, placed(count), next;
    closed_ = Numbers(16);
    closed_count_ = 0;
    nodes_ = List<Node>(1);
    placed_ = placed;
    levels_ = nothing;
    add(0, nothing, placed);
    while (true) {
      const std::size_t last = open_;
      open_ = meld(nodes_[last].left, nodes_[last].right);
      for (std::size_t a = 0; a < count; ++a) placed[a] = placed_[last * count + a];
      if (is_closed(placed)) continue;
      close(last);
      divide(placed);
      if (visits_ == 0) {
        for (std::size_t i = last; i != 1; i = nodes_[i].parent) {
          for (std::size_t t = 0; t < actions_.tasks; ++t) {
            list.push_back(levels_[i * actions_.tasks + t]);
          }
        }
        return true;
      }
      free = nothing;
      choices.clear();
      for (std::size_t a = 0; a < count; ++a) {
        if (placed[a] == actions_.length[a]) continue;
        const std::size_t part = part_of_[any_task(a, placed[a] + 1)];
        if (conflicts_[part] && !is_among(choices, a, placed)) choices.push_back(a);
        if (!waits_[part]) actions_.merge(a, placed[a] + 1, free.data());
      }
      if (nodes_.size() > most || choices.size() > most_choices) return false;
      // Every subset of the choices may lie here, with all levels that cost no more entries.
      for (std::size_t subset = 0; (subset >> choices.size()) == 0; ++subset) {
        level = free;
        for (std::size_t bit = 0; bit < choices.size(); ++bit) {
          const std::size_t a = choices[bit];
          if ((subset >> bit) & 1) actions_.merge(a, placed[a] + 1, level.data());
        }
        next = placed;
        for (std::size_t a = 0; a < count; ++a) {
          if (actions_.fits(a, placed[a] + 1, level.data())) ++next[a];
        }
        if (!is_closed(next)) add(last, level, next);  // The empty subset may place nothing.
      }
    }
  }

 private:
  /// A level of a list; its parent is the level below. Cost and bound are (entries, levels). The
  /// set of its tasks stands in `levels_`, how many levels of each action are placed in `placed_`.
  /// There is no node 0, node 1 is below all lists.
  struct Node {
    std::size_t entries_bound{0}, levels_bound{0}, entries{0}, levels{0}, tasks{0}, parent{0};
    std::size_t left{0}, right{0}, depth{0};  ///< of a leftist heap; its root is the best
    std::size_t next{0};                      ///< of the closed ones, in the same bucket
  };
  static constexpr std::size_t none = static_cast<std::size_t>(-1);

  /// Some task of level `k` of action `a`.
  std::size_t any_task(std::size_t a, std::size_t k) const noexcept {
    std::size_t task = 0;
    while (actions_.heights(a)[task] != k) ++task;
    return task;
  }
  /// Is the next level of action `a` that of one of the choices, too?
  [[gnu::cold]] bool is_among(const Numbers& choices, std::size_t a,
                              const Numbers& placed) const noexcept {
    for (const std::size_t b : choices) {
      std::size_t t = 0;
      while (t < actions_.tasks && (actions_.heights(a)[t] == placed[a] + 1) ==
                                       (actions_.heights(b)[t] == placed[b] + 1)) {
        ++t;
      }
      if (t == actions_.tasks) return true;
    }
    return false;
  }

  // --- the states that were left

  std::size_t& bucket(const std::size_t* placed) noexcept {
    std::size_t hash = 0;
    for (std::size_t a = 0; a < actions_.size(); ++a) hash = 31 * hash + placed[a];
    return closed_[hash % closed_.size()];
  }
  [[gnu::noinline]] void link(std::size_t node) noexcept {
    std::size_t& first = bucket(placed_.data() + node * actions_.size());
    nodes_[node].next = first;
    first = node;
  }
  [[gnu::cold]] void close(std::size_t node) {
    if (++closed_count_ > closed_.size()) {
      const Numbers before = closed_;
      closed_ = Numbers(8 * before.size());
      for (const std::size_t first : before) {
        for (std::size_t i = first, next; i != 0; i = next) {
          next = nodes_[i].next;
          link(i);
        }
      }
    }
    link(node);
  }
  [[gnu::noinline]] bool is_closed(const Numbers& placed) noexcept {
    const std::size_t count = actions_.size();
    for (std::size_t i = bucket(placed.data()); i != 0; i = nodes_[i].next) {
      std::size_t a = 0;
      while (a < count && placed_[i * count + a] == placed[a]) ++a;
      if (a == count) return true;
    }
    return false;
  }

  // --- those to go on from

  /// Of the same bound, the lists of fewer levels are grown first: then all lists that reach a
  /// state are known when the best of them, the one with the smallest upper levels, is taken.
  [[gnu::noinline]] bool is_worse(std::size_t i, std::size_t j) const noexcept {
    const Node &a = nodes_[i], &b = nodes_[j];
    if (a.entries_bound != b.entries_bound) return a.entries_bound > b.entries_bound;
    if (a.levels_bound != b.levels_bound) return a.levels_bound > b.levels_bound;
    if (a.levels != b.levels) return a.levels > b.levels;
    for (std::size_t k = i, l = j; k != l; k = nodes_[k].parent, l = nodes_[l].parent) {
      if (nodes_[k].tasks != nodes_[l].tasks) return nodes_[k].tasks > nodes_[l].tasks;
    }
    return i > j;
  }
  /// The heap of two. The shorter path to an empty place is on the right.
  [[gnu::cold]] std::size_t meld(std::size_t i, std::size_t j) noexcept {
    if (i == 0 || j == 0) return i + j;
    if (is_worse(i, j)) return meld(j, i);
    Node& node = nodes_[i];
    node.right = meld(node.right, j);
    if (nodes_[node.left].depth < nodes_[node.right].depth) std::swap(node.left, node.right);
    node.depth = nodes_[node.right].depth + 1;
    return i;
  }
  /// Every task still to come needs an entry, every part with a conflict one more, and the longest
  /// rest its levels.
  [[gnu::cold]] void add(std::size_t below, const Numbers& level, const Numbers& placed) {
    divide(placed);
    Node node;
    for (const std::size_t there : level) node.tasks += there;
    node.entries = nodes_[below].entries + node.tasks;
    node.levels = nodes_[below].levels + 1;
    node.entries_bound = node.entries + visits_;
    for (std::size_t part = 0; part < parts_; ++part) node.entries_bound += conflicts_[part];
    std::size_t longest = 0;
    for (std::size_t a = 0; a < actions_.size(); ++a) {
      longest = std::max(longest, actions_.length[a] - placed[a]);
    }
    node.levels_bound = node.levels + longest;
    node.parent = below;
    node.depth = 1;
    for (const std::size_t n : placed) placed_.push_back(n);
    for (const std::size_t there : level) levels_.push_back(there);
    nodes_.push_back(node);
    open_ = meld(open_, nodes_.size() - 1);
  }

  // --- the tasks still to come

  /// Divides them into strongly connected components (Tarjan's algorithm): the tasks of a part
  /// share levels, or come both before and after each other, and then one of them must stand twice.
  [[gnu::cold]] void divide(const Numbers& placed) {
    visits_ = parts_ = stacked_ = 0;
    for (std::size_t t = 0; t < actions_.tasks; ++t) part_of_[t] = visit_[t] = none;
    for (std::size_t a = 0; a < actions_.size(); ++a) {
      std::size_t before = none;
      for (std::size_t k = placed[a] + 1; k <= actions_.length[a]; ++k) {
        const std::size_t task = any_task(a, k);
        if (visit_[task] == none) visit(task, placed);
        const std::size_t part = part_of_[task];
        if (k > placed[a] + 1) waits_[part] = 1;
        if (part == before) conflicts_[part] = 1;
        before = part;
      }
    }
  }
  /// Goes from `task` to those of its levels and of the next ones. Returns the earliest visit that
  /// it comes back to.
  [[gnu::cold]] std::size_t visit(std::size_t task, const Numbers& placed) {
    std::size_t earliest = visit_[task] = visits_++;
    stack_[stacked_++] = task;
    for (std::size_t a = 0; a < actions_.size(); ++a) {
      const std::size_t* h = actions_.heights(a);
      if (h[task] <= placed[a]) continue;  // placed, or not in the action
      for (std::size_t t = 0; t < actions_.tasks; ++t) {
        if ((h[t] != h[task] && h[t] != h[task] + 1) || part_of_[t] != none) continue;
        const std::size_t back = visit_[t] == none ? visit(t, placed) : visit_[t];
        if (back < earliest) earliest = back;
      }
    }
    if (earliest != visit_[task]) return earliest;
    while (part_of_[task] == none) part_of_[stack_[--stacked_]] = parts_;
    waits_[parts_] = conflicts_[parts_] = 0;
    ++parts_;
    return earliest;
  }

  ActionOrders actions_;  ///< those to search over
  List<Node> nodes_;
  Numbers placed_, levels_;  ///< of each node
  std::size_t open_{0};      ///< the best of those to go on from
  Numbers closed_;           ///< the first of each bucket
  std::size_t closed_count_{0};
  // Of the tasks still to come.
  Numbers part_of_;  ///< of each task; none if it is placed
  Numbers visit_, stack_;
  Numbers waits_;      ///< Is a level of the part not the next of its action?
  Numbers conflicts_;  ///< Is there one in the part?
  std::size_t visits_{0}, stacked_{0}, parts_{0};
};

/// The two actions that order most pairs of tasks differently.
struct ConflictingActions {
  std::size_t first{0}, second{0};

  [[gnu::cold]] static ConflictingActions of(const ActionOrders& actions) {
    ConflictingActions worst;
    std::size_t most = 0;
    for (std::size_t a = 0; a < actions.size(); ++a) {
      for (std::size_t b = a + 1; b < actions.size(); ++b) {
        const std::size_t *in_a = actions.heights(a), *in_b = actions.heights(b);
        std::size_t count = 0;
        for (std::size_t t = 0; t < actions.tasks; ++t) {
          for (std::size_t u = 0; u < actions.tasks; ++u) {
            if (in_a[t] && in_b[u] && in_a[t] < in_a[u] && in_b[t] >= in_b[u]) ++count;
          }
        }
        if (count > most) most = count, worst = {a, b};
      }
    }
    return worst;
  }
};

/// Where `task` stands in `tasks`; at their end if it was not among them.
template <Robot R>
[[gnu::cold]] std::size_t append_once(Task<R>& task, List<Task<R>*>& tasks) {
  std::size_t i = 0;
  while (i < tasks.size() && tasks[i] != &task) ++i;
  if (i == tasks.size()) tasks.push_back(&task);
  return i;
}

/// The tasks of all actions, each once: their numbers are the indices here.
template <Robot R>
[[gnu::cold]] List<Task<R>*> distinct_tasks(const std::vector<Action<R>>& actions) {
  List<Task<R>*> tasks;
  for (const Action<R>& action : actions) {
    for (const PriorityLevel<R>& level : action.levels) {
      for (Task<R>& task : level) (void)append_once(task, tasks);
    }
  }
  return tasks;
}

/// The orders of the actions, which are checked.
template <Robot R>
[[gnu::cold]] ActionOrders action_orders(const std::vector<Action<R>>& actions,
                                         const List<Task<R>*>& tasks) {
  ActionOrders orders{tasks.size()};
  for (const Action<R>& action : actions) {
    for (std::size_t b = 0; b < orders.size(); ++b) {
      if (actions[b].name == action.name) {
        invalid("unified_hierarchy: two actions are called '", action.name, "'");
      }
    }
    ActionOrders::Numbers heights(tasks.size());
    for (std::size_t k = 0; k < action.levels.size(); ++k) {
      if (action.levels[k].empty()) {
        invalid("action '", action.name, "': level ", k, " has no tasks");
      }
      for (Task<R>& task : action.levels[k]) {
        std::size_t i = 0;
        while (tasks[i] != &task) ++i;
        if (heights[i] != 0) {
          invalid("action '", action.name, "': task '", task.name(), "' stands in it twice");
        }
        heights[i] = action.levels.size() - k;
      }
    }
    orders.add(heights.data(), action.levels.size());
  }
  return orders;
}

}  // namespace detail

/// The shortest unified list of the actions. Fast wherever their orders agree, however many they
/// are; grows with the conflicts, and gives up with an exception rather than take minutes. For
/// configuration, not for the control step. Allocates.
/// @throws std::invalid_argument on no actions, two of the same name, an empty level, a task that
///         stands twice in one action, or orders that conflict too much.
template <Robot R>
[[gnu::cold]] UnifiedHierarchy<R> unified_hierarchy(const std::vector<Action<R>>& actions) {
  if (actions.empty()) detail::invalid("unified_hierarchy: there are no actions");
  const List<Task<R>*> tasks = detail::distinct_tasks(actions);
  const detail::ActionOrders orders = detail::action_orders(actions, tasks);
  detail::ActionOrders::Numbers list, left = orders.length;
  if (!detail::HierarchySearch(orders).solve(list)) {
    const auto worst = detail::ConflictingActions::of(orders);
    detail::invalid(
        "unified_hierarchy: the orders conflict too much for a shortest list, most of all '",
        actions[worst.first].name, "' and '", actions[worst.second].name, "'; use fewer actions");
  }
  UnifiedHierarchy<R> levels(tasks.size() == 0 ? 0 : list.size() / tasks.size());
  for (std::size_t k = 0; k < levels.size(); ++k) {
    const std::size_t* level = list.data() + k * tasks.size();
    std::size_t count = 0;
    for (std::size_t t = 0; t < tasks.size(); ++t) count += level[t];
    levels[k] = List<HierarchyEntry<R>>(count);
    for (std::size_t t = 0, i = 0; t < tasks.size(); ++t) {
      if (!level[t]) continue;
      levels[k][i].task = tasks[t];
      levels[k][i++].in_action = List<bool>(actions.size());
    }
    for (std::size_t a = 0; a < actions.size(); ++a) {
      if (!orders.fits(a, left[a], level)) continue;
      for (std::size_t t = 0, i = 0; t < tasks.size(); ++t) {
        if (orders.heights(a)[t] == left[a]) levels[k][i].in_action[a] = true;
        i += level[t];
      }
      --left[a];
    }
  }
  return levels;
}

}  // namespace icat
