// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The page of replay.hpp while the loop runs: a browser that opens `http://127.0.0.1:<port>` gets
/// the page, and over a WebSocket every sample of a log as the loop records it. HTTP and WebSocket
/// are Boost.Beast's (Debian: libboost-dev; 1.74 or newer; link Threads::Threads).
///
/// The loop never waits: `publish` copies the newest sample into a ring of fixed size, without
/// lock, allocation or system call. A thread of its own takes them out 50 times a second and sends
/// them. Frames are lost, and counted, where the ring is full, and where a browser does not read as
/// fast as they come: one message may be on its way to it, the frames that come meanwhile are
/// dropped for it. A browser that comes late is told the phase and the explanation that hold.
///
/// Anyone who can connect to the port can view the page; everything that a browser sends is
/// discarded.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <cstring>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "icat/adapters/replay.hpp"

namespace icat {

/// How the page is served.
struct LiveOptions {
  std::string address = "127.0.0.1";  ///< of this machine, in numbers; "0.0.0.0": all of them
  std::uint16_t port = 8765;          ///< 0: the system chooses, `Live::port` says which
  std::size_t frames = 256;           ///< of the ring; 2.5 s at 100 Hz
  std::size_t texts = 64;             ///< likewise
  std::size_t clients = 8;            ///< more are refused
};

namespace detail {

/// One thread writes, one reads, neither waits. Elements keep their memory.
template <class T>
class Ring {
 public:
  explicit Ring(std::size_t size, const T& element = T()) : slots_(size + 1, element) {}
  /// A slot to write; null where all are full.
  T* begin_push() noexcept {
    const std::size_t w = write_.load(std::memory_order_relaxed);
    return next(w) == read_.load(std::memory_order_acquire) ? nullptr : &slots_[w];
  }
  void end_push() noexcept {
    write_.store(next(write_.load(std::memory_order_relaxed)), std::memory_order_release);
  }
  /// A slot to read; null where there is none.
  const T* begin_pop() const noexcept {
    const std::size_t r = read_.load(std::memory_order_relaxed);
    return r == write_.load(std::memory_order_acquire) ? nullptr : &slots_[r];
  }
  void end_pop() noexcept {
    read_.store(next(read_.load(std::memory_order_relaxed)), std::memory_order_release);
  }

 private:
  std::size_t next(std::size_t i) const noexcept { return i + 1 == slots_.size() ? 0 : i + 1; }
  std::vector<T> slots_;
  std::atomic<std::size_t> write_{0}, read_{0};
};

/// A text of the loop, cut off where it is longer.
struct LiveText {
  double time{0};
  LogTopic topic{LogTopic::event};
  std::size_t length{0};
  char words[480]{};
};

/// A browser. Lives as long as an operation on it is under way.
class LiveClient : public std::enable_shared_from_this<LiveClient> {
 public:
  using Tcp = boost::asio::ip::tcp;
  static constexpr std::size_t most_waiting = 65536;  // bytes of texts
  LiveClient(Tcp::socket socket, const std::string& page, std::atomic<std::size_t>& dropped)
      : stream_(std::move(socket)), page_(page), dropped_(dropped) {
    boost::beast::get_lowest_layer(stream_).expires_after(std::chrono::seconds(10));
  }
  /// Reads what it asks for: the page, or a WebSocket.
  void start() {
    namespace http = boost::beast::http;
    http::async_read(stream_.next_layer(), buffer_, request_,
                     [self = shared_from_this()](boost::beast::error_code error, std::size_t) {
                       if (error) return self->close();
                       if (boost::beast::websocket::is_upgrade(self->request_)) {
                         self->upgrade();
                       } else {
                         self->answer();
                       }
                     });
  }
  /// Sends `count` frames, unless the message before is still on its way: then they are dropped.
  /// `texts`, elements of JSON, wait for the next message; `before` are those that hold already,
  /// for who comes late.
  void send(const std::string& frames, std::size_t count, const std::string& before,
            const std::string& texts) {
    if (!open_) return;
    if (!greeted_) say(before);
    greeted_ = true;
    say(texts);
    if (sending_) {
      dropped_.fetch_add(count, std::memory_order_relaxed);
      return;
    }
    if (count == 0 && texts_.size() < 2) return;
    // How many frames, as a double so that they stay aligned; the frames; the texts.
    const double head = static_cast<double>(count);
    message_.assign(reinterpret_cast<const char*>(&head), sizeof head);
    message_ += frames;
    message_ += texts_;
    message_ += ']';
    texts_ = "[";
    sending_ = true;
    stream_.binary(true);
    stream_.async_write(boost::asio::buffer(message_),
                        [self = shared_from_this()](boost::beast::error_code error, std::size_t) {
                          self->sending_ = false;
                          if (error) self->close();
                        });
  }
  /// Whether it may be forgotten.
  bool closed() const noexcept { return closed_; }
  /// Whether it gets frames.
  bool open() const noexcept { return open_; }
  /// At once.
  void close() {
    open_ = false;
    closed_ = true;
    boost::beast::error_code ignored;
    boost::beast::get_lowest_layer(stream_).socket().close(ignored);
  }

