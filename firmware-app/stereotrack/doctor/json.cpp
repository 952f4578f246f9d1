#include <nlohmann/json.hpp>

#include "firmware-app/stereotrack/doctor/report.hpp"
#include "firmware-app/stereotrack/doctor/words.hpp"

namespace stereotrack::doctor {

namespace {

using Json = nlohmann::ordered_json;

constexpr int kFormat = 1;  ///< rises when a key changes its meaning or goes; new keys do not raise it

template <class T>
Json or_null(const std::optional<T>& value) {
  return value ? Json(*value) : Json(nullptr);
}

const char* verdict_key(Verdict verdict) {
  switch (verdict) {
    case Verdict::kNote: return "note";
    case Verdict::kProblem: return "problem";
    case Verdict::kOk: break;
  }
  return "ok";
}

const char* whole_key(Verdict verdict) {
  switch (verdict) {
    case Verdict::kNote: return "works_with_limits";
    case Verdict::kProblem: return "cannot_run";
    case Verdict::kOk: break;
  }
  return "ready";
}

Json json_of(const Tail& tail) {
  return {{"count", tail.count},
          {"p50_us", tail.p50_us},
          {"p99_us", tail.p99_us},
          {"p999_us", tail.p999_us},
          {"max_us", tail.max_us}};
}

Json json_of(const CameraFound& camera) {
  const capture::v4l2::CameraFacts& facts = camera.facts;
  Json json{
      {"driver", driver_name(camera.driver)}, {"path", facts.path},   {"card", facts.card},      {"bus", facts.bus},
      {"kernel_driver", facts.driver},        {"links", facts.links}, {"problem", facts.problem}};
  Json& formats = json["formats"] = Json::array();
  for (const auto& format : facts.formats) {
    Json& one = formats.emplace_back(Json{{"fourcc", format.fourcc}, {"name", std::string(format.name)}});
    Json& sizes = one["sizes"] = Json::array();
    for (const auto& size : format.sizes) {
      sizes.push_back({{"width", size.width},
                       {"height", size.height},
                       {"max_width", size.max_width},
                       {"max_height", size.max_height},
                       {"rates", size.rates}});
    }
  }
  Json& controls = json["controls"] = Json::array();
  for (const auto& control : facts.controls) {
    controls.push_back({{"name", control.name},
                        {"minimum", control.minimum},
                        {"maximum", control.maximum},
                        {"step", control.step},
                        {"default", control.standard},
                        {"value", or_null(control.value)}});
  }
  return json;
}

Json json_of(const gpio::gpiod::ChipListing& chip) {
  Json json{{"path", chip.chip.path}, {"name", chip.chip.name}, {"label", chip.chip.label}, {"problem", chip.problem}};
  Json& lines = json["lines"] = Json::array();
  for (const gpio::LineFacts& line : chip.lines) {
    lines.push_back({{"name", line.name}, {"used", line.used}, {"consumer", line.consumer}});
  }
  return json;
}

Json json_of(const CaptureMeasure& m) {
  return {{"side", m.side},
          {"name", m.name},
          {"delivers", m.delivers},
          {"period_ms", m.period_ms},
          {"readout_us", or_null(m.readout_us)},
          {"readout_is_guessed", m.readout_is_guessed},
          {"frames", m.frames},
          {"damaged", m.damaged},
          {"lost", m.lost},
          {"late", m.late},
          {"jitter", json_of(m.jitter)},
          {"delay", json_of(m.delay)},
          {"delay_min_us", m.delay_min_us},
          {"notes", m.notes},
          {"failure", m.failure}};
}

Json facts_of(const Findings& f) {
  Json json;
  json["kernel"] = {{"board", f.kernel.board},
                    {"release", f.kernel.release},
                    {"version", f.kernel.version},
                    {"architecture", f.kernel.architecture},
                    {"preemption", to_string(f.kernel.preemption)},
                    {"rt_runtime_us", or_null(f.kernel.rt_runtime_us)}};
  json["cpu"] = {{"cores", f.cpu.cores},
                 {"governors", f.cpu.governors},
                 {"max_mhz", f.cpu.max_mhz},
                 {"isolated", f.cpu.isolated},
                 {"sleep_states", f.cpu.sleep_states},
                 {"hottest_c", or_null(f.cpu.hottest_c)},
                 {"throttled", or_null(f.cpu.throttled)}};
  json["memory"] = {{"total_mb", f.memory.total_mb},
                    {"available_mb", f.memory.available_mb},
                    {"swap_mb", f.memory.swap_mb},
                    {"cma_mb", f.memory.cma_mb},
                    {"dma_heaps", f.memory.dma_heaps}};
  json["rights"] = {{"user", f.limits.user},
                    {"priority_limit", f.limits.priority},
                    {"locked_memory_limit_kb", or_null(f.limits.locked_kb)},
                    {"missing", Json::array()}};
  for (const runtime::Missing& one : f.missing) {
    json["rights"]["missing"].push_back({{"what", one.what}, {"grant", one.grant}});
  }
  json["clock"] = {{"source", f.clocks.source},
                   {"available", f.clocks.available},
                   {"ptp", f.clocks.ptp},
                   {"tai_error_us", or_null(f.clocks.tai_error_us)}};
  json["gpio"] = {{"libgpiod", f.gpio_interface}, {"chips", Json::array()}, {"lines", Json::array()}};
  for (const auto& chip : f.chips) json["gpio"]["chips"].push_back(json_of(chip));
  for (const LineFound& line : f.lines) {
    json["gpio"]["lines"].push_back({{"for", line.key},
                                     {"line", line.line},
                                     {"output", line.output},
                                     {"consumer", line.consumer},
                                     {"problem", line.problem}});
  }
  Json& pwm = json["pwm"] = Json::array();
  for (const trigger::PwmChip& chip : f.pwm) {
    pwm.push_back(
        {{"name", chip.name}, {"device", chip.device}, {"channels", chip.channels}, {"exported", chip.exported}});
  }
  Json& cameras = json["cameras"] = Json::array();
  for (const CameraFound& camera : f.found.cameras) cameras.push_back(json_of(camera));
  json["libcamera"] = {{"module", f.found.libcamera}, {"problems", f.found.libcamera_problems}};
  return json;
}

Json measured_of(const Findings& f) {
  Json json{{"capture", Json::array()}, {"pair", nullptr},     {"wake_up", nullptr},
            {"line", nullptr},          {"pipeline", nullptr}, {"latency", nullptr}};
  for (const CaptureMeasure& camera : f.capture) json["capture"].push_back(json_of(camera));
  if (f.pair) json["pair"] = {{"phase_ms", or_null(f.pair->phase_ms)}, {"drift_ppm", or_null(f.pair->drift_ppm)}};
  if (f.wake_up) {
    json["wake_up"] = {{"thread", f.wake_up->thread},
                       {"priority", f.wake_up->priority},
                       {"beside_pipeline", f.wake_up->beside_pipeline},
                       {"latency", json_of(f.wake_up->latency)}};
  }
  if (f.line) {
    json["line"] = {{"line", f.line->line},
                    {"failures", f.line->failures},
                    {"latency", json_of(f.line->latency)},
                    {"problem", f.line->problem}};
  }
  if (f.pipeline) {
    const PipelineMeasure& p = *f.pipeline;
    json["pipeline"] = {
        {"width", p.width},         {"height", p.height}, {"colour", p.colour},       {"stereo", p.stereo},
        {"period_ms", p.period_ms}, {"drawn", p.drawn},   {"memory_mb", p.memory_mb}, {"compute", json_of(p.compute)},
        {"problem", p.problem}};
  }
  if (f.latency) {
    const LatencyVerdict& v = *f.latency;
    json["latency"] = {{"achievable_ms", v.achievable_ms},
                       {"configured_ms", v.configured_ms},
                       {"arrival_ms", v.arrival_ms},
                       {"arrival_is_assumed", v.arrival_is_assumed},
                       {"compute_ms", v.compute_ms},
                       {"spare_ms", v.spare_ms},
                       {"wake_ms", v.wake_ms},
                       {"lead_ms", v.lead_ms},
                       {"period_ms", v.period_ms}};
  }
  return json;
}

}  // namespace

std::string json(const Findings& findings, const std::vector<Item>& items) {
  const Verdict worst = worst_of(items);
  Json json{{"format", kFormat},
            {"program", findings.program},
            {"host", findings.host},
            {"config", findings.config},
            {"seconds", findings.seconds},
            {"verdict", whole_key(worst)},
            {"exit_code", exit_code(worst)}};
  Json& told = json["items"] = Json::array();
  for (const Item& item : items) {
    told.push_back({{"topic", item.topic},
                    {"verdict", verdict_key(item.verdict)},
                    {"text", item.text},
                    {"way_out", item.way_out},
                    {"command", item.command}});
  }
  json["found"] = facts_of(findings);
  json["measured"] = measured_of(findings);
  // What drivers call themselves need not be UTF-8.
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + '\n';
}

}  // namespace stereotrack::doctor
