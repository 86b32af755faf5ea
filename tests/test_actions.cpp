// SPDX-License-Identifier: BSD-3-Clause
// The unified hierarchy and the transitions between actions.
#include <gtest/gtest.h>

#include <chrono>
#include <cstdio>
#include <deque>
#include <icat/action/transition.hpp>
#include <icat/action/unified_hierarchy.hpp>
#include <icat/task/function_task.hpp>
#include <map>
#include <random>
#include <set>
#include <tuple>

namespace {

// The least a robot can be.
struct Archetype {
  using Scalar = double;
  static constexpr int size = 2;
  static icat::Index dof() { return 2; }
};
static_assert(icat::Robot<Archetype>);
static_assert(!icat::FramedRobot<Archetype> && !icat::JointedRobot<Archetype>);
static_assert(!icat::MobileRobot<Archetype> && !icat::MassiveRobot<Archetype>);

using Task = icat::task::FunctionTask<Archetype>;
using Action = icat::Action<Archetype>;
using Hierarchy = icat::UnifiedHierarchy<Archetype>;

class Tasks {
 public:
  icat::Task<Archetype>& operator[](const std::string& name) {
    for (auto& t : tasks_) {
      if (t.name() == name) return t;
    }
    return tasks_.emplace_back(
        robot_, icat::Objective<double>::equal_to(0),
        [](const Archetype&, Task::Values, Task::Block) {}, Task::Options{.name = name});
  }
  /// "A < D < C,E"
  Action action(const std::string& name, const std::string& list) {
    Action a{name, {{}}};
    for (const char c : list) {
      if (c == '<') a.levels.emplace_back();
      if (std::isalpha(static_cast<unsigned char>(c))) a.levels.back().push_back((*this)[{c}]);
    }
    return a;
  }

 private:
  Archetype robot_;
  std::deque<Task> tasks_;
};

std::string text(const Hierarchy& h) {
  std::string s;
  for (std::size_t k = 0; k < h.size(); ++k) {
    if (k) s += " < ";
    std::vector<std::string> names;
    for (const auto& e : h[k]) names.push_back(e.task->name());
    std::sort(names.begin(), names.end());
    for (std::size_t i = 0; i < names.size(); ++i) s += (i ? "," : "") + names[i];
  }
  return s;
}
std::size_t entries(const Hierarchy& h) {
  std::size_t n = 0;
  for (const auto& level : h) n += level.size();
  return n;
}

/// What is left of the unified list when the entries that are not in `action` are switched off.
std::string extracted(const Hierarchy& h, std::size_t action) {
  Hierarchy own;
  for (const auto& level : h) {
    std::decay_t<decltype(level)> l;
    for (const auto& e : level) {
      if (e.in_action[action]) l.push_back(e);
    }
    if (l.size() > 0) own.push_back(l);
  }
  return text(own);
}
std::string text(const Action& a) {
  Hierarchy h;
  for (const auto& level : a.levels) {
    std::decay_t<decltype(h[0])> l;
    for (auto& t : level) l.push_back({&t.get(), {}});
    h.push_back(l);
  }
  return text(h);
}

TEST(UnifiedHierarchy, ThePapersExample) {
  Tasks tasks;
  const std::vector<Action> actions{tasks.action("P1", "A < B,C,D"),
                                    tasks.action("P2", "A < D < C,E")};
  const Hierarchy h = icat::unified_hierarchy(actions);
  EXPECT_EQ(text(h), "A < D < B,C,D,E");
  EXPECT_EQ(extracted(h, 0), "A < B,C,D");
  EXPECT_EQ(extracted(h, 1), "A < D < C,E");
}

TEST(UnifiedHierarchy, ConflictingOrdersDuplicateATask) {
  Tasks tasks;
  const Hierarchy h =
      icat::unified_hierarchy<Archetype>({tasks.action("1", "A < B"), tasks.action("2", "B < A")});
  EXPECT_EQ(entries(h), 3u);
  EXPECT_EQ(h.size(), 3u);
  EXPECT_EQ(extracted(h, 0), "A < B");
  EXPECT_EQ(extracted(h, 1), "B < A");
}

TEST(UnifiedHierarchy, ConsistentOrdersNeedEachTaskOnce) {
  Tasks tasks;
  const Hierarchy h =
      icat::unified_hierarchy<Archetype>({tasks.action("navigate", "J < D < M < H < V < a"),
                                          tasks.action("grasp", "J < D < M < C < H < T < v"),
                                          tasks.action("lift", "J < D < M < H < T < a")});
  EXPECT_EQ(entries(h), 9u);  // J D M C H V T a v
  EXPECT_EQ(h.size(), 7u);    // the longest action's: tasks that never meet share a level
  EXPECT_EQ(extracted(h, 0), "J < D < M < H < V < a");
  EXPECT_EQ(extracted(h, 1), "J < D < M < C < H < T < v");
  EXPECT_EQ(extracted(h, 2), "J < D < M < H < T < a");
}

// What a shortest list is the shortest in: entries, levels, and the sizes of the levels.
using Cost = std::tuple<std::size_t, std::size_t, std::vector<std::size_t>>;

Cost cost(const Hierarchy& h) {
  std::vector<std::size_t> sizes;
  for (const auto& level : h) sizes.push_back(level.size());
  return {entries(h), h.size(), sizes};
}

// All merges of all orders, by brute force.
class BruteForce {
 public:
  explicit BruteForce(const std::vector<Action>& actions) : actions_(actions) {}
  Cost least() { return least(std::vector<std::size_t>(actions_.size(), 0)); }

