#pragma once

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <sstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "tests/support/temp_dir.hpp"

namespace stereotrack::test {

inline std::string read_text(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

struct ProgramOptions {
  std::chrono::milliseconds limit{120'000};  ///< then it is killed; in an emulator after five times as long
  /// Largest file it may write [bytes], 0 = any. SIGXFSZ is ignored, so that writing fails as on a full disk.
  /// Its stdout and stderr are files too: leave room for the lines expected.
  rlim_t most_file_bytes = 0;
  int signal = 0;  ///< sent once, `signal_after` after `signal_when` holds
  std::chrono::milliseconds signal_after{0};
  std::function<bool()> signal_when;  ///< empty: from the start
};

struct ProgramResult {
  int exit_code = -1;   ///< -1: ended by a signal
  int signal = 0;       ///< the signal that ended it
  bool killed = false;  ///< by us, after the limit
  std::string out;
  std::string err;
};

/// The words, a line each, of the emulator that programs of another CPU run in: tests/emulated. Empty: none.
inline std::vector<std::string> emulator() {
  std::vector<std::string> words;
  if (const char* lines = std::getenv("STEREOTRACK_EMULATOR"); lines != nullptr) {
    std::istringstream text(lines);
    for (std::string word; std::getline(text, word);) words.push_back(word);
  }
  return words;
}

/// A program that runs beside the test. Its output goes to files, so it never waits for a reader.
class Program {
 public:
  explicit Program(std::vector<std::string> command, ProgramOptions options = {})
      : options_(std::move(options)), start_(Clock::now()) {
    const std::vector<std::string> before = emulator();
    if (!before.empty()) options_.limit *= 5;
    command.insert(command.begin(), before.begin(), before.end());
    std::vector<char*> arguments;
    arguments.reserve(command.size() + 1);
    for (std::string& word : command) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    const std::string out = (folder_ / "out").string();
    const std::string err = (folder_ / "err").string();
    pid_ = fork();
    if (pid_ < 0) throw std::runtime_error(command.front() + ": cannot fork");
    if (pid_ > 0) return;
    redirect("/dev/null", O_RDONLY, STDIN_FILENO);
    redirect(out.c_str(), O_WRONLY | O_CREAT | O_TRUNC, STDOUT_FILENO);
    redirect(err.c_str(), O_WRONLY | O_CREAT | O_TRUNC, STDERR_FILENO);
    if (options_.most_file_bytes > 0) {
      const rlimit limit{options_.most_file_bytes, options_.most_file_bytes};
      if (std::signal(SIGXFSZ, SIG_IGN) == SIG_ERR || setrlimit(RLIMIT_FSIZE, &limit) != 0) _exit(126);
    }
    execv(arguments.front(), arguments.data());
    _exit(127);
  }
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;
  ~Program() {
    if (pid_ <= 0) return;
    (void)kill(pid_, SIGKILL);
    (void)waitpid(pid_, nullptr, 0);
  }

  [[nodiscard]] pid_t pid() const noexcept { return pid_; }

  /// What it has written to stderr so far.
  [[nodiscard]] std::string err_so_far() const { return read_text(folder_ / "err"); }

  ProgramResult wait() {
    ProgramResult result;
    int status = 0;
    while (waitpid(pid_, &status, WNOHANG) == 0) {
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
      send_signal();
      if (Clock::now() - start_ > options_.limit && !result.killed) {
        result.killed = true;
        (void)kill(pid_, SIGKILL);
      }
    }
    pid_ = 0;
    if (WIFEXITED(status)) result.exit_code = WEXITSTATUS(status);
    if (WIFSIGNALED(status)) result.signal = WTERMSIG(status);
    result.out = read_text(folder_ / "out");
    result.err = read_text(folder_ / "err");
    return result;
  }

 private:
  using Clock = std::chrono::steady_clock;

  static void redirect(const char* path, int flags, int to) {
    const int fd = open(path, flags, 0600);
    if (fd < 0 || dup2(fd, to) < 0) _exit(126);
    if (fd != to) (void)close(fd);
  }

  void send_signal() {
    if (options_.signal == 0) return;
    if (!due_known_) {
      if (options_.signal_when && !options_.signal_when()) return;
      due_ = Clock::now() + options_.signal_after;
      due_known_ = true;
    }
    if (Clock::now() < due_) return;
    (void)kill(pid_, options_.signal);
    options_.signal = 0;
  }

  ProgramOptions options_;
  TempDir folder_;
  Clock::time_point start_;
  Clock::time_point due_;
  bool due_known_ = false;
  pid_t pid_ = 0;
};

inline ProgramResult run_program(std::vector<std::string> command, ProgramOptions options = {}) {
  return Program(std::move(command), std::move(options)).wait();
}

}  // namespace stereotrack::test
