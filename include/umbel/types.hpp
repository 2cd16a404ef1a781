// The small types that every part of Umbel shares: vectors, boxes, spheres, ranges,
// errors, and the options that every build takes.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <stdexcept>
#include <string>
#include <string_view>

#if defined(UMBEL_SHARED) && defined(_WIN32)
#if defined(UMBEL_EXPORTS)
#define UMBEL_API __declspec(dllexport)
#else
#define UMBEL_API __declspec(dllimport)
#endif
#elif defined(__GNUC__)
#define UMBEL_API __attribute__((visibility("default")))
#else
#define UMBEL_API
#endif

namespace umbel {

struct Vec2 {
  float x, y;
  bool operator==(const Vec2&) const = default;
};

struct Vec3 {
  float x, y, z;
  bool operator==(const Vec3&) const = default;
};

/// A point of the world, where floats would not do. See AssetContents::origin.
struct Vec3d {
  double x, y, z;
  bool operator==(const Vec3d&) const = default;
};

struct Vec4 {
  float x, y, z, w;
  bool operator==(const Vec4&) const = default;
};

/// A point of the world as one relative to `origin`: subtracted first, rounded to floats then.
constexpr Vec3 relative_to(const Vec3d& origin, const Vec3d& point) {
  return {static_cast<float>(point.x - origin.x), static_cast<float>(point.y - origin.y),
          static_cast<float>(point.z - origin.z)};
}

/// Three vertex indices, counter-clockwise when seen from outside.
using Triangle = std::array<uint32_t, 3>;

/// Axis-aligned box. The default is the empty box (min > max), the identity of a union.
struct Aabb {
  Vec3 min{std::numeric_limits<float>::max(), std::numeric_limits<float>::max(),
           std::numeric_limits<float>::max()};
  Vec3 max{std::numeric_limits<float>::lowest(), std::numeric_limits<float>::lowest(),
           std::numeric_limits<float>::lowest()};
  bool operator==(const Aabb&) const = default;
};

struct Sphere {
  Vec3 center;
  float radius;
  bool operator==(const Sphere&) const = default;
};

/// The half-open index range [offset, offset + count).
struct Range {
  uint32_t offset, count;
  bool operator==(const Range&) const = default;
};

/// An affine map: three rows of four, x' = rows[0] x + rows[1] y + rows[2] z + rows[3], and so on.
struct Transform {
  std::array<float, 12> rows{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
  bool operator==(const Transform&) const = default;
};

/// "No such element", where an index is optional.
inline constexpr uint32_t kNone = 0xffffffffu;

enum class ErrorCode {
  kInvalidArgument,  ///< a config value or a combination of values that cannot be met
  kInvalidMesh,      ///< NaN, infinity or an index out of range in the input geometry
  kIo,               ///< a file cannot be opened, read or written; the disk is full
  kCorrupt,          ///< a file's bytes are not what its format says
  kUnsupported,      ///< valid input that this build or version cannot handle
  kCancelled,        ///< the progress callback asked to stop
  kDevice,           ///< a call of CUDA failed; the message ends with CUDA's own words
};

/// Every failure of the library. `what()` is one sentence that names the offending
/// argument, the index and the value.
class UMBEL_API Error : public std::runtime_error {
 public:
  Error(ErrorCode code, const std::string& message);
  ErrorCode code() const noexcept { return code_; }

 private:
  ErrorCode code_;
};

/// What every build takes. None of it changes the result: the same input and config give
/// the same bytes for any number of threads.
struct BuildOptions {
  /// Called from the building thread with the fraction done in [0, 1] (it never falls) and
  /// the name of the stage. Returning false cancels: the build throws kCancelled.
  std::function<bool(float fraction, std::string_view stage)> progress;
  /// Most threads to use; 0 means all cores.
  uint32_t threads = 0;
};

}  // namespace umbel