 private:
  Cost least(const std::vector<std::size_t>& at) {
    if (const auto found = known_.find(at); found != known_.end()) return found->second;
    std::size_t unfinished = 0;
    for (std::size_t a = 0; a < actions_.size(); ++a) {
      if (at[a] < actions_[a].levels.size()) unfinished |= std::size_t{1} << a;
    }
    if (!unfinished) return {};
    Cost best{static_cast<std::size_t>(-1), 0, {}};
    for (std::size_t move = unfinished; move != 0; move = (move - 1) & unfinished) {
      std::set<const void*> level;
      auto next = at;
      for (std::size_t a = 0; a < actions_.size(); ++a) {
        if (!((move >> a) & 1)) continue;
        for (const auto& t : actions_[a].levels[at[a]]) level.insert(&t.get());
        ++next[a];
      }
      auto [count, levels, sizes] = least(next);
      sizes.insert(sizes.begin(), level.size());
      best = std::min(best, Cost{count + level.size(), levels + 1, sizes});
    }
    return known_[at] = best;
  }

  const std::vector<Action>& actions_;
  std::map<std::vector<std::size_t>, Cost> known_;
};

// The letters as an order of up to `most` of them, now and then two on one level.
std::string some(const std::string& letters, std::size_t most, std::mt19937& rng) {
  std::string list;
  const std::size_t length = 1 + rng() % most;
  for (std::size_t k = 0; k < length; ++k) {
    if (k) list += rng() % 3 ? '<' : ',';
    list += letters[k];
  }
  return list;
}

TEST(UnifiedHierarchy, IsTheShortestAndContainsEveryAction) {
  std::mt19937 rng(1);
  for (int i = 0; i < 1000; ++i) {
    SCOPED_TRACE(i);
    Tasks tasks;
    std::vector<Action> actions;
    const int count = 2 + static_cast<int>(rng() % 3);
    // Any order, or all tasks in one order but for two neighbours now and then.
    const bool any_order = rng() % 2;
    for (int a = 0; a < count; ++a) {
      std::string letters = "ABCDEFG";
      if (any_order) std::shuffle(letters.begin(), letters.end(), rng);
      while (letters.size() > 5) letters.erase(rng() % letters.size(), 1);
      if (rng() % 3 == 0) std::swap(letters[1], letters[2]);
      actions.push_back(tasks.action(std::to_string(a), some(letters, 5, rng)));
    }
    const Hierarchy h = icat::unified_hierarchy(actions);
    for (std::size_t a = 0; a < actions.size(); ++a) EXPECT_EQ(extracted(h, a), text(actions[a]));
    EXPECT_EQ(cost(h), BruteForce(actions).least());
  }
}

// One task more for each conflict, and every action's own order.
TEST(UnifiedHierarchy, ConflictsAmongManyActionsStayExact) {
  Tasks tasks;
  std::vector<Action> actions;
  for (int a = 0; a < 20; ++a) {
    const std::string own(1, static_cast<char>('a' + a));
    actions.push_back(tasks.action(own, "A < B < " + own + " < C < D"));
  }
  actions.push_back(tasks.action("first", "B < A < C < D"));
  actions.push_back(tasks.action("last", "A < B < D < C"));
  const Hierarchy h = icat::unified_hierarchy(actions);
  EXPECT_EQ(entries(h), 26u);
  EXPECT_EQ(h.size(), 5u);
  for (std::size_t a = 0; a < actions.size(); ++a) EXPECT_EQ(extracted(h, a), text(actions[a]));
}

// Every subset of `switches` as an action, between levels that all of them have.
std::vector<Action> all_subsets(Tasks& tasks, const std::string& name,
                                const std::string& switches) {
  std::vector<Action> actions;
  for (std::size_t subset = 0; (subset >> switches.size()) == 0; ++subset) {
    std::string list = "J,L < O";
    for (std::size_t i = 0; i < switches.size(); ++i) {
      if ((subset >> i) & 1) list += std::string("<") + switches[i];
    }
    actions.push_back(tasks.action(name + std::to_string(subset), list + "< T < v"));
  }
  return actions;
}

TEST(UnifiedHierarchy, ManyActionsAreFast) {
  Tasks tasks;
  const auto four = all_subsets(tasks, "", "abcd");
  const auto six = all_subsets(tasks, "", "abcdef");
  auto no_longest = six;  // No action holds all the others.
  no_longest.pop_back();
  auto two_orders = six;
  for (const auto& action : all_subsets(tasks, "swapped ", "acbdef")) two_orders.push_back(action);
  std::vector<Action> apart;
  for (char own = 'a'; own < 'v'; ++own) {
    apart.push_back(tasks.action({own}, std::string("J < ") + own + " < T < v"));
  }
  const struct {
    const char* name;
    const std::vector<Action>& actions;
    std::size_t entries, levels;
  } cases[] = {{"all subsets of four", four, 9, 8},
               {"all subsets of six", six, 11, 10},
               {"all but the longest", no_longest, 11, 10},
               {"two orders", two_orders, 12, 11},
               {"a task of its own in each", apart, 24, 4}};
  for (const auto& c : cases) {
    SCOPED_TRACE(c.name);
    const auto start = std::chrono::steady_clock::now();
    const Hierarchy h = icat::unified_hierarchy(c.actions);
    const std::chrono::duration<double> time = std::chrono::steady_clock::now() - start;
    std::printf("%zu actions, %s: %.2f ms\n", c.actions.size(), c.name, 1e3 * time.count());
    EXPECT_LT(time.count(), 0.5);
    EXPECT_EQ(entries(h), c.entries);
    EXPECT_EQ(h.size(), c.levels);
    for (std::size_t a = 0; a < c.actions.size(); ++a) {
      EXPECT_EQ(extracted(h, a), text(c.actions[a]));
    }
  }
}

TEST(UnifiedHierarchy, HasNoLimitOfLevels) {
  Tasks tasks;
  Action all{"all", {}}, odd{"odd", {}};
  for (int k = 0; k < 300; ++k) {
    auto& task = tasks[std::to_string(k)];
    all.levels.push_back({task});
    if (k % 2) odd.levels.push_back({task});
  }
  const Hierarchy h = icat::unified_hierarchy<Archetype>({odd, all});
  EXPECT_EQ(extracted(h, 0), text(odd));
  EXPECT_EQ(extracted(h, 1), text(all));
  EXPECT_EQ(h.size(), 300u);
}

TEST(UnifiedHierarchy, TooManyConflictsGiveUp) {
  Tasks tasks;
  std::vector<Action> conflict;
  std::mt19937 rng(4);
  std::string letters = "ABCDEFGHIJKL";
  const auto action = [&](const std::string& name) {
    std::string list;
    for (const char c : letters) list += std::string(list.empty() ? "" : "<") + c;
    conflict.push_back(tasks.action(name, list));
  };
  action("sorted");
  for (int a = 0; a < 12; ++a) {
    std::shuffle(letters.begin(), letters.end(), rng);
    action(std::to_string(a));
  }
  std::sort(letters.rbegin(), letters.rend());
  action("reversed");
  try {
    icat::unified_hierarchy(conflict);
    ADD_FAILURE() << "no exception";
  } catch (const std::invalid_argument& e) {
    EXPECT_STREQ(e.what(),
                 "unified_hierarchy: the orders conflict too much for a shortest list, most of all "
                 "'sorted' and 'reversed'; use fewer actions");
  }
}

TEST(UnifiedHierarchy, BadActionsThrow) {
  Tasks tasks;
  const auto message = [](const std::vector<Action>& actions) -> std::string {
    try {
      icat::unified_hierarchy(actions);
    } catch (const std::invalid_argument& e) {
      return e.what();
    }
    return "no exception";
  };
  EXPECT_EQ(message({}), "unified_hierarchy: there are no actions");
  EXPECT_EQ(message({tasks.action("x", "A"), tasks.action("x", "B")}),
            "unified_hierarchy: two actions are called 'x'");
  EXPECT_EQ(message({tasks.action("x", "A < B < A")}), "action 'x': task 'A' stands in it twice");
  EXPECT_EQ(message({tasks.action("x", "A < < B")}), "action 'x': level 1 has no tasks");
}

// --- transitions ---------------------------------------------------------------------------------

TEST(Transition, ThousandRandomSwitchSequencesNeverJump) {
  std::mt19937 rng(2);
  std::uniform_real_distribution<double> u(0, 1);
  for (int sequence = 0; sequence < 1000; ++sequence) {
    SCOPED_TRACE(sequence);
    constexpr std::size_t count = 6;
    icat::Transition transition(count);
    std::vector<double> targets(count), last(count);
    double t = 10 * u(rng);
    for (auto& x : targets) x = rng() % 2 ? 1 : 0;
    ASSERT_EQ(transition.set(targets, t), icat::Status::ok);
    last = targets;
    double duration = 1;
    const double dt = 1e-3;
    for (int cycle = 0; cycle < 600; ++cycle) {
      // A switch in the middle of a transition more often than not; some take it back.
      if (rng() % 60 == 0) {
        for (auto& x : targets) x = rng() % 2 ? 1 : 0;
        duration = 0.05 + 0.4 * u(rng);
        ASSERT_EQ(transition.start(targets, t, duration), icat::Status::ok);
        for (std::size_t i = 0; i < count; ++i) ASSERT_EQ(transition.values()[i], last[i]);
      }
      t += dt;
      ASSERT_EQ(transition.update(t), icat::Status::ok);
      for (std::size_t i = 0; i < count; ++i) {
        const double a = transition.values()[i];
        ASSERT_GE(a, 0);
        ASSERT_LE(a, 1);
        // The steepest slope of the sigmoid is 15/8.
        ASSERT_LE(std::abs(a - last[i]), 15.0 / 8 * dt / duration + 1e-12);
        last[i] = a;
      }
    }
    t += 1;
    ASSERT_EQ(transition.update(t), icat::Status::ok);
    EXPECT_TRUE(transition.finished());
    for (std::size_t i = 0; i < count; ++i) EXPECT_EQ(transition.values()[i], targets[i]);
  }
}

TEST(Transition, TakesTheTimeItWasGiven) {
  icat::Transition transition(1);
  const std::vector<double> one{1}, zero{0};
  ASSERT_EQ(transition.set(zero, 5), icat::Status::ok);
  ASSERT_EQ(transition.start(one, 5, 2), icat::Status::ok);
  ASSERT_EQ(transition.update(6), icat::Status::ok);
  EXPECT_EQ(transition.values()[0], 0.5);
  EXPECT_FALSE(transition.finished());
  ASSERT_EQ(transition.update(6.99), icat::Status::ok);
  EXPECT_LT(transition.values()[0], 1);
  ASSERT_EQ(transition.update(7), icat::Status::ok);
  EXPECT_EQ(transition.values()[0], 1);
  EXPECT_TRUE(transition.finished());
}

// Seconds since 1970 leave nothing of a cycle in a float.
TEST(Transition, EpochSeconds) {
  constexpr double epoch = 1.76e9;
  static_assert(static_cast<float>(epoch) == static_cast<float>(epoch + 1));
  icat::Transition transition(1);
  const std::vector<double> one{1};
  ASSERT_EQ(transition.start(one, epoch, 1), icat::Status::ok);
  ASSERT_EQ(transition.update(epoch + 0.5), icat::Status::ok);
  EXPECT_NEAR(transition.values()[0], 0.5, 1e-6);
  EXPECT_FALSE(transition.finished());
  ASSERT_EQ(transition.update(epoch + 1), icat::Status::ok);
  EXPECT_EQ(transition.values()[0], 1);
}

TEST(Transition, RefusesBadInput) {
  icat::Transition transition(2);
  const std::vector<double> targets{1, 0}, three{1, 0, 1};
  ASSERT_EQ(transition.set(targets, 1), icat::Status::ok);
  const std::vector<double> negative{-0.1, 0}, not_a_number{NAN, 0};
  EXPECT_EQ(transition.set(three, 1), icat::Status::wrong_size);
  EXPECT_EQ(transition.set(targets, NAN), icat::Status::non_finite);
  EXPECT_EQ(transition.start(negative, 1, 1), icat::Status::activation_out_of_range);
  EXPECT_EQ(transition.start(not_a_number, 1, 1), icat::Status::activation_out_of_range);
  EXPECT_EQ(transition.start(three, 1, 1), icat::Status::wrong_size);
  EXPECT_EQ(transition.start(targets, 1, 0), icat::Status::invalid_duration);
  EXPECT_EQ(transition.start(targets, 1, NAN), icat::Status::invalid_duration);
  EXPECT_EQ(transition.start(targets, 0.5, 1), icat::Status::time_reversed);
  EXPECT_EQ(transition.update(0.5), icat::Status::time_reversed);
  EXPECT_EQ(transition.update(NAN), icat::Status::non_finite);
  EXPECT_EQ(transition.update(1), icat::Status::ok);
  EXPECT_EQ(transition.values()[0], 1);
  EXPECT_EQ(transition.values()[1], 0);
  EXPECT_TRUE(transition.finished());  // nothing was started
}

}  // namespace
