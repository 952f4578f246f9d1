#pragma once

#include "drivers/capture/synthetic/synthetic_source.hpp"
#include "pipeline/pipeline.hpp"

namespace stereotrack::test {

/// What a pipeline that sees a synthetic scene in colour with both eyes is made for. The source outlives it.
[[nodiscard]] inline Pipeline::Setup setup_of(const capture::SyntheticSource& source) {
  Pipeline::Setup setup;
  setup.width = source.info().width;
  setup.height = source.info().height;
  setup.colour = true;
  setup.calibration = &source.calibration();
  return setup;
}

}  // namespace stereotrack::test
