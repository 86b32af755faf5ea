// SPDX-License-Identifier: BSD-3-Clause
// Frames, transfers, mappings, and the arm of drives in virtual time.
#include <gtest/gtest.h>

#include <random>
#include <string>

#include "tests/hardware/canopen/model_drives.hpp"
#include "tests/support/allocation_counter.hpp"

namespace {

using namespace icat::canopen;
using icat::CanFrame;
using icat::Status;

// A frame of 11 bits as a text of bits, the checksum by long division, then stuffed.
int bits_by_hand(const CanFrame& f) {
  std::string bits = "0";
  const auto put = [&](unsigned value, int count) {
    while (count-- > 0) bits += value >> count & 1 ? '1' : '0';
  };
  put(f.id, 11);
  put(0, 3);
  put(f.size, 4);
  for (unsigned i = 0; i < f.size; ++i) put(f.data[i], 8);
  std::string rest = bits + std::string(15, '0');
  const std::string divisor = "1100010110011001";  // x^15+x^14+x^10+x^8+x^7+x^4+x^3+1
  for (std::size_t i = 0; i < bits.size(); ++i) {
    if (rest[i] == '0') continue;
    for (std::size_t k = 0; k < divisor.size(); ++k) {
      rest[i + k] = rest[i + k] == divisor[k] ? '0' : '1';
    }
  }
  bits += rest.substr(bits.size());
  std::string stuffed;
  for (const char bit : bits) {
    stuffed += bit;
    if (stuffed.size() >= 5 && stuffed.substr(stuffed.size() - 5) == std::string(5, bit)) {
      stuffed += bit == '0' ? '1' : '0';
    }
  }
  return static_cast<int>(stuffed.size()) + 13;
}

TEST(CanFrame, BitsOnTheWire) {
  EXPECT_EQ(icat::worst_case_bits(8), 135);  // 111 and 24 stuffed: the figure of the literature
  EXPECT_EQ(icat::worst_case_bits(0), 55);
  EXPECT_EQ(icat::worst_case_bits(8, true), 160);
  std::mt19937 random(1);
  int largest = 0;
  for (int k = 0; k < 20000; ++k) {
    CanFrame f{
        static_cast<std::uint32_t>(random() & 0x7ff), static_cast<std::uint8_t>(random() % 9), {}};
    for (unsigned i = 0; i < f.size; ++i) {
      f.data[i] = static_cast<std::uint8_t>(k % 3 ? random() : random() % 2 ? 0 : 255);
    }
    ASSERT_EQ(icat::bits_on_wire(f), bits_by_hand(f)) << k;
    ASSERT_LE(icat::bits_on_wire(f), icat::worst_case_bits(f.size));
    ASSERT_GE(icat::bits_on_wire(f), 47 + 8 * f.size);
    if (f.size == 8) largest = std::max(largest, icat::bits_on_wire(f));
    CanFrame e = f;
    e.extended = true;
    ASSERT_LE(icat::bits_on_wire(e), icat::worst_case_bits(f.size, true));
  }
  EXPECT_GT(largest, 125);
}

TEST(Canopen, FramesAreThoseOfTheStandard) {
  EXPECT_EQ(nmt_frame(NmtCommand::start, 5), (CanFrame{0, 2, {1, 5}}));
  EXPECT_EQ(sync_frame(), (CanFrame{0x80, 0, {}}));
  EXPECT_EQ(heartbeat_frame(3, NmtState::operational), (CanFrame{0x703, 1, {5}}));
  NmtState state{};
  EXPECT_TRUE(decode_heartbeat({0x703, 1, {127}}, 3, state));
  EXPECT_EQ(state, NmtState::pre_operational);
  for (const CanFrame& f :
       {CanFrame{0x704, 1, {5}}, CanFrame{0x703, 2, {5}}, CanFrame{0x703, 0, {}},
        CanFrame{0x703, 1, {6}}, CanFrame{0x703, 1, {0x85}}, CanFrame{0x703, 1, {5}, true},
        CanFrame{0x703, 1, {5}, false, true}}) {
    EXPECT_FALSE(decode_heartbeat(f, 3, state));
  }
  EXPECT_EQ(state, NmtState::pre_operational);
  const Emergency e{0x8130, 0x11, {1, 2, 3, 4, 5}};
  Emergency back;
  ASSERT_TRUE(decode_emergency(emergency_frame(9, e), 9, back));
  EXPECT_EQ(back.code, 0x8130);
  EXPECT_EQ(back.error_register, 0x11);
  EXPECT_EQ(back.detail, e.detail);
  EXPECT_FALSE(decode_emergency(sync_frame(), 9, back));
  EXPECT_FALSE(decode_emergency({0x89, 7, {}}, 9, back));
}

TEST(Canopen, MappingGoesRoundAtTheExtremes) {
  const PdoMapping mapping{{0x6041, 0, 16}, {0x6064, 0, 32}, {0x6078, 0, 16}};
  EXPECT_EQ(mapping.bytes(), 8);
  for (const std::int64_t position : {-2147483648LL, -1LL, 0LL, 1LL, 2147483647LL}) {
    for (const std::int64_t current : {-32768LL, -1LL, 0LL, 32767LL}) {
      for (const std::int64_t status : {0LL, 0x1237LL, 0xffffLL}) {
        CanFrame f{0x181, 8, {}};
        mapping.put(f, 0, status);
        mapping.put(f, 1, position);
        mapping.put(f, 2, current);
        EXPECT_EQ(mapping.get_unsigned(f, 0), static_cast<std::uint64_t>(status));
        EXPECT_EQ(mapping.get_signed(f, 1), position);
        EXPECT_EQ(mapping.get_signed(f, 2), current);
      }
    }
  }
  CanFrame f{0x181, 8, {}};
  mapping.put(f, 1, 0x04030201);
  EXPECT_EQ(f.data, (std::array<std::uint8_t, 8>{0, 0, 1, 2, 3, 4, 0, 0}));
  const PdoMapping whole{{0x2000, 1, 64}};
  for (const std::int64_t value : {INT64_MIN, std::int64_t{-1}, INT64_MAX}) {
    whole.put(f, 0, value);
    EXPECT_EQ(whole.get_signed(f, 0), value);
  }
  EXPECT_THROW(PdoMapping({{0x6041, 0, 12}}), std::invalid_argument);
  EXPECT_THROW(PdoMapping({{0x6041, 0, 64}, {0x6041, 0, 8}}), std::invalid_argument);
  EXPECT_THROW(PdoMapping({}), std::invalid_argument);
}

// The frames of an SDO client, and answers to them.
struct Transfer {
  SdoClient client{5, 0.5, 32};
  CanFrame out;
  bool next() {
    bool some = false;
    client.send([&](const CanFrame& f) { return out = f, some = true; });
    return some;
  }
  void answer(std::initializer_list<std::uint8_t> bytes, double now = 0) {
    CanFrame f{0x585, 8, {}};
    std::copy(bytes.begin(), bytes.end(), f.data.begin());
    client.receive(f, now);
  }
};

TEST(Sdo, Expedited) {
  Transfer t;
  ASSERT_TRUE(t.client.download(0x6060, 0, 3, 1, 0));
  EXPECT_FALSE(t.client.download(0x6060, 0, 3, 1, 0)) << "one at a time";
  ASSERT_TRUE(t.next());
  EXPECT_EQ(t.out, (CanFrame{0x605, 8, {0x2f, 0x60, 0x60, 0, 3}}));
  EXPECT_FALSE(t.next());
  t.answer({0x60, 0x60, 0x60, 1});  // another subindex: of another transfer
  t.answer({0x60, 0x61, 0x60, 0});
  t.answer({0x43, 0x60, 0x60, 0});
  EXPECT_EQ(t.client.state(), SdoState::busy);
  t.answer({0x60, 0x60, 0x60, 0});
  EXPECT_EQ(t.client.state(), SdoState::done);
  for (int bytes = 1; bytes <= 4; ++bytes) {
    ASSERT_TRUE(t.client.upload(0x6041, 0, 0));
    ASSERT_TRUE(t.next());
    EXPECT_EQ(t.out, (CanFrame{0x605, 8, {0x40, 0x41, 0x60, 0}}));
    t.answer({static_cast<std::uint8_t>(0x43 | (4 - bytes) << 2), 0x41, 0x60, 0, 1, 2, 3, 4});
    ASSERT_EQ(t.client.state(), SdoState::done);
    EXPECT_EQ(t.client.data().size(), static_cast<std::size_t>(bytes));
    EXPECT_EQ(t.client.value(), 0x04030201u & (0xffffffffu >> (32 - 8 * bytes)));
  }
}

TEST(Sdo, Segmented) {
  Transfer t;
  const std::array<std::uint8_t, 16> bytes{1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16};
  ASSERT_TRUE(t.client.download(0x2001, 2, bytes, 0));
  ASSERT_TRUE(t.next());
  EXPECT_EQ(t.out, (CanFrame{0x605, 8, {0x21, 0x01, 0x20, 2, 16}}));
  t.answer({0x60, 0x01, 0x20, 2});
  ASSERT_TRUE(t.next());
  EXPECT_EQ(t.out, (CanFrame{0x605, 8, {0x00, 1, 2, 3, 4, 5, 6, 7}}));
  t.answer({0x20});
  t.answer({0x20});  // doubled
  ASSERT_TRUE(t.next());
  EXPECT_EQ(t.out, (CanFrame{0x605, 8, {0x10, 8, 9, 10, 11, 12, 13, 14}}));
  t.answer({0x20});  // late
  EXPECT_FALSE(t.next());
  t.answer({0x30});
  ASSERT_TRUE(t.next());
  EXPECT_EQ(t.out, (CanFrame{0x605, 8, {0x0b, 15, 16}}));
  EXPECT_EQ(t.client.state(), SdoState::busy);
  t.answer({0x20});
  EXPECT_EQ(t.client.state(), SdoState::done);

  ASSERT_TRUE(t.client.upload(0x1008, 0, 0));
  ASSERT_TRUE(t.next());
  t.answer({0x41, 0x08, 0x10, 0, 9});
  ASSERT_TRUE(t.next());
  EXPECT_EQ(t.out, (CanFrame{0x605, 8, {0x60}}));
  t.answer({0x00, 1, 2, 3, 4, 5, 6, 7});
  ASSERT_TRUE(t.next());
  EXPECT_EQ(t.out, (CanFrame{0x605, 8, {0x70}}));
  t.answer({0x00, 9, 9, 9, 9, 9, 9, 9});  // doubled
  EXPECT_EQ(t.client.state(), SdoState::busy);
  t.answer({0x1b, 8, 9});
  ASSERT_EQ(t.client.state(), SdoState::done);
  ASSERT_EQ(t.client.data().size(), 9u);
  for (unsigned i = 0; i < 9; ++i) EXPECT_EQ(t.client.data()[i], i + 1);
}

TEST(Sdo, Failures) {
  Transfer t;
  ASSERT_TRUE(t.client.upload(0x1008, 0, 0));
  t.answer({0x43, 0x08, 0x10, 0, 7});  // before the request is out: of an older one
  EXPECT_EQ(t.client.state(), SdoState::busy);
  ASSERT_TRUE(t.next());
  t.answer({0x80, 0x08, 0x10, 0, 0, 0, 0x02, 0x06});
  EXPECT_EQ(t.client.state(), SdoState::aborted);
  EXPECT_EQ(t.client.abort_code(), 0x06020000u);
  EXPECT_STREQ(describe_abort(t.client.abort_code()), "no such object");

  ASSERT_TRUE(t.client.upload(0x1008, 0, 1));
  ASSERT_TRUE(t.next());
  t.client.advance(1.4);
  EXPECT_EQ(t.client.state(), SdoState::busy);
  t.client.advance(1.6);
  EXPECT_EQ(t.client.state(), SdoState::timed_out);
  EXPECT_FALSE(t.client.upload(0x1008, 0, 2)) << "the abort comes first";
  ASSERT_TRUE(t.next());
  EXPECT_EQ(t.out, (CanFrame{0x605, 8, {0x80, 0x08, 0x10, 0, 0, 0, 0x04, 0x05}}));
  EXPECT_FALSE(t.client.upload(0x1008, 0, 2)) << "an answer may still come";

  // More than fits, announced or not; less than announced; segments without end.
  for (int k = 0; k < 4; ++k) {
    ASSERT_TRUE(t.client.upload(0x1008, 0, 3));
    ASSERT_TRUE(t.next());
    if (k == 0) t.answer({0x41, 0x08, 0x10, 0, 33});
    if (k > 0) t.answer({static_cast<std::uint8_t>(k == 2 ? 0x41 : 0x40), 0x08, 0x10, 0, 9});
    for (int i = 0; i < 6 && t.client.state() == SdoState::busy; ++i) {
      ASSERT_TRUE(t.next());
      const int toggle = i % 2 ? 0x10 : 0;
      const int kind = k == 1 ? 0 : k == 2 ? 1 : 0x0e;
      t.answer({static_cast<std::uint8_t>(toggle | kind), 1, 2, 3, 4, 5, 6, 7});
    }
    EXPECT_EQ(t.client.state(), SdoState::refused) << k;
    EXPECT_TRUE(t.client.data().empty());
    ASSERT_TRUE(t.next());
    EXPECT_EQ(t.out.data[0], 0x80);
  }
  EXPECT_FALSE(t.client.download(0x2001, 0, std::vector<std::uint8_t>(33), 3));
  EXPECT_FALSE(t.client.download(0x2001, 0, {}, 3));
  EXPECT_THROW(SdoClient(0), std::invalid_argument);
  EXPECT_THROW(SdoClient(128), std::invalid_argument);
  EXPECT_THROW(SdoClient(1, -1), std::invalid_argument);
}

TEST(Cia402, StatuswordsAreThoseOfTheStandard) {
  // [CiA 402-2, table 31]: each state with every value of the bits that do not matter.
  const struct {
    unsigned mask, value;
    DriveState state;
  } rows[] = {{0x4f, 0x00, DriveState::not_ready_to_switch_on},
              {0x4f, 0x40, DriveState::switch_on_disabled},
              {0x6f, 0x21, DriveState::ready_to_switch_on},
              {0x6f, 0x23, DriveState::switched_on},
              {0x6f, 0x27, DriveState::operation_enabled},
              {0x6f, 0x07, DriveState::quick_stop_active},
              {0x4f, 0x0f, DriveState::fault_reaction_active},
              {0x4f, 0x08, DriveState::fault}};
  for (unsigned word = 0; word < 0x10000; ++word) {
    DriveState expected = DriveState::unknown;
    for (const auto& row : rows) {
      if ((word & row.mask) == row.value) expected = row.state;
    }
    ASSERT_EQ(drive_state(static_cast<std::uint16_t>(word)), expected) << word;
  }
}

const DriveOptions shoulder{.name = "shoulder", .node = 1, .counts_per_radian = 10000};
const DriveOptions elbow{.name = "elbow", .node = 2, .counts_per_radian = -20000, .zero = 0.5};

TEST(Cia402, WalksToOperationFromAnyStart) {
  for (const bool stays : {false, true}) {
    for (const bool reenables : {false, true}) {
      for (const DriveState start :
           {DriveState::not_ready_to_switch_on, DriveState::switch_on_disabled,
            DriveState::ready_to_switch_on, DriveState::switched_on, DriveState::operation_enabled,
            DriveState::quick_stop_active, DriveState::fault_reaction_active, DriveState::fault}) {
        model::Line line({shoulder, elbow});
        line.drives[0].stays_in_quick_stop = stays;
        line.drives[0].reenables = reenables;
        ASSERT_TRUE(line.ready());
        line.drives[0].state = start;
        line.cycle();
        ASSERT_EQ(line.bus.enable(line.now), Status::ok);
        ASSERT_TRUE(line.until([&] { return line.bus.enabled(); }, 2.5))
            << static_cast<int>(start) << stays << reenables;
        EXPECT_TRUE(line.bus.healthy(line.now));
        EXPECT_EQ(line.drives[0].state, DriveState::operation_enabled);
      }
    }
  }
}

TEST(Cia402, AFaultThatStaysEndsTheTry) {
  model::Line line({shoulder, elbow});
  ASSERT_TRUE(line.ready());
  line.drives[1].state = DriveState::fault;
  line.drives[1].heals = false;
  line.cycle();
  ASSERT_EQ(line.bus.enable(line.now), Status::ok);
  int edges = 0;
  bool high = false;
  ASSERT_TRUE(line.until(
      [&] {
        for (const CanFrame& f : line.sent) {
          if (f.id != 0x202) continue;
          edges += (f.data[0] & 0x80) && !high;
          high = f.data[0] & 0x80;
        }
        if (line.bus.cause() == StopCause::fault) return true;
        EXPECT_EQ(line.bus.enable(line.now), Status::ok) << "asked again and again: the same try";
        return false;
      },
      2));
  EXPECT_EQ(edges, 3);
  EXPECT_EQ(line.bus.culprit(), 1u);
  for (int k = 0; k < 100; ++k) line.cycle();
  EXPECT_NE(line.drives[0].state, DriveState::operation_enabled) << "all or none";
}

TEST(Cia402, ConfigurationIsWhatTheDriveGets) {
  DriveOptions o = shoulder;
  o.acceleration = 5;
  o.quick_stop_deceleration = 20;
  o.velocity_units = 1000;
  o.velocity_feedback = true;
  model::Line line({o});
  line.drives[0].measures = true;
  ASSERT_TRUE(line.ready());
  auto& got = line.drives[0].objects;
  EXPECT_EQ(got[0x101700], 100u);
  EXPECT_EQ(got[0x101601], 127u << 16 | 300u);
  EXPECT_EQ(got[0x140001], 0x201u);
  EXPECT_EQ(got[0x140002], 255u);
  EXPECT_EQ(got[0x140005], 100u);
  EXPECT_EQ(got[0x160000], 2u);
  EXPECT_EQ(got[0x160001], 0x60400010u);
  EXPECT_EQ(got[0x160002], 0x60FF0020u);
  EXPECT_EQ(got[0x180001], 0x40000181u);
  EXPECT_EQ(got[0x180002], 1u);
  EXPECT_EQ(got[0x1A0000], 3u);
  EXPECT_EQ(got[0x1A0001], 0x60410010u);
  EXPECT_EQ(got[0x1A0002], 0x60640020u);
  EXPECT_EQ(got[0x1A0003], 0x60780010u);
  EXPECT_EQ(got[0x180101], 0x40000281u);
  EXPECT_EQ(got[0x1A0101], 0x606C0020u);
  EXPECT_EQ(got[0x606000], 3u);
  EXPECT_EQ(got[0x608300], 5000u);
  EXPECT_EQ(got[0x608500], 20000u);
  EXPECT_EQ(got[0x600700], 3u);
}

TEST(Cia402, VelocityIsScaledCutAndForgotten) {
  model::Line line({shoulder, elbow});
  EXPECT_EQ(line.bus.command_velocity(0, 1, line.now), Status::not_started);
  ASSERT_TRUE(line.enable());
  EXPECT_EQ(line.drives[0].target, 0);
  EXPECT_EQ(line.bus.command_velocity(0, 0.5, line.now), Status::ok);
  EXPECT_EQ(line.bus.command_velocity(1, 0.25, line.now), Status::ok);
  EXPECT_EQ(line.bus.command_velocity(2, 0.25, line.now), Status::unknown_joint);
  EXPECT_EQ(line.bus.command_velocity(1, NAN, line.now), Status::non_finite);
  EXPECT_EQ(line.bus.command_position(1, 1, line.now), Status::out_of_range);
  line.cycle();
  line.cycle();
  EXPECT_EQ(line.drives[0].target, 5000);
  EXPECT_EQ(line.drives[1].target, -5000);
  EXPECT_EQ(line.bus.command_velocity(0, 1e300, line.now), Status::ok);
  line.cycle();
  line.cycle();
  EXPECT_EQ(line.drives[0].target, 100000) << "10 rad/s is the most";
  for (int k = 0; k < 12; ++k) line.cycle();
  EXPECT_EQ(line.drives[0].target, 0) << "no command for longer than hold";
  EXPECT_TRUE(line.bus.healthy(line.now));
  EXPECT_EQ(to_int32(1e300), 2147483647);
  EXPECT_EQ(to_int32(-1e300), -2147483647);
  EXPECT_EQ(to_int32(NAN), 0);
  EXPECT_EQ(to_int32(-2.6), -3);
}

TEST(Cia402, PositionGoesByHandshake) {
  DriveOptions o = elbow;
  o.mode = DriveMode::profile_position;
  model::Line line({o});
  ASSERT_TRUE(line.enable());
  EXPECT_EQ(line.bus.command_velocity(0, 1, line.now), Status::out_of_range);
  EXPECT_EQ(line.bus.command_position(0, 1e9, line.now), Status::out_of_range);
  EXPECT_EQ(line.drives[0].setpoints, 0);
  line.drives[0].extra_status = 0x0400;  // it stands where it was last told to
  line.cycle();
  line.cycle();
  EXPECT_TRUE(line.bus.drive(0).target_reached());
  EXPECT_EQ(line.bus.command_position(0, 1.5, line.now), Status::ok);
  EXPECT_FALSE(line.bus.drive(0).target_reached()) << "it does not know this one yet";
  line.cycle();
  EXPECT_FALSE(line.bus.drive(0).target_reached()) << "it may not know it yet";
  line.drives[0].extra_status = 0;
  for (int k = 0; k < 10; ++k) {  // the same one ten times is one
    EXPECT_EQ(line.bus.command_position(0, 1.5, line.now), Status::ok);
    line.cycle();
  }
  EXPECT_EQ(line.drives[0].setpoints, 1);
  EXPECT_EQ(line.drives[0].target, -20000);
  for (int k = 1; k <= 40; ++k) {
    EXPECT_EQ(line.bus.command_position(0, 1.5 + 0.01 * k, line.now), Status::ok);
    line.cycle();
  }
  for (int k = 0; k < 8; ++k) line.cycle();
  EXPECT_EQ(line.drives[0].target, -28000) << "the last one counts";
  EXPECT_GE(line.drives[0].setpoints, 9);
  // A drive that takes its time until it may have the next one.
  line.drives[0].acknowledges_for = 7;
  for (int k = 1; k <= 40; ++k) {
    EXPECT_EQ(line.bus.command_position(0, 1.9 + 0.01 * k, line.now), Status::ok);
    line.cycle();
  }
  for (int k = 0; k < 20; ++k) line.cycle();
  EXPECT_EQ(line.drives[0].target, -36000);
  // A stop forgets it; after that it is a new one.
  line.bus.stop();
  ASSERT_TRUE(
      line.until([&] { return line.drives[0].state == DriveState::switch_on_disabled; }, 1));
  const int before = line.drives[0].setpoints;
  ASSERT_TRUE(line.enable());
  for (int k = 0; k < 10; ++k) line.cycle();
  EXPECT_EQ(line.drives[0].setpoints, before);
  EXPECT_EQ(line.bus.command_position(0, 1.9, line.now), Status::ok);
  for (int k = 0; k < 4; ++k) line.cycle();
  EXPECT_EQ(line.drives[0].setpoints, before + 1);
}

TEST(Cia402, ADroppedMeasurementLeavesTheLastWithItsAge) {
  model::Line line({shoulder, elbow});
  line.drives[0].position = 12345;
  line.drives[1].position = -2147483647 - 1;
  ASSERT_TRUE(line.enable());
  EXPECT_DOUBLE_EQ(line.bus.drive(0).sample().value.position, 1.2345);
  EXPECT_DOUBLE_EQ(line.bus.drive(1).sample().value.position, 2147483648.0 / 20000 + 0.5);
  line.drives[0].measures = false;
  const double last = line.bus.drive(0).sample().time;
  line.drives[0].position = 99999;
  for (int k = 0; k < 5; ++k) line.cycle();
  EXPECT_DOUBLE_EQ(line.bus.drive(0).sample().value.position, 1.2345);
  EXPECT_DOUBLE_EQ(line.bus.drive(0).sample().time, last);
  EXPECT_NEAR(line.bus.drive(0).sample().age(line.now), 0.05, 1e-9);
  EXPECT_TRUE(line.bus.healthy(line.now));
  // Cut, of another kind, or before its time: the same.
  for (const CanFrame& f :
       {CanFrame{0x181, 7, {1, 2, 3}}, CanFrame{0x181, 8, {1, 2, 3}, true},
        CanFrame{0x181, 8, {1, 2, 3}, false, true}, CanFrame{0x281, 8, {1, 2, 3}}}) {
    line.bus.receive(f, line.now);
  }
  line.bus.receive({0x181, 8, {1, 2, 3}}, NAN);
  EXPECT_DOUBLE_EQ(line.bus.drive(0).sample().time, last);
}

struct Trouble {
  const char* name;
  void (*make)(model::Line&);
  StopCause cause;
  double within;  // s
};

// What the file comment of drive_bus.hpp promises: all drives stop, and stay so until `enable`.
TEST(DriveBus, WhatStopsTheArm) {
  const Trouble troubles[] = {
      {"heartbeat", [](model::Line& l) { l.drives[1].beats = false; }, StopCause::heartbeat_lost,
       0.31},
      {"boot-up",
       [](model::Line& l) { l.bus.receive(heartbeat_frame(2, NmtState::boot_up), l.now); },
       StopCause::restarted, 0.02},
      {"network state", [](model::Line& l) { l.drives[1].nmt = NmtState::pre_operational; },
       StopCause::not_operational, 0.12},
      {"measurements", [](model::Line& l) { l.drives[1].measures = false; },
       StopCause::feedback_lost, 0.13},
      {"fault", [](model::Line& l) { l.drives[1].state = DriveState::fault_reaction_active; },
       StopCause::fault, 0.04},
      {"left", [](model::Line& l) { l.drives[1].state = DriveState::switch_on_disabled; },
       StopCause::left_operation, 0.04},
      {"clock",
       [](model::Line& l) {
         l.now -= 50;
         for (auto& d : l.drives) d.next_heartbeat = l.now;  // on a clock of their own
       },
       StopCause::clock_set_back, 0.02}};
  for (const Trouble& trouble : troubles) {
    DriveBusOptions options;
    if (trouble.cause == StopCause::not_operational) options.feedback_timeout = 1;
    model::Line line({shoulder, elbow}, options);
    ASSERT_TRUE(line.enable());
    for (int k = 0; k < 100; ++k) {
      EXPECT_EQ(line.bus.command_velocity(0, 1, line.now), Status::ok);
      line.cycle();
    }
    ASSERT_TRUE(line.bus.healthy(line.now)) << trouble.name;
    trouble.make(line);
    const double start = line.now;
    while (line.bus.cause() == StopCause::none && line.now < start + 1) line.cycle();
    EXPECT_EQ(line.bus.cause(), trouble.cause) << trouble.name;
    EXPECT_LE(line.now - start, trouble.within + 1e-9) << trouble.name;
    EXPECT_FALSE(line.bus.healthy(line.now));
    EXPECT_EQ(line.bus.command_velocity(0, 1, line.now), Status::not_started);
    int stops = 0;  // in the same call
    for (const CanFrame& f : line.sent) {
      stops += (f.id == 0x201 || f.id == 0x202) && f.data[0] == 2 && f.data[1] == 0;
    }
    EXPECT_EQ(stops, trouble.cause == StopCause::restarted ? 1 : 2) << trouble.name;
    for (int k = 0; k < 300; ++k) line.cycle();
    EXPECT_EQ(line.drives[0].state, DriveState::switch_on_disabled) << trouble.name;
    EXPECT_EQ(line.bus.cause(), trouble.cause) << trouble.name << ": it stays";
    EXPECT_EQ(line.bus.culprit(), trouble.cause == StopCause::clock_set_back ? 0u : 1u);
    // All well again: one call.
    line.drives[1].beats = line.drives[1].measures = true;
    EXPECT_TRUE(line.enable()) << trouble.name;
    EXPECT_EQ(line.bus.cause(), StopCause::none);
  }
}

// Three periods are three: 0.3 s of silence are no loss, a cycle more is.
TEST(DriveBus, HeartbeatLossIsMoreThanThreePeriods) {
  model::Line line({shoulder});
  ASSERT_TRUE(line.enable());
  while (line.bus.drive(0).node().heartbeat().time < line.now) line.cycle();
  line.drives[0].beats = false;
  const double last = line.bus.drive(0).node().heartbeat().time;
  while (line.bus.cause() == StopCause::none) line.cycle();
  EXPECT_GT(line.now - last, 0.3);
  EXPECT_LT(line.now - last, 0.3101);
}

TEST(DriveBus, AnAbsentOrWrongDriveIsNoArm) {
  model::Line line({shoulder, elbow});
  line.drives[1].answers = false;
  // Who knows how it lays out its data.
  line.bus.receive({0x182, 8, {0x37, 2, 9, 9, 9, 9}}, line.now);
  EXPECT_EQ(line.bus.drive(1).sample().count, 0u);
  EXPECT_EQ(line.bus.drive(1).state(), DriveState::unknown);
  EXPECT_FALSE(line.until([&] { return line.bus.ready(line.now); }, 3));
  EXPECT_EQ(line.bus.enable(line.now), Status::not_started);
  line.drives[1].device = 0x20191;  // inputs and outputs
  line.drives[1].answers = true;
  EXPECT_FALSE(line.until([&] { return line.bus.ready(line.now); }, 3));
  EXPECT_EQ(line.bus.drive(1).node().phase(), NodePhase::refused);
  line.drives[1].device = 0x20192;
  std::vector<CanFrame> out;
  line.drives[1].boot(out);
  for (const CanFrame& f : out) line.bus.receive(f, line.now);
  EXPECT_TRUE(line.enable());
}

TEST(DriveBus, AFullTransportKeepsWhatIsNew) {
  model::Line line({shoulder, elbow});
  ASSERT_TRUE(line.enable());
  for (int k = 0; k < 5; ++k) {
    line.now += 0.01;
    EXPECT_FALSE(line.bus.send(line.now, [](const CanFrame&) { return false; }));
  }
  EXPECT_EQ(line.bus.command_velocity(0, 0.5, line.now), Status::ok);
  line.cycle(0.001);
  EXPECT_EQ(line.sent.size(), 3u) << "a command each and SYNC, not six of them";
  line.cycle();
  EXPECT_EQ(line.drives[0].target, 5000);
}

// A queue of ten frames, Linux' default for CAN: the last drive hears a stop as the first does, and
// each hears that we live.
TEST(DriveBus, AShortQueueLeavesNoDriveOut) {
  for (const int count : {9, 10, 12, 24}) {
    std::vector<DriveOptions> drives;
    for (int i = 1; i <= count; ++i) {
      drives.push_back({.name = std::to_string(i), .node = i, .counts_per_radian = 1e4});
    }
    model::Line line(drives);
    ASSERT_TRUE(line.enable());
    line.room = 10;
    std::vector<double> heard(static_cast<std::size_t>(count), line.now);
    double beat = line.now;
    for (int k = 0; k < 100; ++k) {
      line.cycle();
      for (const CanFrame& f : line.sent) {
        if (f.id > 0x200 && f.id < 0x280) heard[f.id - 0x201] = line.now;
        if (f.id == 0x77f) beat = line.now;
      }
      for (const double time : heard) ASSERT_LT(line.now - time, 0.045) << count << " drives";
      ASSERT_LT(line.now - beat, 0.125) << count << " drives";
    }
    EXPECT_TRUE(line.bus.healthy(line.now)) << count << " drives";
    for (int k = 0; k < 5; ++k) {  // who holds a button down
      line.bus.stop();
      line.cycle();
    }
    for (const model::Drive& d : line.drives) EXPECT_EQ(d.control, 2) << count << ", " << d.node;
  }
}

TEST(DriveBus, SyncKeepsItsRateInAFasterLoop) {
  model::Line line({shoulder});
  int syncs = 0;
  std::mt19937 random(3);
  for (int k = 0; k < 1000; ++k) {
    const double now = 100 + 0.001 * k + 1e-4 * static_cast<double>(random() % 5);
    line.bus.send(now, [&](const CanFrame& f) { return syncs += f.id == 0x80, true; });
  }
  EXPECT_NEAR(syncs, 100, 1);
  syncs = 0;
  for (int k = 0; k < 1000; ++k) {
    const double now = 200 + 0.01 * k + 1e-4 * static_cast<double>(random() % 20);
    line.bus.send(now, [&](const CanFrame& f) { return syncs += f.id == 0x80, true; });
  }
  EXPECT_GE(syncs, 999);
  EXPECT_FALSE(line.bus.send(NAN, [](const CanFrame&) { return true; }));
}

TEST(DriveBus, NothingAllocatesAfterConstruction) {
  model::Line line({shoulder, elbow});
  ASSERT_TRUE(line.enable());
  std::vector<CanFrame> frames;
  frames.reserve(1000);
  EXPECT_EQ(count_allocations([&] {
              for (int k = 0; k < 100; ++k) {
                line.bus.receive({0x181, 8, {0x37}}, line.now);
                line.bus.receive(heartbeat_frame(1, NmtState::boot_up), line.now);
                static_cast<void>(line.bus.command_velocity(0, 1, line.now));
                line.bus.send(line.now, [&](const CanFrame& f) {
                  if (frames.size() < 1000) frames.push_back(f);
                  return true;
                });
                line.now += 0.01;
              }
            }),
            0);
}

TEST(DriveBus, RefusesWithNamesAndNumbers) {
  const auto message = [](const std::vector<DriveOptions>& drives, const DriveBusOptions& o = {}) {
    try {
      DriveBus bus(drives, o);
    } catch (const std::invalid_argument& e) {
      return std::string(e.what());
    }
    return std::string("accepted");
  };
  const auto with = [](auto change) {
    DriveOptions o = shoulder;
    change(o);
    return std::vector<DriveOptions>{o};
  };
  EXPECT_EQ(message({shoulder, elbow}), "accepted");
  EXPECT_EQ(message({}), "drive bus: no drive");
  EXPECT_EQ(message({shoulder, shoulder}), "drives 'shoulder' and 'shoulder' are both node 1");
  EXPECT_EQ(message({shoulder}, {.master = 1}), "drive 'shoulder': node 1 is the master");
  EXPECT_NE(message(with([](auto& o) { o.counts_per_radian = NAN; })).find("shoulder"),
            std::string::npos);
  for (const auto& drives :
       {with([](auto& o) { o.counts_per_radian = 0; }),
        with([](auto& o) { o.counts_per_radian = 1e-300; }), with([](auto& o) { o.node = 0; }),
        with([](auto& o) { o.node = 128; }), with([](auto& o) { o.velocity_units = INFINITY; }),
        with([](auto& o) { o.zero = NAN; }), with([](auto& o) { o.max_velocity = 0; }),
        with([](auto& o) { o.acceleration = -1; }), with([](auto& o) { o.rated_current = 0; }),
        with([](auto& o) { o.mode = static_cast<DriveMode>(2); })}) {
    EXPECT_NE(message(drives), "accepted");
  }
  for (const DriveBusOptions& o : {DriveBusOptions{.master = 0},
                                   {.period = 0},
                                   {.heartbeat_period = 30},
                                   {.feedback_timeout = 0.01},
                                   {.hold = NAN},
                                   {.command_timeout = 0.01},
                                   {.start_timeout = 0},
                                   {.sdo_timeout = 0},
                                   {.retry = -1}}) {
    EXPECT_NE(message({shoulder}, o), "accepted");
  }
}

}  // namespace
