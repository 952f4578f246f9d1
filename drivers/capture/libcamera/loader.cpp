#include "drivers/capture/libcamera/loader.hpp"

#include <dlfcn.h>

#include <algorithm>
#include <cstdlib>
#include <string_view>
#include <system_error>
#include <utility>

namespace stereotrack::capture::libcamera {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kSuffix = ".so";

/// The numbers in "0.5.1"; other characters count as dots.
std::vector<unsigned long> version_of(const fs::path& module) {
  std::vector<unsigned long> numbers{0};
  for (const char c : module.stem().string().substr(std::string_view(kModulePrefix).size())) {
    if (c >= '0' && c <= '9') {
      numbers.back() = 10 * numbers.back() + static_cast<unsigned long>(c - '0');
    } else {
      numbers.push_back(0);
    }
  }
  return numbers;
}

std::string last_error() {
  const char* const text = ::dlerror();
  return text == nullptr ? "for no reason that is told" : text;
}

/// Its table, or why it does not fit.
const LibcameraModule* try_module(const fs::path& path, std::string& problem) {
  (void)::setenv("LIBCAMERA_LOG_LEVELS", STEREOTRACK_LIBCAMERA_LOG_LEVELS, 0);
  // Its libcamera's symbols are for it alone: another module may come with another one.
  void* const handle = ::dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (handle == nullptr) {
    // dlerror() names the file, the module or the libcamera that it lacks.
    problem = "libcamera: " + path.string() + " cannot be loaded (" + last_error() +
              "): build the module for the libcamera of this board, or remove it";
    return nullptr;
  }
  const auto refuse = [&](const std::string& why) -> const LibcameraModule* {
    problem = "libcamera: " + path.string() + " " + why + ": build the module of this version of stereotrack";
    (void)::dlclose(handle);
    return nullptr;
  };
  const auto entry = reinterpret_cast<LibcameraEntry>(::dlsym(handle, STEREOTRACK_LIBCAMERA_ENTRY));
  if (entry == nullptr) return refuse("is no module of ours, it has no " STEREOTRACK_LIBCAMERA_ENTRY);
  const LibcameraModule* const module = entry();
  if (module == nullptr) return refuse("gives no table");
  if (module->version != kLibcameraModuleVersion) {
    return refuse("has interface version " + std::to_string(module->version) + ", and " +
                  std::to_string(kLibcameraModuleVersion) + " is wanted");
  }
  if (module->size != sizeof(LibcameraModule)) {
    return refuse("has a table of " + std::to_string(module->size) + " bytes, and " +
                  std::to_string(sizeof(LibcameraModule)) + " are wanted");
  }
  return module;
}

std::string folders_text(const std::vector<fs::path>& folders) {
  std::string text;
  for (const fs::path& folder : folders) text += (text.empty() ? "" : ", ") + folder.string();
  return text;
}

std::weak_ptr<Session> current_session;

}  // namespace

std::vector<fs::path> module_folders() {
  std::vector<fs::path> folders;
  if (const char* const wanted = std::getenv("STEREOTRACK_MODULE_PATH")) {
    std::string_view rest = wanted;
    while (!rest.empty()) {
      const std::size_t end = std::min(rest.find(':'), rest.size());
      if (end > 0) folders.emplace_back(rest.substr(0, end));
      rest.remove_prefix(std::min(end + 1, rest.size()));
    }
  }
  std::error_code none;
  const fs::path program = fs::read_symlink("/proc/self/exe", none);
  if (!program.empty()) folders.push_back(program.parent_path().parent_path() / "lib" / "stereotrack");
  const fs::path installed = STEREOTRACK_MODULE_DIR;
  if (std::find(folders.begin(), folders.end(), installed) == folders.end()) folders.push_back(installed);
  return folders;
}

std::vector<fs::path> find_modules(const std::vector<fs::path>& folders) {
  std::vector<fs::path> all;
  for (const fs::path& folder : folders) {
    std::vector<fs::path> found;
    std::error_code none;
    for (const fs::directory_entry& entry : fs::directory_iterator(folder, none)) {
      const std::string name = entry.path().filename().string();
      if (name.starts_with(kModulePrefix) && name.ends_with(kSuffix)) found.push_back(entry.path());
    }
    std::sort(found.begin(), found.end(), [](const fs::path& a, const fs::path& b) {
      const auto version_a = version_of(a);
      const auto version_b = version_of(b);
      return version_a != version_b ? version_a > version_b : a < b;
    });
    all.insert(all.end(), found.begin(), found.end());
  }
  return all;
}

Loaded load_module(const std::vector<fs::path>& folders) {
  Loaded loaded;
  for (const fs::path& path : find_modules(folders)) {
    std::string problem;
    loaded.module = try_module(path, problem);
    if (loaded.module != nullptr) {
      loaded.path = path;
      return loaded;
    }
    loaded.problems.push_back(std::move(problem));
  }
  if (loaded.problems.empty()) {
    loaded.problems.push_back("libcamera: there is no module, no " + std::string(kModulePrefix) + "*" +
                              std::string(kSuffix) + " in " + folders_text(folders) +
                              ": build it (docs/CAMERAS.md), set STEREOTRACK_MODULE_PATH to its folder, or use "
                              "camera.driver = \"v4l2\"");
  }
  return loaded;
}

std::shared_ptr<Session> Session::get(std::vector<std::string>& problems) {
  if (std::shared_ptr<Session> session = current_session.lock()) return session;
  Loaded loaded = load_module(module_folders());
  if (loaded.module == nullptr) {
    problems = std::move(loaded.problems);
    return nullptr;
  }
  std::shared_ptr<Session> session(new Session(std::move(loaded)));
  char why[kLibcameraTextSize] = "";
  session->manager_ = session->module().open_manager(static_cast<char*>(why));
  if (session->manager_ == nullptr) {
    problems = session->problems();
    problems.push_back(session->module_text() + ": " + static_cast<const char*>(why) +
                       ": stop other programs that look for cameras, and start again");
    return nullptr;
  }
  current_session = session;
  return session;
}

Session::~Session() {
  if (manager_ != nullptr) module().close_manager(manager_);
}

std::string Session::module_text() const {
  return std::string("libcamera ") + module().library() + ", " + loaded_.path.string();
}

std::string Session::complaint() const { return module().complaint(manager_); }

std::vector<LibcameraFacts> Session::cameras() const {
  std::vector<LibcameraFacts> all;
  const std::uint32_t count = module().count(manager_);
  for (std::uint32_t i = 0; i < count; ++i) {
    LibcameraFacts facts{};
    (void)module().facts(manager_, i, &facts);
    all.push_back(facts);
  }
  return all;
}

std::vector<LibcameraFormat> Session::formats(std::uint32_t camera) const {
  std::vector<LibcameraFormat> all;
  LibcameraFormat format{};
  for (std::uint32_t i = 0; module().format(manager_, camera, i, &format) != 0; ++i) all.push_back(format);
  return all;
}

}  // namespace stereotrack::capture::libcamera
