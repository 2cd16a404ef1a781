// Pictures as PNG files, uncompressed: no library needed.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>

namespace sample {
/// `pixels`: red, green, blue, alpha. Throws where the file cannot be written.
void write_png(const std::filesystem::path& path, uint32_t width, uint32_t height,
               std::span<const uint8_t> pixels);
}  // namespace sample
