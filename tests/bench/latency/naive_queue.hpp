#pragma once

#include <chrono>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "config/configuration.hpp"
#include "drivers/capture/film/film.hpp"
#include "drivers/telemetry/endpoint.hpp"
#include "pipeline/geometry/calibration.hpp"

namespace stereotrack::bench {

/// A queue as one writes it on the first day.
template <class T>
class NaiveQueue {
 public:
  void push(T value) {
    {
      const std::lock_guard lock(mutex_);
      values_.push_back(std::move(value));
    }
    filled_.notify_one();
  }
  /// False: closed and empty.
  bool pop(T& value) {
    std::unique_lock lock(mutex_);
    filled_.wait(lock, [this] { return closed_ || !values_.empty(); });
    if (values_.empty()) return false;
    value = std::move(values_.front());
    values_.pop_front();
    return true;
  }
  void close() {
    {
      const std::lock_guard lock(mutex_);
      closed_ = true;
    }
    filled_.notify_all();
  }

 private:
  std::mutex mutex_;
  std::condition_variable filled_;
  std::deque<T> values_;
  bool closed_ = false;
};

/// The same pipeline and contract, built the usual way: pictures are copied into vectors and go through a locked queue
/// to a thread that runs the pipeline, its tracks are copied into a vector and go through another to a thread that
/// sleeps to capture + latency and sends. Ordinary threads, nothing is dropped, nothing is predicted when it is late.
void run_naive(const config::Configuration& configuration, const StereoCalibration& calibration, capture::Film& film,
               const std::vector<telemetry::Endpoint>& to, std::chrono::seconds duration);

}  // namespace stereotrack::bench
