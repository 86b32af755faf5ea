// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Writes the records of an MCAP file (mcap.dev/spec, version 0): chunks without compression, an
/// index of each, and a summary, so that a reader finds a time without reading the file. Every
/// checksum that the format has is there. What the messages say is mcap.hpp.
#pragma once

#include <array>
#include <cstdint>
#include <ostream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace icat::detail {

/// CRC-32 of IEEE 802.3, as zlib's.
class Crc32 {
 public:
  /// One more block.
  void add(std::string_view bytes) noexcept {
    for (const char c : bytes) {
      state_ = table[(state_ ^ static_cast<unsigned char>(c)) & 255u] ^ (state_ >> 8);
    }
  }
  /// Of all blocks.
  std::uint32_t value() const noexcept { return ~state_; }

 private:
  static constexpr std::array<std::uint32_t, 256> table = [] {
    std::array<std::uint32_t, 256> t{};
    for (std::uint32_t i = 0; i < 256; ++i) {
      std::uint32_t c = i;
      for (int k = 0; k < 8; ++k) c = (c & 1u) ? 0xedb88320u ^ (c >> 1) : c >> 1;
      t[i] = c;
    }
    return t;
  }();
  std::uint32_t state_{0xffffffffu};
};

/// Little endian, strings and maps with their length in bytes before them.
struct McapBytes {
  std::string bytes;

  template <class Integer>
  void integer(Integer value) {
    for (std::size_t i = 0; i < sizeof value; ++i) {
      bytes += static_cast<char>((static_cast<std::uint64_t>(value) >> (8 * i)) & 255u);
    }
  }
  void string(std::string_view text) {
    integer(static_cast<std::uint32_t>(text.size()));
    bytes += text;
  }
  void record(std::uint8_t opcode, std::string_view content) {
    integer(opcode);
    integer(static_cast<std::uint64_t>(content.size()));
    bytes += content;
  }
};

/// See the file comment. All schemas and channels come before the first message.
class McapWriter {
 public:
  /// Begins the file.
  explicit McapWriter(std::ostream& to, std::size_t chunk_size = 1 << 20)
      : to_(to), chunk_size_(chunk_size) {
    McapBytes header;
    header.string("");  // of no profile
    header.string("icat");
    McapBytes all;
    all.bytes = magic();
    all.record(0x01, header.bytes);
    put(all.bytes);
  }

  /// Its id, from 1; `text` is JSON schema.
  std::uint16_t add_schema(std::string_view name, std::string_view text) {
    const auto id = static_cast<std::uint16_t>(++schema_count_);
    McapBytes b;
    b.integer(id);
    b.string(name);
    b.string("jsonschema");
    b.string(text);
    schemas_.record(0x03, b.bytes);
    return id;
  }
  /// Its id, from 0; messages are JSON.
  std::uint16_t add_channel(std::uint16_t schema, std::string_view topic) {
    const auto id = static_cast<std::uint16_t>(counts_.size());
    McapBytes b;
    b.integer(id);
    b.integer(schema);
    b.string(topic);
    b.string("json");
    b.integer(std::uint32_t{0});  // no metadata
    channels_.record(0x04, b.bytes);
    counts_.push_back(0);
    index_.emplace_back();
    return id;
  }
  /// `time` in ns.
  void message(std::uint16_t channel, std::uint64_t time, std::string_view data) {
    if (messages_ == 0) put(schemas_.bytes), put(channels_.bytes);
    if (chunk_.bytes.empty() || time < chunk_start_) chunk_start_ = time;
    if (chunk_.bytes.empty() || time > chunk_end_) chunk_end_ = time;
    if (messages_ == 0 || time < start_) start_ = time;
    if (messages_ == 0 || time > end_) end_ = time;
    index_[channel].emplace_back(time, chunk_.bytes.size());
    McapBytes b;
    b.integer(channel);
    b.integer(static_cast<std::uint32_t>(counts_[channel]++));
    b.integer(time);
    b.integer(time);
    b.bytes += data;
    chunk_.record(0x05, b.bytes);
    ++messages_;
    if (chunk_.bytes.size() >= chunk_size_) close_chunk();
  }
  /// Ends the file. False where the stream failed.
  [[nodiscard]] bool finish() {
    if (messages_ == 0) put(schemas_.bytes), put(channels_.bytes);
    close_chunk();
    McapBytes end, footer;
    end.integer(crc_.value());
    McapBytes record;
    record.record(0x0f, end.bytes);
    put(record.bytes);

    const std::uint64_t start = written_;
    crc_ = Crc32();
    const std::array<std::pair<std::uint8_t, std::string>, 4> groups{
        {{std::uint8_t{0x03}, schemas_.bytes},
         {std::uint8_t{0x04}, channels_.bytes},
         {std::uint8_t{0x0b}, statistics()},
         {std::uint8_t{0x08}, chunks_.bytes}}};
    McapBytes offsets;
    for (const auto& [opcode, bytes] : groups) {
      if (bytes.empty()) continue;
      McapBytes offset;
      offset.integer(opcode);
      offset.integer(written_);
      offset.integer(static_cast<std::uint64_t>(bytes.size()));
      offsets.record(0x0e, offset.bytes);
      put(bytes);
    }
    const std::uint64_t offsets_start = written_;
    put(offsets.bytes);
    footer.integer(std::uint8_t{0x02});
    footer.integer(std::uint64_t{20});
    footer.integer(start);
    footer.integer(offsets_start);
    put(footer.bytes);
    McapBytes last;
    last.integer(crc_.value());
    last.bytes += magic();
    put(last.bytes);
    return static_cast<bool>(to_.flush());
  }

