// One thread of a process stands still, and the others go on: what a loop that hangs looks like from outside.
//
//     hold_thread PROCESS NAME
//
// Says "held", and ends when the thread does, with its process. Who holds a thread so has to be its tracer: where this
// program is killed, the thread goes on.
#include <sys/ptrace.h>
#include <sys/wait.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

namespace {

pid_t thread_named(const std::string& process, const std::string& name) {
  for (const auto& task : std::filesystem::directory_iterator("/proc/" + process + "/task")) {
    std::string comm;
    std::getline(std::ifstream(task.path() / "comm"), comm);
    if (comm == name) return std::atoi(task.path().filename().c_str());
  }
  return 0;
}

}  // namespace

int main(int count, char** words) {
  if (count != 3) {
    (void)std::fprintf(stderr, "usage: hold_thread PROCESS NAME\n");
    return 2;
  }
  const pid_t thread = thread_named(words[1], words[2]);
  if (thread == 0 || ptrace(PTRACE_SEIZE, thread, nullptr, nullptr) != 0 ||
      ptrace(PTRACE_INTERRUPT, thread, nullptr, nullptr) != 0) {
    std::perror("hold_thread: cannot be held");
    return 1;
  }
  int status = 0;
  if (waitpid(thread, &status, __WALL) != thread || !WIFSTOPPED(status)) return 1;
  (void)std::printf("held\n");
  (void)std::fflush(stdout);
  while (waitpid(thread, &status, __WALL) == thread && !WIFEXITED(status) && !WIFSIGNALED(status)) {
  }
  return 0;
}
