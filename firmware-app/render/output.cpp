#include "firmware-app/render/output.hpp"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>
#include <stdexcept>
#include <utility>
#include <vector>

#include "drivers/capture/replay/silence.hpp"
#include "firmware-app/render/matroska.hpp"

namespace stereotrack::render {
namespace {

namespace fs = std::filesystem;

struct CloseFile {
  void operator()(std::FILE* file) const { (void)std::fclose(file); }
};
using File = std::unique_ptr<std::FILE, CloseFile>;

std::string lower_extension(const fs::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension;
}

[[noreturn]] void refuse(const fs::path& path, const std::string& what, const std::string& way_out) {
  throw std::runtime_error(path.string() + ": " + what + "; " + way_out);
}

[[noreturn]] void refuse_write(const fs::path& path, int error) {
  refuse(path, std::string("cannot be written: ") + std::strerror(error),
         error == ENOSPC || error == EDQUOT || error == EFBIG ? "free space or choose another place for --render"
                                                              : "choose a place for --render that is writable");
}

struct Encoder {
  cv::VideoCaptureAPIs api;
  std::array<char, 5> fourcc;
};

std::vector<Encoder> encoders(const fs::path& path) {
  if (lower_extension(path) == ".avi") return {{cv::CAP_FFMPEG, {"MJPG"}}, {cv::CAP_OPENCV_MJPEG, {"MJPG"}}};
  return {{cv::CAP_FFMPEG, {"mp4v"}}, {cv::CAP_FFMPEG, {"avc1"}}};
}

/// MPEG-4 counts time in at most 65535 ticks a second: a rate like 30.1386 must be rounded to fit.
double encodable(double fps) {
  fps = std::clamp(fps, 0.1, 1000.0);
  const double ticks = fps < 65 ? 1000 : fps < 650 ? 100 : 10;
  return static_cast<double>(std::lround(fps * ticks)) / ticks;
}

class VideoOutput final : public Output {
 public:
  VideoOutput(const std::string& target, cv::Size size, double fps)
      : path_(target), part_(path_.parent_path() / (path_.stem().string() + ".part" + path_.extension().string())) {
    if (fs::is_directory(path_)) refuse(path_, "is a folder", "name a file, or a folder without that ending");
    errno = 0;
    if (const File probe{std::fopen(part_.c_str(), "wbe")}; !probe) refuse_write(path_, errno);
    capture::silence_codecs();
    for (const Encoder& encoder : encoders(path_)) {
      const auto& name = encoder.fourcc;
      const int fourcc = cv::VideoWriter::fourcc(name[0], name[1], name[2], name[3]);
      try {
        if (writer_.open(part_.string(), encoder.api, fourcc, encodable(fps), size, true)) {
          api_ = encoder.api;
          return;
        }
      } catch (const cv::Exception&) {
        continue;  // OpenCV throws for a back end that it lacks
      }
    }
    remove_part();
    refuse(path_, "this OpenCV has no encoder for it", "install one (FFmpeg), name a .avi file, or a folder for PNG");
  }

  ~VideoOutput() override {
    writer_.release();
    remove_part();
  }

  void write(std::uint64_t /*ordinal*/, const cv::Mat& picture) override {
    std::error_code error;
    const fs::space_info space = fs::space(part_, error);
    if (error) refuse_write(path_, error.value());
    if (space.available == 0) refuse_write(path_, ENOSPC);
    writer_.write(picture);
    ++frames_;
  }

  void commit() override {
    writer_.release();
    if (frames_ == 0) {
      remove_part();
      return;
    }
    if (lower_extension(path_) == ".mkv") make_ids_constant(part_.string());
    const std::uint64_t readable = frames_in_part();
    if (readable != frames_) {
      remove_part();
      refuse(path_, "only " + std::to_string(readable) + " of " + std::to_string(frames_) + " frames were written",
             "free space or choose another place for --render");
    }
    std::error_code error;
    fs::rename(part_, path_, error);
    if (error) refuse_write(path_, error.value());
  }

 private:
  [[nodiscard]] std::uint64_t frames_in_part() const {
    std::uint64_t count = 0;
    try {
      // Left to choose, OpenCV would ask every back end, one of which looks for cameras on the USB.
      cv::VideoCapture video(part_.string(), api_);
      while (video.grab()) ++count;
    } catch (const cv::Exception&) {
      return 0;
    }
    return count;
  }

  void remove_part() const {
    std::error_code ignored;  // on the way out of an error that has been told already
    fs::remove(part_, ignored);
  }

  fs::path path_;
  fs::path part_;
  cv::VideoWriter writer_;
  cv::VideoCaptureAPIs api_ = cv::CAP_FFMPEG;
  std::uint64_t frames_ = 0;
};

class FolderOutput final : public Output {
 public:
  explicit FolderOutput(const std::string& target) : folder_(target) {
    capture::silence_codecs();
    std::error_code error;
    fs::create_directories(folder_, error);
    if (!fs::is_directory(folder_)) refuse_write(folder_, error ? error.value() : ENOTDIR);
    if (::access(folder_.c_str(), W_OK | X_OK) != 0) refuse_write(folder_, errno);
  }

  void write(std::uint64_t ordinal, const cv::Mat& picture) override {
    std::array<char, 32> name{};
    std::snprintf(name.data(), name.size(), "%06llu.png", static_cast<unsigned long long>(ordinal));
    const fs::path path = folder_ / name.data();
    const fs::path part = path.string() + ".part";
    if (!cv::imencode(".png", picture, bytes_, {cv::IMWRITE_PNG_COMPRESSION, 3})) {
      refuse(path, "this OpenCV cannot write PNG", "render to a video");
    }
    if (const int error = write_file(part); error != 0) {
      ::unlink(part.c_str());
      refuse_write(path, error);
    }
    if (std::rename(part.c_str(), path.c_str()) != 0) {
      const int error = errno;
      ::unlink(part.c_str());
      refuse_write(path, error);
    }
  }

  void commit() override {}

 private:
  /// 0 or what went wrong.
  [[nodiscard]] int write_file(const fs::path& path) const {
    File file{std::fopen(path.c_str(), "wbe")};
    if (!file) return errno;
    if (std::fwrite(bytes_.data(), 1, bytes_.size(), file.get()) != bytes_.size()) return errno;
    return std::fclose(file.release()) == 0 ? 0 : errno;
  }

  fs::path folder_;
  std::vector<unsigned char> bytes_;
};

}  // namespace

bool names_video(const std::string& target) {
  const std::string extension = lower_extension(target);
  return extension == ".mp4" || extension == ".avi" || extension == ".mkv";
}

std::unique_ptr<Output> make_video_output(const std::string& target, cv::Size size, double fps) {
  return std::make_unique<VideoOutput>(target, size, fps);
}

std::unique_ptr<Output> make_folder_output(const std::string& target) { return std::make_unique<FolderOutput>(target); }

}  // namespace stereotrack::render
