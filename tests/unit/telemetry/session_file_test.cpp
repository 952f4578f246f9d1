#include "drivers/telemetry/session_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <fstream>
#include <set>
#include <string>
#include <vector>

#include "tests/support/temp_dir.hpp"

namespace stereotrack::telemetry {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

std::string content(const fs::path& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

std::string refusal_of(const fs::path& directory) {
  try {
    return "gave " + std::to_string(next_session(directory));
  } catch (const SessionError& error) {
    EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
    return error.what();
  }
}

TEST(Session, BeginsAtOneAndRises) {
  const test::TempDir state;
  for (std::uint64_t run = 1; run <= 5; ++run) EXPECT_EQ(next_session(state.path()), run);
  EXPECT_EQ(content(state / "session"), "5\n");
  EXPECT_FALSE(fs::exists(state / "session.new"));
}

TEST(Session, GoesOnFromWhatTheFileHolds) {
  const test::TempDir state;
  state.write("session", "18446744073709551613");  // without a line end: written by hand
  EXPECT_EQ(next_session(state.path()), 18446744073709551614U);
  EXPECT_EQ(next_session(state.path()), 18446744073709551615U);
  EXPECT_THAT(refusal_of(state.path()), HasSubstr("does not hold the number")) << "there is none higher";
}

TEST(Session, ALeftOverOfAnInterruptedWriteIsNotBelieved) {
  const test::TempDir state;
  state.write("session", "7\n");
  state.write("session.new", "9");
  EXPECT_EQ(next_session(state.path()), 8U);
}

TEST(Session, WhatIsNoNumberIsRefusedAndKept) {
  for (const char* bad : {"", "\n", "x", "-1\n", "1 2\n", "7\n\n", "1e3", " 7", "18446744073709551616\n",
                          "000000000000000000000000000007\n"}) {
    const test::TempDir state;
    const fs::path file = state.write("session", bad);
    EXPECT_THAT(refusal_of(state.path()), HasSubstr(file.string() + ": does not hold the number of the last session"))
        << bad;
    EXPECT_EQ(content(file), bad);
  }
}

TEST(Session, ADirectoryThatCannotBeUsedIsNamed) {
  const test::TempDir state;
  EXPECT_THAT(refusal_of(state / "none"),
              HasSubstr("state directory " + (state / "none").string() + ": No such file or directory; it must be"));
  EXPECT_THAT(refusal_of(state.write("file", "")), HasSubstr("Not a directory"));
  fs::create_directory(state / "session");
  EXPECT_THAT(refusal_of(state.path()), HasSubstr("/session: cannot be read: Is a directory"));
}

TEST(Session, ANumberThatCannotBeWrittenIsNotGiven) {
  const test::TempDir state;
  state.write("session", "7\n");
  // A full disk: no file may grow beyond 0 bytes.
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit none{0, before.rlim_max};
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &none), 0);
  const std::string refused = refusal_of(state.path());
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &before), 0);
  std::signal(SIGXFSZ, handler);
  EXPECT_THAT(refused, HasSubstr("/session: cannot be written: File too large"));
  EXPECT_THAT(refused, HasSubstr("StateDirectory="));
  EXPECT_EQ(content(state / "session"), "7\n");
  EXPECT_FALSE(fs::exists(state / "session.new"));
  EXPECT_EQ(next_session(state.path()), 8U);
}

TEST(Session, ADirectoryWithoutTheRightToWriteIsRefused) {
  const test::TempDir state;
  ASSERT_EQ(::chmod(state.path().c_str(), 0555), 0);
  const bool root = ::geteuid() == 0;  // who may write everywhere, and so becomes nobody for a moment
  if (root) {
    ASSERT_EQ(::seteuid(65534), 0);
  }
  const std::string refused = refusal_of(state.path());
  if (root) {
    ASSERT_EQ(::seteuid(0), 0);
  }
  ASSERT_EQ(::chmod(state.path().c_str(), 0700), 0);
  EXPECT_THAT(refused, HasSubstr("/session: cannot be written: Permission denied; it must be a directory that"));
}

TEST(Session, ProcessesAtOnceGetDifferentNumbers) {
  constexpr int kProcesses = 4;
  constexpr int kEach = 50;
  const test::TempDir state;
  int go[2];
  int numbers[2];
  ASSERT_EQ(::pipe(go), 0);
  ASSERT_EQ(::pipe(numbers), 0);
  std::vector<pid_t> children;
  for (int i = 0; i < kProcesses; ++i) {
    const pid_t child = ::fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      ::close(go[1]);
      char byte = 0;
      (void)!::read(go[0], &byte, 1);  // all begin when the parent closes its end
      for (int n = 0; n < kEach; ++n) {
        const std::uint64_t number = next_session(state.path());
        if (::write(numbers[1], &number, sizeof number) != sizeof number) ::_exit(1);
      }
      ::_exit(0);
    }
    children.push_back(child);
  }
  ::close(go[0]);
  ::close(go[1]);
  ::close(numbers[1]);
  std::set<std::uint64_t> all;
  for (std::uint64_t number = 0; ::read(numbers[0], &number, sizeof number) == sizeof number;) {
    EXPECT_TRUE(all.insert(number).second) << number << " was given twice";
  }
  ::close(numbers[0]);
  for (const pid_t child : children) {
    int result = -1;
    ::waitpid(child, &result, 0);
    EXPECT_EQ(result, 0);
  }
  EXPECT_EQ(all.size(), static_cast<std::size_t>(kProcesses * kEach));
  EXPECT_EQ(*all.rbegin(), static_cast<std::uint64_t>(kProcesses * kEach));
}

}  // namespace
}  // namespace stereotrack::telemetry
