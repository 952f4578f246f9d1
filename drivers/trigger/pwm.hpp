#pragma once

#include <chrono>
#include <string>
#include <vector>

namespace stereotrack::trigger {

/// Pulses of hardware PWM, through the kernel's /sys/class/pwm (Documentation/driver-api/pwm.rst). The hardware keeps
/// the time: they are more regular than any thread's.
///
/// **It tells nothing**: the kernel does not say when the hardware's pulses are. There is no Trigger; frames are paired
/// by their times and the drivers' counts alone, as of an unseen trigger: silence of both cameras is no fault, a missed
/// exposure shows as a frame without a partner, a doubled one as one too many.
///
/// The clock that drives the PWM is not the one that times frames: a period is true to some 50 in a million, and what
/// the hardware cannot do to the nanosecond it rounds, without saying.
///
/// Who made it owns it; start() and stop() by one thread, hold_safe() by any.
class Pwm {
 public:
  struct Config {
    std::string chip;  ///< pwmchip0, 0, a path, or the name of its device (fe20c000.pwm)
    unsigned channel = 0;
    std::chrono::nanoseconds period{0};
    std::chrono::nanoseconds width{0};  ///< active for so long of it
    bool active_low = false;            ///< the driver's polarity "inversed", which not each has
    std::string root = "/sys/class/pwm";
  };

  /// Exports the channel where nobody has, and sets it up; it stays off. Throws std::runtime_error with one line: no
  /// such chip, and which there are; no such channel; no permission, with the way to grant it; in use: it is on
  /// already; what the driver refuses.
  explicit Pwm(const Config& config);
  Pwm(const Pwm&) = delete;
  Pwm& operator=(const Pwm&) = delete;
  ~Pwm();  ///< stop(); what was exported is unexported

  /// Pulses from now on. Throws std::runtime_error, one line.
  void start();

  /// No more: width 0 first, which ends in the inactive level, then off. Where a driver leaves a PWM that is off at
  /// another level, only a pull on the line helps. False: the driver refused.
  bool stop() noexcept;

  /// The same from the handler of a fault: two write(2).
  [[nodiscard]] bool hold_safe() noexcept;

  /// "pwmchip0 (fe20c000.pwm), channel 0"
  [[nodiscard]] const std::string& name() const noexcept { return name_; }

 private:
  void set_up();
  void let_go() noexcept;

  Config config_;
  std::string chip_folder_;
  std::string folder_;  ///< of the channel
  std::string name_;
  bool exported_ = false;  ///< by us
  int enable_ = -1;
  int duty_ = -1;
};

/// A chip of the kernel's.
struct PwmChip {
  std::string name;    ///< pwmchip0
  std::string device;  ///< fe20c000.pwm; empty: the kernel does not say
  unsigned channels = 0;
  std::vector<unsigned> exported;  ///< channels that somebody uses, by number
};
/// Those that there are; none where the folder is not there.
[[nodiscard]] std::vector<PwmChip> pwm_chips(const std::string& root = "/sys/class/pwm");

/// The folder of a chip. Throws std::runtime_error, one line: there is none and which there are, no such channel.
[[nodiscard]] PwmChip find_pwm(const Pwm::Config& config);

/// After a crash: off, where it is exported; it stays exported, for it may have been by somebody else. One line for
/// people; throws std::runtime_error with one.
[[nodiscard]] std::string set_pwm_safe(const Pwm::Config& config);

}  // namespace stereotrack::trigger
