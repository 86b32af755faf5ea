// SPDX-License-Identifier: BSD-3-Clause
// A Cortex-M4F or M7 without operating system, as QEMU's boards mps2-an386 and mps2-an500 have it:
// start, faults, memory from a static arena, the stack's high-water mark, a count of instructions,
// and text and exit status by semihosting. On another board the vector table, `print` and `stop`
// change.
#include "board.hpp"

#include <array>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <new>

// From the linker script.
extern "C" {
extern std::uint32_t stack_begin[], stack_end[], data_begin[], data_end[], bss_begin[], bss_end[];
extern const std::uint32_t data_in_flash[];
extern const char flash_size[];  // its address is the number
extern void (*const init_array_begin[])();
extern void (*const init_array_end[])();
}

namespace {

// --- semihosting: what the debugger, here QEMU, does for the program -----------------------------

std::uint32_t semihosting(std::uint32_t operation, const void* argument) {
  register std::uint32_t r0 asm("r0") = operation;
  register const void* r1 asm("r1") = argument;
  asm volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
  return r0;
}

[[noreturn]] void stop(std::uint32_t exit_status) {
  constexpr std::uint32_t exit_extended = 0x20, application_exit = 0x20026;
  const std::array<std::uint32_t, 2> argument{application_exit, exit_status};
  for (;;) semihosting(exit_extended, argument.data());
}

// --- memory: an arena that is never given back ---------------------------------------------------

// Memory that is freed is not used again: then nothing fragments, and what construction needs is
// one number that can be tested.
constexpr std::size_t arena_size = 128 * 1024;
constexpr std::size_t arena_alignment = 16;  // what Eigen asks for its matrices of fixed size
constexpr std::size_t usual_alignment = 8;   // what `malloc` and plain `new` give
alignas(arena_alignment) [[gnu::section(".arena")]] std::array<std::byte, arena_size> arena;
std::size_t arena_used = 0;
bool memory_locked = false, violation_expected = false;

void* allocate(std::size_t size, std::size_t alignment = usual_alignment) {
  if (memory_locked) {
    if (violation_expected) {
      board::print("guard an allocation in the control step is caught\n");
      stop(0);
    }
    board::fail("an allocation after construction");
  }
  if (alignment > arena_alignment) board::fail("an alignment above the arena's");
  const std::size_t begin = (arena_used + alignment - 1) / alignment * alignment;
  if (begin > arena_size || size > arena_size - begin) board::fail("the arena is full");
  arena_used = begin + size;
  return arena.data() + begin;
}

void* allocate_zeros(std::size_t count, std::size_t size) {
  if (size != 0 && count > arena_size / size) board::fail("the arena is full");
  return std::memset(allocate(count * size), 0, count * size);
}

// --- the stack's high-water mark -----------------------------------------------------------------

constexpr std::uint32_t paint = 0xdecafbad;

std::uint32_t highest_stack() {
  const std::uint32_t* word = stack_begin;
  while (*word == paint) ++word;
  return static_cast<std::uint32_t>(stack_end - word) * 4;
}

// --- SysTick -------------------------------------------------------------------------------------

struct SysTick {
  std::uint32_t control, reload, current;
};
volatile SysTick& systick = *reinterpret_cast<volatile SysTick*>(0xe000e010);
constexpr std::uint32_t systick_mask = 0xff'ffff;  // 24 bits

// QEMU, started with `-icount shift=0`, lets one instruction take 1 ns of the virtual time that
// drives all its clocks. SysTick runs at the boards' 25 MHz, so one step of it is 40 ns and 40
// instructions. On silicon SysTick counts the processor's own clock: this would be 1, and the
// figures cycles.
constexpr std::uint32_t instructions_per_step = 1'000'000'000 / 25'000'000;

// --- start ---------------------------------------------------------------------------------------

[[gnu::used]] void start() {
  std::memcpy(data_begin, data_in_flash,
              static_cast<std::size_t>(data_end - data_begin) * sizeof(std::uint32_t));
  std::memset(bss_begin, 0, static_cast<std::size_t>(bss_end - bss_begin) * sizeof(std::uint32_t));
  systick.reload = systick_mask;
  systick.current = 0;
  systick.control = 0b101;  // the processor's clock, no interrupt, on
  for (auto initialize = init_array_begin; initialize < init_array_end; ++initialize) {
    (*initialize)();
  }
}

[[noreturn, gnu::used]] void fault() { board::fail("a fault of the processor"); }

}  // namespace