 private:
  void say(const std::string& texts) {
    if (texts.empty() || texts_.size() + texts.size() >= most_waiting) return;
    json_comma(texts_);
    texts_ += texts;
  }
  void answer() {
    namespace http = boost::beast::http;
    const bool root = request_.method() == http::verb::get && request_.target() == "/";
    response_.result(root ? http::status::ok : http::status::not_found);
    response_.set(http::field::content_type, root ? "text/html; charset=utf-8" : "text/plain");
    response_.set(http::field::cache_control, "no-store");
    response_.keep_alive(false);
    response_.body() = root ? page_ : std::string("not here\n");
    response_.prepare_payload();
    http::async_write(
        stream_.next_layer(), response_,
        [self = shared_from_this()](boost::beast::error_code, std::size_t) { self->close(); });
  }
  void upgrade() {
    // A page of another site that the same browser has open gets nothing.
    const auto origin = request_[boost::beast::http::field::origin];
    const auto host = request_[boost::beast::http::field::host];
    if (!origin.empty() && origin != "http://" + std::string(host)) return close();
    boost::beast::get_lowest_layer(stream_).expires_never();
    auto timeout =
        boost::beast::websocket::stream_base::timeout::suggested(boost::beast::role_type::server);
    timeout.idle_timeout = std::chrono::seconds(30);  // then one that answers nothing is gone
    timeout.keep_alive_pings = true;
    stream_.set_option(timeout);
    stream_.read_message_max(4096);
    stream_.async_accept(request_, [self = shared_from_this()](boost::beast::error_code error) {
      if (error) return self->close();
      self->open_ = true;
      self->read();
    });
  }
  // Nothing that comes is used, but a close or an error is seen this way.
  void read() {
    buffer_.clear();
    stream_.async_read(buffer_,
                       [self = shared_from_this()](boost::beast::error_code error, std::size_t) {
                         if (error) return self->close();
                         self->read();
                       });
  }

  boost::beast::websocket::stream<boost::beast::tcp_stream> stream_;
  const std::string& page_;
  std::atomic<std::size_t>& dropped_;
  boost::beast::flat_buffer buffer_;
  boost::beast::http::request<boost::beast::http::string_body> request_;
  boost::beast::http::response<boost::beast::http::string_body> response_;
  std::string message_, texts_{"["};
  bool open_{false}, closed_{false}, sending_{false}, greeted_{false};
};

}  // namespace detail

/// See the file comment. `publish` and `text` belong to the loop's thread, and the log must live
/// until this object ends.
class Live {
 public:
  /// Opens the port and starts the thread. The log has its channels by then, those
  /// that come later are not sent; one or two of
  /// them with `LogFull::newest` are enough.
  /// @throws std::invalid_argument where a file of the page cannot be read, or the port not be had.
  [[gnu::cold]] Live(const ReplayFiles& files, ReplayRun run, ReplayOptions page = {},
                     const LiveOptions& options = {})
      : log_(*run.log),
        channels_(run.log->channel_count()),
        clients_most_(options.clients),
        page_(detail::replay_page(files, detail::replay_data({run}, page, true))),
        frames_(options.frames, std::vector<double>(width(log_) + 1)),
        texts_(options.texts),
        acceptor_(io_),
        timer_(io_) {
    if (page_.empty()) detail::invalid("live: cannot read the page in ", files.folder);
    using Tcp = boost::asio::ip::tcp;
    boost::beast::error_code error;
    const auto address = boost::asio::ip::make_address(options.address, error);
    const Tcp::endpoint at(address, options.port);
    if (!error) acceptor_.open(at.protocol(), error);
    if (!error) acceptor_.set_option(boost::asio::socket_base::reuse_address(true), error);
    if (!error) acceptor_.bind(at, error);
    if (!error) acceptor_.listen(boost::asio::socket_base::max_listen_connections, error);
    if (error) {
      detail::invalid("live: ", options.address, ":", options.port, ": ", error.message());
    }
    port_ = acceptor_.local_endpoint().port();
    accept();
    wait();
    thread_ = std::thread([this] { io_.run(); });
  }
  ~Live() {
    io_.stop();
    if (thread_.joinable()) thread_.join();
  }
  Live(const Live&) = delete;
  Live& operator=(const Live&) = delete;

