// The source is read once, from its first byte to its last: it lies in memory that may not be read, and each read that
// leaves the pages at hand is caught. Within them the kernels' vectors do not overlap.
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <cstdint>
#include <cstring>
#include <vector>

#include "pipeline/core/arena.hpp"
#include "pipeline/photometry/ingest.hpp"
#include "tests/support/each_target.hpp"

namespace stereotrack {
namespace {

/// Pages of which only the two that were come to last are readable: reading another one is caught, counted, and closes
/// the older of the two. So a page that is read, left, and read again, counts twice. Two, because what lies across the
/// border of two pages may be read in any order.
class WatchedPages {
 public:
  explicit WatchedPages(std::size_t bytes)
      : page_(static_cast<std::size_t>(sysconf(_SC_PAGESIZE))), reads_((bytes + page_ - 1) / page_, 0) {
    void* memory = mmap(nullptr, reads_.size() * page_, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (memory != MAP_FAILED) begin_ = static_cast<std::uint8_t*>(memory);
  }
  WatchedPages(const WatchedPages&) = delete;
  WatchedPages& operator=(const WatchedPages&) = delete;
  ~WatchedPages() { munmap(begin_, reads_.size() * page_); }

  [[nodiscard]] std::uint8_t* data() const { return begin_; }
  [[nodiscard]] std::size_t page() const { return page_; }

  /// How often each page was come to while `work` ran.
  template <class Work>
  std::vector<int> reads_during(Work&& work) {
    std::fill(reads_.begin(), reads_.end(), 0);
    order_ok_ = true;
    readable_ = {kNone, kNone};
    watched_ = this;
    mprotect(begin_, reads_.size() * page_, PROT_NONE);
    struct sigaction action {};
    struct sigaction before {};
    action.sa_sigaction = &caught;
    action.sa_flags = SA_SIGINFO;
    sigaction(SIGSEGV, &action, &before);
    work();
    sigaction(SIGSEGV, &before, nullptr);
    mprotect(begin_, reads_.size() * page_, PROT_READ | PROT_WRITE);
    watched_ = nullptr;
    return reads_;
  }
  /// In the last reads_during(): no page was come to after a later one.
  [[nodiscard]] bool forwards() const { return order_ok_; }

 private:
  static constexpr std::size_t kNone = SIZE_MAX;

  static void caught(int, siginfo_t* info, void*) {
    const auto* at = static_cast<const std::uint8_t*>(info->si_addr);
    if (watched_ == nullptr || at < watched_->begin_ ||
        at >= watched_->begin_ + watched_->reads_.size() * watched_->page_) {
      std::signal(SIGSEGV, SIG_DFL);  // a fault of the program: it returns to it and ends
      return;
    }
    watched_->come_to(static_cast<std::size_t>(at - watched_->begin_) / watched_->page_);
  }
  void come_to(std::size_t page) {
    if (readable_[0] != kNone) mprotect(begin_ + readable_[0] * page_, page_, PROT_NONE);
    if (readable_[1] != kNone) order_ok_ = order_ok_ && page > readable_[1];
    mprotect(begin_ + page * page_, page_, PROT_READ);
    readable_ = {readable_[1], page};
    ++reads_[page];
  }

  static inline WatchedPages* watched_ = nullptr;
  std::size_t page_;
  std::vector<int> reads_;
  std::uint8_t* begin_ = nullptr;
  std::array<std::size_t, 2> readable_{kNone, kNone};  // the older one first
  bool order_ok_ = true;
};

// Rows of three pages of pixels, so that whole pages lie within a row, too; page borders are multiples of all vectors.
TEST(IngestOnce, EachPageOfEachFormatIsReadOnceAndInOrder) {
  const auto page = static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
  const int width = static_cast<int>(3 * page);
  const int height = 6;
  Arena arena;
  const IngestPlanes planes{arena.image<std::uint8_t>(width, height), arena.image<std::uint8_t>(width, height),
                            arena.image<std::uint8_t>(width, height)};
  Result<Ingest> ingest = Ingest::create(width, arena);
  ASSERT_TRUE(ingest.has_value());
  for (int number = 0; number < kPixelFormats; ++number) {
    const auto format = static_cast<PixelFormat>(number);
    const std::size_t stride = row_bytes(format, width);
    const std::size_t rows = static_cast<std::size_t>(memory_rows(format, height));
    WatchedPages source(stride * rows);
    ASSERT_NE(source.data(), nullptr);
    for (std::size_t i = 0; i < stride * rows; ++i) source.data()[i] = static_cast<std::uint8_t>(i * 7 + i / 251);
    const Picture picture{source.data(), width, height, static_cast<std::ptrdiff_t>(stride), format};
    test::on_each_target([&] {
      Histogram histogram;
      const std::vector<int> reads = source.reads_during([&] { ingest->run(picture, planes, &histogram); });
      EXPECT_EQ(reads, std::vector<int>(reads.size(), 1)) << static_cast<int>(format);
      EXPECT_TRUE(source.forwards()) << static_cast<int>(format);
    });
    std::vector<std::uint8_t> copy(stride * rows);
    const std::vector<int> reads = source.reads_during([&] { ingest->run(picture, planes, nullptr, copy.data()); });
    EXPECT_EQ(reads, std::vector<int>(reads.size(), 1)) << "with a copy, " << static_cast<int>(format);
    EXPECT_TRUE(std::equal(copy.begin(), copy.end(), source.data()));
  }
}

// The watch itself: what is come back to is counted twice.
TEST(IngestOnce, TheWatchSeesASecondReading) {
  const auto page = static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
  WatchedPages source(3 * page);
  ASSERT_NE(source.data(), nullptr);
  volatile std::uint8_t seen = 0;
  const std::vector<int> reads = source.reads_during([&] {
    for (const std::size_t at : {std::size_t{0}, page, std::size_t{1}, 2 * page, page + 1, std::size_t{2}}) {
      seen = static_cast<const volatile std::uint8_t*>(source.data())[at];
    }
  });
  EXPECT_EQ(reads, (std::vector<int>{2, 1, 1}));
  EXPECT_FALSE(source.forwards());
}

}  // namespace
}  // namespace stereotrack
