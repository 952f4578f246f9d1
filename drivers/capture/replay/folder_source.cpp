#include "drivers/capture/replay/folder_source.hpp"

#include <algorithm>
#include <exception>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "drivers/capture/replay/adjust.hpp"
#include "drivers/capture/replay/picture_file.hpp"

namespace stereotrack::capture {
namespace {

std::string size_text(int width, int height) { return std::to_string(width) + "x" + std::to_string(height); }

}  // namespace

FolderSource::FolderSource(std::string name, Pairing pairing, bool stereo, const ReplayOptions& options)
    : pairing_(std::move(pairing)), options_(options) {
  info_.name = std::move(name);
  info_.stereo = stereo;
  info_.has_time = pairing_.by == PairedBy::kTime;
  info_.period = pairing_.period;
  info_.pairs = pairing_.entries.size();
  std::string first_fault;
  for (const PairEntry& entry : pairing_.entries) {
    const Decoded decoded = decode(entry);
    if (decoded.fault.empty()) {
      info_.width = decoded.left.cols;
      info_.height = decoded.left.rows;
      info_.format = format_of(decoded.left);
      break;
    }
    if (first_fault.empty()) first_fault = decoded.fault;
  }
  if (info_.width == 0) {
    throw std::runtime_error(info_.name + ": none of " + std::to_string(pairing_.entries.size()) +
                             " frames can be read; the first: " + first_fault);
  }
  if (std::abs(options_.shift_rows) >= info_.height) {
    throw std::runtime_error(info_.name + ": a shift of " + std::to_string(options_.shift_rows) +
                             " rows leaves nothing of a picture of " + std::to_string(info_.height) + " rows");
  }
}

FolderSource::Decoded FolderSource::decode(const PairEntry& entry) const {
  if (!entry.fault.empty()) return {{}, {}, entry.fault};
  Decoded decoded;
  int width = info_.width;
  int height = info_.height;
  const auto read = [&](const std::filesystem::path& path, cv::Mat& picture) {
    auto pixels = read_picture(path);
    if (!pixels.has_value()) {
      decoded.fault = pixels.error();
      return false;
    }
    picture = *pixels;
    if (width == 0) {
      width = picture.cols;
      height = picture.rows;
    }
    if (picture.cols == width && picture.rows == height) return true;
    decoded.fault = path.string() + ": " + size_text(picture.cols, picture.rows) + " where " +
                    size_text(width, height) + " is expected";
    return false;
  };
  if (!read(entry.left, decoded.left)) return decoded;
  if (info_.stereo && !read(entry.right, decoded.right)) return decoded;
  if (info_.width == 0) return decoded;
  convert(decoded.left, info_.format);
  if (options_.flip) flip_rows(decoded.left);
  if (info_.stereo) {
    convert(decoded.right, info_.format);
    if (options_.flip) flip_rows(decoded.right);
    shift_rows_down(decoded.right, options_.shift_rows);
  }
  return decoded;
}

void FolderSource::decode_ahead() {
  if (position_ >= pairing_.entries.size()) return;
  const auto task = [this, &entry = pairing_.entries[position_]] { return decode(entry); };
  try {
    ahead_ = std::async(std::launch::async, task);
  } catch (const std::system_error&) {  // no thread to be had: decode when asked
    ahead_ = std::async(std::launch::deferred, task);
  }
}

Next FolderSource::read_next(FramePair& out) {
  if (!ahead_.valid()) decode_ahead();
  current_ = ahead_.get();
  ++position_;
  decode_ahead();
  if (!current_.fault.empty()) {
    reason_ = current_.fault;
    return Next::kSkipped;
  }
  out.skew = pairing_.entries[position_ - 1].skew;
  out.left = view_of(current_.left);
  if (info_.stereo) out.right = view_of(current_.right);
  return Next::kPair;
}

Next FolderSource::next(FramePair& out) noexcept {
  out = {};
  if (position_ >= pairing_.entries.size()) return Next::kEnd;
  const std::size_t index = position_;
  out.ordinal = index + 1;
  out.capture_time = pairing_.entries[index].time;
  try {
    return read_next(out);
  } catch (const std::exception& error) {
    position_ = index + 1;
    reason_ = pairing_.entries[index].left.string() + ": " + error.what();
    return Next::kSkipped;
  }
}

void FolderSource::skip_to(std::uint64_t ordinal) noexcept {
  position_ = static_cast<std::size_t>(std::min<std::uint64_t>(ordinal, pairing_.entries.size()));
}

}  // namespace stereotrack::capture
