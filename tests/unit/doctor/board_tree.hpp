#pragma once

#include <filesystem>
#include <string>

#include "tests/support/temp_dir.hpp"

namespace stereotrack::doctor {

/// sys/, proc/ and dev/ of a Raspberry Pi 5 as its kernel lays them out, as far as the probes read them: real-time
/// kernel, governor ondemand, one PWM chip with a channel in use, three dma heaps.
class BoardTree {
 public:
  BoardTree() {
    write("proc/device-tree/model", std::string("Raspberry Pi 5 Model B Rev 1.0\0", 31));
    write("proc/sys/kernel/osrelease", "6.12.20-v8-rt\n");
    write("proc/sys/kernel/version", "#1 SMP PREEMPT_RT Thu Apr  3 12:00:00 UTC 2025\n");
    write("proc/sys/kernel/arch", "aarch64\n");
    write("proc/sys/kernel/sched_rt_runtime_us", "950000\n");
    write("sys/kernel/realtime", "1\n");

    const std::string cpu = "sys/devices/system/cpu/";
    write(cpu + "online", "0-3\n");
    write(cpu + "isolated", "2-3\n");
    write(cpu + "cpufreq/policy0/scaling_governor", "ondemand\n");
    write(cpu + "cpufreq/policy0/cpuinfo_max_freq", "2400000\n");
    write(cpu + "cpu0/cpuidle/state0/name", "WFI\n");
    write("sys/class/thermal/thermal_zone0/temp", "51300\n");
    write("sys/devices/platform/soc/soc:firmware/get_throttled", "0\n");

    write("proc/meminfo",
          "MemTotal:        4147980 kB\nMemFree:         3000000 kB\nMemAvailable:    3521644 kB\n"
          "SwapTotal:        524272 kB\nCmaTotal:          65536 kB\n");
    for (const char* const heap : {"system", "linux,cma", "vidbuf_cached"})
      write(std::string("dev/dma_heap/") + heap, "");
    write("proc/self/limits",
          "Limit                     Soft Limit           Hard Limit           Units     \n"
          "Max locked memory         8388608              8388608              bytes     \n"
          "Max realtime priority     95                   95                   \n");

    write("sys/devices/platform/axi/1f00098000.pwm/uevent", "");
    write("sys/class/pwm/pwmchip0/npwm", "4\n");
    write("sys/class/pwm/pwmchip0/pwm1/period", "0\n");
    std::filesystem::create_directory_symlink("../../../devices/platform/axi/1f00098000.pwm",
                                              root() / "sys/class/pwm/pwmchip0/device");

    const std::string clock = "sys/devices/system/clocksource/clocksource0/";
    write(clock + "current_clocksource", "arch_sys_counter\n");
    write(clock + "available_clocksource", "arch_sys_counter \n");
    write("dev/ptp0", "");
  }

  void write(const std::string& file, const std::string& text) const { (void)folder_.write(file, text); }
  void remove(const std::string& what) const { std::filesystem::remove_all(root() / what); }
  [[nodiscard]] std::filesystem::path root() const { return folder_.path(); }

 private:
  test::TempDir folder_;
};

}  // namespace stereotrack::doctor
