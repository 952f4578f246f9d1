// The daemon in this process, with its real threads, sockets, files and signals, for minutes or hours, and faults
// thrown at it at random. It must go on, keep its memory, and have a counter that tells of each fault.

#include <fcntl.h>
#include <malloc.h>
#include <netinet/in.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <random>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "drivers/gpio/simulated_chip.hpp"
#include "drivers/telemetry/receiver.hpp"
#include "drivers/telemetry/udp_listener.hpp"
#include "drivers/telemetry/udp_sender.hpp"
#include "firmware-app/rig/rig.hpp"
#include "firmware-app/runtime/allocation_count.hpp"
#include "firmware-app/signals/set_up.hpp"
#include "firmware-app/stereotrackd/daemon.hpp"
#include "firmware-app/stereotrackd/plan.hpp"
#include "firmware-app/stereotrackd/reload.hpp"
#include "firmware-app/stereotrackd/service.hpp"
#include "tests/rt/heap_watch.hpp"
#include "tests/soak/faulty_source.hpp"
#include "tests/support/scene_film.hpp"
#include "tests/support/temp_dir.hpp"

namespace stereotrack::test {
namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr milliseconds kPeriod{25};
constexpr int kFilmPairs = 400;
constexpr int kMissingLimit = 8;
constexpr seconds kStandstill{15};  // a thread that has not gone round for so long has come to a standstill
constexpr seconds kPatience{30};    // for the counter of a fault; the machine may be busy with other things
constexpr seconds kWindow{10};  // memory is the least of so many seconds: what the main thread borrows comes and goes
constexpr std::size_t kHeapBound = std::size_t{256} << 10U;  // more than in the first window
constexpr std::size_t kPagesBound = std::size_t{4} << 20U;   // resident, likewise
constexpr rlim_t kFullDisk = rlim_t{2} << 20U;               // a file gets no larger; a recording would
constexpr const char* kLine = "soak-heart";

struct Arguments {
  double minutes = 20;
  std::uint64_t seed = 1;
  std::string log;
};

// ---------------------------------------------------------------- Who stops and continues the process

// The parent of the process under test: stops it when asked to through a pipe, ends it if it hangs for good, and hands
// on its exit code.
class Keeper {
 public:
  // Returns in the child alone.
  static Keeper fork_child(seconds limit) {
    std::array<int, 2> ends{};
    if (pipe2(ends.data(), O_CLOEXEC) != 0) throw std::runtime_error("pipe2 failed");
    const pid_t child = fork();
    if (child < 0) throw std::runtime_error("fork failed");
    if (child > 0) {
      (void)close(ends[1]);
      keep(child, ends[0], limit);
    }
    (void)close(ends[0]);
    return Keeper(ends[1]);
  }
  void suspend(milliseconds span) const noexcept {
    const auto ms = static_cast<std::int32_t>(span.count());
    (void)!write(pipe_, &ms, sizeof ms);
  }

 private:
  explicit Keeper(int pipe) noexcept : pipe_(pipe) {}

  [[noreturn]] static void keep(pid_t child, int pipe, seconds limit) {
    for (const int signal : {SIGTERM, SIGINT, SIGHUP, SIGUSR1}) (void)std::signal(signal, SIG_IGN);
    (void)fcntl(pipe, F_SETFL, O_NONBLOCK);
    const Clock::time_point end = Clock::now() + limit;
    int status = 0;
    while (waitpid(child, &status, WNOHANG) == 0) {
      std::int32_t ms = 0;
      if (read(pipe, &ms, sizeof ms) == sizeof ms) {
        (void)kill(child, SIGSTOP);
        std::this_thread::sleep_for(milliseconds(ms));
        (void)kill(child, SIGCONT);
      }
      if (Clock::now() > end) {
        (void)std::fprintf(stderr, "stereotrack_soak: the process hangs; it is ended\n");
        (void)kill(child, SIGABRT);
        (void)waitpid(child, &status, 0);
        break;
      }
      std::this_thread::sleep_for(milliseconds(5));
    }
    if (WIFSIGNALED(status)) (void)std::fprintf(stderr, "stereotrack_soak: ended by signal %d\n", WTERMSIG(status));
    std::exit(WIFEXITED(status) ? WEXITSTATUS(status) : 1);
  }

