#include "firmware-app/stereotrack/output_file.hpp"

#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>

namespace stereotrack {

namespace fs = std::filesystem;

namespace {

std::string reason(int error) {
  const std::string text = std::strerror(error);
  switch (error) {
    case ENOSPC: return text + ": free some space or choose another folder";
    case EACCES:
    case EROFS: return text + ": choose a folder that you may write to";
    default: return text;
  }
}

}  // namespace

OutputFile::OutputFile(fs::path path) : path_(std::move(path)), part_(path_) {
  part_ += ".part";
  file_.reset(std::fopen(part_.c_str(), "wb"));
  if (!file_) fail("cannot be made");
}

OutputFile::~OutputFile() {
  if (!file_) return;
  file_.reset();
  std::error_code ignored;
  fs::remove(part_, ignored);
}

void OutputFile::fail(const char* what) const {
  throw std::runtime_error(path_.string() + ": " + what + ": " + reason(errno));
}

void OutputFile::write(std::string_view text) {
  if (std::fwrite(text.data(), 1, text.size(), file_.get()) != text.size()) fail("cannot be written");
}

void OutputFile::commit() {
  if (std::fflush(file_.get()) != 0 || fsync(fileno(file_.get())) != 0) fail("cannot be written");
  if (std::rename(part_.c_str(), path_.c_str()) != 0) fail("cannot be given its name");
  file_.reset();
}

void make_output_folder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw std::runtime_error(folder.string() + ": cannot be made: " + reason(error.value()));
  if (!fs::is_directory(folder)) {
    throw std::runtime_error(folder.string() + ": is a file; --out wants a folder");
  }
  if (access(folder.c_str(), W_OK | X_OK) != 0) {
    throw std::runtime_error(folder.string() + ": is not writable: " + reason(errno));
  }
}

}  // namespace stereotrack
