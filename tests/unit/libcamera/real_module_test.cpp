#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "drivers/capture/libcamera/libcamera.hpp"
#include "drivers/capture/libcamera/loader.hpp"

namespace stereotrack::capture::libcamera {
namespace {

using ::testing::HasSubstr;

// The module that was built, with the libcamera of this machine, which most likely has no cameras.
TEST(RealModule, LoadsAndTellsOfItsCamerasOrThatThereAreNone) {
  setenv("STEREOTRACK_MODULE_PATH", std::filesystem::path(REAL_MODULE).parent_path().c_str(), 1);
  ::testing::internal::CaptureStderr();
  const Listing listing = list_cameras();
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");  // its complaints are in the list
  ASSERT_FALSE(listing.module.empty()) << listing.problems.front();
  EXPECT_THAT(listing.module, HasSubstr("libcamera v" LIBCAMERA_BUILT_AGAINST));
  EXPECT_THAT(listing.module, HasSubstr(REAL_MODULE));
  EXPECT_EQ(listing.cameras.empty(), !listing.problems.empty());

  // Again: a manager may be opened after another was closed.
  EXPECT_EQ(list_cameras().cameras.size(), listing.cameras.size());
  Settings wish;
  wish.device = "no such camera";
  try {
    (void)open(wish);
    FAIL() << "it was opened";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("camera no such camera: libcamera has none of that name; it knows "));
  }
}

// SIGTERM belongs to the service thread: a thread that did not block it would end the program.
TEST(RealModule, ItsThreadsBlockTheProgramsSignals) {
  setenv("STEREOTRACK_MODULE_PATH", std::filesystem::path(REAL_MODULE).parent_path().c_str(), 1);
  std::vector<std::string> problems;
  const auto session = Session::get(problems);
  ASSERT_NE(session, nullptr);
  int faulting = 0;
  for (const auto& task : std::filesystem::directory_iterator("/proc/self/task")) {
    if (task.path().filename() == std::to_string(getpid())) continue;
    std::ifstream status(task.path() / "status");
    std::uint64_t blocked = 0;
    for (std::string word; status >> word;) {
      if (word == "SigBlk:") status >> std::hex >> blocked;
    }
    for (const int signal : {SIGTERM, SIGINT, SIGHUP, SIGUSR1}) EXPECT_NE(blocked >> (signal - 1) & 1, 0U) << signal;
    if ((blocked >> (SIGSEGV - 1) & 1) == 0) ++faulting;
  }
  EXPECT_GT(faulting, 0);  // its manager's; those of lttng block even these
  sigset_t ours;
  ASSERT_EQ(pthread_sigmask(SIG_BLOCK, nullptr, &ours), 0);
  EXPECT_EQ(sigismember(&ours, SIGTERM), 0);
}

}  // namespace
}  // namespace stereotrack::capture::libcamera
