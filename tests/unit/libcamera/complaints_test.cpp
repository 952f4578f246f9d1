#include "drivers/capture/libcamera/module/complaints.hpp"

#include <gtest/gtest.h>

#include <ostream>
#include <thread>

namespace stereotrack::libcamera_module {
namespace {

TEST(LogLine, LosesTimeThreadLevelAndColours) {
  const char* const wanted = "DmaBufAllocator dma_buf_allocator.cpp:120 Could not open any dma-buf provider";
  EXPECT_EQ(
      text_of_log_line("[0:12:34.123456789] [4711] ERROR DmaBufAllocator dma_buf_allocator.cpp:120 Could not open "
                       "any dma-buf provider"),
      wanted);
  EXPECT_EQ(text_of_log_line("\x1b[1;32m[0:12:34.123456789] \x1b[0m[4711] \x1b[1;31mERROR \x1b[1;37mDmaBufAllocator "
                             "\x1b[1;34mdma_buf_allocator.cpp:120 \x1b[0mCould not open any dma-buf provider"),
            wanted);
  EXPECT_EQ(text_of_log_line("of another form"), "of another form");
  EXPECT_EQ(text_of_log_line("torn \x1b[1"), "torn ");
  EXPECT_EQ(text_of_log_line(""), "");
}

TEST(Complaints, TheLastWholeLineIsTold) {
  Complaints complaints;
  std::ostream log(&complaints);
  EXPECT_EQ(complaints.last(), "");
  log << "[1] ERROR V4L2 first\n[2] ERROR "
      << "V4L2 second" << std::endl
      << "[3] ERROR V4L2 not yet";
  EXPECT_EQ(complaints.last(), "V4L2 second");
  log << '\n' << '\n';
  EXPECT_EQ(complaints.last(), "V4L2 not yet");
  complaints.forget();
  EXPECT_EQ(complaints.last(), "");
  EXPECT_TRUE(log.good());
}

TEST(Complaints, AreReadWhileTheyAreWritten) {
  Complaints complaints;
  std::thread writer([&complaints] {
    std::ostream log(&complaints);
    for (int i = 0; i < 1000; ++i) log << "ERROR always the same\n";
  });
  for (int i = 0; i < 1000; ++i) {
    const std::string last = complaints.last();
    EXPECT_TRUE(last.empty() || last == "ERROR always the same") << last;
  }
  writer.join();
  EXPECT_EQ(complaints.last(), "ERROR always the same");
}

}  // namespace
}  // namespace stereotrack::libcamera_module