// Switches the FPU on before any instruction of it can occur, and paints the stack while nothing is
// on it. The compiler writes no instruction of its own into a naked function.
extern "C" [[noreturn, gnu::naked, gnu::used]] void reset() {
  asm volatile(
      "ldr r0, =0xe000ed88 \n"  // CPACR: full access to coprocessors 10 and 11
      "ldr r1, [r0]        \n"
      "orr r1, #0xf00000   \n"
      "str r1, [r0]        \n"
      "dsb                 \n"
      "isb                 \n"
      "ldr r0, =stack_begin\n"
      "ldr r1, =stack_end  \n"
      "ldr r2, =%c0        \n"
      "0: str r2, [r0], #4 \n"
      "cmp r0, r1          \n"
      "blo 0b              \n"
      "bl %c1              \n"
      "bl main             \n"
      "b %c2               \n"  // main does not return
      :
      : "i"(paint), "i"(start), "i"(fault));
}

// Initial stack pointer, reset, and one handler for all faults. No interrupt is ever enabled.
using Vector = void (*)();
extern "C" const Vector vectors[];
[[gnu::section(".vectors"), gnu::used]] const Vector vectors[16] = {
    reinterpret_cast<Vector>(stack_end), reset, fault, fault, fault, fault, fault};

namespace board {

void print(const char* text) {
  constexpr std::uint32_t write0 = 0x04;
  semihosting(write0, text);
}

std::uint32_t now() { return systick.current; }
std::uint32_t elapsed(std::uint32_t start) {  // SysTick counts down
  return ((start - systick.current) & systick_mask) * instructions_per_step;
}
void run_instructions(std::uint32_t instructions) {
  std::uint32_t rounds = instructions / 2;
  asm volatile("0: subs %0, #1 \n bne 0b" : "+r"(rounds) : : "cc");
}

void lock_memory() { memory_locked = true; }
void print_memory() {
  if (*stack_begin != paint) fail("the stack was full");
  const auto bytes = [](const std::uint32_t* begin, const std::uint32_t* end) {
    return static_cast<std::uint32_t>(end - begin) * 4;
  };
  print_figure("flash", reinterpret_cast<std::uintptr_t>(flash_size));
  print_figure("static", bytes(data_begin, data_end) + bytes(bss_begin, bss_end));
  print_figure("arena", arena_used);
  print_figure("stack", highest_stack());
}
void finish() {
  violation_expected = true;
  static_cast<void>(::operator new(1));
  fail("an allocation was not caught");
}
void fail(const char* text) {
  print("error: ");
  print(text);
  print("\n");
  stop(1);
}

}  // namespace board

// --- what the libraries call ---------------------------------------------------------------------

// `malloc` for Eigen, `_malloc_r` for the C library itself.
extern "C" {
struct _reent;
void* malloc(std::size_t size) { return allocate(size); }
void* calloc(std::size_t count, std::size_t size) { return allocate_zeros(count, size); }
void* realloc(void*, std::size_t) { board::fail("realloc"); }  // nothing here needs it
void free(void*) {}
void* _malloc_r(_reent*, std::size_t size) { return allocate(size); }
void* _calloc_r(_reent*, std::size_t count, std::size_t size) {
  return allocate_zeros(count, size);
}
void* _realloc_r(_reent*, void*, std::size_t) { board::fail("realloc"); }
void _free_r(_reent*, void*) {}
void abort() { board::fail("abort"); }
// The C library's own would bring all of stdio with it.
void __assert_func(const char*, int, const char*, const char* text) { board::fail(text); }
}

void* operator new(std::size_t size) { return allocate(size); }
void* operator new[](std::size_t size) { return allocate(size); }
void* operator new(std::size_t size, std::align_val_t alignment) {
  return allocate(size, static_cast<std::size_t>(alignment));
}
void* operator new[](std::size_t size, std::align_val_t alignment) {
  return allocate(size, static_cast<std::size_t>(alignment));
}
void operator delete(void*) noexcept {}
void operator delete[](void*) noexcept {}
void operator delete(void*, std::size_t) noexcept {}
void operator delete[](void*, std::size_t) noexcept {}
void operator delete(void*, std::align_val_t) noexcept {}
void operator delete[](void*, std::align_val_t) noexcept {}
void operator delete(void*, std::size_t, std::align_val_t) noexcept {}
void operator delete[](void*, std::size_t, std::align_val_t) noexcept {}
