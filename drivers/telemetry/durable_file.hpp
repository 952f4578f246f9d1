#pragma once

#include <filesystem>
#include <string_view>
#include <system_error>

namespace stereotrack::telemetry {

/// Writes a small file so that after a power cut it is either the old one or the new one, whole: into `PATH.new`,
/// synced, renamed, its folder synced. Readable and writable by this user alone. Not for two writers at once. Throws
/// std::system_error "PATH: cannot be written: why", the old file unchanged.
void write_durably(const std::filesystem::path& path, std::string_view content);

/// A file that was renamed, or is new, is found after a power cut only once its folder is on the disk, too: waits until
/// that of `path` is. False with errno.
[[nodiscard]] bool sync_folder_of(const std::filesystem::path& path) noexcept;

}  // namespace stereotrack::telemetry
