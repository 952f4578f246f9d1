#include "firmware-app/render/matroska.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <fstream>
#include <optional>
#include <vector>

namespace stereotrack::render {
namespace {

using Bytes = std::span<std::uint8_t>;

constexpr std::uint64_t kCrc32 = 0xBF;
constexpr std::uint64_t kSegment = 0x18538067;  // the whole file: the only one that goes on behind the head
constexpr std::array<std::uint64_t, 3> kIds{0x73A4, 0x73C5, 0x63C5};  // SegmentUID, TrackUID, TagTrackUID
// Segment, Info, Tracks, TrackEntry, Tags, Tag, Targets
constexpr std::array<std::uint64_t, 7> kParents{kSegment, 0x1549A966, 0x1654AE6B, 0xAE, 0x1254C367, 0x7373, 0x63C0};

template <std::size_t N>
bool is_one_of(const std::array<std::uint64_t, N>& all, std::uint64_t id) {
  return std::find(all.begin(), all.end(), id) != all.end();
}

/// EBML number: as many bytes as the first has leading zero bits, and one. Takes it off `bytes`.
std::optional<std::uint64_t> take_number(Bytes& bytes, bool keep_marker) {
  if (bytes.empty() || bytes[0] == 0) return std::nullopt;
  const auto more = static_cast<std::size_t>(std::countl_zero(bytes[0]));
  if (bytes.size() <= more) return std::nullopt;
  std::uint64_t value = keep_marker ? bytes[0] : bytes[0] & (0x7FU >> more);
  for (std::size_t i = 1; i <= more; ++i) value = value << 8U | bytes[i];
  bytes = bytes.subspan(more + 1);
  return value;
}

std::uint32_t crc32(Bytes bytes) {
  std::uint32_t crc = ~0U;
  for (const std::uint8_t byte : bytes) {
    crc ^= byte;
    for (int bit = 0; bit < 8; ++bit) crc = crc >> 1U ^ (0xEDB88320U & (0U - (crc & 1U)));
  }
  return ~crc;
}

}  // namespace

void make_ids_constant(Bytes head) {
  Bytes crc;  // of the elements that follow it in this one
  Bytes covered;
  while (!head.empty()) {
    const auto id = take_number(head, true);
    const auto size = take_number(head, false);
    if (!id || !size || (*size > head.size() && *id != kSegment)) break;
    const Bytes body = head.first(static_cast<std::size_t>(std::min<std::uint64_t>(*size, head.size())));
    head = head.subspan(body.size());
    if (*id == kCrc32 && body.size() == 4) {
      crc = body;
      covered = head;
    } else if (is_one_of(kParents, *id)) {
      make_ids_constant(body);
    } else if (is_one_of(kIds, *id) && !body.empty()) {
      std::fill(body.begin(), body.end() - 1, std::uint8_t{0});
      body.back() = 1;
    }
  }
  const std::uint32_t value = crc32(covered);
  for (std::size_t i = 0; i < crc.size(); ++i) crc[i] = static_cast<std::uint8_t>(value >> 8U * i);
}

void make_ids_constant(const std::string& path) {
  constexpr std::size_t kHead = 4096;  // FFmpeg leaves under 1 KB in front of the first picture
  std::fstream file(path, std::ios::binary | std::ios::in | std::ios::out);
  std::vector<char> head(kHead);
  file.read(head.data(), static_cast<std::streamsize>(head.size()));
  head.resize(static_cast<std::size_t>(file.gcount()));
  file.clear();
  make_ids_constant(Bytes(reinterpret_cast<std::uint8_t*>(head.data()), head.size()));
  file.seekp(0);
  file.write(head.data(), static_cast<std::streamsize>(head.size()));
}

}  // namespace stereotrack::render
