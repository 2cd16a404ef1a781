#include "scale/work_folder.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cinttypes>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <system_error>

#include "base/file.hpp"
#include "base/hash.hpp"
#include "base/refuse.hpp"

#if defined(__unix__) || defined(__APPLE__)
#define UMBEL_POSIX_LOCKS 1
#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>
#endif

namespace umbel::scale {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kChecksum = ",\n  \"checksum\": \"";
constexpr const char* kEnd = "\"\n}\n";

std::string checksum_of(std::string_view text) {
  return std::to_string(xxh64(text.data(), text.size()));
}

// A JSON object of strings, a line each; the last is a checksum of what is before.
std::string manifest_of(const Identity& identity) {
  const auto quoted = [](const std::string& text) {
    std::string out = "\"";
    for (const char c : text) {
      if (c == '"' || c == '\\') out += '\\';
      if (static_cast<unsigned char>(c) < 0x20)
        out.append("\\u00").append(1, c < 0x10 ? '0' : '1').append(1, "0123456789abcdef"[c % 16]);
      else
        out += c;
    }
    return out += '"';
  };
  std::string text = "{";
  for (const auto& [name, value] : identity) {
    text += text.size() == 1 ? "\n" : ",\n";
    text.append("  ").append(quoted(name)).append(": ").append(quoted(value));
  }
  return text + std::string(kChecksum) + checksum_of(text) + kEnd;
}

// The character at `i`, which is moved to its last byte.
char unescaped(const std::string& text, size_t& i) {
  if (text[i] != '\\' || i + 1 == text.size()) return text[i];
  if (text[++i] != 'u') return text[i];
  const std::string digits = text.substr(i + 1, 4);
  i += digits.size();
  return static_cast<char>(std::strtol(digits.c_str(), nullptr, 16));
}

// The strings of such an object, in pairs.
std::map<std::string, std::string> fields_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::string text{std::istreambuf_iterator<char>(file), {}};
  // One of another build of the library may have no checksum: it is refused for that.
  const size_t end = text.rfind(kChecksum);
  bool is_whole = true;
  if (end != std::string::npos) {
    const std::string sum = checksum_of(std::string_view(text).substr(0, end));
    is_whole = text.substr(end) == std::string(kChecksum) + sum + kEnd;
    text.replace(end, std::string::npos, "\n}\n");
  }
  std::vector<std::string> strings;
  bool inside = false;
  for (size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '"') {
      inside = !inside;
      if (inside) strings.emplace_back();
    } else if (inside) {
      strings.back() += unescaped(text, i);
    }
  }
  if (!file || inside || strings.size() % 2 != 0 || !is_whole || !text.ends_with("}\n"))
    throw Error(ErrorCode::kCorrupt,
                path.string() + " is damaged: remove its folder and begin again");
  std::map<std::string, std::string> fields;
  for (size_t i = 0; i < strings.size(); i += 2) fields[strings[i]] = strings[i + 1];
  return fields;
}

// Of a long value, such as the names of many files, what is about a place.
std::string about(const std::string& text, size_t place) {
  constexpr size_t kBefore = 100, kMost = 300;
  if (text.size() <= kMost) return text;
  // Letters of several bytes stay whole.
  const auto whole = [&](size_t at) {
    while (at > 0 && at < text.size() && (static_cast<unsigned char>(text[at]) & 0xc0) == 0x80)
      --at;
    return std::min(at, text.size());
  };
  const size_t begin = whole(place < kBefore ? 0 : place - kBefore), end = whole(begin + kMost);
  return (begin > 0 ? "..." : "") + text.substr(begin, end - begin) +
         (end < text.size() ? "..." : "");
}

fs::path manifest_file(const fs::path& work) { return work / "manifest.json"; }

std::string text_of(bool value) { return value ? "true" : "false"; }
std::string text_of(float value) {
  std::array<char, 32> text;
  std::snprintf(text.data(), text.size(), "%.9g", static_cast<double>(value));
  return text.data();
}
template <typename Integer>
std::string text_of(Integer value) {
  return std::to_string(static_cast<uint64_t>(value));
}