  int pipe_;
};

// ---------------------------------------------------------------- Faults

/// One kind of fault, thrown again and again; the next only when the counter has told of the last.
struct Fault {
  const char* name;
  const char* shown_by;
  std::function<void()> begin;
  std::function<std::uint64_t()> counter;
  milliseconds most_between{4000};
  std::function<void()> end{};  ///< when it was seen; empty: it ends by itself
  bool again = false;           ///< another fault may undo it before it shows: thrown anew every second until then

  std::uint64_t thrown = 0;
  std::uint64_t seen = 0;
  std::uint64_t before = 0;
  bool waits = false;
  Clock::time_point next{};   ///< to be thrown
  Clock::time_point until{};  ///< to be seen
  Clock::time_point anew{};   ///< to be thrown anew
  milliseconds slowest{0};
};

/// Slow stages: each of so many frames has one that sleeps.
struct SlowStage {
  std::atomic<int> frames{0};
  std::atomic<int> stage{0};
  std::atomic<std::int64_t> ms{0};

  void demand(int of_frames, Stage which, milliseconds by) noexcept {
    stage.store(static_cast<int>(which));
    ms.store(by.count());
    frames.store(of_frames);
  }
  static void ended(void* self, Stage which) noexcept {
    SlowStage& slow = *static_cast<SlowStage*>(self);
    if (slow.frames.load() <= 0 || static_cast<int>(which) != slow.stage.load()) return;
    (void)slow.frames.fetch_sub(1);
    sleep_for(milliseconds(slow.ms.load()));
  }
};

class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}
  [[nodiscard]] int upto(int least, int most) {
    return least + static_cast<int>(engine_() % static_cast<std::uint64_t>(most - least + 1));
  }

 private:
  std::mt19937_64 engine_;
};

/// Sockets that the main thread is to give the publisher at the next SIGHUP, after reloading. Bits.
enum BadSocket : std::uint8_t { kFullSocket = 1, kDeadSocket = 2 };

telemetry::Socket socket_to(const telemetry::Endpoint& endpoint) {
  telemetry::Socket made(socket(endpoint.family(), SOCK_DGRAM | SOCK_CLOEXEC, 0));
  if (made.fd() < 0 || connect(made.fd(), endpoint.get(), endpoint.size) != 0) {
    throw std::runtime_error("no socket to " + to_string(endpoint));
  }
  return made;
}

std::array<telemetry::Socket, 2> connected_pair() {
  std::array<int, 2> ends{};
  if (socketpair(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0, ends.data()) != 0) throw std::runtime_error("no socketpair");
  return {telemetry::Socket(ends[0]), telemetry::Socket(ends[1])};
}

/// The configuration file, right, wrong and changed.
class ConfigFile {
 public:
  ConfigFile(const TempDir& folder, std::string listener) : folder_(folder), listener_(std::move(listener)) { same(); }

  void same() const { put(text(hops_)); }
  void changed() {
    hops_ = 3 - hops_;
    same();
  }
  void wrong(int how) const {
    static const std::array<const char*, 4> kWrong{"[latency]\noutput_ms = -1\n", "[latency\n",
                                                   "[telemetry]\nno_such_key = 1\n",
                                                   "[telemetry]\ndestinations = [\"nowhere:1\"]\n"};
    put(kWrong[static_cast<std::size_t>(how) % kWrong.size()]);
  }
  [[nodiscard]] std::string path() const { return (folder_ / "rig.toml").string(); }

 private:
  [[nodiscard]] std::string text(int hops) const {
    return "[realtime]\nmode = \"off\"\n[latency]\noutput_ms = 60\nmissing_limit = " + std::to_string(kMissingLimit) +
           "\n[telemetry]\ndestinations = [\"" + listener_ + "\"]\nmulticast_ttl = " + std::to_string(hops) +
           "\n[record]\non = true\nseconds = 1.5\nseconds_after = 0.5\nmax_mb = 64\non_deadline = false\ndirectory = "
           "\"" +
           (folder_ / "recordings").string() + "\"\n[[signal]]\nname = \"heart\"\nline = \"sim:" + kLine +
           "\"\nwhen = \"heartbeat\"\nperiod_ms = 100\n[[signal]]\nname = \"seen\"\nline = \"sim:soak-seen\"\n";
  }
  // Whole or not at all: the reader may come at any moment.
  void put(const std::string& content) const {
    std::filesystem::rename(folder_.write("rig.toml.new", content), path());
  }

