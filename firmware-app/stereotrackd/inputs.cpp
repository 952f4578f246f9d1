#include "firmware-app/stereotrackd/inputs.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "config/error.hpp"
#include "config/milliseconds.hpp"
#include "firmware-app/signals/set_up.hpp"

namespace stereotrack::daemon {

namespace {

constexpr const char* kConsumer = "stereotrackd";
constexpr std::chrono::seconds kProbePeriod{1};

gpio::InputLines open(const Inputs::Setup& setup) {
  std::vector<gpio::InputSpec> specs;
  for (const Inputs::Input& input : setup.inputs) specs.push_back(input.spec);
  return gpio::open_inputs(specs, kConsumer);
}

}  // namespace

Inputs::Inputs(Setup setup) {
  gpio::InputLines lines = open(setup);
  begin(std::move(setup), std::move(lines));
}

void Inputs::begin(Setup setup, gpio::InputLines lines) {
  std::vector<Course> courses(setup.inputs.size());
  for (std::size_t i = 0; i < courses.size(); ++i) {
    for (std::size_t before = 0; before < courses_.size(); ++before) {
      if (setup_.inputs[before].name != setup.inputs[i].name) continue;
      courses[i] = courses_[before];
      courses[i].events_before = events(before);
      courses[i].lost_before = lost(before);
    }
  }
  outages_before_ = outages();
  courses_ = std::move(courses);
  setup_ = std::move(setup);
  lines_ = std::move(lines);
  care_ = LineCare("GPIO inputs");
}

void Inputs::exchange(Setup setup, record::BlackBox* box) {
  take(box);  // edges that lines of before had until now
  const auto spec_of = [](const Input& input) { return input.spec; };
  const bool same =
      std::equal(setup.inputs.begin(), setup.inputs.end(), setup_.inputs.begin(), setup_.inputs.end(),
                 [&](const Input& a, const Input& b) { return a.name == b.name && spec_of(a) == spec_of(b); });
  if (same) {
    setup_ = std::move(setup);
    return;
  }
  if (lines_.gone() != 0) throw std::runtime_error("a chip is gone: " + lines_.why() + ": they change once it is back");
  // Lines of before would be busy for those to come.
  begin(setup_, gpio::InputLines());
  try {
    gpio::InputLines lines = open(setup);
    begin(std::move(setup), std::move(lines));
  } catch (const std::runtime_error& refused) {
    const std::string why = refused.what();
    try {
      begin(setup_, open(setup_));
    } catch (const std::runtime_error& error) {
      begin({.inputs = {}, .record = setup_.record}, gpio::InputLines());
      throw std::runtime_error(why + "; and those of before cannot be had any more, none is read: " + error.what());
    }
    throw;
  }
}

void Inputs::take(record::BlackBox* box) {
  std::array<gpio::EdgeEvent, 64> events;
  const std::size_t count = lines_.read(events);
  for (const gpio::EdgeEvent& event : std::span(events).first(count)) {
    Course& course = courses_[event.line];
    const bool too_soon = course.has_triggered && event.time - course.triggered < setup_.inputs[event.line].apart;
    if (box == nullptr || !setup_.record || too_soon) continue;
    course.has_triggered = true;
    course.triggered = event.time;
    ++course.triggers;
    box->trigger(record::kGpioInput);
  }
}

void Inputs::tend(MonotonicTime now) {
  if (size() == 0) return;
  if (now - probed_ >= kProbePeriod) {
    lines_.probe();
    probed_ = now;
  }
  const auto tell = [&] {
    care_.tell(
        lines_.gone(), [this](std::size_t i) { return to_string(lines_.name(i)); }, lines_.why(), now);
  };
  tell();
  if (!care_.is_due(lines_.gone(), now)) return;
  (void)lines_.reopen();
  if (lines_.gone() != 0) care_.cannot(lines_.why());
  tell();
}

std::uint64_t Inputs::events(std::size_t i) const noexcept {
  return courses_[i].events_before + (i < lines_.size() ? lines_.reading(i).events : 0);
}

std::uint64_t Inputs::lost(std::size_t i) const noexcept {
  return courses_[i].lost_before + (i < lines_.size() ? lines_.reading(i).lost : 0);
}

Inputs::Setup input_setup(const config::Configuration& configuration) {
  Inputs::Setup setup;
  setup.record = configuration.record.on_input;
  for (const config::InputConfig& said : configuration.inputs) {
    try {
      Inputs::Input input;
      input.name = said.name;
      input.spec = {.name = gpio::parse_line_name(said.line),
                    .active_low = said.active == config::ActiveLevel::kLow,
                    .bias = signals::bias_of(said.bias),
                    .edges = signals::edges_of(said.edge),
                    .debounce = std::chrono::microseconds(std::llround(said.debounce_ms * 1e3))};
      input.apart = config::from_ms(said.apart_ms);
      gpio::check_inputs({&input.spec, 1});
      setup.inputs.push_back(std::move(input));
    } catch (const std::runtime_error& error) {
      throw config::Error("input " + said.name + ": " + error.what());
    }
  }
  return setup;
}

}  // namespace stereotrack::daemon
