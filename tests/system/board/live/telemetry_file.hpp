#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <iterator>
#include <span>
#include <stdexcept>
#include <string>

#include "drivers/telemetry/receiver.hpp"

namespace stereotrack {

/// take(datagram, its bytes) with each of a file that keep_telemetry, or a replay, has written. Throws
/// std::runtime_error where it is none.
template <class Take>
void each_datagram(const char* path, Take take) {
  std::ifstream in(path, std::ios::binary);
  if (!in) throw std::runtime_error(std::string(path) + ": cannot be read");
  const std::string file((std::istreambuf_iterator<char>(in)), {});
  for (std::size_t at = 0; at + 4 <= file.size();) {
    std::uint32_t size = 0;
    std::memcpy(&size, file.data() + at, 4);
    if (at + 4 + size > file.size()) throw std::runtime_error(std::string(path) + ": is cut");
    const std::span bytes(reinterpret_cast<const std::byte*>(file.data() + at + 4), size);
    const auto datagram = telemetry::decode(bytes);
    if (!datagram.has_value()) throw std::runtime_error(std::string(path) + ": holds what is no datagram of ours");
    take(*datagram, bytes);
    at += 4 + size;
  }
}

}  // namespace stereotrack
