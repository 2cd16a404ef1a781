// Procedural meshes. The same bits on every platform: coordinates come from integers, exact
// quotients, square roots and explicit fused multiply-adds, never from libm's sines, and noise is
// made in fixed point (lattice value noise, after Perlin, "An Image Synthesizer", 1985).
#include <bit>
#include <cmath>

#include "base/hash.hpp"
#include "base/hash_index.hpp"
#include "base/parallel.hpp"
#include "base/refuse.hpp"
#include "umbel/mesh.hpp"

namespace umbel::shapes {
namespace {

Vec3 rounded(const Vec3d& v) {
  return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
}

Vec3d normalized(const Vec3d& v) {
  const double length = std::sqrt(std::fma(v.x, v.x, std::fma(v.y, v.y, v.z * v.z)));
  return {v.x / length, v.y / length, v.z / length};
}

struct SinCos {
  double sin, cos;
};

/// Sine and cosine of `numerator / denominator` turns, exact at multiples of a quarter turn:
/// Taylor series within an eighth of a turn, then symmetry.
SinCos sin_cos_turns(uint64_t numerator, uint64_t denominator) {
  const uint64_t eighths = (numerator % denominator) * 8;
  const uint64_t octant = eighths / denominator, rest = eighths % denominator;
  const uint64_t within = octant % 2 == 0 ? rest : denominator - rest;
  constexpr double kEighthTurn = 0.78539816339744830962;
  const double a = static_cast<double>(within) / static_cast<double>(denominator) * kEighthTurn;
  const double minus_square = -(a * a);
  double sin = 1, cos = 1;
  for (int term = 9; term >= 1; --term) {
    sin = std::fma(sin, minus_square / ((2 * term) * (2 * term + 1)), 1.0);
    cos = std::fma(cos, minus_square / ((2 * term - 1) * (2 * term)), 1.0);
  }
  sin *= a;
  const uint64_t quarter = octant / 2;
  if (octant % 2 == 1) std::swap(sin, cos);
  switch (quarter) {
    case 0:
      return {sin, cos};
    case 1:
      return {cos, -sin};
    case 2:
      return {-sin, -cos};
    default:
      return {-cos, sin};
  }
}

/// Two triangles for each quad of a (columns + 1) x (rows + 1) lattice of vertices.
std::vector<Triangle> lattice_triangles(uint32_t columns, uint32_t rows) {
  std::vector<Triangle> triangles;
  triangles.reserve(size_t{2} * columns * rows);
  for (uint32_t row = 0; row < rows; ++row) {
    for (uint32_t column = 0; column < columns; ++column) {
      const uint32_t a = row * (columns + 1) + column, b = a + 1;
      const uint32_t c = a + columns + 1, d = c + 1;
      triangles.push_back({a, b, d});
      triangles.push_back({a, d, c});
    }
  }
  return triangles;
}

void require_vertices(uint64_t count) {
  require(count < kNone,
          "the shape would have " + std::to_string(count) + " vertices; indices have 32 bits");
}

// ---- noise in fixed point -------------------------------------------------------------------

constexpr int kFraction = 16;  // fractional bits of coordinates and of values
constexpr int64_t kOne = int64_t{1} << kFraction;

/// A value in [-kOne, kOne) for each lattice point.
int64_t lattice_value(int64_t x, int64_t y, int64_t z, uint64_t seed) {
  uint64_t hash = mix64(seed ^ static_cast<uint64_t>(x));
  hash = mix64(hash ^ static_cast<uint64_t>(y));
  hash = mix64(hash ^ static_cast<uint64_t>(z));
  return static_cast<int64_t>(hash >> (64 - kFraction - 1)) - kOne;
}

int64_t smooth(int64_t t) { return ((t * t) >> kFraction) * (3 * kOne - 2 * t) >> kFraction; }
int64_t lerp(int64_t a, int64_t b, int64_t t) { return a + (((b - a) * t) >> kFraction); }

int64_t value_noise(int64_t x, int64_t y, int64_t z, uint64_t seed) {
  const int64_t i = x >> kFraction, j = y >> kFraction, k = z >> kFraction;
  const int64_t u = smooth(x & (kOne - 1)), v = smooth(y & (kOne - 1)), w = smooth(z & (kOne - 1));
  int64_t planes[2];
  for (int64_t plane = 0; plane < 2; ++plane) {
    const int64_t low =
        lerp(lattice_value(i, j, k + plane, seed), lattice_value(i + 1, j, k + plane, seed), u);
    const int64_t high = lerp(lattice_value(i, j + 1, k + plane, seed),
                              lattice_value(i + 1, j + 1, k + plane, seed), u);
    planes[plane] = lerp(low, high, v);
  }
  return lerp(planes[0], planes[1], w);
}

/// Octaves of noise, each of twice the frequency and half the height; in (-2 * kOne, 2 * kOne).
int64_t fractal_noise(int64_t x, int64_t y, int64_t z, uint64_t seed, int octaves) {
  int64_t sum = 0;
  for (int octave = 0; octave < octaves; ++octave) {
    sum += value_noise(x << octave, y << octave, z << octave, seed + octave) >> octave;
  }
  return sum;
}

// ---- icosphere ------------------------------------------------------------------------------

struct Icosphere {
  std::vector<Vec3d> directions;  // unit length
  std::vector<Triangle> triangles;
};

Icosphere icosahedron() {
  const double g = (1 + std::sqrt(5.0)) / 2;
  Icosphere ico;
  ico.directions = {{-1, g, 0},  {1, g, 0},  {-1, -g, 0}, {1, -g, 0}, {0, -1, g},  {0, 1, g},
                    {0, -1, -g}, {0, 1, -g}, {g, 0, -1},  {g, 0, 1},  {-g, 0, -1}, {-g, 0, 1}};
  for (Vec3d& v : ico.directions) v = normalized(v);
  ico.triangles = {{0, 11, 5}, {0, 5, 1},  {0, 1, 7},   {0, 7, 10}, {0, 10, 11},
                   {1, 5, 9},  {5, 11, 4}, {11, 10, 2}, {10, 7, 6}, {7, 1, 8},
                   {3, 9, 4},  {3, 4, 2},  {3, 2, 6},   {3, 6, 8},  {3, 8, 9},
                   {4, 9, 5},  {2, 4, 11}, {6, 2, 10},  {8, 6, 7},  {9, 8, 1}};
  return ico;
}

/// Gives each edge of the sphere one midpoint, numbered by first use.
class Midpoints {
 public:
  explicit Midpoints(std::vector<Vec3d>& directions, size_t edges)
      : directions_(directions), first_(static_cast<uint32_t>(directions.size())), table_(edges) {
    ends_.reserve(edges);
    directions_.reserve(directions_.size() + edges);
  }