  const TempDir& folder_;
  std::string listener_;
  int hops_ = 1;
};

// ---------------------------------------------------------------- The run

class Soak {
 public:
  Soak(const Arguments& arguments, const Keeper& keeper)
      : arguments_(arguments),
        keeper_(keeper),
        random_(arguments.seed),
        listener_(telemetry::parse_endpoint("127.0.0.1:0", true)),
        file_(folder_, to_string(listener_.local())) {
    std::filesystem::create_directories(folder_ / "recordings");
    configuration_ = load_configuration(file_.path(), {}).configuration;
    auto source = std::make_unique<FaultySource>(film_of_scene(1, kFilmPairs, kPeriod, capture::Film::Repeat::kBounce));
    source_ = source.get();
    daemon::Daemon::Parts parts;
    parts.configuration = &configuration_;
    parts.calibration = &calibration_;
    parts.unit_m = 1;
    parts.source = std::move(source);
    parts.plan = daemon::make_plan(configuration_, 1);
    parts.lines = gpio::open_lines(signals::line_specs(configuration_), "soak");
    parts.session = 1;
    parts.also = {&SlowStage::ended, &slow_};
    parts.program = "stereotrack_soak";
    daemon_ = std::make_unique<daemon::Daemon>(std::move(parts));
    std::array<telemetry::Socket, 2> ends = connected_pair();
    unread_ = std::move(ends[0]);
    full_ = std::move(ends[1]);
    while (::send(full_.fd(), "full", 4, MSG_DONTWAIT) > 0) {
    }
    make_faults();
  }

  /// The main thread's part. 0: all is well.
  int run() {
    daemon::Service service({.metrics = {},
                             .session = 1,
                             .summary = "soak",
                             .reload = [this] { reload(); },
                             .record = [this] { box().trigger(record::kDemand); }});
    (void)daemon_->start(configuration_.realtime, false);
    std::thread tormentor([this] { torment(); });
    try {
      service.run(*daemon_);
    } catch (const std::exception& error) {
      wrong(std::string("the service failed: ") + error.what());
    }
    main_is_back_.store(true);
    tormentor.join();
    judge();
    return failures_.empty() ? 0 : 1;
  }

 private:
  [[nodiscard]] record::BlackBox& box() { return *daemon_->black_box(); }
  [[nodiscard]] const daemon::Vitals& vitals() const { return daemon_->vitals(); }
  [[nodiscard]] std::uint64_t schedule(const char* name) const {
    for (std::size_t i = 0; i < daemon::kScheduleCounters.size(); ++i) {
      if (std::string_view(name) == daemon::kScheduleCounters[i].name) return vitals().schedule[i].get();
    }
    throw std::logic_error(name);
  }
  [[nodiscard]] std::uint64_t came_of(daemon::Reload outcome) const {
    return reloads_[static_cast<std::size_t>(outcome)].load();
  }

  void wrong(const std::string& what) {
    (void)std::printf("WRONG: %s\n", what.c_str());
    (void)std::fflush(stdout);
    failures_.push_back(what);
  }

  // In the main thread, as by stereotrackd.
  void reload() {
    const daemon::Reload outcome = daemon::reload(file_.path(), {}, 1, configuration_, *daemon_);
    ++reloads_[static_cast<std::size_t>(outcome)];
    const unsigned bad = bad_sockets_.exchange(0);
    if (bad == 0) return;
    std::vector<telemetry::Socket> sockets;
    sockets.push_back(socket_to(listener_.local()));
    if ((bad & kFullSocket) != 0) sockets.emplace_back(dup(full_.fd()));
    if ((bad & kDeadSocket) != 0) {
      std::array<telemetry::Socket, 2> ends = connected_pair();
      sockets.push_back(std::move(ends[0]));
    }
    auto plan = daemon::make_plan(configuration_, 1);
    plan->sink = std::make_unique<telemetry::UdpSender>(std::move(sockets));
    daemon_->exchange(std::move(plan));
  }

  void hang_up(int times) const {
    for (int i = 0; i < times; ++i) (void)kill(getpid(), SIGHUP);
  }

