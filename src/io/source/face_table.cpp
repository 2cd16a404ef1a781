#include "io/source/face_table.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include "base/bytes.hpp"
#include "base/file.hpp"

namespace umbel::io {
namespace {

/// A file's bytes from a place on, through a window.
class Window {
 public:
  explicit Window(const FaceRows& faces)
      : file_(faces.path), at_(faces.offset), begin_(faces.offset) {}

  uint64_t at() const { return at_; }
  uint64_t size() const { return file_.size(); }
  /// The next `count` bytes, or null where the file has fewer.
  const std::byte* take(uint64_t count) {
    if (count > file_.size() || at_ > file_.size() - count) return nullptr;
    if (at_ + count > begin_ + bytes_.size()) fill(count);
    const std::byte* found = bytes_.data() + (at_ - begin_);
    at_ += count;
    return found;
  }

 private:
  void fill(uint64_t count) {
    constexpr uint64_t kWindow = uint64_t{1} << 20;
    begin_ = at_;
    bytes_.resize(std::min(std::max(count, kWindow), file_.size() - at_));
    file_.read(begin_, bytes_);
  }

  InputFile file_;
  uint64_t at_, begin_;
  std::vector<std::byte> bytes_;
};

/// A length as doubles have it: -1 if it can be none.
int64_t length_of(const std::byte* p, Scalar type, bool big_endian) {
  int64_t length = -1;
  with_type(type, [&]<typename T>(T) {
    const T value = load_scalar<T>(p, big_endian);
    if constexpr (std::is_floating_point_v<T>) {
      if (value >= 0 && value == std::floor(value) && value < T(0x1p53))
        length = static_cast<int64_t>(value);
    } else if (value >= 0 && static_cast<uint64_t>(value) < uint64_t{1} << 53) {
      length = static_cast<int64_t>(static_cast<uint64_t>(value));
    }
  });
  return length;
}

int64_t material_of(const std::byte* p, Scalar type, bool big_endian) {
  int64_t material = -1;
  with_type(type, [&]<typename T>(T) {
    const T value = load_scalar<T>(p, big_endian);
    if constexpr (!std::is_floating_point_v<T>)
      material =
          static_cast<uint64_t>(value) > uint64_t{1} << 62 ? -1 : static_cast<int64_t>(value);
  });
  return material;
}

/// Reads rows one by one.
class Reader {
 public:
  explicit Reader(const FaceRows& faces) : faces_(faces), window_(faces) {}

  struct Row {
    std::vector<uint32_t> vertices;
    int64_t material = 0;
    std::vector<int64_t> lengths;  // of all lists
  };

  FaceScan run(const std::function<void(const Row&)>& visit) {
    FaceScan scan;
    Row row;
    std::vector<int64_t> lengths;
    for (uint64_t r = 0; r < faces_.rows; ++r) {
      const uint64_t begin = window_.at();
      read(r, row, scan);
      if (r == 0) {
        lengths = row.lengths;
        scan.row_bytes = window_.at() - begin;
      }
      scan.are_triangles &= row.vertices.size() == 3 && row.lengths == lengths;
      scan.small_faces += row.vertices.size() < 3 ? 1 : 0;
      scan.triangles += row.vertices.size() < 3 ? 0 : row.vertices.size() - 2;
      if (faces_.material && row.vertices.size() >= 3) {
        scan.least_material = std::min(scan.least_material, row.material);
        scan.largest_material = std::max(scan.largest_material, row.material);
      }
      if (visit) visit(row);
    }
    scan.end = window_.at();
    return scan;
  }

 private:
  [[noreturn]] void cut_short(uint64_t row) const {
    corrupt(faces_.name + ", byte " + std::to_string(window_.size()) +
            ": the file is cut short or corrupt: the header says " + std::to_string(faces_.rows) +
            " of element 'face', the data holds " + std::to_string(row));
  }

  const std::byte* take(uint64_t count, uint64_t row) {
    const std::byte* found = window_.take(count);
    if (!found) cut_short(row);
    return found;
  }

  void read(uint64_t r, Row& row, FaceScan& scan) {
    row.lengths.clear();
    const uint64_t begin = window_.at();
    for (size_t k = 0; k < faces_.properties.size(); ++k) {
      const FaceProperty& property = faces_.properties[k];
      uint64_t count = 1;
      if (property.length) {
        const uint64_t at = window_.at();
        const std::byte* p = take(size_of(*property.length), r);
        const int64_t length = length_of(p, *property.length, faces_.big_endian);
        if (length < 0)
          corrupt(faces_.name + ", byte " + std::to_string(at) +
                  ": a list of element 'face', row " + std::to_string(r) +
                  ", has no length that can be");
        count = static_cast<uint64_t>(length);
        row.lengths.push_back(length);
      }
      const auto offset = static_cast<uint32_t>(window_.at() - begin);
      if (count > window_.size()) cut_short(r);
      const std::byte* values = take(count * size_of(property.type), r);
      if (k == faces_.indices) {
        if (r == 0) scan.index_offset = offset;
        take_vertices(values, count, property.type, row);
      } else if (faces_.material && k == *faces_.material) {
        if (r == 0) scan.material_offset = offset;
        row.material = material_of(values, property.type, faces_.big_endian);
      }
    }
  }

  void take_vertices(const std::byte* values, uint64_t count, Scalar type, Row& row) const {
    row.vertices.resize(count);
    const Column plain;
    with_type(type, [&]<typename T>(T) {
      for (uint64_t i = 0; i < count; ++i)
        row.vertices[i] =
            converted<uint32_t>(load_scalar<T>(values + i * sizeof(T), faces_.big_endian), plain);
    });
  }

  const FaceRows& faces_;
  Window window_;
};

}  // namespace

FaceScan scan_faces(const FaceRows& faces) { return Reader(faces).run({}); }

FaceScan write_triangles(const FaceRows& faces, const std::filesystem::path& path) {
  OutputFile file(path);
  constexpr size_t kRows = size_t{1} << 16;
  std::vector<std::byte> bytes(kRows * kTriangleRow);
  uint64_t written = 0;
  size_t at = 0;
  const auto flush = [&] {
    file.write(written, std::span<const std::byte>(bytes).first(at));
    written += at;
    at = 0;
  };
  const FaceScan scan = Reader(faces).run([&](const Reader::Row& row) {
    for (size_t k = 1; k + 1 < row.vertices.size(); ++k) {
      ByteWriter out(std::span<std::byte>(bytes).subspan(at, kTriangleRow));
      for (uint32_t v : {row.vertices[0], row.vertices[k], row.vertices[k + 1]}) out.u32(v);
      out.u32(static_cast<uint32_t>(row.material));
      at += kTriangleRow;
      if (at == bytes.size()) flush();
    }
  });
  flush();
  file.commit_unflushed();
  return scan;
}

}  // namespace umbel::io
