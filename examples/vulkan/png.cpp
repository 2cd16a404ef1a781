#include "png.hpp"

#include <algorithm>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace sample {

namespace {

using Bytes = std::vector<uint8_t>;

void add_big_endian(Bytes& bytes, uint32_t value) {
  for (int shift = 24; shift >= 0; shift -= 8)
    bytes.push_back(static_cast<uint8_t>(value >> shift));
}

uint32_t crc(std::span<const uint8_t> bytes) {
  uint32_t c = 0xffffffffu;
  for (const uint8_t byte : bytes) {
    c ^= byte;
    for (int bit = 0; bit < 8; ++bit) c = (c & 1) != 0 ? c >> 1 ^ 0xedb88320u : c >> 1;
  }
  return ~c;
}

void add_chunk(Bytes& file, const std::string& name, const Bytes& data) {
  add_big_endian(file, static_cast<uint32_t>(data.size()));
  Bytes body(name.begin(), name.end());
  body.insert(body.end(), data.begin(), data.end());
  file.insert(file.end(), body.begin(), body.end());
  add_big_endian(file, crc(body));
}

// A zlib stream (RFC 1950) of stored blocks.
Bytes stored(const Bytes& data) {
  Bytes out{0x78, 0x01};
  uint32_t a = 1, b = 0;
  for (size_t start = 0; start < data.size(); start += 65535) {
    const size_t count = std::min<size_t>(65535, data.size() - start);
    out.push_back(start + count == data.size() ? 1 : 0);
    for (const size_t n : {count, ~count}) {
      out.push_back(static_cast<uint8_t>(n));
      out.push_back(static_cast<uint8_t>(n >> 8));
    }
    for (size_t i = start; i < start + count; ++i) {
      out.push_back(data[i]);
      a = (a + data[i]) % 65521;
      b = (b + a) % 65521;
    }
  }
  add_big_endian(out, b << 16 | a);
  return out;
}

}  // namespace

void write_png(const std::filesystem::path& path, uint32_t width, uint32_t height,
               std::span<const uint8_t> pixels) {
  Bytes rows;
  rows.reserve((size_t{width} * 4 + 1) * height);
  for (uint32_t y = 0; y < height; ++y) {
    rows.push_back(0);  // no filter
    const auto row = pixels.subspan(size_t{y} * width * 4, size_t{width} * 4);
    rows.insert(rows.end(), row.begin(), row.end());
  }
  Bytes header;
  add_big_endian(header, width);
  add_big_endian(header, height);
  header.insert(header.end(), {8, 6, 0, 0, 0});  // 8 bits, red, green, blue, alpha
  Bytes file{0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
  add_chunk(file, "IHDR", header);
  add_chunk(file, "IDAT", stored(rows));
  add_chunk(file, "IEND", {});
  std::ofstream out(path, std::ios::binary);
  out.write(reinterpret_cast<const char*>(file.data()), static_cast<std::streamsize>(file.size()));
  out.close();
  if (!out) throw std::runtime_error("cannot write " + path.string() + ".");
}

}  // namespace sample
