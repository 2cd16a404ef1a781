#include "lod/simplify/patches.hpp"

#include <algorithm>
#include <limits>
#include <numeric>
#include <utility>

#include "base/math.hpp"

namespace umbel::lod {
namespace {

struct Patch {
  Aabb box;
  size_t triangles = 0;
  bool fixed = false;
  float diagonal() const { return length(box.max - box.min); }
};

// For each triangle the lowest triangle of its patch.
std::vector<uint32_t> find_patches(const PatchInput& input, std::span<const Triangle> triangles) {
  struct Side {
    uint32_t a, b, triangle;
    auto operator<=>(const Side&) const = default;
  };
  std::vector<Side> sides;
  for (uint32_t t = 0; t < triangles.size(); ++t)
    for (int i = 0; i < 3; ++i) {
      const uint32_t p = input.position_of[triangles[t][i]];
      const uint32_t q = input.position_of[triangles[t][(i + 1) % 3]];
      const bool allowed = input.component[p] != kNone && input.component[p] == input.component[q];
      if (!allowed) sides.push_back({std::min(p, q), std::max(p, q), t});
    }
  std::sort(sides.begin(), sides.end());
  std::vector<uint32_t> parent(triangles.size());
  std::iota(parent.begin(), parent.end(), 0u);
  const auto root = [&](uint32_t t) {
    while (parent[t] != t) t = parent[t] = parent[parent[t]];
    return t;
  };
  for (size_t i = 1; i < sides.size(); ++i) {
    if (sides[i].a != sides[i - 1].a || sides[i].b != sides[i - 1].b) continue;
    const uint32_t x = root(sides[i].triangle), y = root(sides[i - 1].triangle);
    parent[std::max(x, y)] = std::min(x, y);
  }
  for (uint32_t t = 0; t < triangles.size(); ++t) parent[t] = root(t);
  return parent;
}

// By the lowest triangle of each; the others are empty.
std::vector<Patch> measure_patches(const PatchInput& input, std::span<const Triangle> triangles,
                                   std::span<const uint32_t> patch_of) {
  std::vector<Patch> patches(triangles.size());
  for (uint32_t t = 0; t < triangles.size(); ++t) {
    Patch& patch = patches[patch_of[t]];
    ++patch.triangles;
    for (uint32_t v : triangles[t]) {
      extend(patch.box, input.positions[v]);
      patch.fixed |= input.locked[input.position_of[v]] != 0;
    }
  }
  return patches;
}

std::vector<uint32_t> numbers_of(std::span<const Patch> patches) {
  std::vector<uint32_t> numbers;
  for (uint32_t s = 0; s < patches.size(); ++s)
    if (patches[s].triangles > 0) numbers.push_back(s);
  return numbers;
}

// The directed sides of the patch that nothing cancels and nothing allows, as vertices.
std::vector<std::pair<uint32_t, uint32_t>> border_of(const PatchInput& input,
                                                     std::span<const Triangle> patch) {
  struct Side {
    uint32_t low, high;  // positions
    uint32_t from, to;   // vertices
  };
  std::vector<Side> sides;
  for (const Triangle& t : patch)
    for (int i = 0; i < 3; ++i) {
      const uint32_t from = t[i], to = t[(i + 1) % 3];
      const uint32_t p = input.position_of[from], q = input.position_of[to];
      const bool allowed = input.component[p] != kNone && input.component[p] == input.component[q];
      if (!allowed) sides.push_back({std::min(p, q), std::max(p, q), from, to});
    }
  std::stable_sort(sides.begin(), sides.end(), [](const Side& a, const Side& b) {
    return std::pair(a.low, a.high) < std::pair(b.low, b.high);
  });
  std::vector<std::pair<uint32_t, uint32_t>> border;
  for (size_t i = 0; i < sides.size();) {
    size_t end = i;
    while (end < sides.size() && sides[end].low == sides[i].low && sides[end].high == sides[i].high)
      ++end;
    if ((end - i) % 2 == 1) border.emplace_back(sides[i].from, sides[i].to);
    i = end;
  }
  return border;
}

using Sides = std::vector<std::pair<uint32_t, uint32_t>>;

// Takes a border apart into loops of vertices, none of which is at a position twice. What does not
// close is left out.
std::vector<std::vector<uint32_t>> loops_of(const PatchInput& input, Sides border) {
  const auto position = [&](uint32_t v) { return input.position_of[v]; };
  std::vector<std::vector<uint32_t>> loops;
  while (!border.empty()) {
    std::vector<uint32_t> path = {border.front().first};
    for (;;) {
      const auto side = std::find_if(border.begin(), border.end(), [&](const auto& s) {
        return position(s.first) == position(path.back());
      });
      if (side == border.end()) break;
      const uint32_t to = side->second;
      border.erase(side);
      const auto seen = std::find_if(path.begin(), path.end(),
                                     [&](uint32_t v) { return position(v) == position(to); });
      if (seen != path.end()) {
        loops.emplace_back(seen, path.end());
        path.erase(seen + 1, path.end());
      } else {
        path.push_back(to);
      }
    }
  }
  return loops;
}

// A fan over each loop of the border, which keeps the loop's sides and their direction, around a
// vertex from the inside, so that no two of the border's positions become neighbours.
void add_caps(const PatchInput& input, std::span<const Triangle> patch, const Sides& border,
              std::vector<Triangle>& out) {
  std::vector<uint8_t> used(input.locked.begin(), input.locked.end());
  for (const auto& loop : loops_of(input, border)) {
    Vec3 middle{0, 0, 0};
    for (uint32_t v : loop)
      middle = middle + input.positions[v] * (1.0f / static_cast<float>(loop.size()));
    uint32_t apex = kNone;
    float nearest = std::numeric_limits<float>::infinity();
    for (const Triangle& t : patch)
      for (uint32_t v : t) {
        const Vec3 d = input.positions[v] - middle;
        if (used[input.position_of[v]] || !(dot(d, d) < nearest)) continue;
        nearest = dot(d, d);
        apex = v;
      }
    if (apex == kNone) return;
    used[input.position_of[apex]] = 1;
    for (size_t i = 0; i < loop.size(); ++i)
      out.push_back({apex, loop[i], loop[(i + 1) % loop.size()]});
  }
}

uint32_t farthest(const PatchInput& input, std::span<const uint32_t> vertices, auto&& distance) {
  return *std::max_element(vertices.begin(), vertices.end(), [&](uint32_t a, uint32_t b) {
    return distance(input.positions[a]) < distance(input.positions[b]);
  });
}

// Of vertices that may be in one triangle; nothing where they are all in a line.
void add_double_triangle(const PatchInput& input, std::span<const uint32_t> vertices,
                         std::vector<Triangle>& out) {
  const Vec3 start = input.positions[vertices[0]];
  const uint32_t a =
      farthest(input, vertices, [&](const Vec3& p) { return dot(p - start, p - start); });
  const Vec3 pa = input.positions[a];
  const uint32_t b = farthest(input, vertices, [&](const Vec3& p) { return dot(p - pa, p - pa); });
  const Vec3 along = input.positions[b] - pa;
  const uint32_t c = farthest(input, vertices, [&](const Vec3& p) {
    const Vec3 m = cross(p - pa, along);
    return dot(m, m);
  });
  const auto position = [&](uint32_t v) { return input.position_of[v]; };
  if (position(a) == position(b) || position(b) == position(c) || position(c) == position(a))
    return;
  out.push_back({a, b, c});
  out.push_back({c, b, a});
}

/// Takes the triangles of the patches that are gone, and adds others.
void replace_patches(const std::vector<uint32_t>& patch_of, const std::vector<uint8_t>& gone,
                     const std::vector<Triangle>& added, std::vector<Triangle>& triangles) {
  size_t kept = 0;
  for (uint32_t t = 0; t < triangles.size(); ++t)
    if (!gone[patch_of[t]]) triangles[kept++] = triangles[t];
  triangles.resize(kept);
  triangles.insert(triangles.end(), added.begin(), added.end());
}

}  // namespace

float remove_patches(const PatchInput& input, size_t target, std::vector<Triangle>& triangles) {
  const std::vector<uint32_t> patch_of = find_patches(input, triangles);
  const std::vector<Patch> patches = measure_patches(input, triangles, patch_of);
  std::vector<uint32_t> order = numbers_of(patches);
  std::stable_sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
    return patches[a].diagonal() < patches[b].diagonal();
  });
  std::vector<uint8_t> gone(triangles.size(), 0);
  size_t left = triangles.size();
  float moved = 0.0f;
  const auto remove = [&](uint32_t s) {
    gone[s] = 1;
    left -= patches[s].triangles;
    moved = std::max(moved, patches[s].diagonal());
  };
  for (size_t i = 0; i + 1 < order.size() && left > target; ++i)
    if (!patches[order[i]].fixed) remove(order[i]);

  std::vector<Triangle> doubles;
  if (!order.empty() && left > target && !patches[order.back()].fixed) {
    std::vector<uint32_t> corners;
    const auto material = [&](const Triangle& t) {
      return input.materials.empty() ? 0 : input.materials[t[0]];
    };
    for (uint32_t t = 0; t < triangles.size(); ++t)
      if (patch_of[t] == order.back() &&
          material(triangles[t]) == material(triangles[order.back()]))
        corners.insert(corners.end(), triangles[t].begin(), triangles[t].end());
    add_double_triangle(input, corners, doubles);
    remove(order.back());
  }
  replace_patches(patch_of, gone, doubles, triangles);
  return moved;
}

