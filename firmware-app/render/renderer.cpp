#include "firmware-app/render/renderer.hpp"

#include <chrono>
#include <stdexcept>
#include <utility>

#include "firmware-app/render/output.hpp"
#include "firmware-app/render/painter.hpp"

namespace stereotrack::render {
namespace {

constexpr double kUnknownRate_hz = 25;

double rate_hz(const capture::SourceInfo& info) {
  const double period_s = std::chrono::duration<double>(info.period).count();
  return period_s > 0 ? 1 / period_s : kUnknownRate_hz;
}

class PainterToOutput final : public Renderer {
 public:
  PainterToOutput(const std::string& target, const capture::SourceInfo& info, const RectifiedGeometry* geometry,
                  const LengthUnit& unit, std::vector<ShownZone> zones)
      : painter_(info.width, info.height, geometry, unit, std::move(zones)),
        output_(names_video(target) ? make_video_output(target, painter_.size(), rate_hz(info))
                                    : make_folder_output(target)) {}

  void draw(const FramePair& pair, const FrameResult& result, const Annotation* annotation) override {
    output_->write(pair.ordinal, painter_.draw(pair, result, annotation));
  }
  void commit() override { output_->commit(); }

 private:
  Painter painter_;
  std::unique_ptr<Output> output_;
};

}  // namespace

std::unique_ptr<Renderer> make_renderer(const std::string& target, const capture::SourceInfo& info,
                                        const Rectifier* rectifier, double unit_m, std::vector<ShownZone> zones) {
  if (info.width <= 0 || info.height <= 0) throw std::runtime_error(info.name + ": size of its pictures is not known");
  const LengthUnit unit = unit_m > 0 ? LengthUnit{unit_m, "m"} : LengthUnit{};
  if (rectifier != nullptr) {
    for (ShownZone& shown : zones) {
      if (shown.zone.kind == Zone::Kind::kSpace) shown.floor = floor_of(shown.zone, *rectifier, unit_m);
    }
  }
  return std::make_unique<PainterToOutput>(target, info, rectifier != nullptr ? &rectifier->geometry() : nullptr, unit,
                                           std::move(zones));
}

}  // namespace stereotrack::render
