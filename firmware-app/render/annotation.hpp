#pragma once

#include <string>
#include <vector>

#include "pipeline/core/rect.hpp"

namespace stereotrack::render {

/// What is said of one frame beside its targets: text over the picture's foot, and boxes.
struct Annotation {
  enum class Kind { kDetection, kRejected, kExpected };
  struct Mark {
    Rect box;  ///< raw left picture [px]
    std::string text;
    Kind kind = Kind::kDetection;
  };
  std::vector<std::string> lines;
  std::vector<Mark> marks;

  void clear() {
    lines.clear();
    marks.clear();
  }
};

}  // namespace stereotrack::render
