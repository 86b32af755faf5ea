// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Counts heap allocations of the calling thread by interposing malloc (glibc), which works in
/// Release and sees Eigen's, unlike EIGEN_RUNTIME_NO_MALLOC and operator-new counters.
/// Include in exactly one file of an executable.
#pragma once

#include <cstddef>
#include <cstdlib>

extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);
}

inline thread_local long allocations = 0;

// Sanitizers interpose malloc themselves; there the counter stays 0 and the tests are skipped.
#if defined(__SANITIZE_ADDRESS__)
#define ICAT_TEST_NO_MALLOC_COUNT 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
#define ICAT_TEST_NO_MALLOC_COUNT 1
#endif
#endif

#ifndef ICAT_TEST_NO_MALLOC_COUNT
extern "C" {
void* malloc(std::size_t size) noexcept {
  ++allocations;
  return __libc_malloc(size);
}
void* calloc(std::size_t n, std::size_t size) noexcept {
  ++allocations;
  return __libc_calloc(n, size);
}
void* realloc(void* p, std::size_t size) noexcept {
  ++allocations;
  return __libc_realloc(p, size);
}
void* memalign(std::size_t alignment, std::size_t size) noexcept {
  ++allocations;
  return __libc_memalign(alignment, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) noexcept {
  ++allocations;
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** p, std::size_t alignment, std::size_t size) noexcept {
  ++allocations;
  *p = __libc_memalign(alignment, size);
  return *p ? 0 : 12;
}
}
#endif

/// Heap allocations made by `f`.
template <class F>
long count_allocations(F&& f) {
  const long before = allocations;
  f();
  return allocations - before;
}
