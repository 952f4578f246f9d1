#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace stereotrack::render {

/// FFmpeg gives each Matroska file and its tracks random numbers (SegmentUID, TrackUID), so that the same run
/// twice gives different bytes. Puts 1 in their place, everywhere in front of the first picture, and corrects
/// the CRC-32 of the elements around them (RFC 8794, 11.3.1; RFC 9559, 5.1). What is not understood stays.
void make_ids_constant(std::span<std::uint8_t> head);

/// The same for the file's head. A file that cannot be changed stays as it is.
void make_ids_constant(const std::string& path);

}  // namespace stereotrack::render
