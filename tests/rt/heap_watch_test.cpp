// The guard of the frame loop's test is a test's subject itself: what it lets through, nobody would see.
#include "tests/rt/heap_watch.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <new>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace stereotrack::test {
namespace {

// The compiler may leave out a pair of new and delete that nobody looks at; through this it looks.
template <class T>
T* seen(T* memory) {
  asm volatile("" : "+r"(memory) : : "memory");
  return memory;
}

class HeapWatchTest : public testing::Test {
 protected:
  void SetUp() override { ASSERT_TRUE(allocations_are_counted()) << "not to be built with a sanitizer"; }
};

TEST_F(HeapWatchTest, WorkWithoutHeapIsNotCounted) {
  char text[64];
  const HeapWatch watch;
  std::memset(seen(text), 7, sizeof text);
  EXPECT_EQ(watch.calls(), 0U);
}

TEST_F(HeapWatchTest, MallocIsCaught) {
  const HeapWatch watch;
  void* memory = seen(std::malloc(100));
  EXPECT_EQ(watch.allocations(), 1U);
  std::free(memory);
}

TEST_F(HeapWatchTest, CallocIsCaught) {
  const HeapWatch watch;
  void* memory = seen(std::calloc(10, 10));
  EXPECT_EQ(watch.allocations(), 1U);
  std::free(memory);
}

TEST_F(HeapWatchTest, ReallocIsCaught) {
  void* memory = seen(std::malloc(100));
  const HeapWatch watch;
  void* grown = seen(std::realloc(memory, 100000));
  EXPECT_EQ(watch.allocations(), 1U);
  std::free(grown);
}

TEST_F(HeapWatchTest, AlignedAllocIsCaught) {
  const HeapWatch watch;
  void* memory = seen(std::aligned_alloc(64, 128));
  EXPECT_EQ(watch.allocations(), 1U);
  std::free(memory);
}

TEST_F(HeapWatchTest, PosixMemalignIsCaught) {
  void* memory = nullptr;
  const HeapWatch watch;
  ASSERT_EQ(posix_memalign(&memory, 64, 128), 0);
  EXPECT_EQ(watch.allocations(), 1U);
  std::free(seen(memory));
}

TEST_F(HeapWatchTest, MemalignIsCaught) {
  const HeapWatch watch;
  void* memory = seen(memalign(64, 128));
  EXPECT_EQ(watch.allocations(), 1U);
  std::free(memory);
}

TEST_F(HeapWatchTest, VallocIsCaught) {
  const HeapWatch watch;
  void* memory = seen(valloc(128));
  EXPECT_EQ(watch.allocations(), 1U);
  std::free(memory);
}

TEST_F(HeapWatchTest, PvallocIsCaught) {
  const HeapWatch watch;
  void* memory = seen(pvalloc(128));
  EXPECT_EQ(watch.allocations(), 1U);
  std::free(memory);
}

TEST_F(HeapWatchTest, ReallocarrayIsCaught) {
  const HeapWatch watch;
  void* memory = seen(reallocarray(nullptr, 10, 10));
  EXPECT_EQ(watch.allocations(), 1U);
  std::free(memory);
}

TEST_F(HeapWatchTest, FreeIsCaught) {
  void* memory = seen(std::malloc(100));
  const HeapWatch watch;
  std::free(memory);
  EXPECT_EQ(watch.frees(), 1U);
  EXPECT_EQ(watch.allocations(), 0U);
}

// NOLINTBEGIN(clang-analyzer-cplusplus.NewDeleteLeaks): it does not see through seen()
TEST_F(HeapWatchTest, NewIsCaught) {
  const HeapWatch watch;
  int* memory = seen(new int(3));
  EXPECT_EQ(watch.allocations(), 1U);
  delete memory;
}

TEST_F(HeapWatchTest, NewOfAnArrayIsCaught) {
  const HeapWatch watch;
  int* memory = seen(new int[30]);
  EXPECT_EQ(watch.allocations(), 1U);
  delete[] memory;
}

TEST_F(HeapWatchTest, NewThatIsAlignedIsCaught) {
  struct alignas(64) Line {
    int value[16];
  };
  const HeapWatch watch;
  Line* memory = seen(new Line);
  EXPECT_EQ(watch.allocations(), 1U);
  delete memory;
}

TEST_F(HeapWatchTest, NewThatDoesNotThrowIsCaught) {
  const HeapWatch watch;
  int* memory = seen(new (std::nothrow) int(3));
  EXPECT_EQ(watch.allocations(), 1U);
  delete memory;
}

TEST_F(HeapWatchTest, DeleteIsCaught) {
  int* memory = seen(new int(3));
  const HeapWatch watch;
  delete memory;
  EXPECT_EQ(watch.frees(), 1U);
  EXPECT_EQ(watch.allocations(), 0U);
}
// NOLINTEND(clang-analyzer-cplusplus.NewDeleteLeaks)

TEST_F(HeapWatchTest, VectorThatGrowsIsCaught) {
  std::vector<int> numbers(4);
  const HeapWatch watch;
  numbers.resize(1000);
  EXPECT_EQ(watch.allocations(), 1U);
  EXPECT_EQ(watch.frees(), 1U);
}

TEST_F(HeapWatchTest, FunctionThatHoldsMuchIsCaught) {
  const std::string text(100, 'a');
  const HeapWatch watch;
  const std::function<std::size_t()> size = [text] { return text.size(); };
  EXPECT_GE(watch.allocations(), 2U);
  EXPECT_EQ(size(), 100U);
}

TEST_F(HeapWatchTest, ExceptionIsCaught) {
  const HeapWatch watch;
  try {
    throw 3;
  } catch (int) {
    EXPECT_GE(watch.allocations(), 1U);
  }
}

TEST_F(HeapWatchTest, AllocationInsideTheStandardLibraryOfCIsCaught) {
  const HeapWatch watch;
  char* copy = seen(strdup("text"));
  EXPECT_EQ(watch.allocations(), 1U);
  std::free(copy);
}

TEST_F(HeapWatchTest, OtherThreadsAreNotCounted) {
  std::atomic<int> turn{0};
  std::uint64_t of_the_other = 0;
  std::thread other([&] {
    while (turn != 1) std::this_thread::yield();
    const HeapWatch watch;
    for (int i = 0; i < 100; ++i) std::free(seen(std::malloc(100)));
    of_the_other = watch.calls();
    turn = 2;
  });
  const HeapWatch watch;
  turn = 1;
  while (turn != 2) std::this_thread::yield();
  EXPECT_EQ(watch.calls(), 0U);
  other.join();
  EXPECT_EQ(of_the_other, 200U);
}

TEST_F(HeapWatchTest, HeapThatGrowsShowsInTheProcessMemory) {
  const ProcessMemory before = ProcessMemory::now();
  constexpr std::size_t kBytes = 4 << 20;
  void* memory = seen(std::malloc(kBytes));
  std::memset(memory, 7, kBytes);
  seen(memory);
  const ProcessMemory after = ProcessMemory::now();
  EXPECT_GE(after.heap, before.heap + kBytes);
  EXPECT_GE(after.anonymous, before.anonymous + kBytes);
  std::free(memory);
  EXPECT_EQ(ProcessMemory::now().heap, before.heap);
}

}  // namespace
}  // namespace stereotrack::test
