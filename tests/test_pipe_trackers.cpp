// SPDX-License-Identifier: BSD-3-Clause
// Lines followed in the image, frames followed on the vehicle.
#include <gtest/gtest.h>

#include <icat/perception/frame_tracker.hpp>
#include <icat/perception/line_tracker.hpp>
#include <icat/perception/pose_history.hpp>

#include "support/allocation_counter.hpp"
#include "support/pipes.hpp"
#include "support/states.hpp"

namespace {

using icat::Status;
using testing_support::make_pose;
using Vector3 = icat::Vector3<double>;
using Pose = icat::Pose<double>;
using Line = icat::ContourLine<double>;
using Measurement = icat::CylinderMeasurement<double>;

const auto rig = icat::parallel_cameras<double>();

// ---- Lines

constexpr double middle_u = 1292 / 2.0, middle_v = 964 / 2.0;
/// `offset` px from the middle of the image.
Line line_at(double theta, double offset, int camera = 0) {
  Line l;
  l.camera = camera;
  l.theta = std::remainder(theta, 2 * std::numbers::pi);
  l.rho = offset + std::cos(theta) * middle_u + std::sin(theta) * middle_v;
  return l;
}
using Lines = std::vector<Line>;

TEST(LineTracker, BirthLifeAndDeath) {
  icat::LineTracker<double> tracker(rig, 0, icat::ContourKind::edge);
  const Lines seen{line_at(1, 50)}, none{};
  EXPECT_EQ(tracker.step(0.1, seen), 0);
  EXPECT_EQ(tracker.step(0.1, seen), 0);
  EXPECT_EQ(tracker.step(0.1, none), -1);  // not three in a row
  for (int k = 0; k < 3; ++k) {
    EXPECT_FALSE(tracker.alive());
    EXPECT_EQ(tracker.step(0.1, seen), 0);
  }
  EXPECT_TRUE(tracker.alive());
  for (int k = 0; k < 40; ++k) EXPECT_EQ(tracker.step(0.1, seen), 0);
  EXPECT_EQ(tracker.life(), 15);
  for (int k = 0; k < 14; ++k) {
    tracker.step(0.1, none);
    EXPECT_TRUE(tracker.alive());
    EXPECT_NEAR(tracker.line().rho, seen[0].rho, 1e-9);
  }
  tracker.step(0.1, none);
  EXPECT_FALSE(tracker.alive());
}

// A line that turns and moves steadily is followed without a lag, also through ±π: the error of an
// α-β filter falls by its slower root, 0.84 in each step here, 100 steps.
TEST(LineTracker, FollowsAndCoasts) {
  icat::LineTracker<double> tracker(rig, 0, icat::ContourKind::edge);
  const auto truth = [](int k) { return line_at(2.9 + 0.01 * k, 3.0 * k - 100); };
  for (int k = 0; k < 100; ++k) ASSERT_EQ(tracker.step(0.1, Lines{truth(k)}), 0) << k;
  for (int k = 100; k < 110; ++k) {
    ASSERT_EQ(tracker.step(0.1, Lines{}), -1);
    EXPECT_LT(std::abs(std::remainder(tracker.line().theta - truth(k).theta, 6.283185307)), 1e-5);
    EXPECT_NEAR(tracker.line().rho, truth(k).rho, 1e-2);
  }
}

TEST(LineTracker, GatesAndChoice) {
  icat::LineTracker<double> tracker(rig, 0, icat::ContourKind::edge);
  for (int k = 0; k < 5; ++k) tracker.step(0.1, Lines{line_at(0.5, 10)});
  Line end = line_at(0.5, 10);
  end.kind = icat::ContourKind::end;
  Line none = line_at(0.5, 10);
  none.rho = NAN;
  const double pi = std::numbers::pi;
  // Another camera, another kind, NaN, the other side of a pipe, too far, too oblique: none of
  // them.
  EXPECT_EQ(tracker.step(0.1, Lines{line_at(0.5, 10, 1), end, none, line_at(0.5 + pi, -10),
                                    line_at(0.5, 111), line_at(0.81, 10)}),
            -1);
  EXPECT_NEAR(tracker.line().rho, line_at(0.5, 10).rho, 1e-9);
  EXPECT_EQ(tracker.step(0.1, Lines{line_at(0.5, 60), line_at(0.5, 12), line_at(0.5, -40)}), 1);
  EXPECT_EQ(tracker.step(0.1, Lines{line_at(0.5, 60), line_at(0.5, 12), line_at(0.5, -70)}, 1), 0);
  const int life = tracker.life();
  for (const double dt : {double(NAN), -0.1, HUGE_VAL}) {
    EXPECT_EQ(tracker.step(dt, Lines{line_at(0.5, 12)}), -1);
  }
  EXPECT_EQ(tracker.life(), life - 3);
  // No time between two pictures: no rate, nothing infinite.
  EXPECT_EQ(tracker.step(0, Lines{line_at(0.5, 40)}), 0);
  EXPECT_EQ(tracker.step(0.1, Lines{line_at(0.5, 40)}), 0);
  EXPECT_TRUE(std::isfinite(tracker.line().rho + tracker.line().theta));
  // Finite, and no place in an image: no line of a tracker that is dead, either.
  icat::LineTracker<double> other(rig, 0, icat::ContourKind::edge);
  Line far = line_at(0.5, 10);
  for (int k = 0; k < 5; ++k) {
    far.rho = k % 2 ? 1e308 : -1e308;
    EXPECT_EQ(other.step(0.1, Lines{far}), -1);
  }
  EXPECT_FALSE(other.alive());
  const auto bad = [](icat::LineTracker<double>::Options o, int camera = 0) {
    EXPECT_THROW(icat::LineTracker<double>(rig, camera, icat::ContourKind::edge, o),
                 std::invalid_argument);
  };
  bad({.alpha = 0}), bad({.alpha = 1.1}), bad({.beta = -1}), bad({.beta = 3}), bad({.gate = 0});
  bad({.angle_gate = 4}), bad({.born = 0}), bad({.lives = 2}), bad({}, 2);
}

// ---- Frames

/// Looks down from the front of the vehicle.
const Pose mount = make_pose<double>(0.45, 0, 0.35, 0, 0, 0);

Measurement seen_from(const Pose& vehicle, const Pose& pipe, bool end_seen = true) {
  Measurement m;
  m.frame = mount.inverse() * vehicle.inverse() * pipe;
  m.end_seen = end_seen;
  return m;
}
/// ⟨o⟩ in ⟨0⟩: on the floor, its direction towards −x of the vehicle.
const Pose pipe = make_pose<double>(2, 1, 4, 0, 0, 2);
const Pose start = make_pose<double>(1.5, 1, 1.8, 0.02, -0.03, 0.4);

double distance(const Pose& a, const Pose& b) { return (a.translation() - b.translation()).norm(); }

using Tracker = icat::FrameTracker<double>;
Tracker tracking() {
  Tracker tracker(mount);
  EXPECT_EQ(tracker.predict(start), Status::ok);
  for (int k = 0; k < 3; ++k) EXPECT_EQ(tracker.update(seen_from(start, pipe), start), Status::ok);
  return tracker;
}

// A second without a picture while the vehicle turns by 20 degrees and goes 10 cm, by a navigation
// that is off by 1 cm/s and 0.2 deg/s: 1 cm and, 2.3 m away, 8 mm. Asked are 3 cm. Without the
// prediction it would be 0.5 m × 20 degrees and 10 cm.
TEST(FrameTracker, DropOutWhileTheVehicleTurns) {
  Tracker tracker = tracking();
  Pose vehicle = start, believed = start;
  const auto move = [](double forward, double yaw) {
    icat::Vector6<double> v = icat::Filled{0};
    v(0) = forward, v(5) = yaw;
    return v;
  };
  for (int k = 1; k <= 100; ++k) {
    vehicle = icat::integrate<double>(vehicle, move(0.1, 0.349), 0.01);
    believed = icat::integrate<double>(believed, move(0.11, 0.3525), 0.01);
    ASSERT_EQ(tracker.predict(believed), Status::ok);
    if (k % 10 == 0) tracker.miss();
  }
  const Pose truth = vehicle.inverse() * pipe;
  EXPECT_TRUE(tracker.valid());
  EXPECT_EQ(tracker.misses(), 10);
  std::printf("after the drop-out: %.1f mm\n", 1e3 * distance(tracker.frame(), truth));
  EXPECT_LT(distance(tracker.frame(), truth), 0.03);
  EXPECT_GT(distance(start.inverse() * pipe, truth), 0.15);
  // The next picture is within the gates, and draws it nearer by 0.6.
  const double before = distance(tracker.frame(), truth);
  EXPECT_EQ(tracker.update(seen_from(vehicle, pipe), believed), Status::ok);
  EXPECT_NEAR(distance(tracker.frame(), truth), 0.4 * before, 1e-9);
}

TEST(FrameTracker, OutliersAreRejectedAndMoveNothing) {
  Tracker tracker = tracking();
  const Pose before = tracker.frame();
  Pose far = pipe, turned = pipe;
  far.translation() += Vector3(0.9, 1.2, 0);  // 1.5 m
  turned.linear() = icat::rotation_exp<double>(Vector3(0, 0, 0.4)) * pipe.linear();
  EXPECT_EQ(tracker.update(seen_from(start, far), start), Status::outlier);
  EXPECT_EQ(tracker.update(seen_from(start, turned), start), Status::outlier);
  Measurement near = seen_from(start, pipe);
  near.frame.translation() = Vector3(0, 0, 0.4);
  EXPECT_EQ(tracker.update(near, start), Status::outlier);
  Measurement none = seen_from(start, pipe);
  none.frame.translation()(0) = NAN;
  EXPECT_EQ(tracker.update(none, start), Status::non_finite);
  none = seen_from(start, pipe);
  none.frame.linear() *= 1.1;
  EXPECT_EQ(tracker.update(none, start), Status::not_a_rotation);
  EXPECT_EQ(tracker.update(seen_from(start, pipe), none.frame), Status::not_a_rotation);
  EXPECT_EQ(tracker.frame().matrix(), before.matrix());
  EXPECT_EQ(tracker.misses(), 6);
  EXPECT_EQ(tracker.update(seen_from(start, pipe), start), Status::ok);
  EXPECT_EQ(tracker.misses(), 0);
  // No gate for ever: what is elsewhere steadily is believed when the old place is given up.
  int pictures = 0;
  while (distance(tracker.frame(), start.inverse() * far) > 0.01 && pictures < 100) {
    (void)tracker.update(seen_from(start, far), start);
    ++pictures;
  }
  EXPECT_EQ(pictures, 32);  // 31 misses, and the first hit
  EXPECT_FALSE(tracker.valid());
  EXPECT_EQ(tracker.update(seen_from(start, far), start), Status::ok);
  EXPECT_TRUE(tracker.valid());
}

TEST(FrameTracker, BirthNeedsTwoThatAgree) {
  Tracker tracker(mount);
  EXPECT_EQ(tracker.update(seen_from(start, pipe), start), Status::not_started);
  ASSERT_EQ(tracker.predict(start), Status::ok);
  EXPECT_EQ(tracker.update(seen_from(start, pipe, false), start), Status::not_measured);
  Pose other = pipe;
  for (int k = 0; k < 5; ++k) {  // a frame that is elsewhere each time is never valid
    other.translation()(0) += k % 2 == 0 ? 0.8 : -0.8;
    const Status expected = k == 0 ? Status::ok : Status::outlier;
    EXPECT_EQ(tracker.update(seen_from(start, other), start), expected);
    EXPECT_FALSE(tracker.valid());
  }
  EXPECT_EQ(tracker.update(seen_from(start, other), start), Status::ok);
  EXPECT_TRUE(tracker.valid());
  Tracker apart(mount);
  ASSERT_EQ(apart.predict(start), Status::ok);
  EXPECT_EQ(apart.update(seen_from(start, pipe), start), Status::ok);
  apart.miss();
  EXPECT_EQ(apart.update(seen_from(start, pipe), start), Status::ok);
  EXPECT_FALSE(apart.valid());  // not two in a row
}

// With twice the deviation that is trusted a measurement counts a quarter.
TEST(FrameTracker, BadMeasurementsCountLess) {
  Tracker tracker = tracking();
  Pose moved = pipe;
  moved.translation()(2) += 0.1;
  moved.linear() = icat::rotation_exp<double>(Vector3(0, 0, 0.1)) * pipe.linear();
  Measurement seen = seen_from(start, moved);
  seen.covariance(1, 1) = HUGE_VAL;  // along the axis nothing is asked
  seen.covariance(2, 2) = 0.04 * 0.04;
  seen.covariance(5, 5) = 0.06 * 0.06;
  ASSERT_EQ(tracker.update(seen, start), Status::ok);
  const Pose now = start * tracker.frame();
  EXPECT_NEAR((now.translation() - pipe.translation()).norm(), 0.1 * 0.6 / 4, 1e-9);
  const icat::Matrix3<double> turn = now.linear() * pipe.linear().transpose();
  EXPECT_NEAR(icat::rotation_log<double>(turn)(2), 0.1 * 0.6 / 9, 1e-9);
  seen.covariance(2, 2) = NAN;
  EXPECT_EQ(tracker.update(seen, start), Status::non_finite);
  seen.covariance(0, 0) = seen.covariance(2, 2) = -1;  // would push the frame away
  EXPECT_EQ(tracker.update(seen, start), Status::out_of_range);
  // Two places that are finite, and their difference is not.
  const Pose before = tracker.frame();
  for (const double x : {1e308, -1e308}) {
    Pose far = start;
    far.translation()(0) = x;
    EXPECT_EQ(tracker.predict(far), Status::implausible);
  }
  EXPECT_EQ(tracker.frame().matrix(), before.matrix());
}

// Without an end the frame goes to the measured axis by k, and stays where it is along it.
TEST(FrameTracker, WithoutAnEndItMovesAcrossTheAxisAlone) {
  Tracker tracker = tracking();
  const Vector3 axis = pipe.linear().col(1);
  Pose seen = pipe;
  seen.translation() += 0.8 * axis + Vector3(0, 0, 0.1);  // further along than the gate
  EXPECT_EQ(tracker.update(seen_from(start, seen), start), Status::outlier);
  EXPECT_EQ(tracker.update(seen_from(start, seen, false), start), Status::ok);
  const Vector3 moved = (start * tracker.frame()).translation() - pipe.translation();
  EXPECT_LT((moved - Vector3(0, 0, 0.06)).norm(), 1e-9);
}

// A pipe has no front: the frame that was seen first stays, and turns with the vehicle.
TEST(FrameTracker, HalfATurnIsTheSamePipe) {
  Tracker tracker = tracking();
  const Pose before = tracker.frame();
  const Pose turned = pipe * make_pose<double>(0, 0, 0, 0, 0, std::numbers::pi);
  EXPECT_EQ(tracker.update(seen_from(start, turned), start), Status::ok);
  EXPECT_LT((tracker.frame().matrix() - before.matrix()).norm(), 1e-9);
}

// A picture that comes 0.1 s late is brought to now; without a position only the turn counts.
TEST(FrameTracker, LatePicturesAndUnknownPositions) {
  Tracker tracker = tracking();
  const Pose now = start * make_pose<double>(0.05, 0.02, 0, 0, 0, 0.1);
  ASSERT_EQ(tracker.predict(now), Status::ok);
  ASSERT_EQ(tracker.update(seen_from(start, pipe), start), Status::ok);
  EXPECT_LT(distance(tracker.frame(), now.inverse() * pipe), 1e-9);
  // A rotation that is as bad as may be does not add up.
  Pose rough = now;
  rough.linear() *= 1.0002;
  for (int k = 0; k < 1000; ++k) ASSERT_EQ(tracker.predict(rough), Status::ok);
  EXPECT_LT(distance(tracker.frame(), now.inverse() * pipe), 1e-4);  // once, not a thousand times
  Pose lost = start * make_pose<double>(0, 0, 0, 0, 0, 0.3);
  Tracker turning = tracking();
  const Pose right = lost.inverse() * pipe;
  lost.translation() = Vector3(50, 0, 0);
  ASSERT_EQ(turning.predict(lost, false), Status::ok);
  EXPECT_LT(distance(turning.frame(), right), 1e-9);
  Pose none = start;
  none.translation()(2) = NAN;
  EXPECT_EQ(turning.predict(none), Status::non_finite);
  none = start;
  none.linear() *= 2;
  EXPECT_EQ(turning.predict(none), Status::not_a_rotation);
  EXPECT_LT(distance(turning.frame(), right), 1e-9);
}

// ᵛT_g = ᵛT_c ᶜT_o ᵒT_g, ᶜp_l = ᶜT_o ᵒp_l.
TEST(FrameTracker, GoalFrames) {
  Tracker tracker = tracking();
  const Pose on_pipe = make_pose<double>(0, 0.1, -0.05, 0, 0.6, 0);
  const Pose in_camera = seen_from(start, pipe).frame;
  const Pose goal = icat::grasp_in_vehicle<double>(mount, in_camera, on_pipe);
  EXPECT_LT((goal.matrix() - (start.inverse() * pipe * on_pipe).matrix()).norm(), 1e-12);
  EXPECT_LT((tracker.grasp(on_pipe).matrix() - goal.matrix()).norm(), 1e-9);
  const Vector3 end(0, -0.5, 0);
  EXPECT_LT((tracker.point_in_camera(end) - in_camera * end).norm(), 1e-9);
  EXPECT_EQ(count_allocations([&] {
              for (int k = 0; k < 10; ++k) {
                (void)tracker.predict(start);
                (void)tracker.update(seen_from(start, pipe), start);
                (void)tracker.grasp(on_pipe);
              }
            }),
            0);
  const auto bad = [](Tracker::Options o) {
    EXPECT_THROW(Tracker(mount, o), std::invalid_argument);
  };
  bad({.gain = 0}), bad({.gain = 1.1}), bad({.nearest = -1}), bad({.furthest = 0.4});
  bad({.max_jump = NAN}), bad({.max_turn = 1.6}), bad({.hits = 0}), bad({.misses = 0});
  bad({.trusted = 0}), bad({.trusted_tilt = NAN});
}

// ---- Where the vehicle was

TEST(PoseHistory, IsThePoseOfThen) {
  const auto truth = [](double t) { return make_pose<double>(0.2 * t, 1, 0, 0, 0, 0.5 * t); };
  icat::PoseHistory<double> history;
  Pose p = start;
  EXPECT_EQ(history.at(0, p), Status::not_started);
  for (const double clock : {50.0, 20.0}) {  // a clock that goes back begins anew
    for (int k = 0; k <= 100; ++k) {
      ASSERT_EQ(history.record(clock + 0.01 * k, truth(0.01 * k)), Status::ok);
    }
    for (const double age : {0.0, 0.003, 0.1, 0.256, 0.49}) {
      ASSERT_EQ(history.at(clock + 1 - age, p), Status::ok);
      EXPECT_LT((p.matrix() - truth(1 - age).matrix()).norm(), 1e-6);  // of an arc by chords
    }
  }
  EXPECT_EQ(history.at(20.4, p), Status::late_measurement);
  EXPECT_EQ(history.at(21.1, p), Status::time_reversed);
  EXPECT_EQ(history.at(NAN, p), Status::non_finite);
  EXPECT_EQ(history.record(NAN, start), Status::non_finite);
  Pose none = start;
  none.linear() *= 2;
  EXPECT_EQ(history.record(22, none), Status::not_a_rotation);
  EXPECT_EQ(history.at(21, p), Status::ok);
  ASSERT_EQ(history.record(5, start), Status::ok);
  EXPECT_EQ(history.at(4.9, p), Status::late_measurement);
  EXPECT_EQ(history.at(5, p), Status::ok);
}

}  // namespace