  uint32_t of(uint32_t a, uint32_t b) {
    const uint64_t edge = a < b ? a | uint64_t{b} << 32 : b | uint64_t{a} << 32;
    const auto next = static_cast<uint32_t>(ends_.size());
    const uint32_t found = table_.find_or_insert(
        mix64(edge), next, [&](uint32_t other) { return ends_[other] == edge; });
    if (found == next) {
      ends_.push_back(edge);
      // The lower end first, so that both triangles of an edge would compute the same sum.
      const Vec3d p = directions_[std::min(a, b)], q = directions_[std::max(a, b)];
      directions_.push_back(normalized({p.x + q.x, p.y + q.y, p.z + q.z}));
    }
    return first_ + found;
  }

 private:
  std::vector<Vec3d>& directions_;
  uint32_t first_;
  HashIndex table_;
  std::vector<uint64_t> ends_;
};

Icosphere icosphere(uint32_t subdivisions) {
  require(subdivisions <= 12, "subdivisions is " + std::to_string(subdivisions) +
                                  ", but must be at most 12 (335 million triangles)");
  Icosphere ico = icosahedron();
  for (uint32_t step = 0; step < subdivisions; ++step) {
    Midpoints midpoints(ico.directions, ico.triangles.size() / 2 * 3);
    std::vector<Triangle> finer;
    finer.reserve(ico.triangles.size() * 4);
    for (const auto& [a, b, c] : ico.triangles) {
      const uint32_t ab = midpoints.of(a, b), bc = midpoints.of(b, c), ca = midpoints.of(c, a);
      finer.insert(finer.end(), {{a, ab, ca}, {b, bc, ab}, {c, ca, bc}, {ab, bc, ca}});
    }
    ico.triangles = std::move(finer);
  }
  return ico;
}

}  // namespace

Mesh grid(uint32_t columns, uint32_t rows) {
  Mesh mesh;
  if (columns == 0 || rows == 0) return mesh;
  require_vertices((uint64_t{columns} + 1) * (uint64_t{rows} + 1));
  for (uint32_t row = 0; row <= rows; ++row)
    for (uint32_t column = 0; column <= columns; ++column)
      mesh.positions.push_back({static_cast<float>(static_cast<double>(column) / columns),
                                static_cast<float>(static_cast<double>(row) / rows), 0.0f});
  mesh.triangles = lattice_triangles(columns, rows);
  return mesh;
}

Mesh sphere(uint32_t subdivisions) {
  Icosphere ico = icosphere(subdivisions);
  Mesh mesh;
  mesh.positions.reserve(ico.directions.size());
  for (const Vec3d& v : ico.directions) mesh.positions.push_back(rounded(v));
  mesh.triangles = std::move(ico.triangles);
  return mesh;
}

Mesh torus(uint32_t rings, uint32_t sides) {
  require(rings >= 3 && sides >= 3, "a torus needs at least 3 rings and 3 sides, not " +
                                        std::to_string(rings) + " and " + std::to_string(sides));
  require_vertices(uint64_t{rings} * sides);
  Mesh mesh;
  for (uint32_t ring = 0; ring < rings; ++ring) {
    const SinCos around = sin_cos_turns(ring, rings);
    for (uint32_t side = 0; side < sides; ++side) {
      const SinCos along = sin_cos_turns(side, sides);
      const double radius = std::fma(0.35, along.cos, 1.0);
      mesh.positions.push_back(
          rounded({radius * around.cos, radius * around.sin, 0.35 * along.sin}));
      const uint32_t next_ring = (ring + 1) % rings * sides, next_side = (side + 1) % sides;
      const uint32_t a = ring * sides + side, b = next_ring + side;
      const uint32_t c = next_ring + next_side, d = ring * sides + next_side;
      mesh.triangles.push_back({a, b, c});
      mesh.triangles.push_back({a, c, d});
    }
  }
  return mesh;
}

Mesh moebius(uint32_t segments, uint32_t width) {
  require(segments >= 3 && width >= 1,
          "a Moebius strip needs at least 3 segments and a width of 1, not " +
              std::to_string(segments) + " and " + std::to_string(width));
  require_vertices(uint64_t{segments} * (uint64_t{width} + 1));
  Mesh mesh;
  const uint32_t across = width + 1;
  for (uint32_t segment = 0; segment < segments; ++segment) {
    const SinCos around = sin_cos_turns(segment, segments);
    const SinCos twist = sin_cos_turns(segment, uint64_t{segments} * 2);
    const bool last = segment + 1 == segments;
    for (uint32_t i = 0; i <= width; ++i) {
      const double offset = 0.4 * (2.0 * i / width - 1);
      const double radius = std::fma(offset, twist.cos, 1.0);
      mesh.positions.push_back(
          rounded({radius * around.cos, radius * around.sin, offset * twist.sin}));
      if (i == width) break;
      // After one turn the strip has turned over: vertex i meets vertex width - i.
      const uint32_t a = segment * across + i, d = a + 1;
      const uint32_t b = last ? width - i : a + across, c = last ? width - i - 1 : b + 1;
      mesh.triangles.push_back({a, b, c});
      mesh.triangles.push_back({a, c, d});
    }
  }
  return mesh;
}

Mesh fan(uint32_t triangles) {
  Mesh mesh;
  if (triangles == 0) return mesh;
  const uint32_t corners = triangles < 3 ? triangles + 1 : triangles;  // closed from 3 on
  require_vertices(uint64_t{corners} + 1);
  mesh.positions.push_back({0, 0, 0});
  for (uint32_t i = 0; i < corners; ++i) {
    const SinCos at = sin_cos_turns(i, std::max(corners, 4u));
    mesh.positions.push_back(rounded({at.cos, at.sin, 0}));
  }
  for (uint32_t i = 0; i < triangles; ++i)
    mesh.triangles.push_back({0, 1 + i, 1 + (i + 1) % corners});
  return mesh;
}

Mesh soup(uint32_t triangles, uint32_t seed) {
  require_vertices(uint64_t{triangles} * 3);
  // Coordinates are 22-bit integers plus small offsets: below 2^24, so exact in a float.
  const auto random = [&](uint64_t i, int bits) {
    return static_cast<int64_t>(mix64(mix64(seed) ^ i) >> (64 - bits));
  };
  const auto coordinate = [&](uint64_t triangle, uint64_t corner, uint64_t axis) {
    const int64_t middle = random(triangle * 16 + axis, 22);
    const int64_t offset = random(triangle * 16 + 3 + corner * 3 + axis, 18) - (1 << 17);
    return static_cast<float>(middle + offset) * 0x1p-22f;
  };
  Mesh mesh;
  mesh.positions.reserve(size_t{triangles} * 3);
  for (uint32_t t = 0; t < triangles; ++t) {
    for (uint32_t c = 0; c < 3; ++c)
      mesh.positions.push_back({coordinate(t, c, 0), coordinate(t, c, 1), coordinate(t, c, 2)});
    mesh.triangles.push_back({3 * t, 3 * t + 1, 3 * t + 2});
  }
  return mesh;
}

Mesh tetrahedra(uint32_t count) {
  require_vertices(uint64_t{count} * 4);
  uint64_t side = 1;
  while (side * side * side < count) ++side;
  constexpr uint32_t kCorners[4][3] = {{0, 0, 0}, {1, 1, 0}, {1, 0, 1}, {0, 1, 1}};
  Mesh mesh;
  for (uint32_t i = 0; i < count; ++i) {
    const uint64_t cell[3] = {i % side, i / side % side, i / side / side};
    for (const auto& corner : kCorners)
      mesh.positions.push_back({static_cast<float>(2 * cell[0] + corner[0]),
                                static_cast<float>(2 * cell[1] + corner[1]),
                                static_cast<float>(2 * cell[2] + corner[2])});
    const uint32_t a = 4 * i, b = a + 1, c = a + 2, d = a + 3;
    mesh.triangles.insert(mesh.triangles.end(), {{a, b, c}, {a, c, d}, {a, d, b}, {b, d, c}});
  }
  return mesh;
}

Mesh terrain(uint32_t columns, uint32_t rows, uint32_t seed) {
  Mesh mesh = grid(columns, rows);
  // Four cells of the coarsest noise along the longer side, eight octaves.
  const uint64_t longer = std::max<uint64_t>(std::max(columns, rows), 1);
  parallel_for(mesh.positions.size(), 1 << 12, [&](size_t i) {
    const uint64_t column = i % (uint64_t{columns} + 1), row = i / (uint64_t{columns} + 1);
    const auto x = static_cast<int64_t>(column * 4 * kOne / longer);
    const auto y = static_cast<int64_t>(row * 4 * kOne / longer);
    mesh.positions[i].z = static_cast<float>(fractal_noise(x, y, 0, mix64(seed), 8)) * 0x1p-19f;
  });
  return mesh;
}

Mesh blob(uint32_t subdivisions, uint32_t seed) {
  Icosphere ico = icosphere(subdivisions);
  Mesh mesh;
  mesh.positions.resize(ico.directions.size());
  parallel_for(mesh.positions.size(), 1 << 12, [&](size_t i) {
    const Vec3d v = ico.directions[i];
    const auto fixed = [](double c) {  // the sphere spans four cells of the coarsest noise
      return static_cast<int64_t>(std::floor((c + 2) * (2 * kOne)));
    };
    const int64_t noise = fractal_noise(fixed(v.x), fixed(v.y), fixed(v.z), mix64(seed), 6);
    const double radius = static_cast<double>(4 * kOne + noise) / (4 * kOne);
    mesh.positions[i] = rounded({v.x * radius, v.y * radius, v.z * radius});
  });
  mesh.triangles = std::move(ico.triangles);
  return mesh;
}

}  // namespace umbel::shapes
