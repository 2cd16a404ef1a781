#include "io/obj_join.hpp"

#include <algorithm>
#include <numeric>
#include <string>
#include <unordered_map>
#include <utility>

#include "base/parallel.hpp"

namespace umbel::io {
namespace {

/// Vertices whose corners one task puts in order.
constexpr size_t kVertexChunk = size_t{1} << 15;

/// Makes a table's indices the file's; whether one is beyond the table.
bool resolve(ObjIndices& indices, uint64_t before, uint64_t total) {
  for (const uint32_t corner : indices.relative) {
    int32_t& index = indices.values[corner];
    const int64_t found = index + static_cast<int64_t>(before);
    index = found < 0 ? kBadIndex : static_cast<int32_t>(std::min<int64_t>(found, kBadIndex));
  }
  indices.relative = std::vector<uint32_t>();
  const auto rows = static_cast<int32_t>(total);
  bool is_bad = false;
  for (int32_t& index : indices.values) {
    if (index < rows) continue;
    index = kBadIndex;
    is_bad = true;
  }
  return is_bad;
}

/// Whether each corner's index is that of its vertex, where that is one of the file's.
bool follows_vertices(const ObjIndices& indices, const ObjIndices& v) {
  if (indices.values.empty()) return v.values.empty();
  for (size_t i = 0; i < v.values.size(); ++i)
    if (indices.values[i] != v.values[i] && v.values[i] != kBadIndex) return false;
  return true;
}

class Joiner {
 public:
  Joiner(std::vector<ObjBlock>& blocks, const std::vector<ObjOffsets>& offsets)
      : blocks_(blocks), offsets_(offsets), total_(offsets.back()) {}

  ObjMesh join() {
    has_vt_ = any_block([](const ObjBlock& b) { return !b.vt.values.empty(); });
    has_vn_ = any_block([](const ObjBlock& b) { return !b.vn.values.empty(); });
    const bool keeps_vertices = follows(has_vt_, total_.rows.vt, &ObjBlock::vt) &&
                                follows(has_vn_, total_.rows.vn, &ObjBlock::vn);
    v_ = gathered(&ObjBlock::v);
    if (!keeps_vertices && has_vt_) vt_ = gathered(&ObjBlock::vt);
    if (!keeps_vertices && has_vn_) vn_ = gathered(&ObjBlock::vn);
    gather_tables();
    gather_materials();
    if (!keeps_vertices) split_vertices();
    make_triangles();
    return std::move(mesh_);
  }

 private:
  template <typename Has>
  bool any_block(const Has& has) const {
    return std::any_of(blocks_.begin(), blocks_.end(), has);
  }

  bool follows(bool has, uint64_t rows, ObjIndices ObjBlock::* indices) const {
    return !has || (rows == total_.rows.v && !any_block([&](const ObjBlock& b) {
                      return !follows_vertices(b.*indices, b.v);
                    }));
  }

  /// Calls body(block, offsets) for every block, on all threads.
  template <typename Body>
  void for_each_block(const Body& body) {
    parallel_for(blocks_.size(), 1, [&](size_t k) { body(blocks_[k], offsets_[k]); });
  }

  /// A table's indices of all corners; the blocks' own are gone then.
  std::vector<int32_t> gathered(ObjIndices ObjBlock::* indices) {
    std::vector<int32_t> all(total_.corners, kNoIndex);
    for_each_block([&](ObjBlock& block, const ObjOffsets& offsets) {
      std::vector<int32_t>& own = (block.*indices).values;
      std::copy(own.begin(), own.end(), all.begin() + static_cast<ptrdiff_t>(offsets.corners));
      own = std::vector<int32_t>();  // {} would keep the memory
    });
    return all;
  }

  /// Rows of `columns` numbers from all blocks, as values of T; the blocks' own are gone then.
  template <typename T, typename Scalar>
  std::vector<T> rows(std::vector<Scalar> ObjBlock::* numbers, uint64_t ObjCounts::* before) {
    std::vector<T> all(total_.rows.*before);
    for_each_block([&](ObjBlock& block, const ObjOffsets& offsets) {
      std::vector<Scalar>& own = block.*numbers;
      std::copy(own.begin(), own.end(),
                reinterpret_cast<Scalar*>(all.data() + offsets.rows.*before));
      own = std::vector<Scalar>();
    });
    return all;
  }

