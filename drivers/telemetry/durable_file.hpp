#pragma once

#include <filesystem>
#include <string_view>
#include <system_error>

namespace stereotrack::telemetry {

/// Writes a small file so that after a power cut it is either the old one or the new one, whole: into `PATH.new`,
/// synced, renamed, its folder synced. Readable and writable by this user alone. Not for two writers at once. Throws
/// std::system_error "PATH: cannot be written: why", the old file unchanged.
void write_durably(const std::filesystem::path& path, std::string_view content);

}  // namespace stereotrack::telemetry
