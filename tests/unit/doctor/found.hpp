#pragma once

#include <string>
#include <vector>

#include "firmware-app/stereotrack/doctor/findings.hpp"

namespace stereotrack::doctor {

/// A camera as the kernel's drivers describe theirs.
inline CameraFound camera_at(int number, const std::string& driver, const std::string& card, const std::string& bus,
                             std::vector<capture::v4l2::CameraFacts::Format> formats) {
  CameraFound camera;
  camera.facts.path = "/dev/video" + std::to_string(number);
  camera.facts.driver = driver;
  camera.facts.card = card;
  camera.facts.bus = bus;
  camera.facts.formats = std::move(formats);
  return camera;
}

inline capture::v4l2::CameraFacts::Size size_of(int width, int height, std::vector<double> rates) {
  return {width, height, width, height, std::move(rates)};
}

/// A board on which all is well: two cameras, rights, kernel, everything measured.
inline Findings good_board() {
  Findings f;
  f.program = "stereotrack 0";
  f.host = "mast";
  f.seconds = 5;
  f.kernel = {.board = "Raspberry Pi 5 Model B Rev 1.0",
              .release = "6.12.20-v8-rt",
              .version = "#1 SMP PREEMPT_RT",
              .architecture = "aarch64",
              .preemption = Preemption::kRealTime,
              .rt_runtime_us = 950000};
  f.cpu = {.cores = 4,
           .governors = {"performance"},
           .max_mhz = 2400,
           .isolated = "",
           .sleep_states = 1,
           .hottest_c = 51.3,
           .throttled = false};
  f.memory = {.total_mb = 4050, .available_mb = 3439, .swap_mb = 0, .cma_mb = 64, .dma_heaps = {"system", "linux,cma"}};
  f.limits = {.user = "stereotrack", .locked_kb = std::nullopt, .priority = 95};
  f.clocks = {.source = "arch_sys_counter", .available = {"arch_sys_counter"}, .ptp = {}, .tai_error_us = 120.0};
  f.gpio_interface = "2";
  f.chips.resize(1);
  f.chips[0].chip = {"/dev/gpiochip0", "gpiochip0", "pinctrl-rp1", 2};
  f.chips[0].lines = {{"GPIO17", false, ""}, {"GPIO27", true, "spi0"}};
  f.pwm = {{"pwmchip0", "1f00098000.pwm", 4, {}}};
  const std::vector<capture::v4l2::CameraFacts::Format> formats{
      {"GREY", "grey8", {size_of(640, 480, {25, 30, 60}), size_of(1280, 960, {30})}},
      {"MJPG", "", {size_of(640, 480, {30})}}};
  f.found.cameras = {camera_at(0, "uvcvideo", "Eye", "usb-1", formats),
                     camera_at(2, "uvcvideo", "Eye", "usb-2", formats)};
  f.configuration.source.name = "cameras";
  f.configuration.camera.left.device = "bus:usb-1";
  f.configuration.camera.right.device = "bus:usb-2";
  f.configuration.camera.format = "grey8";
  f.suggestion = true;
  f.has_calibration = true;
  const Tail quick{150, 20, 60, 80, 90};
  for (const char* const side : {"left", "right"}) {
    f.capture.push_back({.side = side,
                         .name = std::string("bus:usb-") + (f.capture.empty() ? "1 (/dev/video0)" : "2 (/dev/video2)"),
                         .delivers = "640x480 grey8",
                         .colour = false,
                         .period_ms = 1e3 / 30,
                         .readout_us = 9'000,
                         .readout_is_guessed = false,
                         .frames = 150,
                         .damaged = 0,
                         .lost = 0,
                         .late = 0,
                         .jitter = quick,
                         .delay = {150, 12'000, 12'500, 13'000, 13'000},
                         .delay_min_us = 11'000,
                         .notes = {},
                         .failure = ""});
  }
  f.pair = {.phase_ms = 0.02, .drift_ppm = 0.1};
  f.wake_up = {.thread = "st-publisher", .priority = 82, .beside_pipeline = true, .latency = {5000, 5, 20, 40, 60}};
  f.pipeline = {.width = 640,
                .height = 480,
                .colour = false,
                .stereo = true,
                .period_ms = 1e3 / 30,
                .drawn = 60,
                .compute = {150, 9'000, 11'000, 12'000, 12'000},
                .memory_mb = 90,
                .problem = ""};
  f.latency = LatencyVerdict{.arrival_ms = 13,
                             .arrival_is_assumed = false,
                             .compute_ms = 12,
                             .wake_ms = 0.08,
                             .lead_ms = 0.8,
                             .spare_ms = 3,
                             .achievable_ms = 29,
                             .configured_ms = 50,
                             .period_ms = 1e3 / 30};
  return f;
}

}  // namespace stereotrack::doctor
