// Residency: which pages of an asset are in memory, within a budget of bytes, as cameras move.
//
// Each frame calls Residency::step with its views, then draws Residency::cut. What is not in memory
// yet is shown coarser and loads in the background. A group is open, and shown finer, only if its
// page is in memory and all groups that were made from it are open, so the cut has no hole and no
// overlap whatever is missing. docs/streaming.md explains the choice of pages.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "umbel/asset.hpp"
#include "umbel/lod/select.hpp"

namespace umbel {

/// In all whole numbers but `threads`, 0 is no limit.
struct ResidencyConfig {
  /// Most bytes of pages in memory, counted as in the file. The pages of root groups always stay in
  /// memory and count.
  uint64_t budget_bytes = uint64_t{256} << 20;
  uint32_t loads_in_flight = 8;  ///< most pages requested and not arrived
  uint64_t bytes_per_step = uint64_t{8}
                            << 20;  ///< most bytes taken over in a step; at least one page
  uint32_t evictions_per_step = 64;
  /// Groups that a step evaluates, about; the rest stay as they are until the next. A camera in
  /// motion needs some hundreds a step, a jump all that it then shows.
  uint32_t groups_per_step = 4096;
  /// A page that is shown is evicted only for one of so many times its priority, >= 1.
  float hysteresis = 1.5f;
  uint32_t attempts = 5;         ///< to load a page, before its region stays coarse
  double backoff_seconds = 0.1;  ///< after the first failure; doubled after each further one
  /// A load that takes longer counts as failed; a late arrival is still used.
  double slow_seconds = 10;
  uint32_t threads = 2;  ///< that read and decode pages, if no loader is given
};

/// A page that a loader has loaded, or why it could not.
struct PageArrival {
  uint32_t page = 0;
  std::shared_ptr<const AssetPage> data;  ///< null where it failed
  std::string problem;
};

/// Loads pages. Called from the thread that calls Residency::step, and must not block it.
class PageLoader {
 public:
  virtual ~PageLoader() = default;
  virtual void request(uint32_t page) = 0;
  /// The page is no longer wanted. True if it will not arrive.
  virtual bool cancel(uint32_t page) = 0;
  /// Arrivals since the last call.
  virtual std::vector<PageArrival> poll() = 0;
};

/// Reads pages of `asset`, which must outlive it, on `threads` threads. Its destructor waits for
/// reads in progress.
UMBEL_API std::unique_ptr<PageLoader> make_thread_loader(const Asset& asset, uint32_t threads);

/// A link to a server or a disk, for simulations.
struct LinkModel {
  double latency_seconds = 0.05;
  double bytes_per_second = 20e6;
  /// Share of loads that fail, [0, 1]: a third each arrive empty, short, and corrupt.
  double failure_rate = 0;
  double slow_rate = 0;  ///< share of loads that take ten times as long, [0, 1]
  uint32_t seed = 1;
};
/// Simulates loading pages of `asset` over the link. The caller sets `*clock`, in seconds, before
/// each step. Reads all pages at once, here. Deterministic.
UMBEL_API std::unique_ptr<PageLoader> make_model_loader(const Asset& asset, const LinkModel& link,
                                                        std::shared_ptr<const double> clock);

/// What is seen of one mesh: a view of the kind kError or kCamera, in the mesh's own space,
/// relative to the asset's origin. What lies outside a plane is shown as coarse as possible.
struct StreamView {
  uint32_t mesh = 0;
  lod::View view;
  std::vector<lod::Plane> planes{};
};

/// A cluster of a cut: AssetPage::groups[group], of that clusters[cluster]. `view` is an index into
/// the views of the step.
struct StreamCluster {
  uint32_t view, page, group, cluster;
  bool operator==(const StreamCluster&) const = default;
};

struct StreamStep {
  /// The largest error of missing groups, in units of what their view allows, within two per cent.
  /// 0 if nothing is missing.
  float worst_error = 0;
  uint32_t open_groups = 0, missing_groups = 0;
  uint32_t loaded = 0, evicted = 0, requested = 0, cancelled = 0;
  uint32_t evaluated = 0;  ///< groups, see ResidencyConfig::groups_per_step
  /// Whether the cut is that of these views; else the next step goes on.
  bool caught_up = true;
};

struct ResidencyStatistics {
  uint64_t steps = 0;
  uint64_t resident_bytes = 0, pinned_bytes = 0, loaded_bytes = 0, evicted_bytes = 0;
  uint64_t loads = 0, reloads = 0, evictions = 0, cancellations = 0;
  uint64_t failures = 0, slow_loads = 0;
  uint64_t refused = 0;  ///< pages that arrived when others had higher priorities
  uint32_t resident_pages = 0, in_flight = 0;
  std::vector<uint32_t>
      given_up;  ///< pages that failed `attempts` times: their regions stay coarse
  std::string last_problem;
};

/// For one thread at a time; loading runs on threads of its own.
class UMBEL_API Residency {
 public:
  /// Reads the pages of all root groups. `asset` must outlive it. Throws kInvalidArgument for a
  /// budget that does not hold them or a configuration out of range, and what reading throws.
  explicit Residency(const Asset& asset, const ResidencyConfig& config = {},
                     std::unique_ptr<PageLoader> loader = nullptr);
  Residency(Residency&&) noexcept;
  Residency& operator=(Residency&&) noexcept;
  ~Residency();

  /// Takes over pages that have arrived, updates the cut, evicts pages, and requests missing ones.
  /// `now` is in seconds on any clock that does not run backwards. Throws kInvalidArgument for a
  /// view or a time out of range, and changes nothing then. Where it throws std::bad_alloc, or what
  /// a loader throws, the cut is empty until the next step, which begins again with the pages in
  /// memory.
  StreamStep step(std::span<const StreamView> views, double now);
  /// The clusters that the views of the last step show, in no order. A step costs what changes, if
  /// views keep their indices.
  std::span<const StreamCluster> cut() const;
  /// A page in memory, or null.
  std::shared_ptr<const AssetPage> page(uint32_t page) const;
  /// Pages in memory, ascending.
  std::vector<uint32_t> resident_pages() const;
  /// Pages that the last step's views need, whether in memory or not, ascending.
  std::vector<uint32_t> wanted_pages() const;
  ResidencyStatistics statistics() const;
  /// Tries again to load the pages of ResidencyStatistics::given_up.
  void retry_failed();
  void set_budget(uint64_t bytes);  ///< as ResidencyConfig::budget_bytes
  /// Stops loading and waits for reads in progress. Pages in memory stay.
  void close();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace umbel
