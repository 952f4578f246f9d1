#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

/// What the kernel says of itself in files: small, on one line or some, now and then not readable.
namespace stereotrack::doctor {

/// Its text without blanks and zeros at the end; empty: there is none, or it may not be read.
[[nodiscard]] std::string text_of(const std::filesystem::path& file);
/// A number that it begins with; none: it does not.
[[nodiscard]] std::optional<std::int64_t> number_of(const std::filesystem::path& file);
/// The number in a line that begins with `key`, such as "MemTotal:   947748 kB".
[[nodiscard]] std::optional<std::int64_t> number_in(const std::string& text, const std::string& key);
/// Names in a folder that begin with `stem`, sorted by number; empty `stem`: all.
[[nodiscard]] std::vector<std::string> names_in(const std::filesystem::path& folder, const std::string& stem = "");
/// Words, blanks between.
[[nodiscard]] std::vector<std::string> words_of(const std::string& text);

}  // namespace stereotrack::doctor