float cap_patches(const PatchInput& input, size_t target, std::vector<Triangle>& triangles) {
  const std::vector<uint32_t> patch_of = find_patches(input, triangles);
  const std::vector<Patch> patches = measure_patches(input, triangles, patch_of);
  std::vector<uint32_t> order = numbers_of(patches);
  std::stable_sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
    return patches[a].triangles > patches[b].triangles;
  });
  size_t left = triangles.size();
  float moved = 0.0f;
  std::vector<uint8_t> capped(triangles.size(), 0);
  std::vector<Triangle> caps;
  for (uint32_t s : order) {
    if (left <= target) break;
    if (!patches[s].fixed) continue;
    std::vector<Triangle> patch, its_caps;
    for (uint32_t t = 0; t < triangles.size(); ++t)
      if (patch_of[t] == s) patch.push_back(triangles[t]);
    add_caps(input, patch, border_of(input, patch), its_caps);
    if (its_caps.size() >= patch.size()) continue;
    capped[s] = 1;
    left -= patch.size() - its_caps.size();
    moved = std::max(moved, patches[s].diagonal());
    caps.insert(caps.end(), its_caps.begin(), its_caps.end());
  }
  replace_patches(patch_of, capped, caps, triangles);
  return moved;
}

}  // namespace umbel::lod