std::string number(uint32_t n) {
  std::array<char, 16> text;
  std::snprintf(text.data(), text.size(), "%06u", n);
  return text.data();
}

std::string hexadecimal(uint64_t n) {
  std::array<char, 20> text;
  std::snprintf(text.data(), text.size(), "%016" PRIx64, n);
  return text.data();
}

bool is_temporary(const fs::path& path) {
  const std::string name = path.filename().string();
  return name.starts_with('.') && name.ends_with(".tmp");
}

// What there may be without a manifest, which is a build's first file and its last. Folders of
// others may be called "source" or "t1" as well.
bool is_before_manifest(const fs::directory_entry& entry) {
  const fs::path& path = entry.path();
  if (path.filename() == "lock") return entry.is_regular_file() && entry.file_size() == 0;
  return is_temporary(path) && path.filename().string().starts_with(".manifest.json.");
}

// What a build makes in its folder: files of these names, and folders t0, t1, ...
bool is_own(const fs::path& path) {
  const std::string name = path.filename().string();
  if (name == "manifest.json" || name == "lock" || name == "source" || name == "source_stamp" ||
      is_temporary(path))
    return true;
  return name.size() > 1 && name[0] == 't' &&
         name.find_first_not_of("0123456789", 1) == std::string::npos;
}

}  // namespace

Identity identity_of(const lod::Config& c, const ScaleConfig& scale) {
  Identity fields;
  const auto add = [&](const char* name, const auto& value) {
    fields.emplace_back(name, text_of(value));
  };
  add("unit_triangles", scale.capacity), add("rounds", scale.rounds_of_tier());
  add("max_triangles", c.max_triangles), add("max_vertices", c.max_vertices);
  add("min_triangles", c.min_triangles), add("underfill_cost", c.underfill_cost);
  add("vertex_underfill_cost", c.vertex_underfill_cost), add("overlap_cost", c.overlap_cost);
  add("min_group", c.min_group), add("max_group", c.max_group);
  add("group_underfill_cost", c.group_underfill_cost);
  add("group_overlap_cost", c.group_overlap_cost);
  add("ratio", c.ratio), add("position_step", c.position_step), add("attributes", c.attributes);
  add("normal_weight", c.normal_weight), add("uv_weight", c.uv_weight);
  add("color_weight", c.color_weight), add("tangent_weight", c.tangent_weight);
  add("skin_weight", c.skin_weight), add("keep_area", c.keep_area);
  add("mix_materials", c.mix_materials), add("seams", c.seams), add("creases", c.creases);
  add("refit_attributes", c.refit_attributes), add("max_levels", c.max_levels);
  add("stop_triangles", c.stop_triangles), add("max_error", c.max_error);
  add("lock_borders", c.lock_borders);
  return fields;
}

WorkFolder::WorkFolder(fs::path path, const Identity& identity, bool resume)
    : path_(std::move(path)) {
  make_folder(path_);
  // Before anything is written: a folder of somebody else's stays as it is.
  const bool is_begun = fs::exists(manifest_file(path_));
  for (const fs::directory_entry& entry : fs::directory_iterator(path_))
    if (!(is_begun ? is_own(entry.path()) : is_before_manifest(entry)))
      refuse("the work folder " + path_.string() + " has files that are no build's, such as " +
             entry.path().filename().string() + ": name one that is empty");
  lock();
  remove_temporaries(path_);
  is_resumed_ = fs::exists(manifest_file(path_));
  if (is_resumed_) {
    if (!resume)
      refuse("the work folder " + path_.string() +
             " has a build that was not finished: go on with resume, or remove the folder");
    compare(identity);
    return;
  }
  const std::string manifest = manifest_of(identity);
  OutputFile file(manifest_file(path_));
  file.write(0, std::as_bytes(std::span(manifest)));
  file.commit();
}

