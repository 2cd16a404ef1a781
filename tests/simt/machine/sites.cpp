#include "sites.hpp"

#include <dlfcn.h>

#include <cstdio>
#include <cstdlib>
#include <map>
#include <set>

namespace umbel::simt {
namespace {

class Sites {
 public:
  Sites() {
    if (const char* list = getenv("SIMT_SKIP"))
      for (char* end = nullptr; *list != 0; list = *end ? end + 1 : end) {
        const uintptr_t address = strtoull(list, &end, 16);
        if (end == list) break;
        skipped_.insert(address);
      }
  }
  ~Sites() {
    const char* path = getenv("SIMT_SITES");
    FILE* file = path ? fopen(path, "w") : nullptr;
    if (!file) return;
    constexpr const char* kNames[] = {"block", "warp", "grid", "fence", "release"};
    for (const auto& [address, kind] : seen_)
      fprintf(file, "%s %zx\n", kNames[uint32_t(kind)], size_t(address));
    fclose(file);
  }
  bool note(SiteKind kind, const void* caller) {
    if (!base_) {
      Dl_info info;
      if (dladdr(caller, &info) == 0) return false;
      base_ = reinterpret_cast<uintptr_t>(info.dli_fbase);
    }
    // An address in the call, not behind it.
    const uintptr_t address = reinterpret_cast<uintptr_t>(caller) - 1 - base_;
    seen_.try_emplace(address, kind);
    return skipped_.contains(address);
  }

 private:
  uintptr_t base_ = 0;
  std::set<uintptr_t> skipped_;
  std::map<uintptr_t, SiteKind> seen_;
};

}  // namespace

bool is_skipped(SiteKind kind, const void* caller) {
  static const bool is_asked = getenv("SIMT_SITES") || getenv("SIMT_SKIP");
  if (!is_asked) return false;
  static Sites sites;
  return sites.note(kind, caller);
}

}  // namespace umbel::simt
