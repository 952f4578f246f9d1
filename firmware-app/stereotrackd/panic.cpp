#include "firmware-app/stereotrackd/panic.hpp"

#include <fcntl.h>
#include <pthread.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <stdexcept>
#include <string_view>

#include "firmware-app/runtime/clock.hpp"

namespace stereotrack::daemon {

namespace {

constexpr std::array<int, 5> kFaults{SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT};

// What the handler needs; set before it is installed.
Daemon* g_daemon = nullptr;
int g_file = -1;
std::atomic<bool> g_panics{false};
std::atomic<pthread_t> g_panicking{};

/// One line without printf, which may take memory and locks.
class Line {
 public:
  Line& text(std::string_view text) noexcept {
    for (const char letter : text) put(letter);
    return *this;
  }
  Line& number(std::int64_t value) noexcept {
    if (value < 0) put('-');
    std::array<char, 20> digits{};
    std::size_t count = 0;
    // Of the unsigned value: the smallest has no opposite.
    for (auto rest = value < 0 ? ~static_cast<std::uint64_t>(value) + 1 : static_cast<std::uint64_t>(value);
         rest != 0 || count == 0; rest /= 10) {
      digits[count++] = static_cast<char>('0' + rest % 10);
    }
    while (count > 0) put(digits[--count]);
    return *this;
  }
  void write_to(int fd) noexcept {
    put('\n');
    // Nobody is left to be told that it failed.
    if (fd >= 0 && write(fd, letters_.data(), size_) < 0) return;
  }

 private:
  void put(char letter) noexcept {
    if (size_ < letters_.size()) letters_[size_++] = letter;
  }
  std::array<char, 256> letters_{};
  std::size_t size_ = 0;
};

void tell(const Line& line) noexcept {
  Line copy = line;
  copy.write_to(g_file);
  copy = line;
  copy.write_to(STDERR_FILENO);
}

void on_fault(int signal) {
  // A second fault in here: end at once.
  if (!g_panics.exchange(true)) {
    g_panicking.store(pthread_self());
    const bool safe = g_daemon->make_lines_safe();
    tell(Line()
             .text("stereotrackd: fault, signal ")
             .number(signal)
             .text(safe ? ": lines are in their safe states" : ": LINES COULD NOT BE MADE SAFE")
             .text("; the last outputs:"));
    g_daemon->last_states().for_each([](const LastStates::State& state) {
      tell(Line()
               .text("  pair ")
               .number(static_cast<std::int64_t>(state.ordinal))
               .text(" kind ")
               .number(state.kind)
               .text(" due_ns ")
               .number(state.due_ns)
               .text(" send_error_ns ")
               .number(state.send_error_ns)
               .text(" compute_max_ns ")
               .number(static_cast<std::int64_t>(state.compute_max_ns))
               .text(" targets ")
               .number(state.targets)
               .text(" flags ")
               .number(state.flags)
               .text(" health ")
               .number(state.health));
    });
    if (g_file >= 0) (void)fsync(g_file);
    (void)g_daemon->make_lines_safe();  // a set() that was under way in another thread is over now
  } else if (g_panicking.load() != pthread_self()) {
    // Another thread's fault: the first one is not through yet with the lines, and ends the process.
    for (;;) (void)pause();
  }
  (void)std::signal(signal, SIG_DFL);
  (void)raise(signal);
}

}  // namespace

Panic::Panic(Daemon& daemon, const std::string& path) : path_(path) {
  g_daemon = &daemon;
  g_file = open(path.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0640);
  if (g_file < 0)
    throw std::runtime_error(path + ": " + std::strerror(errno) + ": give a directory that can be written to");
  struct sigaction action {};
  action.sa_handler = on_fault;
  action.sa_flags = SA_NODEFER | SA_ONSTACK;
  for (const int signal : kFaults) (void)sigaction(signal, &action, nullptr);
}

Panic::~Panic() {
  for (const int signal : kFaults) (void)std::signal(signal, SIG_DFL);
  struct stat status {};
  const bool empty = fstat(g_file, &status) == 0 && status.st_size == 0;
  (void)close(g_file);
  if (empty) (void)unlink(path_.c_str());
  g_file = -1;
  g_daemon = nullptr;
}

}  // namespace stereotrack::daemon