  void scale_colors() {
    ColorScaleFinder finder;
    for (const ObjBlock& block : blocks_) finder.add(block.colors);
    const ColorScale scale = finder.scale();
    for_each_block([&](ObjBlock& block, const ObjOffsets&) {
      for (size_t k = 0; k < block.colors.size(); ++k)
        block.colors[k] = fraction_of(block.colors[k], k % 4 == 3 ? scale.alpha : scale.color);
    });
  }

  void gather_tables() {
    if (any_block([](const ObjBlock& b) { return !b.colors.empty(); })) {
      for_each_block([](ObjBlock& block, const ObjOffsets&) {
        if (block.colors.empty()) block.colors.assign(4 * block.vertices(), kNoColor);
      });
      scale_colors();
      mesh_.colors = rows<Vec4>(&ObjBlock::colors, &ObjCounts::v);
    }
    mesh_.positions = rows<std::array<double, 3>>(&ObjBlock::positions, &ObjCounts::v);
    if (has_vt_) mesh_.uvs = rows<Vec2>(&ObjBlock::uvs, &ObjCounts::vt);
    if (has_vn_) mesh_.normals = rows<Vec3>(&ObjBlock::normals, &ObjCounts::vn);
  }

  void gather_materials() {
    std::unordered_map<std::string, uint32_t> numbers;
    uint32_t current = kNone;
    std::vector<std::pair<uint64_t, uint32_t>> uses;  // first triangle, material
    for (size_t k = 0; k < blocks_.size(); ++k) {
      ObjBlock& block = blocks_[k];
      for (std::string& library : block.libraries) mesh_.libraries.push_back(std::move(library));
      for (const auto& use : block.uses) {
        const std::string& name = block.names[use.name];
        const auto next = static_cast<uint32_t>(mesh_.material_names.size());
        const auto [known, is_new] = numbers.try_emplace(name, next);
        if (is_new) mesh_.material_names.push_back(name);
        uses.emplace_back(offsets_[k].triangles + use.triangle, known->second);
      }
    }
    if (uses.empty()) return;
    mesh_.materials.resize(total_.triangles);
    uint64_t begin = 0;
    for (const auto& [end, material] : uses) {
      std::fill(mesh_.materials.begin() + static_cast<ptrdiff_t>(begin),
                mesh_.materials.begin() + static_cast<ptrdiff_t>(end), current);
      begin = end;
      current = material;
    }
    std::fill(mesh_.materials.begin() + static_cast<ptrdiff_t>(begin), mesh_.materials.end(),
              current);
  }

  // --- a vertex for each combination of v, vt and vn

  /// The other two numbers of a corner; none is less than any.
  uint64_t key(uint32_t corner) const {
    const auto part = [&](const std::vector<int32_t>& indices) {
      return indices.empty() ? 0u : static_cast<uint32_t>(indices[corner] + 1);
    };
    return uint64_t{part(vt_)} << 32 | part(vn_);
  }

  /// Fills `starts_` and `order_`: corners by vertex.
  void order_by_vertex() {
    starts_.assign(total_.rows.v + 1, 0);
    for (const int32_t v : v_)
      if (v != kBadIndex) ++starts_[static_cast<size_t>(v)];
    std::exclusive_scan(starts_.begin(), starts_.end(), starts_.begin(), 0u);
    order_.resize(starts_.back());
    for (size_t corner = 0; corner < v_.size(); ++corner)
      if (v_[corner] != kBadIndex)
        order_[starts_[static_cast<size_t>(v_[corner])]++] = static_cast<uint32_t>(corner);
    // Each start has become the next one's.
    std::copy_backward(starts_.begin(), starts_.end() - 1, starts_.end());
    starts_[0] = 0;
  }

  /// Puts the corners of a vertex in order of their keys, and counts the different ones.
  uint32_t order_corners(size_t v, std::vector<std::pair<uint64_t, uint32_t>>& keyed) {
    keyed.clear();
    for (uint32_t i = starts_[v]; i < starts_[v + 1]; ++i)
      keyed.emplace_back(key(order_[i]), order_[i]);
    std::sort(keyed.begin(), keyed.end());
    uint32_t different = 0;
    for (size_t i = 0; i < keyed.size(); ++i) {
      order_[starts_[v] + i] = keyed[i].second;
      different += i == 0 || keyed[i].first != keyed[i - 1].first;
    }
    return different;
  }

