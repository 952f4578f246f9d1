#pragma once

#include <ios>
#include <mutex>
#include <streambuf>
#include <string>
#include <string_view>

namespace stereotrack::libcamera_module {

/// A line of libcamera's log without time, thread, level and colours, as far as it has them:
/// "DmaBufAllocator dma_buf_allocator.cpp:120 Could not open any dma-buf provider".
[[nodiscard]] std::string text_of_log_line(std::string_view line);

/// What libcamera's log is sent to while it looks for cameras, so that whoever asked tells of it at its place, instead
/// of libcamera in the midst of the output. Any thread; libcamera's write to it.
class Complaints final : public std::streambuf {
 public:
  /// The last line since then, by text_of_log_line(); empty: there was none.
  [[nodiscard]] std::string last() const;
  void forget();

 protected:
  std::streamsize xsputn(const char* text, std::streamsize count) override;
  int_type overflow(int_type c) override;

 private:
  void put(std::string_view text);

  mutable std::mutex mutex_;
  std::string line_;  ///< that has not ended yet
  std::string last_;
};

}  // namespace stereotrack::libcamera_module
