#include "drivers/capture/replay/picture_file.hpp"

#include <array>
#include <cstddef>
#include <cstdlib>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <string_view>
#include <vector>

namespace stereotrack::capture {
namespace {

using Bytes = std::span<const std::uint8_t>;

std::uint32_t big_endian_32(Bytes b, std::size_t at) {
  return static_cast<std::uint32_t>(b[at]) << 24 | static_cast<std::uint32_t>(b[at + 1]) << 16 |
         static_cast<std::uint32_t>(b[at + 2]) << 8 | b[at + 3];
}

std::uint32_t little_endian_32(Bytes b, std::size_t at) {
  return static_cast<std::uint32_t>(b[at + 3]) << 24 | static_cast<std::uint32_t>(b[at + 2]) << 16 |
         static_cast<std::uint32_t>(b[at + 1]) << 8 | b[at];
}

bool begins_with(Bytes bytes, std::string_view magic) {
  if (bytes.size() < magic.size()) return false;
  for (std::size_t i = 0; i < magic.size(); ++i) {
    if (bytes[i] != static_cast<std::uint8_t>(magic[i])) return false;
  }
  return true;
}

/// ITU-T T.81 annex B: FF marker, big-endian length that counts itself, data; after SOS entropy-coded data in
/// which FF is followed by 00 or a restart marker.
std::string jpeg_damage(Bytes b) {
  const std::string truncated = "truncated: the JPEG end marker is missing";
  std::size_t at = 2;
  while (at + 1 < b.size()) {
    if (b[at] != 0xFF) return "corrupt: a JPEG marker was expected at byte " + std::to_string(at);
    const std::uint8_t marker = b[at + 1];
    if (marker == 0xFF) {  // fill byte
      ++at;
      continue;
    }
    if (marker == 0xD9) return {};
    const bool may_stand_here =
        (marker >= 0xC0 && marker <= 0xCF && marker != 0xC8) || marker == 0xFE || (marker >= 0xDA && marker <= 0xEF);
    if (!may_stand_here) return "corrupt: wrong JPEG marker at byte " + std::to_string(at);
    if (at + 3 >= b.size()) return truncated;
    at += 2 + (static_cast<std::size_t>(b[at + 2]) << 8 | b[at + 3]);
    if (marker != 0xDA) continue;
    while (at + 1 < b.size()) {
      const std::uint8_t next = b[at + 1];
      if (b[at] == 0xFF && next != 0x00 && !(next >= 0xD0 && next <= 0xD7)) break;
      ++at;
    }
  }
  return truncated;
}

constexpr std::array<std::uint32_t, 256> make_crc_table() {
  std::array<std::uint32_t, 256> table{};
  for (std::uint32_t n = 0; n < 256; ++n) {
    std::uint32_t c = n;
    for (int k = 0; k < 8; ++k) c = (c & 1U) != 0 ? 0xEDB88320U ^ (c >> 1) : c >> 1;
    table[n] = c;
  }
  return table;
}
constexpr std::array<std::uint32_t, 256> kCrcTable = make_crc_table();

std::uint32_t crc32(Bytes bytes) {
  std::uint32_t c = 0xFFFFFFFFU;
  for (const std::uint8_t byte : bytes) c = kCrcTable[(c ^ byte) & 0xFFU] ^ (c >> 8);
  return ~c;
}

/// ISO/IEC 15948: signature of 8 bytes, then chunks: length, type, data, CRC-32 of type and data.
std::string png_damage(Bytes b) {
  std::size_t at = 8;
  while (b.size() - at >= 12) {
    const std::size_t length = big_endian_32(b, at);
    if (length > b.size() - at - 12) break;
    if (crc32(b.subspan(at + 4, length + 4)) != big_endian_32(b, at + 8 + length)) {
      return "corrupt: wrong checksum in the PNG chunk at byte " + std::to_string(at);
    }
    if (begins_with(b.subspan(at + 4), "IEND")) return {};
    at += 12 + length;
  }
  return "truncated: the PNG end chunk is missing";
}

/// Offset of the pixels at byte 10; width, height, bits a pixel, compression of the 40 byte header at 18, 22, 28, 30.
std::string bmp_damage(Bytes b) {
  if (b.size() < 54) return "truncated: no whole BMP header";
  if (little_endian_32(b, 14) < 40 || little_endian_32(b, 30) != 0) return {};  // old or compressed: its decoder knows
  const auto width = static_cast<std::int32_t>(little_endian_32(b, 18));
  const auto height = static_cast<std::int32_t>(little_endian_32(b, 22));
  const std::uint64_t bits = little_endian_32(b, 28) & 0xFFFFU;
  const std::uint64_t row =
      (static_cast<std::uint64_t>(std::abs(static_cast<std::int64_t>(width))) * bits + 31) / 32 * 4;
  const std::uint64_t rows = static_cast<std::uint64_t>(std::abs(static_cast<std::int64_t>(height)));
  if (little_endian_32(b, 10) + row * rows > b.size()) return "truncated: the BMP header promises more bytes";
  return {};
}

/// "P5" or "P6", width, height, maximum as text with white space and # comments between; one white space; samples.
std::string pnm_damage(Bytes b) {
  const std::uint64_t channels = b[1] == '6' ? 3 : 1;
  std::array<std::uint64_t, 3> numbers{};
  std::size_t at = 2;
  const auto is_digit = [&] { return at < b.size() && b[at] >= '0' && b[at] <= '9'; };
  for (std::uint64_t& number : numbers) {
    while (at < b.size() && !is_digit()) {
      if (b[at] == '#') {
        while (at < b.size() && b[at] != '\n') ++at;
      } else {
        ++at;
      }
    }
    for (; is_digit() && number < 1'000'000; ++at) number = number * 10 + (b[at] - '0');
  }
  const std::uint64_t bytes = numbers[0] * numbers[1] * channels * (numbers[2] > 255 ? 2 : 1);
  if (at + 1 + bytes > b.size()) return "truncated: the header promises more bytes";
  return {};
}

// A size of 32 bits holds it, as a stream's and a vector's are there.
constexpr std::streamoff kMostBytes = std::streamoff{1} << 30;

cv::Mat high_byte(const cv::Mat& wide) {
  cv::Mat narrow(wide.size(), CV_MAKETYPE(CV_8U, wide.channels()));
  for (int y = 0; y < wide.rows; ++y) {
    const auto* from = wide.ptr<std::uint16_t>(y);
    auto* to = narrow.ptr<std::uint8_t>(y);
    for (int i = 0; i < wide.cols * wide.channels(); ++i) to[i] = static_cast<std::uint8_t>(from[i] >> 8);
  }
  return narrow;
}

}  // namespace

std::string damage(std::span<const std::uint8_t> bytes) {
  using namespace std::string_view_literals;
  if (bytes.empty()) return "truncated: the file is empty";
  if (begins_with(bytes, "\xFF\xD8"sv)) return jpeg_damage(bytes);
  if (begins_with(bytes, "\x89PNG\r\n\x1A\n"sv)) return png_damage(bytes);
  if (begins_with(bytes, "BM"sv)) return bmp_damage(bytes);
  if (begins_with(bytes, "P5"sv) || begins_with(bytes, "P6"sv)) return pnm_damage(bytes);
  for (const std::string_view magic : {"P1"sv, "P2"sv, "P3"sv, "P4"sv, "II*\0"sv, "MM\0*"sv, "II+\0"sv, "MM\0+"sv}) {
    if (begins_with(bytes, magic)) return {};
  }
  return "no picture: it begins like none of png, jpg, bmp, pgm, ppm and tif";
}

tl::expected<cv::Mat, std::string> read_picture(const std::filesystem::path& path) {
  const auto fault = [&](const std::string& what) { return tl::unexpected<std::string>(path.string() + ": " + what); };
  std::error_code error;
  if (!std::filesystem::exists(path, error)) return fault("missing");
  if (!std::filesystem::is_regular_file(path, error)) return fault("not a file");
  std::ifstream in(path, std::ios::binary | std::ios::ate);
  const std::streamoff size = in ? static_cast<std::streamoff>(in.tellg()) : -1;
  if (size < 0) return fault("cannot be read");
  if (size > kMostBytes) return fault("larger than 1 GiB");
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(size));
  in.seekg(0);
  in.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(size));
  if (!in) return fault("cannot be read");

  const std::string what = damage(bytes);
  if (!what.empty()) return fault(what);
  try {
    cv::Mat pixels = cv::imdecode(bytes, cv::IMREAD_ANYCOLOR | cv::IMREAD_ANYDEPTH | cv::IMREAD_IGNORE_ORIENTATION);
    if (pixels.empty()) return fault("cannot be decoded");
    if (pixels.depth() == CV_16U) pixels = high_byte(pixels);
    if (pixels.type() != CV_8UC1 && pixels.type() != CV_8UC3) return fault("pixels of neither 8 nor 16 bits");
    return pixels;
  } catch (const cv::Exception&) {
    return fault("cannot be decoded");
  }
}

}  // namespace stereotrack::capture
