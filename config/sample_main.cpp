// Writes the sample configuration to standard output; the target update_sample_config puts it in its place.
#include <cstdio>
#include <string>

#include "config/schema.hpp"

int main() {
  const std::string text = stereotrack::config::sample_text();
  const bool written = std::fwrite(text.data(), 1, text.size(), stdout) == text.size() && std::fflush(stdout) == 0;
  return written ? 0 : 1;
}
