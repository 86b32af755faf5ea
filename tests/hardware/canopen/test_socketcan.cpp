// SPDX-License-Identifier: BSD-3-Clause
// A CAN socket on one end of a SOCK_SEQPACKET pair that carries struct can_frame.
#include <gtest/gtest.h>
#include <net/if.h>

#include "icat/adapters/socketcan.hpp"
#include "tests/support/allocation_counter.hpp"

namespace {

using icat::CanFrame;
using icat::CanStatus;
using icat::SocketCan;

class SocketPair : public testing::Test {
 protected:
  ~SocketPair() override { ::close(far_); }
  void put(const can_frame& raw, std::size_t size = sizeof(can_frame)) {
    ASSERT_EQ(::send(far_, &raw, size, 0), static_cast<ssize_t>(size));
  }
  can_frame get() {
    can_frame raw{};
    EXPECT_EQ(::recv(far_, &raw, sizeof raw, MSG_DONTWAIT), static_cast<ssize_t>(sizeof raw));
    return raw;
  }
  int far_{-1};
  SocketCan can_ = SocketCan::from_descriptor(open_pair());

 private:
  int open_pair() {
    int ends[2];
    if (::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends) != 0) std::abort();
    far_ = ends[1];
    return ends[0];
  }
};

TEST_F(SocketPair, FramesGoThrough) {
  for (const CanFrame& f :
       {CanFrame{0x7ff, 8, {1, 2, 3, 4, 5, 6, 7, 255}}, CanFrame{0, 0, {}},
        CanFrame{0x1fffffff, 3, {9, 8, 7}, true}, CanFrame{0x123, 4, {}, false, true}}) {
    ASSERT_EQ(can_.send(f), CanStatus::ok);
    const can_frame raw = get();
    EXPECT_EQ(raw.can_id & CAN_EFF_MASK, f.id);
    EXPECT_EQ((raw.can_id & CAN_EFF_FLAG) != 0, f.extended);
    EXPECT_EQ((raw.can_id & CAN_RTR_FLAG) != 0, f.remote);
    EXPECT_EQ(raw.can_dlc, f.size);
    put(raw);
    CanFrame back;
    ASSERT_EQ(can_.receive(back), CanStatus::ok);
    EXPECT_EQ(back, f);
  }
  EXPECT_EQ(can_.send({0x800, 0, {}}), CanStatus::malformed);
  EXPECT_EQ(can_.send({0x20000000, 0, {}, true}), CanStatus::malformed);
  EXPECT_EQ(can_.send({1, 9, {}}), CanStatus::malformed);
  EXPECT_EQ(::recv(far_, nullptr, 0, MSG_DONTWAIT), -1) << "nothing of these went out";
}

TEST_F(SocketPair, WhatIsNoFrameLeavesTheLast) {
  const CanFrame before{5, 2, {1, 2}};
  CanFrame frame = before;
  EXPECT_EQ(can_.receive(frame), CanStatus::empty);
  can_frame raw{};
  raw.can_id = 7;
  raw.can_dlc = 9;
  put(raw);
  EXPECT_EQ(can_.receive(frame), CanStatus::malformed);
  raw.can_dlc = 1;
  put(raw, 15);
  EXPECT_EQ(can_.receive(frame), CanStatus::malformed);
  const canfd_frame longer{};  // CAN FD
  ASSERT_EQ(::send(far_, &longer, sizeof longer, 0), static_cast<ssize_t>(sizeof longer));
  EXPECT_EQ(can_.receive(frame), CanStatus::malformed);
  EXPECT_EQ(frame, before);
  raw.data[3] = 77;  // beyond its size
  put(raw);
  ASSERT_EQ(can_.receive(frame), CanStatus::ok);
  EXPECT_EQ(frame, (CanFrame{7, 1, {}}));
}

TEST_F(SocketPair, ErrorFramesAreCounted) {
  CanFrame frame;
  can_frame raw{};
  raw.can_dlc = 8;
  raw.can_id = CAN_ERR_FLAG | CAN_ERR_BUSOFF;
  put(raw);
  EXPECT_EQ(can_.receive(frame), CanStatus::error);
  EXPECT_TRUE(can_.errors().off);
  raw.can_id = CAN_ERR_FLAG | CAN_ERR_RESTARTED | CAN_ERR_ACK;
  put(raw);
  EXPECT_EQ(can_.receive(frame), CanStatus::error);
  EXPECT_FALSE(can_.errors().off);
  raw.can_id = CAN_ERR_FLAG | CAN_ERR_CRTL;
  raw.data[1] = CAN_ERR_CRTL_TX_PASSIVE | CAN_ERR_CRTL_RX_OVERFLOW;
  put(raw);
  raw = can_frame{};
  raw.can_id = 3;
  put(raw);
  int taken = 0;
  EXPECT_EQ(can_.receive_all([&](const CanFrame& f) { taken += f.id == 3; }), CanStatus::ok);
  EXPECT_EQ(taken, 1);
  EXPECT_EQ(can_.errors().frames, 3u);
  EXPECT_EQ(can_.errors().bus_off, 1u);
  EXPECT_EQ(can_.errors().restarted, 1u);
  EXPECT_EQ(can_.errors().unacknowledged, 1u);
  EXPECT_EQ(can_.errors().passive, 1u);
  EXPECT_EQ(can_.errors().lost, 1u);
}

TEST_F(SocketPair, AFullQueueIsAStatus) {
  int sent = 0;
  CanStatus status = CanStatus::ok;
  EXPECT_EQ(count_allocations([&] {
              while ((status = can_.send({1, 0, {}})) == CanStatus::ok && sent < 100000) ++sent;
            }),
            0);
  EXPECT_EQ(status, CanStatus::full);
  EXPECT_GT(sent, 0);
  get();
  EXPECT_EQ(can_.send({2, 0, {}}), CanStatus::ok);
}

TEST_F(SocketPair, ABusyBusDoesNotHoldTheLoop) {
  can_frame raw{};
  for (int k = 0; k < 20; ++k) put(raw);
  int taken = 0;
  EXPECT_EQ(can_.receive_all([&](const CanFrame&) { ++taken; }, 12), CanStatus::full);
  EXPECT_EQ(taken, 12);
  EXPECT_EQ(can_.receive_all([&](const CanFrame&) { ++taken; }, 12), CanStatus::ok);
  EXPECT_EQ(taken, 20);
}

TEST_F(SocketPair, ALineThatIsGoneIsDown) {
  ::close(far_);
  far_ = -1;
  CanFrame frame;
  EXPECT_EQ(can_.receive(frame), CanStatus::down);
  EXPECT_EQ(can_.send(frame), CanStatus::down);
  EXPECT_EQ(can_.last_error(), EPIPE);
  SocketCan other = std::move(can_);
  EXPECT_EQ(can_.send(frame), CanStatus::down);
  EXPECT_GE(other.descriptor(), 0);
}

TEST(SocketCan, RefusesWithTheReason) {
  for (const char* name : {"", "nosuchcan0", "a name that is longer than an interface may have"}) {
    try {
      SocketCan can(name);
      ADD_FAILURE() << name;
    } catch (const std::invalid_argument& e) {
      EXPECT_NE(std::string(e.what()).find("CAN interface '" + std::string(name)),
                std::string::npos);
    }
  }
  EXPECT_THROW(SocketCan::from_descriptor(-1), std::invalid_argument);
}

}  // namespace