  /// Sends the newest sample of the log. No lock, no allocation, no system call.
  void publish() noexcept {
    if (log_.size() == 0) return;
    std::vector<double>* frame = frames_.begin_push();
    if (!frame) {
      lost_.fetch_add(1, std::memory_order_relaxed);
      return;
    }
    const std::size_t newest = log_.size() - 1;
    double* to = frame->data();
    *to++ = log_.time(newest);
    for (std::size_t c = 0; c < channels_; ++c) {
      const std::size_t n = Log::width(log_.kind(c));
      std::memcpy(to, log_.values(c, newest), n * sizeof(double));
      to += n;
    }
    frames_.end_push();
  }
  /// Sends a text, of which the first 480 bytes; lost where the ring is full. No lock, no
  /// allocation.
  void text(LogTopic topic, double time, std::string_view words) noexcept {
    detail::LiveText* t = texts_.begin_push();
    if (!t || !std::isfinite(time)) return;
    t->time = time;
    t->topic = topic;
    t->length = std::min(words.size(), sizeof t->words);
    std::memcpy(t->words, words.data(), t->length);
    // Not in the middle of a character of UTF-8.
    while (t->length < words.size() && t->length > 0 &&
           (static_cast<unsigned char>(words[t->length]) & 0xc0u) == 0x80u) {
      --t->length;
    }
    texts_.end_push();
  }

  /// Where the page is.
  std::uint16_t port() const noexcept { return port_; }
  /// Frames that the ring had no place for.
  std::size_t lost() const noexcept { return lost_.load(std::memory_order_relaxed); }
  /// Frames that were dropped because a browser was too slow, summed over all of them.
  std::size_t dropped() const noexcept { return dropped_.load(std::memory_order_relaxed); }
  /// Frames that were taken out of the ring, each once, whoever looks.
  std::size_t sent() const noexcept { return sent_.load(std::memory_order_relaxed); }
  /// Browsers that get frames.
  std::size_t clients() const noexcept { return watching_.load(std::memory_order_relaxed); }

 private:
  static std::size_t width(const Log& log) noexcept {
    std::size_t n = 0;
    for (std::size_t c = 0; c < log.channel_count(); ++c) n += Log::width(log.kind(c));
    return n;
  }
  void accept() {
    accepting_ = true;
    acceptor_.async_accept(
        [this](boost::beast::error_code error, boost::asio::ip::tcp::socket socket) {
          if (!error && clients_.size() < clients_most_) {
            clients_.push_back(
                std::make_shared<detail::LiveClient>(std::move(socket), page_, dropped_));
            clients_.back()->start();
          }
          accepting_ = false;
          // After an error, such as no descriptor left, not before the next tick.
          if (!error) accept();
        });
  }
  void wait() {
    timer_.expires_after(std::chrono::milliseconds(20));
    timer_.async_wait([this](boost::beast::error_code error) {
      if (error) return;
      if (!accepting_) accept();
      pass_on();
      wait();
    });
  }
  // All frames that wait are one message.
  void pass_on() {
    clients_.erase(std::remove_if(clients_.begin(), clients_.end(),
                                  [](const auto& client) { return client->closed(); }),
                   clients_.end());
    std::size_t watching = 0;
    for (const auto& client : clients_) watching += client->open();
    watching_.store(watching, std::memory_order_relaxed);

    std::size_t count = 0;
    block_.clear();
    words_.clear();
    for (const std::vector<double>* f; count < 64 && (f = frames_.begin_pop()); ++count) {
      block_.append(reinterpret_cast<const char*>(f->data()), f->size() * sizeof(double));
      frames_.end_pop();
    }
    before_.clear();
    for (const std::string& text : holding_) {
      if (text.empty()) continue;
      detail::json_comma(before_);
      before_ += text;
    }
    for (const detail::LiveText* t; (t = texts_.begin_pop());) {
      text_ = "[";
      detail::json_number(text_, t->time);
      text_ += ',';
      detail::json_string(text_, detail::log_topic(t->topic));
      text_ += ',';
      detail::json_string(text_, {t->words, t->length});
      text_ += ']';
      detail::json_comma(words_);
      words_ += text_;
      if (t->topic != LogTopic::event) holding_[t->topic == LogTopic::phase ? 0 : 1] = text_;
      texts_.end_pop();
    }
    for (const auto& client : clients_) client->send(block_, count, before_, words_);
    sent_.fetch_add(count, std::memory_order_relaxed);
  }

  const Log& log_;
  std::size_t channels_;  // that a frame has: those of the construction
  std::size_t clients_most_;
  std::string page_;
  detail::Ring<std::vector<double>> frames_;
  detail::Ring<detail::LiveText> texts_;
  std::atomic<std::size_t> lost_{0}, dropped_{0}, sent_{0}, watching_{0};
  boost::asio::io_context io_{1};
  boost::asio::ip::tcp::acceptor acceptor_;
  boost::asio::steady_timer timer_;
  std::vector<std::shared_ptr<detail::LiveClient>> clients_;
  std::string block_, words_, before_, text_;  // of a tick
  std::array<std::string, 2> holding_;         // the phase and the explanation
  bool accepting_{false};
  std::uint16_t port_{0};
  std::thread thread_;
};

}  // namespace icat
