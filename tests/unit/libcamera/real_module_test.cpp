#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <stdexcept>

#include "drivers/capture/libcamera/libcamera.hpp"
#include "drivers/capture/libcamera/loader.hpp"

namespace stereotrack::capture::libcamera {
namespace {

using ::testing::HasSubstr;

// The module that was built, with the libcamera of this machine, which most likely has no cameras.
TEST(RealModule, LoadsAndTellsOfItsCamerasOrThatThereAreNone) {
  setenv("STEREOTRACK_MODULE_PATH", std::filesystem::path(REAL_MODULE).parent_path().c_str(), 1);
  const Listing listing = list_cameras();
  ASSERT_FALSE(listing.module.empty()) << listing.problems.front();
  EXPECT_THAT(listing.module, HasSubstr(std::string("libcamera v") + LIBCAMERA_BUILT_AGAINST));
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

}  // namespace
}  // namespace stereotrack::capture::libcamera
