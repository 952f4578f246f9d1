#include "drivers/capture/film/film.hpp"

#include <cerrno>
#include <cstring>
#include <ctime>
#include <stdexcept>

namespace stereotrack::capture {

namespace {

MonotonicTime now() noexcept {
  timespec time{};
  (void)clock_gettime(CLOCK_MONOTONIC, &time);
  return MonotonicTime(std::chrono::seconds(time.tv_sec) + std::chrono::nanoseconds(time.tv_nsec));
}

void sleep_until(MonotonicTime moment) noexcept {
  const auto since = moment.time_since_epoch();
  const auto whole = std::chrono::floor<std::chrono::seconds>(since);
  const timespec until{static_cast<time_t>(whole.count()), static_cast<long>((since - whole).count())};
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) == EINTR) {
  }
}

}  // namespace

std::unique_ptr<std::uint8_t[]> Film::keep(Picture& picture, const Config& config) {
  if (picture.empty()) return nullptr;
  const std::size_t row = row_bytes(picture.format, picture.width);
  const int rows = memory_rows(picture.format, picture.height);
  const std::size_t size = row * static_cast<std::size_t>(rows);
  bytes_ += size;
  if (bytes_ > config.most_bytes) {
    throw std::runtime_error(info_.name + ": takes more than " + std::to_string(config.most_bytes >> 20) +
                             " MB of memory after " + std::to_string(pairs_.size()) +
                             " pairs: raise source.memory_mb, or play fewer pairs");
  }
  // Not initialised: every byte is written below, and a film is large.
  auto memory = std::make_unique_for_overwrite<std::uint8_t[]>(size);
  for (int y = 0; y < rows; ++y) std::memcpy(memory.get() + row * static_cast<std::size_t>(y), picture.row(y), row);
  picture.data = memory.get();
  picture.stride_bytes = static_cast<std::ptrdiff_t>(row);
  return memory;
}

void Film::check(const SourceInfo& info, const Config& config) {
  const std::uint64_t pair_bytes =
      picture_bytes(info.format, info.width, info.height) * static_cast<std::uint64_t>(info.stereo ? 2 : 1);
  if (info.pairs && *info.pairs * pair_bytes > config.most_bytes) {
    throw std::runtime_error(info.name + ": " + std::to_string(*info.pairs) + " pairs take " +
                             std::to_string((*info.pairs * pair_bytes >> 20) + 1) + " MB of memory, and there may be " +
                             std::to_string(config.most_bytes >> 20) +
                             ": raise source.memory_mb, or play fewer (synthetic.frames)");
  }
}

Film::Film(FrameSource& source, const Config& config) : info_(source.info()), repeat_(config.repeat) {
  check(info_, config);  // before it is drawn, which takes long
  std::size_t read = 0;
  for (;;) {
    Pair kept;
    const Next next = source.next(kept.pair);
    if (next == Next::kEnd) break;
    if (next == Next::kSkipped) {
      kept.pair.left = {};
      kept.pair.right = {};
    } else {
      kept.left = keep(kept.pair.left, config);
      kept.right = keep(kept.pair.right, config);
      ++read;
    }
    pairs_.push_back(std::move(kept));
  }
  if (read == 0) throw std::runtime_error(info_.name + ": no pair could be read");
  if (info_.period.count() <= 0) {
    const auto span = pairs_.back().pair.capture_time - pairs_.front().pair.capture_time;
    info_.period = pairs_.size() > 1 ? span / static_cast<std::int64_t>(pairs_.size() - 1) : std::chrono::seconds(1);
  }
}

void Film::advance() noexcept {
  const std::size_t from = at_;
  std::chrono::nanoseconds gap = info_.period;
  if (pairs_.size() == 1 || repeat_ != Repeat::kBounce) {
    at_ = from + 1 < pairs_.size() ? from + 1 : 0;
    ended_ = at_ == 0 && repeat_ == Repeat::kOnce;
  } else {
    if (backwards_ ? from == 0 : from + 1 == pairs_.size()) backwards_ = !backwards_;
    at_ = backwards_ ? from - 1 : from + 1;
  }
  const bool neighbours = at_ == from + 1 || at_ + 1 == from;
  if (neighbours) gap = std::chrono::abs(pairs_[at_].pair.capture_time - pairs_[from].pair.capture_time);
  *next_ += gap;
  ++ordinal_;
}

LiveSource::Step Film::step(PairOutlet& outlet, MonotonicTime until) noexcept {
  if (ended_) return Step::kEnded;
  if (!next_) next_ = now();
  std::uint32_t slot = 0;
  while (outlet.take_back(slot)) {  // nothing to requeue, but what is free is counted as free
  }
  if (*next_ > until) {
    sleep_until(until);
    return Step::kGoing;
  }
  sleep_until(*next_);
  const Pair& shown = pairs_[at_];
  if (!shown.pair.left.empty()) {
    FramePair pair = shown.pair;
    pair.ordinal = ordinal_;
    pair.capture_time = CaptureTime(next_->time_since_epoch());
    (void)outlet.put(pair);
  }
  advance();
  // A process that was stopped does not show in a burst what it has slept over.
  const MonotonicTime late = now() - 2 * info_.period;
  while (*next_ < late && !ended_) advance();
  return ended_ ? Step::kEnded : Step::kGoing;
}

}  // namespace stereotrack::capture
