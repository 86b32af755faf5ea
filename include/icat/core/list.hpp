// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A list for the library's own data. `std::vector` does the same, but each type of its elements
/// takes a compiler ten times as long (docs/benchmarks.md bounds the compile time of user
/// programs).
#pragma once

#include <cstddef>
#include <utility>

namespace icat {

/// Elements one after the other, all of them constructed: they need a default. Construction, copies
/// and `push_back` allocate.
template <class T>
class List {
 public:
  /// Empty.
  List() {}
  /// `size` elements, each as its default has it.
  [[gnu::noinline, gnu::cold]] explicit List(std::size_t size)
      : elements_(new T[size]()), size_(size), room_(size) {}
  /// `size` times `value`.
  List(std::size_t size, const T& value) : List(size) { fill(value); }
  /// Copies.
  [[gnu::noinline, gnu::cold]] List(const List& other) : List(other.size_) {
    for (std::size_t i = 0; i < size_; ++i) elements_[i] = other.elements_[i];
  }
  /// Takes over what the other has, and leaves it empty.
  List(List&& other) noexcept : elements_(other.elements_), size_(other.size_), room_(other.room_) {
    other.elements_ = nullptr;
    other.size_ = other.room_ = 0;
  }
  /// Copies, or takes over.
  [[gnu::noinline, gnu::cold]] List& operator=(List other) noexcept {
    swap(other);
    return *this;
  }
  [[gnu::noinline, gnu::cold]] ~List() { delete[] elements_; }

  /// Elements.
  std::size_t size() const noexcept { return size_; }
  /// Element `i` < size().
  T& operator[](std::size_t i) noexcept { return elements_[i]; }
  /// The same.
  const T& operator[](std::size_t i) const noexcept { return elements_[i]; }
  /// They are contiguous; null where there never was one.
  T* data() noexcept { return elements_; }
  /// The same.
  const T* data() const noexcept { return elements_; }
  /// For ranges.
  T* begin() noexcept { return elements_; }
  /// The same.
  const T* begin() const noexcept { return elements_; }
  /// For ranges.
  T* end() noexcept { return elements_ + size_; }
  /// The same.
  const T* end() const noexcept { return elements_ + size_; }

  /// All become `value`.
  void fill(const T& value) noexcept {
    for (std::size_t i = 0; i < size_; ++i) elements_[i] = value;
  }
  /// Keeps its memory.
  void clear() noexcept { size_ = 0; }
  /// One more at the end.
  [[gnu::noinline, gnu::cold]] void push_back(T element) {
    if (size_ == room_) {
      List larger(2 * size_ + 4);
      for (std::size_t i = 0; i < size_; ++i) larger.elements_[i] = std::move(elements_[i]);
      larger.size_ = size_;
      swap(larger);
    }
    elements_[size_++] = std::move(element);
  }

 private:
  void swap(List& other) noexcept {
    std::swap(elements_, other.elements_);
    std::swap(size_, other.size_);
    std::swap(room_, other.room_);
  }

  T* elements_{nullptr};
  std::size_t size_{0}, room_{0};
};

}  // namespace icat