void WorkFolder::compare(const Identity& identity) const {
  std::map<std::string, std::string> found = fields_of(manifest_file(path_));
  for (const auto& [name, value] : identity) {
    const auto at = found.find(name);
    const std::string before = at == found.end() ? "nothing" : at->second;
    if (before != value) {
      const auto place = static_cast<size_t>(
          std::mismatch(before.begin(), before.end(), value.begin(), value.end()).first -
          before.begin());
      std::string changed = name;
      changed.append(" was ").append(about(before, place));
      changed.append(" and is now ").append(about(value, place));
      refuse("the build in " + path_.string() + " cannot be resumed: " + changed);
    }
    found.erase(at);
  }
  if (!found.empty())
    refuse("the build in " + path_.string() + " cannot be resumed: it had " + found.begin()->first +
           " " + found.begin()->second);
}

#if defined(UMBEL_POSIX_LOCKS)

void WorkFolder::lock() {
  const fs::path path = path_ / "lock";
  lock_.descriptor = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
  if (lock_.descriptor < 0)
    throw Error(ErrorCode::kIo,
                "cannot write " + path.string() + ": " + std::generic_category().message(errno));
  // It ends with the process, however that ends.
  if (::flock(lock_.descriptor, LOCK_EX | LOCK_NB) == 0) return;
  refuse("another build is at work in " + path_.string());
}

WorkFolder::Lock::~Lock() {
  if (descriptor >= 0) ::close(descriptor);
}

#else

void WorkFolder::lock() {}
WorkFolder::Lock::~Lock() = default;

#endif

void WorkFolder::remove() {
  std::error_code ignored;
  // The manifest last: what is left by a process that is killed here can still be resumed.
  for (const fs::directory_entry& entry : fs::directory_iterator(path_))
    if (is_own(entry.path()) && entry.path() != manifest_file(path_))
      fs::remove_all(entry.path(), ignored);
  fs::remove(manifest_file(path_), ignored);
  fs::remove(path_, ignored);  // if it is empty
}

void remove_temporaries(const fs::path& folder) {
  std::vector<fs::path> found;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder))
    if (entry.is_regular_file() && is_temporary(entry.path())) found.push_back(entry.path());
  std::error_code ignored;
  for (const fs::path& path : found) fs::remove(path, ignored);
}

fs::path tier_folder(const fs::path& work, uint32_t tier) {
  return work / std::string("t").append(std::to_string(tier));
}

fs::path plan_file(const fs::path& work, uint32_t tier) { return tier_folder(work, tier) / "plan"; }

fs::path unit_file(const fs::path& work, const Task& task, const char* what) {
  return tier_folder(work, task.tier) / "unit" /
         (std::string("u").append(number(task.unit)) + what);
}

fs::path shard_file(const fs::path& work, uint32_t tier, uint32_t shard) {
  return tier_folder(work, tier) / "route" / (std::string("s").append(number(shard)) + ".route");
}

fs::path taken_file(const fs::path& work, uint32_t tier) {
  return tier_folder(work, tier) / "taken";
}

fs::path places_file(const fs::path& work, uint32_t tier, uint32_t shard) {
  return shard_file(work, tier, shard).replace_extension(".places");
}

fs::path encode_plan_file(const fs::path& work, uint64_t plan) {
  return tier_folder(work, 0) / std::string("encode-").append(hexadecimal(plan));
}

fs::path chunks_file(const fs::path& work, const Task& task) {
  const std::string ending = std::string(".").append(hexadecimal(task.plan)).append(".chunks");
  return unit_file(work, task, ending.c_str());
}

void make_folder(const fs::path& path) {
  std::error_code error;
  fs::create_directories(path, error);
  if (error)
    throw Error(ErrorCode::kIo, "cannot make the folder " + path.string() + ": " + error.message());
}

void make_tier_folders(const fs::path& work, uint32_t tier) {
  make_folder(tier_folder(work, tier) / "route");
  make_folder(tier_folder(work, tier) / "unit");
}

}  // namespace umbel::scale
