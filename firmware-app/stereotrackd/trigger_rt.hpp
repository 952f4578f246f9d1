#pragma once

#include <atomic>
#include <chrono>

#include "drivers/trigger/pulse_train.hpp"
#include "firmware-app/stereotrackd/vitals.hpp"

namespace stereotrack::daemon {

/// The trigger thread's body: gives the pulses of `train` until `stop`; the line is inactive then. It is awake for the
/// last `awake` of each wait for a pulse. Ends within 0.1 s.
void give_pulses(trigger::PulseTrain& train, Vitals& vitals, std::chrono::nanoseconds awake,
                 const std::atomic<bool>& stop) noexcept;

}  // namespace stereotrack::daemon
