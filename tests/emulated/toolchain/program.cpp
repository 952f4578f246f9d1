// Ends well where the C++ library, Highway and libsodium that it was linked with are those that it runs with.
#include <gnu/libc-version.h>
#include <hwy/targets.h>
#include <sodium.h>

#include <algorithm>
#include <chrono>
#include <iostream>
#include <ranges>
#include <stdexcept>
#include <string>
#include <vector>

int main() {
  std::vector<std::string> words{"b", "a"};
  std::ranges::sort(words);
  try {
    throw std::runtime_error(words.front());
  } catch (const std::exception& error) {
    std::cout << error.what() << " glibc " << gnu_get_libc_version() << " targets " << hwy::SupportedTargets()
              << " seconds " << 8 * sizeof(time_t) << " bits, sodium " << sodium_version_string() << std::endl;
  }
  return sodium_init() < 0 ? 1 : 0;
}