  void split_vertices() {
    order_by_vertex();
    const size_t count = total_.rows.v;
    std::vector<uint32_t> firsts((count + kVertexChunk - 1) / kVertexChunk + 1);
    parallel_chunks(count, kVertexChunk, [&](size_t begin, size_t end) {
      std::vector<std::pair<uint64_t, uint32_t>> keyed;
      uint32_t different = 0;
      for (size_t v = begin; v < end; ++v) different += order_corners(v, keyed);
      firsts[begin / kVertexChunk] = different;
    });
    std::exclusive_scan(firsts.begin(), firsts.end(), firsts.begin(), 0u);
    ObjMesh split;
    const uint32_t all = firsts.back();
    split.positions.resize(all);
    if (!mesh_.colors.empty()) split.colors.resize(all);
    if (has_vt_) split.uvs.resize(all);
    if (has_vn_) split.normals.resize(all);
    std::vector<uint8_t> lacks_normal(has_vn_ ? all : 0);
    parallel_chunks(count, kVertexChunk, [&](size_t begin, size_t end) {
      number_vertices(begin, end, firsts[begin / kVertexChunk], split, lacks_normal);
    });
    mesh_.positions = std::move(split.positions);
    mesh_.colors = std::move(split.colors);
    mesh_.uvs = std::move(split.uvs);
    mesh_.normals = std::move(split.normals);
    for (uint32_t i = 0; i < lacks_normal.size(); ++i)
      if (lacks_normal[i]) mesh_.without_normal.push_back(i);
    order_ = std::vector<uint32_t>();
    starts_ = std::vector<uint32_t>();
  }

  /// The new vertices of the file's vertices [begin, end), from number `next` on; their corners
  /// then name them.
  void number_vertices(size_t begin, size_t end, uint32_t next, ObjMesh& split,
                       std::vector<uint8_t>& lacks_normal) {
    for (size_t v = begin; v < end; ++v)
      for (uint32_t i = starts_[v]; i < starts_[v + 1]; ++i) {
        const uint32_t corner = order_[i];
        const bool is_new = i == starts_[v] || key(corner) != key(order_[i - 1]);
        if (is_new) {
          split.positions[next] = mesh_.positions[v];
          if (!split.colors.empty()) split.colors[next] = mesh_.colors[v];
          if (has_vt_ && vt_[corner] != kNoIndex)
            split.uvs[next] = mesh_.uvs[static_cast<size_t>(vt_[corner])];
          if (has_vn_ && vn_[corner] != kNoIndex)
            split.normals[next] = mesh_.normals[static_cast<size_t>(vn_[corner])];
          else if (has_vn_)
            lacks_normal[next] = 1;
          ++next;
        }
        v_[corner] = static_cast<int32_t>(next - 1);
      }
  }

  void make_triangles() {
    mesh_.triangles.resize(total_.triangles);
    for_each_block([&](const ObjBlock& block, const ObjOffsets& offsets) {
      const int32_t* corner = v_.data() + offsets.corners;
      Triangle* out = mesh_.triangles.data() + offsets.triangles;
      const auto vertex = [](int32_t v) {
        return v == kBadIndex ? kNone : static_cast<uint32_t>(v);
      };
      for (size_t k = 0; k < block.faces; ++k) {
        const uint32_t size = block.corners(k);
        for (uint32_t i = 2; i < size; ++i)
          *out++ = {vertex(corner[0]), vertex(corner[i - 1]), vertex(corner[i])};
        corner += size;
      }
    });
  }

  std::vector<ObjBlock>& blocks_;
  const std::vector<ObjOffsets>& offsets_;
  const ObjOffsets& total_;
  ObjMesh mesh_;
  bool has_vt_ = false, has_vn_ = false;
  std::vector<int32_t> v_, vt_, vn_;      // of each corner
  std::vector<uint32_t> starts_, order_;  // corners by vertex
};

}  // namespace

ObjOffsets after(const ObjOffsets& before, const ObjBlock& block) {
  ObjOffsets next = before;
  next.rows.v += block.vertices();
  next.rows.vt += block.uvs.size() / 2;
  next.rows.vn += block.normals.size() / 3;
  next.corners += block.v.values.size();
  next.triangles += block.triangles;
  next.lines += block.lines;
  return next;
}

BadIndices resolve(ObjBlock& block, const ObjCounts& before, const ObjCounts& total) {
  BadIndices bad;
  bad.vertices = resolve(block.v, before.v, total.v);
  const bool bad_vt = resolve(block.vt, before.vt, total.vt);
  const bool bad_vn = resolve(block.vn, before.vn, total.vn);
  bad.attributes = bad_vt || bad_vn;
  return bad;
}

ObjMesh join(std::vector<ObjBlock>& blocks, const std::vector<ObjOffsets>& offsets) {
  return Joiner(blocks, offsets).join();
}

}  // namespace umbel::io