  void limit_files(rlim_t most) const {
    rlimit limit{};
    (void)getrlimit(RLIMIT_FSIZE, &limit);
    limit.rlim_cur = std::min(most, limit.rlim_max);
    (void)setrlimit(RLIMIT_FSIZE, &limit);
  }

  [[nodiscard]] Stage any_stage() { return random_.upto(0, 1) == 0 ? Stage::kIngest : Stage::kTracking; }

  void make_faults() {
    using daemon::Reload;
    const auto gaps = [this] { return schedule("missing") + schedule("overslept_missing"); };
    const auto slept = [this] { return schedule("overslept_pairs") + schedule("overslept_missing"); };
    const auto passed_over = [this] { return daemon_->pool().skipped + daemon_->pool().evicted; };
    const auto& box_counters = box().counters();
    faults_ = {
        // Amid an outage of pairs there is no slot to be missing, or to be slept over.
        {"pairs lost",
         "missing, overslept_missing",
         [this] { source_->lose(random_.upto(1, 3)); },
         gaps,
         milliseconds(4'000),
         {},
         true},
        {"pair twice", "notices_out_of_order", [this] { source_->repeat(1); },
         [this] { return schedule("notices_out_of_order"); }},
        {"capture stands still", "outages",
         [this] { source_->stand_still(kPeriod * (kMissingLimit + random_.upto(8, 20))); },
         [this] { return schedule("outages"); }, milliseconds(15'000)},
        {"capture clock steps", "clock_steps",
         [this] { source_->step_clock(milliseconds(random_.upto(5, 5000)) * (random_.upto(0, 1) == 0 ? 1 : -1)); },
         [this] { return vitals().clock_steps.get(); }},
        {"slow stage", "effort_overruns",
         [this] { slow_.demand(1, any_stage(), kPeriod * random_.upto(1, 3) + milliseconds(1)); },
         [this] { return vitals().effort_overruns.get(); }},
        {"slow for long", "efforts_shed, effort_helpless",
         [this] { slow_.demand(random_.upto(4, 12), Stage::kTracking, kPeriod + milliseconds(5)); },
         [this] { return vitals().efforts_shed.get() + vitals().effort_helpless.get(); }, milliseconds(12'000)},
        {"stage hangs", "pool skipped, evicted",
         [this] { slow_.demand(1, any_stage(), kPeriod * random_.upto(8, 16)); }, passed_over, milliseconds(10'000)},
        {"result too late", "predicted_late", [this] { slow_.demand(1, any_stage(), milliseconds(100)); },
         [this] { return schedule("predicted_late"); }, milliseconds(5'000)},
        {"process suspended",
         "overslept_pairs, overslept_missing",
         [this] { keeper_.suspend(milliseconds(random_.upto(150, 600))); },
         slept,
         milliseconds(12'000),
         {},
         true},
        {"socket full",
         "telemetry_dropped",
         [this] {
           bad_sockets_.fetch_or(kFullSocket);
           hang_up(1);
         },
         [this] { return vitals().telemetry_dropped.get(); },
         milliseconds(8'000),
         {},
         true},
        {"peer is gone",
         "telemetry_failed",
         [this] {
           bad_sockets_.fetch_or(kDeadSocket);
           hang_up(1);
         },
         [this] { return vitals().telemetry_failed.get(); },
         milliseconds(8'000),
         {},
         true},
        {"chip gone", "lines_failed", [] { gpio::simulated_chip::set_gone(kLine, true); },
         [this] { return vitals().lines_failed.get(); }, milliseconds(6'000),
         [] { gpio::simulated_chip::set_gone(kLine, false); }},
        {"SIGHUP storm", "reloads, as the file says", [this] { begin_storm(); }, [this] { return storm_counter(); },
         milliseconds(3'000)},
        {"SIGUSR1, disk full", "recordings_failed",
         [this] {
           disk_in_use_ = true;
           limit_files(kFullDisk);
           (void)kill(getpid(), SIGUSR1);
         },
         [&box_counters] { return box_counters.recordings_failed.load(); }, milliseconds(10'000),
         [this] {
           limit_files(RLIM_INFINITY);
           disk_in_use_ = false;
         }},
        {"SIGUSR1", "recordings",
         [this] {
           disk_in_use_ = true;
           (void)kill(getpid(), SIGUSR1);
         },
         [&box_counters] { return box_counters.recordings.load(); }, milliseconds(10'000),
         [this] { disk_in_use_ = false; }},
        // Several in one round of the service are one trigger.
        {"SIGUSR1 storm",
         "merged, triggers_dropped",
         [this] {
           for (int i = 0; i < 3; ++i) {
             (void)kill(getpid(), SIGUSR1);
             sleep_for(milliseconds(150));
           }
         },
         [&box_counters] { return box_counters.merged.load() + box_counters.triggers_dropped.load(); },
         milliseconds(15'000),
         {},
         true},
    };
  }

  // What the file says when the storm ends is what must come of it.
  void begin_storm() {
    using daemon::Reload;
    for (int i = random_.upto(1, 4); i > 0; --i) {
      file_.wrong(i);
      hang_up(random_.upto(1, 30));
      file_.same();
      hang_up(random_.upto(1, 30));
    }
    const int which = random_.upto(0, 2);
    storm_ = which == 0 ? Reload::kRefused : which == 1 ? Reload::kTakenOver : Reload::kNothing;
    storm_before_ = came_of(storm_);
    if (storm_ == Reload::kRefused) file_.wrong(random_.upto(0, 3));
    if (storm_ == Reload::kTakenOver) file_.changed();
    hang_up(random_.upto(1, 100));
  }
  [[nodiscard]] std::uint64_t storm_counter() const { return came_of(storm_); }

  // ---- The tormentor's thread

  void torment() {
    const Clock::time_point start = Clock::now();
    const Clock::time_point end =
        start + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(60 * arguments_.minutes));
    // The first of each soon, so that a short run has all.
    for (Fault& fault : faults_) fault.next = start + milliseconds(random_.upto(3000, 12'000));
    Clock::time_point second = start;
    for (;;) {
      if (main_is_back_.load()) {
        wrong("ended before its time");
        return;
      }
      const Clock::time_point now = Clock::now();
      bool waits = false;
      for (Fault& fault : faults_) {
        if (daemon_is_stuck_) break;
        step(fault, now, now < end);
        waits = waits || fault.waits;
      }
      listen();
      if (now >= second) {
        second += seconds(1);
        if (second < now) second = now + seconds(1);
        every_second(now - start);
      }
      if ((now >= end && !waits) || daemon_is_stuck_) break;
      sleep_for(milliseconds(5));
    }
    (void)kill(getpid(), SIGTERM);
    const Clock::time_point limit = Clock::now() + kStandstill;
    while (!main_is_back_.load() && Clock::now() < limit) sleep_for(milliseconds(10));
    if (main_is_back_.load()) return;
    wrong("the daemon does not end: a thread does not come back");
    print_table();
    (void)std::printf("soak: FAILED\n");
    (void)std::fflush(stdout);
    std::_Exit(1);
  }

  void step(Fault& fault, Clock::time_point now, bool more) {
    if (fault.waits) {
      const bool seen = fault.counter() > fault.before;
      if (!seen && fault.again && now >= fault.anew) {
        fault.anew = now + seconds(1);
        fault.begin();
      }
      if (!seen && now < fault.until) return;
      const auto took = std::chrono::duration_cast<milliseconds>(now - (fault.until - kPatience));
      if (seen) {
        ++fault.seen;
        fault.slowest = std::max(fault.slowest, took);
      } else {
        wrong(std::string(fault.name) + ": nothing shows in " + fault.shown_by);
      }
      fault.waits = false;
      fault.next = now + milliseconds(random_.upto(100, static_cast<int>(fault.most_between.count())));
      if (fault.end) fault.end();
      return;
    }
    if (!more || now < fault.next) return;
    if (fault.end && disk_in_use_ && std::string_view(fault.name).starts_with("SIGUSR1")) return;  // one disk
    fault.before = fault.counter();
    fault.begin();
    if (std::string_view(fault.name) == "SIGHUP storm") fault.before = storm_before_;  // chosen just now
    ++fault.thrown;
    fault.waits = true;
    fault.until = Clock::now() + kPatience;
    fault.anew = Clock::now() + seconds(1);
  }

  void listen() {
    std::array<std::byte, 2048> buffer{};
    for (std::ptrdiff_t size = listener_.receive(buffer); size >= 0; size = listener_.receive(buffer)) {
      const auto outcome = receiver_.accept(std::span(buffer).first(static_cast<std::size_t>(size)));
      if (outcome == telemetry::Outcome::kRefused) wrong("a datagram is not what the schema says");
      if (outcome != telemetry::Outcome::kPair) continue;
      const auto& header = receiver_.pair().header;
      ++messages_;
      if (header.sequence <= sequence_) wrong("message " + std::to_string(header.sequence) + " came after a later one");
      sequence_ = header.sequence;
      if (header.send_time_ns - header.capture_time_ns != static_cast<std::int64_t>(header.latency_ns)) {
        wrong("message " + std::to_string(header.sequence) + " is not stamped with the latency of the contract");
      }
    }
  }

  void every_second(Clock::duration since_start) {
    look_at_beats();
    const auto whole = std::chrono::duration_cast<seconds>(since_start).count();
    const ProcessMemory memory = ProcessMemory::now();
    least_.heap = std::min(least_.heap, memory.heap);
    least_.anonymous = std::min(least_.anonymous, memory.anonymous);
    ++samples_;
    if (samples_ % kWindow.count() != 0) return;
    // The first window is warm-up, the second is what all later ones are compared to.
    if (samples_ == 2 * kWindow.count()) first_ = least_;
    if (samples_ > 2 * kWindow.count()) {
      most_.heap = std::max(most_.heap, least_.heap);
      most_.anonymous = std::max(most_.anonymous, least_.anonymous);
      ++windows_;
    }
    (void)std::printf("%5llds: %llu pairs, %llu messages heard, heap %zu kB, resident %zu kB\n",
                      static_cast<long long>(whole), static_cast<unsigned long long>(vitals().frames.get()),
                      static_cast<unsigned long long>(messages_), least_.heap >> 10U, least_.anonymous >> 10U);
    (void)std::fflush(stdout);
    least_ = {SIZE_MAX, SIZE_MAX};
  }

  void look_at_beats() {
    struct Beat {
      const char* thread;
      std::uint64_t now;
    };
    const std::array<Beat, 3> beats{{{"capture", vitals().capture_beats.get()},
                                     {"frames", vitals().frame_beats.get()},
                                     {"publisher", vitals().publisher_beats.get()}}};
    const Clock::time_point now = Clock::now();
    for (std::size_t i = 0; i < beats.size(); ++i) {
      if (beats[i].now != beat_[i] || beat_at_[i] == Clock::time_point{}) {
        beat_[i] = beats[i].now;
        beat_at_[i] = now;
      } else if (now - beat_at_[i] > kStandstill) {
        wrong(std::string("thread ") + beats[i].thread + " stands still");
        daemon_is_stuck_ = true;
      }
    }
  }

  // ---- The end

  void print_table() const {
    (void)std::printf("\n%-22s %-36s %8s %8s %12s %9s\n", "fault", "shown by", "thrown", "seen", "counter", "slowest");
    for (const Fault& fault : faults_) {
      (void)std::printf("%-22s %-36s %8llu %8llu %12llu %6lld ms\n", fault.name, fault.shown_by,
                        static_cast<unsigned long long>(fault.thrown), static_cast<unsigned long long>(fault.seen),
                        static_cast<unsigned long long>(fault.counter()),
                        static_cast<long long>(fault.slowest.count()));
    }
  }

  void judge() {
    for (const Fault& fault : faults_) {
      if (fault.thrown == 0) wrong(std::string(fault.name) + ": never thrown: the run was too short");
    }
    if (messages_ == 0) wrong("no telemetry was heard");
    const std::uint64_t heap_calls = vitals().frame_allocations.get() + vitals().publisher_allocations.get();
    if (heap_calls != 0) wrong(std::to_string(heap_calls) + " heap calls in real-time threads");
    const capture::FramePool::Counters pool = daemon_->pool();
    const std::uint64_t ended = vitals().frames.get() + vitals().frames_refused.get() + pool.skipped + pool.evicted;
    if (ended > pool.captured || pool.captured > ended + capture::FramePool::kMaxSlots) {
      wrong("of " + std::to_string(pool.captured) + " captured pairs " + std::to_string(ended) + " are accounted for");
    }
    if (gpio::simulated_chip::level(kLine) != false) wrong("a line is not in its safe state at the end");
    print_table();
    judge_memory();
    (void)std::printf("heap calls of real-time threads: %s\n",
                      allocations_are_counted() ? std::to_string(heap_calls).c_str() : "not counted under a sanitizer");
    (void)std::printf("%s\n", failures_.empty() ? "soak: all is well" : "soak: FAILED");
    for (const std::string& failure : failures_) (void)std::printf("  %s\n", failure.c_str());
  }

  void judge_memory() {
    if (!allocations_are_counted()) {
      (void)std::printf("\nmemory: not judged: a sanitizer has a malloc of its own\n");
      return;
    }
    if (windows_ == 0) {
      (void)std::printf("\nmemory: not judged: the run was shorter than %lld s\n",
                        static_cast<long long>(3 * kWindow.count()));
      return;
    }
    const auto grown = [](std::size_t most, std::size_t first) { return most > first ? most - first : 0; };
    const std::size_t heap = grown(most_.heap, first_.heap);
    const std::size_t pages = grown(most_.anonymous, first_.anonymous);
    (void)std::printf("\nmemory: heap %zu kB + %zu kB (bound %zu kB), resident %zu kB + %zu kB (bound %zu kB)\n",
                      first_.heap >> 10U, heap >> 10U, kHeapBound >> 10U, first_.anonymous >> 10U, pages >> 10U,
                      kPagesBound >> 10U);
    if (heap > kHeapBound) wrong("the heap grows");
    if (pages > kPagesBound) wrong("resident memory grows");
  }

  Arguments arguments_;
  const Keeper& keeper_;
  Random random_;
  TempDir folder_;
  telemetry::UdpListener listener_;
  telemetry::Receiver receiver_;
  ConfigFile file_;
  config::Configuration configuration_;
  StereoCalibration calibration_ = MovingScene::calibration();
  SlowStage slow_;
  FaultySource* source_ = nullptr;
  telemetry::Socket unread_;
  telemetry::Socket full_;  ///< to unread_
  std::unique_ptr<daemon::Daemon> daemon_;

  // Of the main thread and the tormentor.
  std::atomic<unsigned> bad_sockets_{0};  ///< BadSocket
  std::array<std::atomic<std::uint64_t>, 3> reloads_{};
  std::atomic<bool> main_is_back_{false};

  // The tormentor's; the main thread's before it begins and after it has ended.
  std::vector<Fault> faults_;
  std::vector<std::string> failures_;
  daemon::Reload storm_ = daemon::Reload::kNothing;
  std::uint64_t storm_before_ = 0;
  bool disk_in_use_ = false;
  bool daemon_is_stuck_ = false;
  std::uint64_t messages_ = 0;
  std::uint64_t sequence_ = 0;
  std::array<std::uint64_t, 3> beat_{};
  std::array<Clock::time_point, 3> beat_at_{};
  ProcessMemory least_{SIZE_MAX, SIZE_MAX};
  ProcessMemory first_;
  ProcessMemory most_;
  std::int64_t samples_ = 0;
  std::int64_t windows_ = 0;
};

int run(const Arguments& arguments) {
  // Before there are threads.
  const seconds limit(static_cast<std::int64_t>(60 * arguments.minutes) + 180);
  const Keeper keeper = Keeper::fork_child(limit);
  (void)std::signal(SIGXFSZ, SIG_IGN);
  // One heap for all threads, or mallinfo2() tells of the first alone.
  (void)mallopt(M_ARENA_MAX, 1);
  if (!arguments.log.empty() && std::freopen(arguments.log.c_str(), "w", stderr) == nullptr) {
    throw std::runtime_error(arguments.log + ": cannot be written");
  }
  (void)std::setvbuf(stderr, nullptr, _IONBF, 0);  // a file, too: what was logged last matters most
  Soak soak(arguments, keeper);
  return soak.run();
}

}  // namespace
}  // namespace stereotrack::test

int main(int argc, char** argv) {
  CLI::App app("Runs the daemon for long, and throws faults at it.", "stereotrack_soak");
  stereotrack::test::Arguments arguments;
  app.add_option("--minutes", arguments.minutes, "how long")->check(CLI::Range(0.25, 10'000.0))->capture_default_str();
  app.add_option("--seed", arguments.seed, "of the faults' order and times")->capture_default_str();
  app.add_option("--log", arguments.log, "file for what the daemon logs; else stderr");
  CLI11_PARSE(app, argc, argv);
  try {
    return stereotrack::test::run(arguments);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "stereotrack_soak: %s\n", error.what());
    return 1;
  }
}
