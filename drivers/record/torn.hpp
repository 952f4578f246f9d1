#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace stereotrack::record {

/// What a process left of recordings in `directory` that it was writing when it was killed, or when power was cut:
///
///     NAME.strec.part, whole              becomes NAME.strec: only its renaming was missing
///     cut, with frames                    NAME-torn.strec, which is read up to its last whole frame
///     cut before its first frame          deleted
///
/// One that another process still writes stays as it is. A line for each of the others. For set-up; reads little of
/// each file but its keyframe. What cannot be renamed or deleted has a line that says so. Throws std::bad_alloc alone.
[[nodiscard]] std::vector<std::string> keep_torn(const std::filesystem::path& directory);

}  // namespace stereotrack::record
