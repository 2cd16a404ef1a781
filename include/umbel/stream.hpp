// Residency: which pages of an asset are in memory, under a budget of bytes, as cameras move.
//
// Each frame asks for what its views would show; what is not there yet is shown coarser, and loads
// in the background. A group is open, and shown finer, only if its page is there and all groups
// that were made from it are open, so what is shown has no hole and no overlap whatever is missing.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "umbel/asset.hpp"
#include "umbel/lod.hpp"
#include "umbel/lod_select.hpp"

namespace umbel {

struct ResidencyConfig {
  /// Most bytes of pages in memory, as they are in the file. The pages of root groups are always
  /// there and count.
  uint64_t budget_bytes = uint64_t{256} << 20;
  uint32_t loads_in_flight = 8;                 ///< pages asked for and not there yet
  uint64_t bytes_per_step = uint64_t{8} << 20;  ///< taken over in a step, or one page
  uint32_t evictions_per_step = 64;
  /// Groups that a step looks at, about; what is left is looked at in the next, and until then as
  /// it was. A camera that walks needs some hundreds of them, one that leaps all that it then
  /// shows.
  uint32_t groups_per_step = 4096;
  /// A page that is shown gives way to another only if that one is worth so many times as much.
  float hysteresis = 1.5f;
  uint32_t attempts = 5;         ///< to load a page, before it stays coarse
  double backoff_seconds = 0.1;  ///< after the first failure; twice as long after each further one
  /// A load that takes longer counts as failed; what it brings later is taken all the same.
  double slow_seconds = 10;
  uint32_t threads = 2;  ///< that read and decode pages, where no loader is given
};

/// A page that a loader brings, or why it cannot.
struct PageArrival {
  uint32_t page = 0;
  std::shared_ptr<const AssetPage> data;  ///< null where it failed
  std::string problem;
};

/// Brings pages. Called from the thread that steps, and must not block it.
class PageLoader {
 public:
  virtual ~PageLoader() = default;
  virtual void request(uint32_t page) = 0;
  /// The page is not wanted any more; it may come all the same. True if it will not.
  virtual bool cancel(uint32_t page) = 0;
  /// What has come since the last call.
  virtual std::vector<PageArrival> poll() = 0;
};

/// Reads pages of `asset`, which must outlive it, on `threads` threads. Its end waits for reads
/// that are under way.
UMBEL_API std::unique_ptr<PageLoader> make_thread_loader(const Asset& asset, uint32_t threads);

/// A line to a server or a disk, for simulations.
struct LinkModel {
  double latency_seconds = 0.05;
  double bytes_per_second = 20e6;
  /// Of loads that fail when they would have come, [0, 1]: a third each bring nothing, too few
  /// bytes, and wrong ones.
  double failure_rate = 0;
  double slow_rate = 0;  ///< of loads that take ten times the latency and time
  uint32_t seed = 1;
};
/// Brings pages of `asset` as the line would by `*clock`, in seconds, which the caller sets before
/// each step. All pages are read at once, here. Deterministic.
UMBEL_API std::unique_ptr<PageLoader> make_model_loader(const Asset& asset, const LinkModel& link,
                                                        std::shared_ptr<const double> clock);

/// One mesh as somebody sees it: kError or kCamera, in the mesh's own space, relative to the
/// asset's origin. What lies outside a plane is shown as coarse as it may be.
struct StreamView {
  uint32_t mesh = 0;
  lod::View view;
  std::vector<lod::Plane> planes{};
};

/// A cluster of a cut: clusters[cluster] of groups[group] of the page.
struct StreamCluster {
  uint32_t view, page, group, cluster;
  bool operator==(const StreamCluster&) const = default;
};

struct StreamStep {
  /// What is missing, at worst: how many times larger the error of something shown is than its
  /// view asked for, within two per cent. 1 or less where nothing is missing.
  float worst_error = 0;
  uint32_t open_groups = 0, missing_groups = 0;
  uint32_t loaded = 0, evicted = 0, requested = 0, cancelled = 0;
  uint32_t looked_at = 0;  ///< groups, see ResidencyConfig::groups_per_step
  /// Whether all of it is as these views have it; else there was too much to look at for one step.
  bool caught_up = true;
};

struct ResidencyStatistics {
  uint64_t steps = 0;
  uint64_t resident_bytes = 0, pinned_bytes = 0, loaded_bytes = 0, evicted_bytes = 0;
  uint64_t loads = 0, reloads = 0, evictions = 0, cancellations = 0;
  uint64_t failures = 0, slow_loads = 0;
  uint64_t refused = 0;  ///< pages that came and were not worth their place any more
  uint32_t resident_pages = 0, in_flight = 0;
  std::vector<uint32_t> given_up;  ///< pages that failed too often, and so stay coarse
  std::string last_problem;
};

/// Not safe to use from several threads at once; loads run on their own.
class UMBEL_API Residency {
 public:
  /// Reads the pages of all root groups. `asset` must outlive it. Throws kInvalidArgument for a
  /// budget that does not hold them or a configuration out of range, and what reading throws.
  explicit Residency(const Asset& asset, const ResidencyConfig& config = {},
                     std::unique_ptr<PageLoader> loader = nullptr);
  Residency(Residency&&) noexcept;
  Residency& operator=(Residency&&) noexcept;
  ~Residency();

  /// Takes over what has come, chooses what the views show of it, and asks for what is missing.
  /// `now` are seconds on any clock that does not run backwards.
  StreamStep step(std::span<const StreamView> views, double now);
  /// What the views of the last step show, in no order. A change of the views of a step costs what
  /// changes, if they keep their places among them.
  std::span<const StreamCluster> cut() const;
  /// A page that is in memory, or null.
  std::shared_ptr<const AssetPage> page(uint32_t page) const;
  /// Pages that are in memory, ascending.
  std::vector<uint32_t> resident_pages() const;
  /// Pages that the last step's views show, or would: ascending.
  std::vector<uint32_t> wanted_pages() const;
  ResidencyStatistics statistics() const;
  /// Tries pages again that were given up.
  void forgive();
  void set_budget(uint64_t bytes);
  /// Ends loading, and waits for reads that are under way; pages stay, and nothing more comes.
  void close();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace umbel
