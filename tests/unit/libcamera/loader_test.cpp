#include "drivers/capture/libcamera/loader.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/libcamera/support.hpp"

namespace stereotrack::capture::libcamera {
namespace {

using ::testing::HasSubstr;
using Module = test::Scripted;

TEST_F(Module, ThatFitsIsLoadedAndNamesItsLibrary) {
  const Loaded loaded = load_module({folder_.path()});
  ASSERT_NE(loaded.module, nullptr);
  EXPECT_EQ(loaded.path, folder_ / "stereotrack-libcamera-9.1.so");
  EXPECT_STREQ(loaded.module->library(), "v9.1-scripted");
  EXPECT_TRUE(loaded.problems.empty());
}

TEST_F(Module, EachThatDoesNotFitIsALineAndTheNextIsTried) {
  const auto newest = folder_.write("stereotrack-libcamera-12.so", "no object");
  const auto lacks = add("11.2", "lacks");
  const auto version = add("11.1", "other_version");
  const auto size = add("11.0.9", "other_size");
  const auto entry = add("10.0", "no_entry");
  const auto table = add("9.2", "no_table");
  const Loaded loaded = load_module({folder_.path()});
  ASSERT_NE(loaded.module, nullptr);
  EXPECT_EQ(loaded.path, folder_ / "stereotrack-libcamera-9.1.so");
  ASSERT_EQ(loaded.problems.size(), 6U);
  EXPECT_THAT(loaded.problems[0], HasSubstr(newest.string() + " cannot be loaded ("));
  EXPECT_THAT(loaded.problems[1], HasSubstr(lacks.string() + " cannot be loaded ("));
  EXPECT_THAT(loaded.problems[1], HasSubstr("symbol_of_another_libcamera"));
  EXPECT_THAT(loaded.problems[2], HasSubstr(version.string() + " has interface version 3, and 2 is wanted"));
  EXPECT_THAT(loaded.problems[3], HasSubstr(size.string() + " has a table of 8 bytes"));
  EXPECT_THAT(loaded.problems[4], HasSubstr(entry.string() + " is no module of ours"));
  EXPECT_THAT(loaded.problems[5], HasSubstr(table.string() + " gives no table"));
  for (const std::string& problem : loaded.problems) EXPECT_EQ(problem.find('\n'), std::string::npos) << problem;
}

TEST_F(Module, NoneAtAllIsOneLineWithTheFoldersAndTheWayOut) {
  const Loaded loaded = load_module({folder_ / "empty", folder_ / "not-there"});
  EXPECT_EQ(loaded.module, nullptr);
  ASSERT_EQ(loaded.problems.size(), 1U);
  EXPECT_THAT(loaded.problems[0], HasSubstr((folder_ / "empty").string()));
  EXPECT_THAT(loaded.problems[0], HasSubstr((folder_ / "not-there").string()));
  EXPECT_THAT(loaded.problems[0], HasSubstr("STEREOTRACK_MODULE_PATH"));
}

TEST(Modules, AreTriedFolderByFolderTheNewestFirst) {
  const test::TempDir folder;
  for (const char* const name :
       {"a/stereotrack-libcamera-0.0.3.so", "a/stereotrack-libcamera-0.4.so", "a/stereotrack-libcamera-0.10.so",
        "b/stereotrack-libcamera-1.0.so", "a/libcamera.so", "a/stereotrack-libcamera-0.5.so.bak"}) {
    (void)folder.write(name, "");
  }
  const auto found = find_modules({folder / "a", folder / "b"});
  ASSERT_EQ(found.size(), 4U);
  EXPECT_EQ(found[0], folder / "a/stereotrack-libcamera-0.10.so");
  EXPECT_EQ(found[1], folder / "a/stereotrack-libcamera-0.4.so");
  EXPECT_EQ(found[2], folder / "a/stereotrack-libcamera-0.0.3.so");
  EXPECT_EQ(found[3], folder / "b/stereotrack-libcamera-1.0.so");
}

TEST(Modules, FoldersAreThoseOfTheUserThenBesideTheProgramThenTheInstalled) {
  setenv("STEREOTRACK_MODULE_PATH", "/one::/two", 1);
  const auto folders = module_folders();
  unsetenv("STEREOTRACK_MODULE_PATH");
  ASSERT_EQ(folders.size(), 4U);
  EXPECT_EQ(folders[0], "/one");
  EXPECT_EQ(folders[1], "/two");
  EXPECT_EQ(folders[2], std::filesystem::path(STEREOTRACK_BIN_DIR).parent_path() / "lib/stereotrack");
  EXPECT_EQ(folders[3].filename(), "stereotrack");
  EXPECT_EQ(module_folders().size(), 2U);
}

TEST_F(Module, ThatCannotLookForCamerasSaysSoAndAV4l2CameraIsNoneOfItsBusiness) {
  script_->refuses_manager = 1;
  EXPECT_THAT(refusal(settings("0")), HasSubstr("camera 0: libcamera v9.1-scripted, "));
  EXPECT_THAT(refusal(settings("0")), HasSubstr("does not start to look for cameras"));
  const Listing listing = list_cameras();
  EXPECT_TRUE(listing.cameras.empty());
  EXPECT_TRUE(listing.module.empty());
  ASSERT_EQ(listing.problems.size(), 1U);
}

}  // namespace
}  // namespace stereotrack::capture::libcamera