 private:
  static std::string magic() { return {"\x89MCAP0\r\n", 8}; }

  void put(std::string_view bytes) {
    crc_.add(bytes);
    to_.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    written_ += bytes.size();
  }
  void close_chunk() {
    if (chunk_.bytes.empty()) return;
    Crc32 crc;
    crc.add(chunk_.bytes);
    const auto size = static_cast<std::uint64_t>(chunk_.bytes.size());
    McapBytes b;
    b.integer(chunk_start_);
    b.integer(chunk_end_);
    b.integer(size);
    b.integer(crc.value());
    b.string("");  // not compressed
    b.integer(size);
    b.bytes += chunk_.bytes;
    McapBytes record;
    record.record(0x06, b.bytes);
    const std::uint64_t at = written_;
    put(record.bytes);
    const std::uint64_t length = record.bytes.size();

    McapBytes where, indices;  // of the messages of each channel
    for (std::size_t c = 0; c < index_.size(); ++c) {
      if (index_[c].empty()) continue;
      where.integer(static_cast<std::uint16_t>(c));
      where.integer(written_ + indices.bytes.size());
      McapBytes entry;
      entry.integer(static_cast<std::uint16_t>(c));
      entry.integer(static_cast<std::uint32_t>(16 * index_[c].size()));
      for (const auto& [time, offset] : index_[c]) entry.integer(time), entry.integer(offset);
      indices.record(0x07, entry.bytes);
      index_[c].clear();
    }
    put(indices.bytes);

    McapBytes chunk;
    chunk.integer(chunk_start_);
    chunk.integer(chunk_end_);
    chunk.integer(at);
    chunk.integer(length);
    chunk.string(where.bytes);
    chunk.integer(static_cast<std::uint64_t>(indices.bytes.size()));
    chunk.string("");
    chunk.integer(size);
    chunk.integer(size);
    chunks_.record(0x08, chunk.bytes);
    ++chunk_count_;
    chunk_.bytes.clear();
  }
  std::string statistics() const {
    McapBytes b;
    b.integer(messages_);
    b.integer(static_cast<std::uint16_t>(schema_count_));
    b.integer(static_cast<std::uint32_t>(counts_.size()));
    b.integer(std::uint32_t{0});  // attachments
    b.integer(std::uint32_t{0});  // metadata
    b.integer(chunk_count_);
    b.integer(start_);
    b.integer(end_);
    McapBytes counts;
    for (std::size_t c = 0; c < counts_.size(); ++c) {
      counts.integer(static_cast<std::uint16_t>(c));
      counts.integer(counts_[c]);
    }
    b.string(counts.bytes);
    McapBytes record;
    record.record(0x0b, b.bytes);
    return record.bytes;
  }

  std::ostream& to_;
  std::size_t chunk_size_;
  Crc32 crc_;
  std::uint64_t written_{0}, messages_{0}, start_{0}, end_{0}, chunk_start_{0}, chunk_end_{0};
  std::uint32_t schema_count_{0}, chunk_count_{0};
  McapBytes schemas_, channels_, chunk_, chunks_;
  std::vector<std::uint64_t> counts_;
  std::vector<std::vector<std::pair<std::uint64_t, std::uint64_t>>> index_;
};

}  // namespace icat::detail
