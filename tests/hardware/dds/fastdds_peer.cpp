// SPDX-License-Identifier: BSD-3-Clause
// A robot of ROS 2 made with Fast DDS, another vendor's, which serializes with Fast CDR. Joints
// move at the velocities of rt/arm_controller/commands, the base at that of rt/cmd_vel; each
// command is answered at once by rt/joint_states and rt/odom, which come every 20 ms without.
//
//     dds_peer <domain> <what its clock is ahead, s> [dirty|big]
//
// big: the robot's processor is big endian, and knows efforts. dirty: each state is followed by
// some that are cut off, doubled, late and not numbers; all of them say a velocity of 99.
#include <fastcdr/Cdr.h>
#include <fastcdr/FastBuffer.h>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastrtps/utils/IPLocator.h>

#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

namespace fast = eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;
using eprosima::fastcdr::Cdr;

// Bytes as they came, or as they are to go instead of the message.
struct Raw {
  std::vector<std::uint8_t> raw;
};
struct Header {
  std::int32_t sec{0};
  std::uint32_t nanosec{0};
  std::string frame_id;
  void write(Cdr& cdr) const { cdr << sec << nanosec << frame_id; }
};
struct JointState : Raw {
  static constexpr const char* type = "sensor_msgs::msg::dds_::JointState_";
  Header header;
  std::vector<std::string> name;
  std::vector<double> position, velocity, effort;
  void write(Cdr& cdr) const {
    header.write(cdr);
    cdr << name << position << velocity << effort;
  }
  void read(Cdr&) {}
};
struct Odometry : Raw {
  static constexpr const char* type = "nav_msgs::msg::dds_::Odometry_";
  Header header;
  std::string child_frame_id;
  std::array<double, 7> pose{0, 0, 0, 0, 0, 0, 1};
  std::array<double, 36> pose_covariance{};
  std::array<double, 6> twist{};
  std::array<double, 36> twist_covariance{};
  void write(Cdr& cdr) const {
    header.write(cdr);
    cdr << child_frame_id << pose << pose_covariance << twist << twist_covariance;
  }
  void read(Cdr&) {}
};
struct Twist : Raw {
  static constexpr const char* type = "geometry_msgs::msg::dds_::Twist_";
  std::array<double, 6> values{};
  void write(Cdr&) const {}
  void read(Cdr& cdr) { cdr >> values; }
};
struct Commands : Raw {
  static constexpr const char* type = "std_msgs::msg::dds_::Float64MultiArray_";
  std::vector<double> data;
  void write(Cdr&) const {}
  void read(Cdr& cdr) {
    std::uint32_t dimensions = 0, offset = 0;
    cdr >> dimensions;
    for (std::uint32_t i = 0; i < dimensions; ++i) {
      std::string label;
      std::uint32_t size = 0, stride = 0;
      cdr >> label >> size >> stride;
    }
    cdr >> offset >> data;
  }
};

bool big_endian = false;

template <class Message>
std::vector<std::uint8_t> bytes_of(const Message& message) {
  if (!message.raw.empty()) return message.raw;
  std::vector<char> room(4096);
  eprosima::fastcdr::FastBuffer buffer(room.data(), room.size());
  Cdr cdr(buffer, big_endian ? Cdr::BIG_ENDIANNESS : Cdr::LITTLE_ENDIANNESS, Cdr::DDS_CDR);
  cdr.serialize_encapsulation();
  message.write(cdr);
  return {room.begin(), room.begin() + static_cast<long>(cdr.getSerializedDataLength())};
}

