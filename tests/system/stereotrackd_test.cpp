#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <string>
#include <thread>
#include <vector>

#include "drivers/record/recording_source.hpp"
#include "drivers/telemetry/receiver.hpp"
#include "drivers/telemetry/udp_listener.hpp"
#include "tests/support/run_program.hpp"

// The daemon as a process of its own. Nothing here depends on how fast the machine is: tests wait until something has
// happened, and the limit of Program ends what never does.
namespace stereotrack {
namespace {

namespace fs = std::filesystem;
using test::Program;
using test::ProgramResult;
using test::read_text;
using test::run_program;
using test::TempDir;

const std::string kDaemon = STEREOTRACK_BIN_DIR "/stereotrackd";
const std::string kTool = STEREOTRACK_BIN_DIR "/stereotrack";

/// A small scene, and all files in a folder of their own.
std::string small(const fs::path& folder, const std::string& more = "") {
  const fs::path path = folder / "rig.toml";
  std::ofstream(path) << "[source]\nname = \"synthetic:eleven\"\nfps = 30.0\n"
                      << "[synthetic]\nframes = 24\nwidth = 160\nheight = 120\n"
                      << "[realtime]\nmode = \"off\"\n"
                      << "[service]\nstate_directory = \"" << (folder / "state").string() << "\"\n"
                      << more;
  return path.string();
}

bool wait_for(const std::function<bool()>& what) {
  for (int i = 0; i < 6000; ++i) {
    if (what()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return false;
}

bool has_started(const Program& program) { return program.err_so_far().find("latency") != std::string::npos; }

/// Datagrams as they come over UDP, by the sequence of their message.
class Ear {
 public:
  Ear() : listener_(telemetry::parse_endpoint("127.0.0.1:0", true)) {}
  [[nodiscard]] std::string where() const { return to_string(listener_.local()); }
  void listen() {
    std::array<std::byte, 2048> buffer{};
    for (std::ptrdiff_t size = listener_.receive(buffer); size > 0; size = listener_.receive(buffer)) {
      const auto bytes = std::span(buffer).first(static_cast<std::size_t>(size));
      const auto datagram = telemetry::decode(bytes);
      ASSERT_TRUE(datagram.has_value());
      if (datagram->status) {
        ++statuses_;
      } else {
        auto& parts = messages_[datagram->header.sequence];
        parts.insert(parts.end(), bytes.begin(), bytes.end());
        targets_ += datagram->targets.size();
      }
    }
  }
  [[nodiscard]] const std::map<std::uint64_t, std::vector<std::byte>>& messages() const { return messages_; }
  [[nodiscard]] std::size_t statuses() const { return statuses_; }
  [[nodiscard]] std::size_t targets() const { return targets_; }

 private:
  telemetry::UdpListener listener_;
  std::map<std::uint64_t, std::vector<std::byte>> messages_;
  std::size_t statuses_ = 0;
  std::size_t targets_ = 0;
};

TEST(Stereotrackd, ChecksItsConfigurationAndStartsNothing) {
  const TempDir folder;
  const ProgramResult done = run_program({kDaemon, "--config", small(folder.path()), "--check-config"});
  EXPECT_EQ(done.exit_code, 0) << done.err;
  EXPECT_NE(done.out.find("configuration, calibration and source are fine"), std::string::npos) << done.out;
  EXPECT_NE(done.out.find("total"), std::string::npos);
  EXPECT_FALSE(fs::exists(folder / "state"));
}

TEST(Stereotrackd, ChecksASceneWithoutDrawingIt) {
  const TempDir folder;
  // Drawn, it would take 9 GB and half an hour.
  const ProgramResult done = run_program({kDaemon, "--config", small(folder.path()), "--check-config", "--set",
                                          "synthetic.frames=10000", "--set", "synthetic.width=640", "--set",
                                          "synthetic.height=480", "--set", "source.memory_mb=1000000"});
  EXPECT_EQ(done.exit_code, 0) << done.err;
  EXPECT_NE(done.out.find("640x480"), std::string::npos) << done.out;
  const ProgramResult large = run_program({kDaemon, "--config", small(folder.path()), "--check-config", "--set",
                                           "synthetic.frames=10000", "--set", "source.memory_mb=1"});
  EXPECT_EQ(large.exit_code, 1);
  EXPECT_NE(large.err.find("source.memory_mb"), std::string::npos) << large.err;
}

TEST(Stereotrackd, CamerasThatAreNotThereAreALineEach) {
  const TempDir folder;
  const std::string config = small(folder.path());
  const std::vector<std::string> cameras{
      kDaemon, "--config", config, "--set", "source.name=cameras", "--set", "camera.left.device=/dev/no-camera",
      "--set"};
  const auto with = [&](const std::string& set, bool check) {
    std::vector<std::string> all = cameras;
    all.push_back(set);
    if (check) all.emplace_back("--check-config");
    return run_program(all);
  };
  for (const bool check : {true, false}) {
    const ProgramResult mono = with("camera.right.device=", check);
    EXPECT_EQ(mono.exit_code, 1);
    EXPECT_NE(mono.err.find("/dev/no-camera"), std::string::npos) << mono.err;
    EXPECT_EQ(std::count(mono.err.begin(), mono.err.end(), '\n'), 1) << mono.err;
    const ProgramResult format = with("camera.format=png", check);
    EXPECT_EQ(format.exit_code, 2);
    EXPECT_NE(format.err.find("camera.format: "), std::string::npos) << format.err;
    const ProgramResult stereo = with("camera.right.device=/dev/no-other", check);
    EXPECT_EQ(stereo.exit_code, 2);
    EXPECT_NE(stereo.err.find("calibration.file: "), std::string::npos) << stereo.err;
  }
}

TEST(Stereotrackd, BadConfigurationIsOneLineAndExitCodeTwo) {
  const TempDir folder;
  struct Case {
    std::string toml;
    std::string says;
  };
  const std::string synthetic =
      "[synthetic]\nframes = 2\nwidth = 64\nheight = 48\n[source]\nname = \"synthetic:eleven\"\n";
  for (const Case& bad :
       {Case{"[source]\nfps = 30.0\n", "source.name: not set"},
        Case{"[source]\nname = \"synthetic:twelve\"\n", "twelve"},
        Case{"[source]\nname = \"/dev/video0\"\n", "source.name: \"/dev/video0\" is no source"},
        Case{synthetic + "[latency]\noutput = 50\n", "latency.output: unknown key"},
        Case{synthetic + "[metrics]\nlisten = \"garbage\"\n", "metrics.listen: "},
        Case{synthetic + "[latency]\nlead_ms = 20\n", "latency.lead_ms: "},
        Case{synthetic + "[[input]]\nname = \"a\"\nline = \"gpiochip0\"\n", "input[1].line: "},
        Case{synthetic + "[[input]]\nname = \"a\"\nline = \"sim:a\"\nedge = \"up\"\n", "input[1].edge: "},
        Case{"[source]\nflip = true\nname = \"synthetic:eleven\"\n", "source.flip: "},
        Case{synthetic + "[telemetry]\ndestinations = [\"nowhere:1\"]\n", "nowhere"},
        Case{synthetic + "[telemetry]\nkey_file = "
                         "\"/no/such.key\"\n",
             "/no/such.key"}}) {
    const fs::path path = folder / "bad.toml";
    std::ofstream(path) << bad.toml;
    const ProgramResult done = run_program({kDaemon, "--config", path.string()});
    EXPECT_EQ(done.exit_code, 2) << bad.toml << done.err;
    EXPECT_NE(done.err.find(bad.says), std::string::npos) << done.err;
    EXPECT_EQ(std::count(done.err.begin(), done.err.end(), '\n'), 1) << done.err;
  }
  EXPECT_EQ(run_program({kDaemon}).exit_code, 2);
  EXPECT_EQ(run_program({kDaemon, "--config", "/no/such.toml"}).exit_code, 2);
}

TEST(Stereotrackd, AChipThatIsNotThereIsNamed) {
  const TempDir folder;
  const ProgramResult done =
      run_program({kDaemon, "--config",
                   small(folder.path(), "[[signal]]\nname = \"a\"\nline = \"/dev/nochip:3\"\nwhen = \"confirmed\"\n")});
  EXPECT_NE(done.exit_code, 0);
  EXPECT_NE(done.err.find("/dev/nochip"), std::string::npos) << done.err;
}

TEST(Stereotrackd, SendsEachPairAndEndsWithTheFilm) {
  const TempDir folder;
  Ear ear;
  Program daemon({kDaemon, "--config", small(folder.path()), "--set", "source.repeat=once", "--set",
                  "telemetry.destinations=" + ear.where()});
  const ProgramResult done = daemon.wait();
  EXPECT_EQ(done.exit_code, 0) << done.err;
  ear.listen();
  EXPECT_GT(ear.messages().size(), 0U);
  EXPECT_EQ(read_text(folder / "state" / "session").substr(0, 1), "1");
  EXPECT_FALSE(fs::exists(folder / "state" / "last_states.txt")) << "it is written on a fault alone";
}

TEST(Stereotrackd, LogsEachTargetThatComesUnlessToldNotTo) {
  const TempDir folder;
  const std::string config = small(folder.path());
  for (const char* logged : {"true", "false"}) {
    const ProgramResult done =
        run_program({kDaemon, "--config", config, "--set", "source.repeat=once", "--set", "synthetic.frames=60",
                     "--set", "synthetic.width=320", "--set", "synthetic.height=240", "--set",
                     std::string("service.log_targets=") + logged});
    EXPECT_EQ(done.exit_code, 0) << done.err;
    EXPECT_EQ(done.err.find("stereotrackd: target 1 is there, at ") != std::string::npos, *logged == 't') << done.err;
  }
}

TEST(Stereotrackd, SigtermEndsItCleanly) {
  const TempDir folder;
  Program daemon({kDaemon, "--config", small(folder.path())});
  ASSERT_TRUE(wait_for([&] { return has_started(daemon); }));
  ASSERT_EQ(kill(daemon.pid(), SIGTERM), 0);
  const ProgramResult done = daemon.wait();
  EXPECT_EQ(done.exit_code, 0) << done.err;
}

TEST(Stereotrackd, EachRunHasAHigherSession) {
  const TempDir folder;
  const std::string config = small(folder.path());
  for (const char* session : {"session 1", "session 2"}) {
    const ProgramResult done = run_program({kDaemon, "--config", config, "--set", "source.repeat=once"});
    EXPECT_EQ(done.exit_code, 0) << done.err;
    EXPECT_NE(done.err.find(session), std::string::npos) << done.err;
  }
}

/// What systemd would hear.
class NotifySocket {
 public:
  explicit NotifySocket(const fs::path& path) : fd_(socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strncpy(address.sun_path, path.c_str(), sizeof address.sun_path - 1);
    EXPECT_EQ(bind(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  }
  NotifySocket(const NotifySocket&) = delete;
  NotifySocket& operator=(const NotifySocket&) = delete;
  ~NotifySocket() { (void)close(fd_); }
  bool has_heard(const std::string& what) {
    std::array<char, 4096> text{};
    for (ssize_t size = recv(fd_, text.data(), text.size(), 0); size > 0;
         size = recv(fd_, text.data(), text.size(), 0)) {
      heard_.append(text.data(), static_cast<std::size_t>(size)).append("\n");
    }
    return heard_.find(what) != std::string::npos;
  }

 private:
  int fd_;
  std::string heard_;
};

TEST(Stereotrackd, TellsSystemdThatItIsReadyAliveReloadingAndStopping) {
  const TempDir folder;
  NotifySocket systemd(folder / "notify");
  Program daemon({"/usr/bin/env", "NOTIFY_SOCKET=" + (folder / "notify").string(), "WATCHDOG_USEC=400000", kDaemon,
                  "--config", small(folder.path())});
  EXPECT_TRUE(wait_for([&] { return systemd.has_heard("READY=1"); }));
  EXPECT_TRUE(wait_for([&] { return systemd.has_heard("WATCHDOG=1"); }));
  EXPECT_TRUE(wait_for([&] { return systemd.has_heard("STATUS=synthetic:eleven"); }));
  ASSERT_EQ(kill(daemon.pid(), SIGHUP), 0);
  EXPECT_TRUE(wait_for([&] { return systemd.has_heard("RELOADING=1"); }));
  ASSERT_EQ(kill(daemon.pid(), SIGTERM), 0);
  EXPECT_EQ(daemon.wait().exit_code, 0);
  EXPECT_TRUE(systemd.has_heard("STOPPING=1"));
}

TEST(Stereotrackd, SighupTakesOverDestinationsAndRefusesTheRestByItsKey) {
  const TempDir folder;
  Ear first;
  Ear second;
  const auto to = [](const Ear& ear) { return "[telemetry]\ndestinations = [\"" + ear.where() + "\"]\n"; };
  const std::string config = small(folder.path(), to(first));
  Program daemon({kDaemon, "--config", config});
  ASSERT_TRUE(wait_for([&] {
    first.listen();
    return first.messages().size() > 3;
  })) << daemon.err_so_far();

  (void)small(folder.path(), to(second) + "[latency]\noutput_ms = 70.0\n");
  ASSERT_EQ(kill(daemon.pid(), SIGHUP), 0);
  ASSERT_TRUE(wait_for([&] {
    second.listen();
    return second.messages().size() > 3;
  })) << daemon.err_so_far();
  EXPECT_TRUE(wait_for([&] {
    return daemon.err_so_far().find("reload: latency.output_ms: cannot change") != std::string::npos;
  })) << daemon.err_so_far();

  // A wrong file never replaces the configuration that runs.
  std::ofstream(config) << "[latency\n";
  const std::size_t before = second.messages().size();
  ASSERT_EQ(kill(daemon.pid(), SIGHUP), 0);
  EXPECT_TRUE(wait_for([&] { return daemon.err_so_far().find("reload: refused") != std::string::npos; }));
  EXPECT_TRUE(wait_for([&] {
    second.listen();
    return second.messages().size() > before + 3;
  }));
  ASSERT_EQ(kill(daemon.pid(), SIGTERM), 0);
  EXPECT_EQ(daemon.wait().exit_code, 0);
}

// Signals in another order are other lines, which cannot change; what can is taken over without them.
TEST(Stereotrackd, SighupNeverPutsARuleOnAnotherLine) {
  const TempDir folder;
  Ear first;
  Ear second;
  const std::string beat = "[[signal]]\nname = \"beat\"\nline = \"sim:beat\"\nwhen = \"heartbeat\"\n";
  const std::string zone =
      "[[zone]]\nname = \"nowhere\"\nz_m = [900, 901]\n"
      "[[signal]]\nname = \"zone\"\nline = \"sim:zone\"\nwhen = \"in_zone\"\nzone = \"nowhere\"\n";
  const std::string figures = (folder / "figures.prom").string();
  const auto with = [&](const Ear& ear, const std::string& signals) {
    return small(folder.path(), "[metrics]\nfile = \"" + figures + "\"\n[telemetry]\ndestinations = [\"" + ear.where() +
                                    "\"]\n" + signals);
  };
  const auto edges = [&](const std::string& line) {
    const std::string text = read_text(figures);
    const std::string name = "stereotrack_line_transitions_total{line=\"" + line + "\"} ";
    const std::size_t at = text.find(name);
    return at == std::string::npos ? 0 : std::stoi(text.substr(at + name.size()));
  };
  Program daemon({kDaemon, "--config", with(first, beat + zone)});
  ASSERT_TRUE(wait_for([&] { return edges("sim:beat") > 1; })) << daemon.err_so_far();
  (void)with(second, zone + beat);
  ASSERT_EQ(kill(daemon.pid(), SIGHUP), 0);
  ASSERT_TRUE(wait_for([&] {
    second.listen();
    return second.messages().size() > 3;
  })) << daemon.err_so_far();
  EXPECT_NE(daemon.err_so_far().find("reload: signal: cannot change"), std::string::npos) << daemon.err_so_far();
  const int before = edges("sim:beat");
  EXPECT_TRUE(wait_for([&] { return edges("sim:beat") > before + 2; }));
  EXPECT_EQ(edges("sim:zone"), 0);
  ASSERT_EQ(kill(daemon.pid(), SIGTERM), 0);
  EXPECT_EQ(daemon.wait().exit_code, 0);
}

// What is tracked where is the pipeline's, which does not change while it runs; the same file's zone of a signal does.
TEST(Stereotrackd, SighupNamesTheZonesThatWaitForARestart) {
  const TempDir folder;
  const auto with = [&](const std::string& gate, const std::string& targets) {
    return small(folder.path(), "[[zone]]\nname = \"gate\"\nz_m = [0.1, " + gate +
                                    "]\n[[zone]]\nname = \"pole\"\npicture = [[0, 0], [9, 0], [9, 9]]\ntargets = \"" +
                                    targets +
                                    "\"\n[[signal]]\nname = \"in\"\nline = \"sim:in\"\nwhen = "
                                    "\"in_zone\"\nzone = \"gate\"\n");
  };
  Program daemon({kDaemon, "--config", with("5", "ignore")});
  ASSERT_TRUE(wait_for([&] { return has_started(daemon); })) << daemon.err_so_far();
  (void)with("6", "none_begin");
  ASSERT_EQ(kill(daemon.pid(), SIGHUP), 0);
  EXPECT_TRUE(wait_for([&] { return daemon.err_so_far().find("reload: taken over") != std::string::npos; }))
      << daemon.err_so_far();
  EXPECT_NE(daemon.err_so_far().find("reload: zone pole: cannot change while the daemon runs, restart it"),
            std::string::npos)
      << daemon.err_so_far();
  EXPECT_EQ(daemon.err_so_far().find("reload: zone gate"), std::string::npos) << daemon.err_so_far();
  ASSERT_EQ(kill(daemon.pid(), SIGTERM), 0);
  EXPECT_EQ(daemon.wait().exit_code, 0);
}

TEST(Stereotrackd, AFaultMakesTheLinesSafeAndTellsTheLastOutputs) {
  const TempDir folder;
  Ear ear;
  Program daemon({kDaemon, "--config",
                  small(folder.path(), "[[signal]]\nname = \"b\"\nline = \"sim:b\"\nwhen = \"heartbeat\"\n"), "--set",
                  "telemetry.destinations=" + ear.where()});
  ASSERT_TRUE(wait_for([&] {
    ear.listen();
    return ear.messages().size() > 3;
  }));
  ASSERT_EQ(kill(daemon.pid(), SIGSEGV), 0);
  const ProgramResult done = daemon.wait();
  EXPECT_EQ(done.signal, SIGSEGV);
  EXPECT_NE(done.err.find("fault, signal 11: lines are in their safe states"), std::string::npos) << done.err;
  const std::string told = read_text(folder / "state" / "last_states.txt");
  EXPECT_NE(told.find("  pair "), std::string::npos) << told;
  EXPECT_NE(told.find(" due_ns "), std::string::npos) << told;
}

TEST(Stereotrackd, DrivesItsLinesSafeAfterACrash) {
  const TempDir folder;
  const std::string lines =
      "[[signal]]\nname = \"a\"\nline = \"sim:a\"\nwhen = \"confirmed\"\nsafe = \"active\"\n"
      "[[signal]]\nname = \"b\"\nline = \"/dev/nochip:3\"\nwhen = \"confirmed\"\n";
  const ProgramResult done = run_program({kDaemon, "--config", small(folder.path(), lines), "--safe-lines"});
  EXPECT_EQ(done.exit_code, 1) << "one of them failed";
  EXPECT_NE(done.err.find("sim:a"), std::string::npos) << done.err;
  EXPECT_NE(done.err.find("/dev/nochip"), std::string::npos) << done.err;
}

TEST(Stereotrackd, AfterACrashItsLinesAreThoseThatItTookWhateverTheFileSaysSince) {
  const TempDir folder;
  const auto lines = [](const std::string& name, const std::string& safe) {
    return "[[signal]]\nname = \"a\"\nline = \"sim:" + name + "\"\nwhen = \"confirmed\"\nsafe = \"" + safe + "\"\n";
  };
  const std::string config = small(folder.path(), lines("taken", "active"));
  const fs::path taken = folder / "state" / "taken_lines.toml";
  Program program({kDaemon, "--config", config});
  ASSERT_TRUE(wait_for([&] { return has_started(program); })) << program.err_so_far();
  EXPECT_TRUE(fs::exists(taken));
  (void)kill(program.pid(), SIGKILL);
  (void)program.wait();
  (void)small(folder.path(), lines("other", "active"));
  const ProgramResult changed = run_program({kDaemon, "--config", config, "--safe-lines"});
  EXPECT_EQ(changed.exit_code, 0) << changed.err;
  EXPECT_NE(changed.err.find("sim:taken: driven active"), std::string::npos) << changed.err;
  EXPECT_NE(changed.err.find("sim:other: driven active"), std::string::npos) << changed.err;
  EXPECT_FALSE(fs::exists(taken)) << "they are safe now";
}

TEST(Stereotrackd, AfterACrashAWrongFileDoesNotKeepTheLinesFromBeingSafe) {
  const TempDir folder;
  const std::string config =
      small(folder.path(), "[[signal]]\nname = \"a\"\nline = \"sim:taken\"\nwhen = \"confirmed\"\n");
  // As systemd gives it: a file that cannot be read says nothing of where the state is.
  ASSERT_EQ(setenv("STATE_DIRECTORY", (folder / "state").c_str(), 1), 0);
  Program program({kDaemon, "--config", config});
  ASSERT_TRUE(wait_for([&] { return has_started(program); })) << program.err_so_far();
  (void)kill(program.pid(), SIGKILL);
  (void)program.wait();
  (void)small(folder.path(), "[[signal]]\nname = \"a\"\n");
  const ProgramResult wrong = run_program({kDaemon, "--config", config, "--safe-lines"});
  (void)unsetenv("STATE_DIRECTORY");
  EXPECT_EQ(wrong.exit_code, 0) << wrong.err;
  EXPECT_NE(wrong.err.find("rig.toml:12:1: signal[1].line: it is missing"), std::string::npos) << wrong.err;
  EXPECT_NE(wrong.err.find("sim:taken: driven inactive"), std::string::npos) << wrong.err;
}

TEST(Stereotrackd, ARunThatEndedInOrderLeavesNoLinesToBeMadeSafe) {
  const TempDir folder;
  const ProgramResult done = run_program({kDaemon, "--config", small(folder.path()), "--set", "source.repeat=once"});
  EXPECT_EQ(done.exit_code, 0) << done.err;
  EXPECT_FALSE(fs::exists(folder / "state" / "taken_lines.toml"));
}

TEST(Stereotrackd, StopsWhatAskedTheCamerasForExposuresAfterACrash) {
  const TempDir folder;
  const std::filesystem::path file = folder.path() / "rig.toml";
  const auto safe = [&](const std::string& trigger) {
    std::ofstream(file) << "[source]\nname = \"cameras\"\n[camera]\nleft.device = \"/dev/none\"\n[trigger]\n"
                        << trigger;
    return run_program({kDaemon, "--config", file.string(), "--safe-lines"});
  };
  const ProgramResult line = safe("mode = \"gpio\"\nline = \"sim:pulses\"\nactive = \"low\"\n");
  EXPECT_EQ(line.exit_code, 0) << line.err;
  EXPECT_NE(line.err.find("sim:pulses: driven inactive, its safe state (high)"), std::string::npos) << line.err;
  const ProgramResult pwm = safe("mode = \"pwm\"\npwm_chip = \"no-such.pwm\"\n");
  EXPECT_EQ(pwm.exit_code, 1);
  EXPECT_NE(pwm.err.find("PWM no-such.pwm: no such chip"), std::string::npos) << pwm.err;
  EXPECT_EQ(safe("mode = \"unseen\"\n").exit_code, 0);
}

std::string http_get(std::uint16_t port) {
  const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  std::string text;
  if (connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0) {
    const std::string request = "GET /metrics HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n";
    EXPECT_EQ(send(fd, request.data(), request.size(), 0), static_cast<ssize_t>(request.size()));
    std::array<char, 4096> part{};
    for (ssize_t size = recv(fd, part.data(), part.size(), 0); size > 0; size = recv(fd, part.data(), part.size(), 0)) {
      text.append(part.data(), static_cast<std::size_t>(size));
    }
  }
  (void)close(fd);
  return text;
}

TEST(Stereotrackd, ServesItsFiguresOverHttpAndInAFile) {
  const TempDir folder;
  const std::string file = (folder / "figures.prom").string();
  Program daemon({kDaemon, "--config", small(folder.path()), "--set", "metrics.listen=127.0.0.1:0", "--set",
                  "metrics.file=" + file});
  std::uint16_t port = 0;
  ASSERT_TRUE(wait_for([&] {
    const std::string text = daemon.err_so_far();
    const std::size_t at = text.find("http://127.0.0.1:");
    if (at == std::string::npos) return false;
    port = static_cast<std::uint16_t>(std::stoi(text.substr(at + 17)));
    return true;
  }));
  std::string text;
  EXPECT_TRUE(wait_for([&] {
    text = http_get(port);
    return text.find("stereotrack_outputs_total{cause=\"on_time\"} ") != std::string::npos &&
           text.find("stereotrack_frames_total 0\n") == std::string::npos;
  })) << text;
  EXPECT_NE(text.find("HTTP/1.1 200"), std::string::npos);
  EXPECT_NE(text.find("stereotrack_send_error_seconds{quantile=\"0.999\"}"), std::string::npos);
  EXPECT_NE(text.find("stereotrack_stage_seconds_count{stage=\"disparity\"}"), std::string::npos);
  for (const std::string thread : {"capture", "frames", "publisher"}) {
    EXPECT_NE(text.find("stereotrack_allocations_total{thread=\"" + thread + "\"} 0\n"), std::string::npos) << thread;
  }
  EXPECT_TRUE(wait_for([&] { return read_text(file).find("stereotrack_session 1\n") != std::string::npos; }));
  ASSERT_EQ(kill(daemon.pid(), SIGTERM), 0);
  EXPECT_EQ(daemon.wait().exit_code, 0);
}

TEST(Stereotrackd, EnforceRefusesToStartWithoutTheRightsAndSaysHowToGrantThem) {
  const TempDir folder;
  std::vector<std::string> command;
  if (geteuid() == 0) {
    command = {"/usr/bin/setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"};
    fs::permissions(folder.path(), fs::perms::all);
  }
  for (const std::string& word :
       {std::string("/usr/bin/prlimit"), std::string("--rtprio=0"), std::string("--memlock=65536"), kDaemon,
        std::string("--config"), small(folder.path()), std::string("--set"), std::string("realtime.mode=enforce")}) {
    command.push_back(word);
  }
  const ProgramResult done = run_program(command);
  EXPECT_EQ(done.exit_code, 1) << done.err;
  EXPECT_NE(done.err.find("realtime.mode = \"enforce\""), std::string::npos) << done.err;
  EXPECT_NE(done.err.find("to grant it: "), std::string::npos) << done.err;
}

/// What makes a small run record: 320x240, two seconds and a half.
std::vector<std::string> recording_daemon(const std::string& config, const fs::path& recordings, const Ear& ear) {
  std::vector<std::string> command{kDaemon, "--config", config};
  for (const std::string& set :
       {std::string("synthetic.width=320"), std::string("synthetic.height=240"), std::string("synthetic.frames=60"),
        std::string("record.on=true"), std::string("record.seconds=2"), std::string("record.seconds_after=0.5"),
        std::string("record.on_deadline=false"), "record.directory=" + recordings.string(),
        "telemetry.destinations=" + ear.where()}) {
    command.insert(command.end(), {"--set", set});
  }
  return command;
}

/// Recordings with this cause that are whole.
std::vector<std::string> written_for(const std::string& cause, const fs::path& recordings) {
  std::vector<std::string> found;
  if (!fs::exists(recordings)) return found;
  for (const auto& entry : fs::directory_iterator(recordings)) {
    if (entry.path().filename().string().ends_with("-" + cause + ".strec")) found.push_back(entry.path().string());
  }
  return found;
}

/// The replay of a recording gives what the run had sent over UDP, byte for byte.
void expect_replay_is_the_run(const std::string& recorded, const Ear& ear, const fs::path& out) {
  const record::RecordingSource recording(recorded);
  ASSERT_TRUE(recording.about().exact);
  ASSERT_GT(recording.outputs().size(), 30U);
  const ProgramResult replay = run_program({kTool, "replay", recorded, "--out", out.string()});
  ASSERT_EQ(replay.exit_code, 0) << replay.err;
  // telemetry.bin: each datagram after its length.
  const std::string file = read_text(out / "telemetry.bin");
  std::map<std::uint64_t, std::vector<std::byte>> replayed;
  std::size_t targets = 0;
  for (std::size_t at = 0; at + 4 <= file.size();) {
    std::uint32_t size = 0;
    std::memcpy(&size, file.data() + at, 4);
    const auto* bytes = reinterpret_cast<const std::byte*>(file.data() + at + 4);
    const auto datagram = telemetry::decode({bytes, size});
    ASSERT_TRUE(datagram.has_value());
    auto& parts = replayed[datagram->header.sequence];
    parts.insert(parts.end(), bytes, bytes + size);
    targets += datagram->targets.size();
    at += 4 + size;
  }
  EXPECT_GT(targets, 10U);
  EXPECT_EQ(replayed.size(), recording.outputs().size());
  for (const auto& [sequence, bytes] : replayed) {
    const auto live = ear.messages().find(sequence);
    ASSERT_NE(live, ear.messages().end()) << sequence;
    EXPECT_TRUE(live->second == bytes) << "message " << sequence;
  }
}

// The black box of a live run, on demand.
TEST(Stereotrackd, ARecordingOfALiveRunReplaysItsTelemetryByteForByte) {
  const TempDir folder;
  Ear ear;
  const fs::path recordings = folder / "recordings";
  Program daemon(recording_daemon(small(folder.path()), recordings, ear));
  ASSERT_TRUE(wait_for([&] {
    ear.listen();
    return ear.messages().size() > 150;
  })) << daemon.err_so_far();
  ASSERT_EQ(kill(daemon.pid(), SIGUSR1), 0);
  ASSERT_TRUE(wait_for([&] {
    ear.listen();
    return !written_for("demand", recordings).empty();
  })) << daemon.err_so_far();
  ASSERT_EQ(kill(daemon.pid(), SIGTERM), 0);
  EXPECT_EQ(daemon.wait().exit_code, 0);
  ear.listen();
  expect_replay_is_the_run(written_for("demand", recordings).front(), ear, folder / "out");
}

std::string input_at(const fs::path& fifo, const std::string& more = "") {
  return "[[input]]\nname = \"door\"\nline = \"sim:" + fifo.string() + "\"\n" + more;
}

// A person's hand: echo 1 > FIFO.
void press(const fs::path& fifo) { std::ofstream(fifo) << "1\n0\n"; }

TEST(Stereotrackd, AnEdgeOfAnInputIsRecordedAndReplaysByteForByte) {
  const TempDir folder;
  Ear ear;
  const fs::path recordings = folder / "recordings";
  Program daemon(recording_daemon(small(folder.path(), input_at(folder / "door")), recordings, ear));
  ASSERT_TRUE(wait_for([&] {
    ear.listen();
    return ear.messages().size() > 150;
  })) << daemon.err_so_far();
  EXPECT_TRUE(written_for("gpio", recordings).empty());
  press(folder / "door");
  ASSERT_TRUE(wait_for([&] {
    ear.listen();
    return !written_for("gpio", recordings).empty();
  })) << daemon.err_so_far();
  ASSERT_EQ(kill(daemon.pid(), SIGTERM), 0);
  EXPECT_EQ(daemon.wait().exit_code, 0);
  ear.listen();
  expect_replay_is_the_run(written_for("gpio", recordings).front(), ear, folder / "out");
  EXPECT_FALSE(fs::exists(folder / "door")) << "let go";
}

/// The value of a figure in `metrics.file`; -1: it is not there.
int figure(const fs::path& file, const std::string& name) {
  const std::string text = read_text(file);
  const std::string whole = "\nstereotrack_" + name + " ";
  const std::size_t at = text.find(whole);
  return at == std::string::npos ? -1 : std::stoi(text.substr(at + whole.size()));
}

int lines_with(const std::string& text, const std::string& what) {
  int count = 0;
  for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++count;
  return count;
}

TEST(Stereotrackd, AnInputThatIsPulledOutIsToldOnceAndReadAgainWhenItIsBack) {
  const TempDir folder;
  fs::create_directory(folder / "usb");
  const fs::path door = folder / "usb" / "door";
  const fs::path figures = folder / "figures.prom";
  const std::string labels = "{input=\"door\",line=\"sim:" + door.string() + "\"}";
  Program daemon(
      {kDaemon, "--config", small(folder.path(), input_at(door)), "--set", "metrics.file=" + figures.string()});
  ASSERT_TRUE(wait_for([&] { return figure(figures, "input_there" + labels) == 1; })) << daemon.err_so_far();
  press(door);
  EXPECT_TRUE(wait_for([&] { return figure(figures, "input_edges_total" + labels) == 1; })) << "rising edges alone";

  fs::rename(folder / "usb", folder / "away");
  EXPECT_TRUE(wait_for([&] { return figure(figures, "input_there" + labels) == 0; }));
  EXPECT_TRUE(wait_for([&] { return figure(figures, "health") % 1024 >= 512; })) << read_text(figures);
  std::this_thread::sleep_for(std::chrono::milliseconds(1200));  // some rounds of the service
  fs::rename(folder / "away", folder / "usb");
  EXPECT_TRUE(wait_for([&] { return figure(figures, "input_there" + labels) == 1; }));
  press(door);
  EXPECT_TRUE(wait_for([&] { return figure(figures, "input_edges_total" + labels) == 2; }));
  EXPECT_EQ(figure(figures, "gpio_chips_lost_total{lines=\"inputs\"}"), 1);
  ASSERT_EQ(kill(daemon.pid(), SIGTERM), 0);
  const ProgramResult done = daemon.wait();
  EXPECT_EQ(done.exit_code, 0);
  EXPECT_EQ(lines_with(done.err, "GPIO inputs sim:" + door.string() + " fail: No such device"), 1) << done.err;
  EXPECT_EQ(lines_with(done.err, "GPIO inputs sim:" + door.string() + " work again after"), 1) << done.err;
  EXPECT_EQ(lines_with(done.err, "GPIO inputs"), 2) << done.err;
}

TEST(Stereotrackd, SighupTakesOverInputsAndRefusesThoseThatCannotBeHad) {
  const TempDir folder;
  Ear ear;
  const fs::path recordings = folder / "recordings";
  const fs::path first = folder / "first";
  const fs::path second = folder / "second";
  const fs::path figures = folder / "figures.prom";
  const std::string metrics = "[metrics]\nfile = \"" + figures.string() + "\"\n";
  Program daemon(recording_daemon(small(folder.path(), metrics + "[record]\non_input = false\n" + input_at(first)),
                                  recordings, ear));
  ASSERT_TRUE(wait_for([&] {
    ear.listen();
    return ear.messages().size() > 50;
  })) << daemon.err_so_far();
  press(first);
  const std::string before = "{input=\"door\",line=\"sim:" + first.string() + "\"}";
  ASSERT_TRUE(wait_for([&] { return figure(figures, "input_edges_total" + before) == 1; }));

  (void)small(folder.path(), metrics + input_at(folder / "no" / "such" / "folder"));
  ASSERT_EQ(kill(daemon.pid(), SIGHUP), 0);
  ASSERT_TRUE(wait_for([&] { return daemon.err_so_far().find("reload: nothing to take over") != std::string::npos; }))
      << daemon.err_so_far();
  EXPECT_NE(daemon.err_so_far().find("reload: input: cannot change: "), std::string::npos) << daemon.err_so_far();
  EXPECT_TRUE(fs::is_fifo(first)) << "the lines of before are read on";

  (void)small(folder.path(), metrics + input_at(second, "edge = \"falling\"\napart_ms = 0\n"));
  ASSERT_EQ(kill(daemon.pid(), SIGHUP), 0);
  ASSERT_TRUE(wait_for([&] { return daemon.err_so_far().find("reload: taken over") != std::string::npos; }))
      << daemon.err_so_far();
  EXPECT_TRUE(fs::is_fifo(second));
  EXPECT_FALSE(fs::exists(first));
  const std::string labels = "{input=\"door\",line=\"sim:" + second.string() + "\"}";
  EXPECT_TRUE(wait_for([&] { return figure(figures, "input_edges_total" + labels) == 1; })) << "that of before";
  EXPECT_EQ(figure(figures, "input_triggers_total" + labels), 0) << "record.on_input was false";
  press(second);
  EXPECT_TRUE(wait_for([&] {
    ear.listen();
    return !written_for("gpio", recordings).empty();
  })) << daemon.err_so_far();
  EXPECT_TRUE(wait_for([&] { return figure(figures, "input_triggers_total" + labels) == 1; }));
  ASSERT_EQ(kill(daemon.pid(), SIGTERM), 0);
  EXPECT_EQ(daemon.wait().exit_code, 0);
}

}  // namespace
}  // namespace stereotrack
