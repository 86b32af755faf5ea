// SPDX-License-Identifier: BSD-3-Clause
// PI loops, low-pass filter, sampled feedback.
#include <gtest/gtest.h>

#include <cmath>
#include <icat/control/low_pass.hpp>
#include <icat/control/pi_loop.hpp>
#include <icat/control/sample_hold.hpp>
#include <string>

#include "support/allocation_counter.hpp"

namespace {

template <class S>
class Loops : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(Loops, Scalars);

TYPED_TEST(Loops, LowPassIsTheExactExponentialAtAnyStep) {
  using S = TypeParam;
  const S tau = static_cast<S>(0.4);
  const icat::Vector<S, 2> from(S(1), S(-2)), to(S(3), S(5));
  for (const int steps : {1, 7, 500}) {
    icat::LowPass<S, 2> filter(tau, from);
    for (int i = 0; i < steps; ++i) {
      ASSERT_EQ(filter.update(to, S(1) / S(steps)), icat::Status::ok);
    }
    const icat::Vector<S, 2> expected = to + std::exp(-1 / tau) * (from - to);
    EXPECT_LT((filter.value() - expected).norm(), sizeof(S) == 4 ? 2e-5 : 1e-12) << steps;
  }
  icat::LowPass<S, 2> through(S(0));
  ASSERT_EQ(through.update(to, S(0)), icat::Status::ok);
  EXPECT_EQ(through.value(), to);
}

TYPED_TEST(Loops, LowPassRefusesWhatIsNotFinite) {
  using S = TypeParam;
  icat::LowPass<S, 1> filter(S(1), icat::Vector<S, 1>(S(2)));
  EXPECT_EQ(filter.update(icat::Vector<S, 1>(S(NAN)), S(0.1)), icat::Status::non_finite);
  EXPECT_EQ(filter.update(icat::Vector<S, 1>(S(1)), S(NAN)), icat::Status::non_finite);
  EXPECT_EQ(filter.update(icat::Vector<S, 1>(S(1)), S(-1)), icat::Status::time_reversed);
  EXPECT_EQ(filter.value()(0), S(2));
}

// m ẏ = u with both poles at −ω: y = 1 − e^{−ωt} (1 − ωt) after a step of the reference.
TYPED_TEST(Loops, PiLoopHasBothPolesAtTheBandwidth) {
  using S = TypeParam;
  using V = icat::Vector<S, 2>;
  const V inertia(S(3), S(400)), omega(S(8), S(2));
  icat::PiLoop<S, 2> loop(icat::PiLoop<S, 2>::tuned(inertia, omega));
  V y = V::Zero();
  const S dt = static_cast<S>(1e-4);
  S worst(0);
  for (int k = 0; k < 20000; ++k) {
    ASSERT_EQ(loop.update(V::Ones(), y, V::Zero(), dt), icat::Status::ok);
    y += dt * loop.output().cwiseQuotient(inertia);
    for (int i = 0; i < 2; ++i) {
      const S wt = omega(i) * S(k + 1) * dt;
      worst = std::max(worst, std::abs(y(i) - (1 - std::exp(-wt) * (1 - wt))));
    }
  }
  EXPECT_LT(worst, 2e-3);  // the step, 1e-4 s, against 1/ω
}

// A constant load is taken over by the integral; with the load fed forward there is nothing to do.
TYPED_TEST(Loops, TheIntegralCarriesWhatFeedForwardDoesNot) {
  using S = TypeParam;
  using V = icat::Vector<S, 1>;
  for (const S share : {S(0), S(1)}) {
    icat::PiLoop<S, 1> loop(icat::PiLoop<S, 1>::tuned(V(S(5)), V(S(10))));
    const S load(20);
    V y = V::Zero();
    S largest(0);
    for (int k = 0; k < 4000; ++k) {
      ASSERT_EQ(loop.update(V::Zero(), y, V(share * load), S(1e-3)), icat::Status::ok);
      y(0) += S(1e-3) * (loop.output()(0) - load) / S(5);
      largest = std::max(largest, std::abs(y(0)));
    }
    EXPECT_NEAR(loop.output()(0), load, 1e-2);
    EXPECT_NEAR(loop.integral()(0), (1 - share) * load, 1e-2);
    EXPECT_EQ(largest > S(0.01), share == S(0));
  }
}

// A reference out of reach for 100 s: without anti-windup s would have grown to 100 k_i.
TYPED_TEST(Loops, TheIntegralDoesNotWindUp) {
  using S = TypeParam;
  using V = icat::Vector<S, 1>;
  for (const S sign : {S(1), S(-1)}) {
    auto options = icat::PiLoop<S, 1>::tuned(V(S(1)), V(S(5)));
    options.bound = V(S(2));
    icat::PiLoop<S, 1> loop(options);
    for (int k = 0; k < 10000; ++k) {
      ASSERT_EQ(loop.update(V(sign), V(S(0)), V(S(0)), S(0.01)), icat::Status::ok);
      ASSERT_LE(std::abs(loop.output()(0)), S(2));
    }
    EXPECT_EQ(loop.output()(0), sign * S(2));
    EXPECT_LT(std::abs(loop.integral()(0)), S(0.5));
    // So it answers at once when the error turns.
    ASSERT_EQ(loop.update(V(S(0)), V(sign * S(0.1)), V(S(0)), S(0.01)), icat::Status::ok);
    EXPECT_LT(sign * loop.output()(0), S(0));
  }
  // At the bound, but with an error that leads away from it, the integral unwinds.
  auto options = icat::PiLoop<S, 1>::tuned(V(S(1)), V(S(1)));
  options.bound = V(S(2));
  icat::PiLoop<S, 1> loop(options);
  ASSERT_EQ(loop.update(V(S(-1)), V(S(0)), V(S(10)), S(0.1)), icat::Status::ok);
  EXPECT_LT(loop.integral()(0), S(0));
}

// Other gains take over where the loop is; bad ones change nothing.
TYPED_TEST(Loops, PiLoopIsRetunedWhileItRuns) {
  using S = TypeParam;
  using V = icat::Vector<S, 1>;
  icat::PiLoop<S, 1> loop(icat::PiLoop<S, 1>::tuned(V(S(1)), V(S(1))));
  ASSERT_EQ(loop.update(V(S(1)), V(S(0)), V(S(0)), S(0.5)), icat::Status::ok);
  EXPECT_EQ(loop.integral()(0), S(0.5));
  loop.retune(icat::PiLoop<S, 1>::tuned(V(S(2)), V(S(1))));
  EXPECT_EQ(loop.integral()(0), S(0.5));
  EXPECT_EQ(loop.output()(0), S(2));
  EXPECT_THROW(loop.retune({.proportional = V(S(-1))}), std::invalid_argument);
  ASSERT_EQ(loop.update(V(S(1)), V(S(0)), V(S(0)), S(0.5)), icat::Status::ok);
  EXPECT_EQ(loop.output()(0), S(4.5));
}

TYPED_TEST(Loops, PiLoopRefusesWhatIsNotFinite) {
  using S = TypeParam;
  using V = icat::Vector<S, 1>;
  icat::PiLoop<S, 1> loop(icat::PiLoop<S, 1>::tuned(V(S(1)), V(S(5))));
  ASSERT_EQ(loop.update(V(S(1)), V(S(0)), V(S(0)), S(0.01)), icat::Status::ok);
  const V output = loop.output(), integral = loop.integral();
  EXPECT_EQ(loop.update(V(S(NAN)), V(S(0)), V(S(0)), S(0.01)), icat::Status::non_finite);
  EXPECT_EQ(loop.update(V(S(0)), V(S(INFINITY)), V(S(0)), S(0.01)), icat::Status::non_finite);
  EXPECT_EQ(loop.update(V(S(0)), V(S(0)), V(S(NAN)), S(0.01)), icat::Status::non_finite);
  EXPECT_EQ(loop.update(V(S(1)), V(S(0)), V(S(0)), S(NAN)), icat::Status::non_finite);
  EXPECT_EQ(loop.output(), output);
  EXPECT_EQ(loop.integral(), integral);
}

TEST(SampledFeedback, IsTakenInEverySlotAndHeldBetween) {
  for (const double rate : {10.0, 100.0}) {
    icat::SampleHold<double> feedback(rate, -1.0);
    const int steps = static_cast<int>(2000 / rate);
    double time = 0;  // a sum of steps, with its rounding
    for (int k = 0; k < 20000; ++k, time += 0.0005) {
      ASSERT_EQ(feedback.update(time, k), k / steps * steps) << k;
    }
  }
  icat::SampleHold<double> feedback(10, -1.0);
  EXPECT_EQ(feedback.update(NAN, 7), -1);
  EXPECT_EQ(feedback.update(0.25, 7), 7);  // a slot that nobody was there for
}

TEST(LoopsAllocate, Nothing) {
#ifdef ICAT_TEST_NO_MALLOC_COUNT
  GTEST_SKIP() << "malloc belongs to the sanitizer";
#endif
  using V = icat::Vector<double, 13>;
  icat::PiLoop<double, 13> loop(icat::PiLoop<double, 13>::tuned(V::Ones(), V::Ones()));
  icat::LowPass<double, 13> filter(1);
  icat::SampleHold<V> feedback(10, V::Zero());
  bool ok = true;
  EXPECT_EQ(count_allocations([&] {
              ok = loop.update(V::Ones(), feedback.update(1, V::Ones()), V::Ones(), 0.1) ==
                       icat::Status::ok &&
                   filter.update(loop.output(), 0.1) == icat::Status::ok;
            }),
            0);
  EXPECT_TRUE(ok);
}

template <class F>
std::string message_of(F&& f) {
  try {
    f();
  } catch (const std::invalid_argument& e) {
    return e.what();
  }
  return "no exception";
}

TEST(LoopErrors, ConfigurationThrowsWithNamesAndNumbers) {
  using Loop = icat::PiLoop<double, 2>;
  EXPECT_EQ(message_of([] {
              Loop({.proportional = {1, -2}});
            }),
            "PiLoop: proportional gain 1 must be finite and >= 0, got -2");
  EXPECT_EQ(message_of([] {
              Loop({.integral = {INFINITY, 0}});
            }),
            "PiLoop: integral gain 0 must be finite and >= 0, got inf");
  EXPECT_EQ(message_of([] { Loop({.bound = {1, -1}}); }), "PiLoop: bound 1 must be >= 0, got -1");
  EXPECT_EQ(message_of([] { icat::LowPass<double, 1>(-1); }),
            "LowPass: time_constant must be finite and >= 0, got -1");
  EXPECT_EQ(message_of([] { icat::LowPass<double, 1>(1, icat::Vector<double, 1>(NAN)); }),
            "LowPass: the initial value is not finite");
  EXPECT_EQ(message_of([] { icat::SampleHold<int>(0, 1); }),
            "SampleHold: rate must be finite and > 0, got 0");
}

}  // namespace
