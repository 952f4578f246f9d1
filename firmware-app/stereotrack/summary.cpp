#include "firmware-app/stereotrack/summary.hpp"

#include <sodium.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "firmware-app/runtime/allocation_count.hpp"
#include "firmware-app/stereotrack/output_file.hpp"

namespace stereotrack {

namespace {

nlohmann::ordered_json json_of(const Percentiles& p) { return {{"p50", p.p50}, {"p99", p.p99}, {"max", p.max}}; }

}  // namespace

Percentiles percentiles(std::vector<double> values) {
  if (values.empty()) return {};
  std::sort(values.begin(), values.end());
  const auto at = [&](double part) {
    const auto index = static_cast<std::size_t>(part * static_cast<double>(values.size()));
    return values[std::min(index, values.size() - 1)];
  };
  return {at(0.5), at(0.99), values.back()};
}

Digest::Digest() : state_(new crypto_generichash_blake2b_state) {
  (void)crypto_generichash_blake2b_init(state_, nullptr, 0, crypto_generichash_blake2b_BYTES);
}
Digest::~Digest() { delete state_; }

void Digest::add(std::span<const std::byte> bytes) noexcept {
  (void)crypto_generichash_blake2b_update(state_, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size());
}

void Digest::add(const Picture& picture) noexcept {
  const std::array<std::uint32_t, 3> head{static_cast<std::uint32_t>(picture.width),
                                          static_cast<std::uint32_t>(picture.height),
                                          static_cast<std::uint32_t>(picture.format)};
  add(std::as_bytes(std::span(head)));
  const std::size_t bytes = row_bytes(picture.format, picture.width);
  const int rows = memory_rows(picture.format, picture.height);
  for (int y = 0; y < rows; ++y) add(std::as_bytes(std::span(picture.row(y), bytes)));
}

std::string Digest::hex() const {
  crypto_generichash_blake2b_state copy = *state_;
  std::array<unsigned char, crypto_generichash_blake2b_BYTES> digest{};
  (void)crypto_generichash_blake2b_final(&copy, digest.data(), digest.size());
  std::string text;
  for (const unsigned char byte : digest) {
    constexpr const char* kDigits = "0123456789abcdef";
    text += kDigits[byte >> 4];
    text += kDigits[byte & 15];
  }
  return text;
}

void StageTimes::frame_begins() {
  for (std::vector<double>& ms : ms_) {
    if (ms.size() == ms.capacity()) ms.reserve(std::max<std::size_t>(1024, 2 * ms.size()));
  }
  last_ = std::chrono::steady_clock::now();
}

void StageTimes::stage_ended(void* context, Stage stage) noexcept {
  auto& self = *static_cast<StageTimes*>(context);
  const auto now = std::chrono::steady_clock::now();
  self.ms_[static_cast<std::size_t>(stage)].push_back(
      std::chrono::duration<double, std::milli>(now - self.last_).count());
  self.last_ = now;
}

Percentiles StageTimes::of(Stage stage) const { return percentiles(ms_[static_cast<std::size_t>(stage)]); }

Percentiles StageTimes::whole() const {
  std::vector<double> sum = ms_[0];
  for (std::size_t stage = 1; stage < kStages; ++stage) {
    for (std::size_t i = 0; i < sum.size() && i < ms_[stage].size(); ++i) sum[i] += ms_[stage][i];
  }
  return percentiles(std::move(sum));
}

void save_summary(const std::filesystem::path& path, const Summary& summary, const StageTimes* times) {
  nlohmann::ordered_json json;
  json["source"] = summary.source;
  json["frames"] = summary.frames;
  json["drops"] = {{"unreadable", summary.skipped},
                   {"telemetry_full_socket", summary.telemetry_dropped},
                   {"telemetry_failed", summary.telemetry_failed}};
  json["skipped"] = summary.skip_reasons;
  if (summary.pair_skews_us.empty()) {
    json["pair_skew_us"] = nullptr;
  } else {
    json["pair_skew_us"] = json_of(percentiles(summary.pair_skews_us));
  }
  json["wrong_pairs"] = summary.wrong_pairs;
  json["tracks"] = summary.tracks;
  json["rows"] = summary.rows;
  json["deadline_misses"] = summary.deadline_misses;
  json["mono"] = (summary.flags & kFlagMono) != 0;
  json["colour"] = (summary.flags & kFlagNoColour) == 0;
  json["light_changes"] = (summary.flags & kFlagLightChange) != 0;
  nlohmann::ordered_json rejected;
  for (std::size_t i = 0; i < kRejections; ++i) {
    rejected[to_string(static_cast<Rejection>(i))] = summary.rejections[i];
  }
  json["candidates_rejected"] = rejected;
  json["hulls_reduced"] = summary.hulls_reduced;
  json["telemetry_datagrams"] = summary.telemetry_sent;
  if (allocations_are_counted()) {
    json["allocations_after_warmup"] = summary.allocations_after_warmup;
  } else {
    json["allocations_after_warmup"] = nullptr;
  }
  json["memory_bytes"] = summary.memory_bytes;
  json["pixels_blake2b"] = summary.pixels_hash;
  json["telemetry_blake2b"] = summary.telemetry_hash;
  json["configuration"] = summary.configuration;
  if (times != nullptr) {
    nlohmann::ordered_json stages;
    for (std::size_t i = 0; i < kStages; ++i) {
      const auto stage = static_cast<Stage>(i);
      stages[to_string(stage)] = json_of(times->of(stage));
    }
    stages["whole"] = json_of(times->whole());
    json["stages_ms"] = stages;
  }
  OutputFile file(path);
  file.write(json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n");
  file.commit();
}

}  // namespace stereotrack