template <class Message>
class Type : public fast::TopicDataType {
 public:
  Type() {
    setName(Message::type);
    m_typeSize = 8192;
    m_isGetKeyDefined = false;
  }
  bool serialize(void* data, rtps::SerializedPayload_t* payload) override {
    const auto bytes = bytes_of(*static_cast<const Message*>(data));
    if (bytes.size() > payload->max_size) return false;
    std::memcpy(payload->data, bytes.data(), bytes.size());
    payload->length = static_cast<std::uint32_t>(bytes.size());
    payload->encapsulation = big_endian ? CDR_BE : CDR_LE;
    return true;
  }
  bool deserialize(rtps::SerializedPayload_t* payload, void* data) override {
    auto* message = static_cast<Message*>(data);
    message->raw.assign(payload->data, payload->data + payload->length);
    eprosima::fastcdr::FastBuffer buffer(reinterpret_cast<char*>(payload->data), payload->length);
    Cdr cdr(buffer, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR);
    try {
      cdr.read_encapsulation();
      message->read(cdr);
    } catch (const std::exception&) {
      return false;
    }
    return true;
  }
  std::function<std::uint32_t()> getSerializedSizeProvider(void*) override {
    return [] { return 8192u; };
  }
  void* createData() override { return new Message; }
  void deleteData(void* data) override { delete static_cast<Message*>(data); }
  bool getKey(void*, rtps::InstanceHandle_t*, bool) override { return false; }
};

void print(const char* what, const std::vector<std::uint8_t>& bytes) {
  std::printf("%s ", what);
  for (const std::uint8_t b : bytes) std::printf("%02x", b);
  std::printf("\n");
  std::fflush(stdout);
}

class Robot {
 public:
  Robot(unsigned domain, double ahead, bool dirty) : ahead_(ahead), dirty_(dirty) {
    fast::DomainParticipantQos qos;
    auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
    udp->interfaceWhiteList.push_back("127.0.0.1");
    qos.transport().use_builtin_transports = false;
    qos.transport().user_transports.push_back(udp);
    rtps::Locator_t local;
    rtps::IPLocator::setIPv4(local, "127.0.0.1");
    qos.wire_protocol().builtin.initialPeersList.push_back(local);
    qos.wire_protocol().builtin.metatrafficUnicastLocatorList.push_back(local);
    participant_ = fast::DomainParticipantFactory::get_instance()->create_participant(domain, qos);
    if (!participant_) std::exit(1);
    states_ = writer<JointState>("rt/joint_states", true);
    odometry_ = writer<Odometry>("rt/odom", false);
    reader<Commands>("rt/arm_controller/commands",
                     [this](const Commands& commands) { take(commands); });
    reader<Twist>("rt/cmd_vel", [this](const Twist& twist) { take(twist); });
  }

  // States go out without commands, too.
  void run() {
    for (;;) {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
      std::lock_guard<std::mutex> lock(mutex_);
      if (clock() - said_ < 0.02) continue;
      move();
      say_joints();
      say_base();
    }
  }

 private:
  template <class F, class Message>
  struct Listener : fast::DataReaderListener {
    explicit Listener(F f) : take(f) {}
    void on_data_available(fast::DataReader* reader) override {
      Message message;
      fast::SampleInfo info;
      while (reader->take_next_sample(&message, &info) == ReturnCode_t::RETCODE_OK) {
        if (info.valid_data) take(message);
      }
    }
    F take;
  };
  template <class Message>
  fast::Topic* topic(const char* name) {
    fast::TypeSupport type(new Type<Message>);
    type.register_type(participant_);
    return participant_->create_topic(name, Message::type, fast::TOPIC_QOS_DEFAULT);
  }
  template <class Message>
  fast::DataWriter* writer(const char* name, bool reliable) {
    fast::DataWriterQos qos;
    qos.reliability().kind =
        reliable ? fast::RELIABLE_RELIABILITY_QOS : fast::BEST_EFFORT_RELIABILITY_QOS;
    qos.history().depth = 10;
    qos.data_sharing().off();
    return participant_->create_publisher(fast::PUBLISHER_QOS_DEFAULT)
        ->create_datawriter(topic<Message>(name), qos);
  }
  template <class Message, class F>
  void reader(const char* name, F take) {
    fast::DataReaderQos qos;
    qos.reliability().kind = fast::RELIABLE_RELIABILITY_QOS;
    qos.history().depth = 10;
    qos.data_sharing().off();
    participant_->create_subscriber(fast::SUBSCRIBER_QOS_DEFAULT)
        ->create_datareader(topic<Message>(name), qos, new Listener<F, Message>(take));
  }

