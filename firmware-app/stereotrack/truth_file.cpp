#include "firmware-app/stereotrack/truth_file.hpp"

#include "firmware-app/formatted.hpp"
#include "firmware-app/stereotrack/output_file.hpp"

namespace stereotrack {

void TruthFile::add(std::uint64_t frame, const capture::SyntheticSource& scene) {
  const capture::synthetic::Delivery& delivery = scene.delivery();
  const bool scored = delivery.left && delivery.right && delivery.right_off == 0;
  for (const capture::TrueObject& o : scene.truth().objects) {
    rows_ += formatted("%llu,%u,%d,%d,%d,%d,%d,%.5f,%.5f,%.5f\n", static_cast<unsigned long long>(frame), o.id,
                       o.box.left, o.box.top, o.box.width, o.box.height, scored && o.scored() ? 1 : 0, o.x, o.y, o.z);
  }
}

void TruthFile::save(const std::filesystem::path& path) const {
  OutputFile file(path);
  file.write(rows_);
  file.commit();
}

}  // namespace stereotrack
