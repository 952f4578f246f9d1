#pragma once

#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

namespace stereotrack {

/// A text file that is whole or not there: written to `PATH.part`, renamed by commit(). Without a commit the
/// part is removed. Throws std::runtime_error with one line naming the file (disk full, folder not writable).
class OutputFile {
 public:
  explicit OutputFile(std::filesystem::path path);
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;
  ~OutputFile();

  void write(std::string_view text);
  void commit();

 private:
  struct Close {
    void operator()(std::FILE* file) const noexcept { (void)std::fclose(file); }
  };
  [[noreturn]] void fail(const char* what) const;

  std::filesystem::path path_;
  std::filesystem::path part_;
  std::unique_ptr<std::FILE, Close> file_;
};

/// Makes the folder if it is not there and tries whether files can be made in it. Throws like OutputFile.
void make_output_folder(const std::filesystem::path& folder);

}  // namespace stereotrack
