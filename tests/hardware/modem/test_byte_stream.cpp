// SPDX-License-Identifier: BSD-3-Clause
// The stream of bytes against the kernel's own peers: a pseudo terminal and TCP on the loopback.
#include <gtest/gtest.h>

#include <icat/adapters/byte_stream.hpp>
#include <string>
#include <thread>
#include <vector>

#include "tests/hardware/support/loop.hpp"

namespace {

using icat::ByteStream;
using icat::SerialPort;
using icat::TcpServer;

std::span<const std::byte> bytes(const std::string& text) {
  return std::as_bytes(std::span(text.data(), text.size()));
}
// What comes within 2 s, until there are `n` bytes.
std::string read(ByteStream& stream, std::size_t n) {
  std::string all;
  for (const double end = hardware::now() + 2; all.size() < n && hardware::now() < end;) {
    std::byte block[4096];
    const std::size_t got = stream.read(block);
    all.append(reinterpret_cast<const char*>(block), got);
    if (got == 0) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return all;
}
// Every byte there is.
std::string everything() {
  std::string all;
  for (int k = 0; k < 256; ++k) all += static_cast<char>(k);
  return all;
}
// Reads until it is closed, at most 2 s.
bool closes(ByteStream& stream) {
  for (const double end = hardware::now() + 2; stream.is_open() && hardware::now() < end;) {
    std::byte block[64];
    (void)stream.read(block);
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return !stream.is_open();
}

// A serial line, of which this is the device's end.
struct Terminal {
  Terminal() {
    descriptor = ::posix_openpt(O_RDWR | O_NOCTTY);
    EXPECT_GE(descriptor, 0);
    EXPECT_EQ(::grantpt(descriptor), 0);
    EXPECT_EQ(::unlockpt(descriptor), 0);
    name = ::ptsname(descriptor);
  }
  ~Terminal() { hang_up(); }
  void hang_up() {
    if (descriptor >= 0) ::close(descriptor);
    descriptor = -1;
  }
  int descriptor{-1};
  std::string name;
};
// A TCP server at a port that the system chooses.
struct Server {
  Server() {
    listening = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(::bind(listening, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
    socklen_t size = sizeof address;
    ::getsockname(listening, reinterpret_cast<sockaddr*>(&address), &size);
    port = ntohs(address.sin_port);
  }
  ~Server() {
    drop();
    ::close(listening);
  }
  void accept() { client = ::accept(listening, nullptr, nullptr); }
  void drop() {
    if (client >= 0) ::close(client);
    client = -1;
  }
  int listening{-1}, client{-1}, port{0};
};

TEST(ByteStream, SerialLinesCarryEveryByteAsItIs) {
  Terminal terminal;
  ByteStream stream(SerialPort{terminal.name, 115200});
  EXPECT_FALSE(stream.is_open());
  ASSERT_TRUE(stream.open(0));
  termios settings{};
  ASSERT_EQ(::tcgetattr(stream.descriptor(), &settings), 0);
  EXPECT_EQ(::cfgetospeed(&settings), speed_t{B115200});
  const std::string all = everything();
  ASSERT_EQ(stream.write(bytes(all)), all.size());
  std::string there;
  while (there.size() < all.size()) {
    char block[512];
    const ssize_t n = ::read(terminal.descriptor, block, sizeof block);
    ASSERT_GT(n, 0);
    there.append(block, static_cast<std::size_t>(n));
  }
  EXPECT_EQ(there, all);
  ASSERT_EQ(::write(terminal.descriptor, all.data(), all.size()), 256);
  EXPECT_EQ(read(stream, 256), all);
  std::byte one[1];
  EXPECT_EQ(stream.read(one), 0u);  // nothing there is not the end
  EXPECT_TRUE(stream.is_open());
  terminal.hang_up();
  EXPECT_TRUE(closes(stream));
  EXPECT_EQ(stream.write(bytes("x")), 0u);
  EXPECT_FALSE(stream.open(0.5));  // within `retry`
  EXPECT_FALSE(stream.open(1.5));  // there is no such device any more
  EXPECT_EQ(stream.openings(), 1u);
}
TEST(ByteStream, OpensWhatIsThereAndATerminal) {
  ByteStream missing(SerialPort{"/dev/no_such_device"});
  EXPECT_FALSE(missing.open(0));
  ByteStream file(SerialPort{"/dev/null"});
  EXPECT_FALSE(file.open(0));
  EXPECT_EQ(file.descriptor(), -1);
}

TEST(ByteStream, ConnectsAgainAfterAPause) {
  Server server;
  ByteStream stream(TcpServer{"127.0.0.1", server.port}, {.retry = 1});
  EXPECT_FALSE(stream.open(NAN));
  EXPECT_FALSE(stream.open(0));  // nobody listens
  ASSERT_EQ(::listen(server.listening, 1), 0);
  EXPECT_FALSE(stream.open(0.9));
  EXPECT_TRUE(stream.open(1.1));
  EXPECT_TRUE(stream.open(1.2));
  EXPECT_EQ(stream.openings(), 1u);
  server.accept();
  const std::string all = everything();
  ASSERT_EQ(stream.write(bytes(all)), 256u);
  char block[512];
  ASSERT_EQ(::recv(server.client, block, 256, MSG_WAITALL), 256);
  ASSERT_EQ(::send(server.client, all.data(), all.size(), 0), 256);
  EXPECT_EQ(read(stream, 256), all);

  // What is written to a peer that has gone raises no signal, and closes the stream.
  server.drop();
  for (const double end = hardware::now() + 2; stream.is_open() && hardware::now() < end;) {
    (void)stream.write(bytes("x"));
  }
  EXPECT_FALSE(stream.is_open());
  EXPECT_FALSE(stream.open(2.0));
  EXPECT_TRUE(stream.open(2.2));
  EXPECT_EQ(stream.openings(), 2u);
  server.accept();
  server.drop();
  EXPECT_TRUE(closes(stream));
  EXPECT_TRUE(stream.open(-1e6));  // a clock that was set back does not make it wait
}
TEST(ByteStream, GivesUpAConnectionThatIsNotAnswered) {
  Server server;
  ASSERT_EQ(::listen(server.listening, 0), 0);
  // Fills the queue of those who wait to be accepted: the next one gets no answer.
  std::vector<int> others;
  for (int k = 0; k < 4; ++k) {
    others.push_back(::socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK, 0));
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address.sin_port = htons(static_cast<std::uint16_t>(server.port));
    (void)::connect(others.back(), reinterpret_cast<sockaddr*>(&address), sizeof address);
  }
  ByteStream stream(TcpServer{"127.0.0.1", server.port}, {.retry = 1, .connect_timeout = 2});
  const double before = hardware::now();
  for (double t = 0; t < 1.9; t += 0.1) {
    EXPECT_FALSE(stream.open(t));
    EXPECT_GE(stream.descriptor(), 0);
  }
  EXPECT_FALSE(stream.open(2.1));
  EXPECT_EQ(stream.descriptor(), -1);
  EXPECT_LT(hardware::now() - before, 0.5);  // nothing waits
  for (const int other : others) ::close(other);
}
// As much as the system takes, and no more than that.
TEST(ByteStream, WritesWhatFits) {
  Server server;
  ASSERT_EQ(::listen(server.listening, 1), 0);
  ByteStream stream(TcpServer{"127.0.0.1", server.port});
  ASSERT_TRUE(stream.open(0));
  server.accept();
  const std::string block(1 << 16, 'x');
  std::size_t sum = 0, n = 0;
  while ((n = stream.write(bytes(block))) > 0) sum += n;
  EXPECT_GT(sum, 0u);
  EXPECT_TRUE(stream.is_open());
  std::string there(1 << 16, ' ');
  for (std::size_t got = 0; got < sum;) {
    const ssize_t part = ::recv(server.client, there.data(), there.size(), 0);
    ASSERT_GT(part, 0);
    got += static_cast<std::size_t>(part);
  }
  EXPECT_GT(stream.write(bytes("y")), 0u);
}
// A socket of TCP that connects to its own port while nobody listens there would meet itself.
TEST(ByteStream, DoesNotMeetItself) {
  int first = 32768, last = 60999;
  if (std::FILE* range = std::fopen("/proc/sys/net/ipv4/ip_local_port_range", "r")) {
    EXPECT_EQ(std::fscanf(range, "%d %d", &first, &last), 2);
    std::fclose(range);
  }
  // One of those that the system chooses for sockets that connect, free again at once.
  int port = 0;
  {
    Server server;
    ASSERT_EQ(::listen(server.listening, 1), 0);
    ByteStream stream(TcpServer{"127.0.0.1", server.port});
    ASSERT_TRUE(stream.open(0));
    sockaddr_in own{};
    socklen_t size = sizeof own;
    ::getsockname(stream.descriptor(), reinterpret_cast<sockaddr*>(&own), &size);
    port = ntohs(own.sin_port);
    const linger reset{1, 0};
    ::setsockopt(stream.descriptor(), SOL_SOCKET, SO_LINGER, &reset, sizeof reset);
  }
  ASSERT_TRUE(port >= first && port <= last);
  ByteStream stream(TcpServer{"127.0.0.1", port}, {.retry = 1e-9});
  for (int k = 0; k < 2 * (last - first); ++k) ASSERT_FALSE(stream.open(k)) << k;
}
TEST(ByteStream, DoesNotAllocate) {
  Server server;
  ASSERT_EQ(::listen(server.listening, 8), 0);
  ByteStream tcp(TcpServer{"127.0.0.1", server.port});
  Terminal terminal;
  ByteStream serial(SerialPort{terminal.name});
  const std::string text = everything();
  EXPECT_EQ(count_allocations([&] {
              for (int k = 0; k < 3; ++k) {
                for (ByteStream* stream : {&tcp, &serial}) {
                  std::byte block[256];
                  (void)stream->open(2.0 * k);
                  (void)stream->write(bytes(text));
                  (void)stream->read(block);
                  stream->close();
                }
              }
            }),
            0);
  EXPECT_EQ(tcp.openings(), 3u);
  EXPECT_EQ(serial.openings(), 3u);
}
TEST(ByteStream, RefusesWhatIsNoDevice) {
  EXPECT_THROW(ByteStream(SerialPort{""}), std::invalid_argument);
  EXPECT_THROW(ByteStream(SerialPort{"/dev/ttyUSB0", 12345}), std::invalid_argument);
  EXPECT_THROW(ByteStream(SerialPort{"/dev/ttyUSB0", 0}), std::invalid_argument);
  EXPECT_THROW(ByteStream(TcpServer{"127.0.0.1", 0}), std::invalid_argument);
  EXPECT_THROW(ByteStream(TcpServer{"127.0.0.1", 65536}), std::invalid_argument);
  EXPECT_THROW(ByteStream(TcpServer{"modem.local", 9200}), std::invalid_argument);
  EXPECT_THROW(ByteStream(TcpServer{"", 9200}), std::invalid_argument);
  EXPECT_NO_THROW(ByteStream(TcpServer{"::1", 9200}));
  for (const double bad : {0.0, -1.0, double(NAN), double(INFINITY)}) {
    EXPECT_THROW(ByteStream(SerialPort{"/dev/ttyUSB0"}, {.retry = bad}), std::invalid_argument);
    EXPECT_THROW(ByteStream(SerialPort{"/dev/ttyUSB0"}, {.connect_timeout = bad}),
                 std::invalid_argument);
    EXPECT_THROW(ByteStream(SerialPort{"/dev/ttyUSB0"}, {.broken_after = bad}),
                 std::invalid_argument);
  }
}

}  // namespace