  static double clock() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch())
        .count();
  }
  Header header(double time) const {
    Header header;
    header.sec = static_cast<std::int32_t>(std::floor(time));
    header.nanosec = static_cast<std::uint32_t>(1e9 * (time - std::floor(time)));
    return header;
  }
  void move() {
    const double now = clock();
    const double step = now - moved_;
    moved_ = now;
    for (std::size_t i = 0; i < 3; ++i) position_[i] += step * velocity_[i];
  }
  void take(const Commands& commands) {
    std::lock_guard<std::mutex> lock(mutex_);
    if (!command_seen_) print("commands", commands.raw);
    command_seen_ = true;
    if (commands.data.size() != 3) return;
    move();
    std::copy(commands.data.begin(), commands.data.end(), velocity_.begin());
    say_joints();
  }
  void take(const Twist& twist) {
    std::lock_guard<std::mutex> lock(mutex_);
    if (!twist_seen_) print("twist", twist.raw);
    twist_seen_ = true;
    twist_ = twist.values;
    say_base();
  }
  // In another order than the controller's, with a joint that nobody asked for, with no efforts and
  // a joint whose velocity is not measured, as ros2_control's broadcaster has them.
  void say_joints() {
    const double nan = std::nan("");
    const double now = said_ = clock();
    JointState state;
    state.header = header(now + ahead_);
    state.name = {"gripper", "wrist", "shoulder", "elbow"};
    state.position = {7, position_[2], position_[0], position_[1]};
    state.velocity = {nan, velocity_[2], velocity_[0], velocity_[1]};
    if (big_endian) state.effort = {1, 2, 3, 4};
    states_->write(&state);
    if (!dirty_) return;
    JointState wrong = state;
    wrong.velocity = {99, 99, 99, 99};
    states_->write(&wrong);                     // the same stamp
    wrong.header = header(now + ahead_ - 0.5);  // late, not a clock that was set back
    states_->write(&wrong);
    wrong.header = header(now + ahead_ + 1e-6);
    wrong.position = {nan, nan, INFINITY, nan};
    states_->write(&wrong);
    wrong.header = header(now + ahead_ + 1e-6);
    wrong.position = {99, 99, 99};  // one for four names
    states_->write(&wrong);
    wrong.position = {99, 99, 99, 99};
    const auto good = bytes_of(wrong);
    wrong.raw.assign(good.begin(), good.end() - 13);
    states_->write(&wrong);
    wrong.raw = good;
    wrong.raw.insert(wrong.raw.end(), good.begin(), good.end());
    states_->write(&wrong);
    wrong.raw = good;
    wrong.raw[4 + 8] = 0xff;  // the length of the frame's name
    wrong.raw[4 + 11] = 0xff;
    states_->write(&wrong);
  }
  void say_base() {
    Odometry odometry;
    odometry.header = header(clock() + ahead_);
    odometry.header.frame_id = "odom";
    odometry.child_frame_id = "base_link";
    odometry.pose = {1, 2, 3, 0, 0, std::sqrt(0.5), std::sqrt(0.5)};
    odometry.pose_covariance[35] = 0.25;
    odometry.twist = twist_;
    odometry_->write(&odometry);
    if (!dirty_) return;
    odometry.twist[0] = 99;
    odometry_->write(&odometry);  // the same stamp
    odometry.header = header(clock() + ahead_);
    odometry.pose[6] = 0;  // no rotation
    odometry_->write(&odometry);
  }

  fast::DomainParticipant* participant_;
  fast::DataWriter* states_;
  fast::DataWriter* odometry_;
  std::mutex mutex_;
  double ahead_;
  bool dirty_;
  bool command_seen_{false}, twist_seen_{false};
  double moved_{clock()}, said_{0};
  std::array<double, 3> position_{0.1, 0.2, 0.3}, velocity_{};
  std::array<double, 6> twist_{};
};

int main(int count, char** arguments) {
  if (count < 3) return 1;
  const std::string mode = count > 3 ? arguments[3] : "";
  big_endian = mode == "big";
  Robot robot(static_cast<unsigned>(std::atoi(arguments[1])), std::atof(arguments[2]),
              mode == "dirty");
  std::printf("ready\n");
  std::fflush(stdout);
  robot.run();
}
