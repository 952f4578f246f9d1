#pragma once

#include <string>

namespace stereotrack {

struct PictureSize {
  int width = 0;   ///< px
  int height = 0;  ///< px
};

/// WIDTHxHEIGHT, of the option --size; throws config::Error if it is none.
[[nodiscard]] PictureSize parse_picture_size(const std::string& text);

}  // namespace stereotrack
