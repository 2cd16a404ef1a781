// Pages are loaded by priority per byte, and evicted for pages of a higher one.
//
// The cut tracker knows what views show and want of the pages in memory. A reference to a group
// that must be refined has the square of how many times its error is too large as its priority (the
// worst errors count, not the number of small ones); a page has the sum over its groups, per byte,
// but not less than any page that is reached through it. So parents are loaded before their
// children, and no page is evicted for one that cannot be shown without it.
#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <utility>

#include "base/math.hpp"
#include "base/printed.hpp"
#include "base/refuse.hpp"
#include "stream/cut_tracker.hpp"
#include "umbel/stream.hpp"

namespace umbel {
namespace {

enum class PageState : uint8_t { kAbsent, kInFlight, kResident };

struct PageSlot {
  std::shared_ptr<const AssetPage> data;
  PageState state = PageState::kAbsent;
  bool pinned = false, was_loaded = false, given_up = false;
  uint32_t failures = 0;
  double not_before = 0, asked_at = 0;
  double last_used = 0;
  uint64_t listed = 0;  // the list of missing pages that it was last put in
};

/// A page that is shown and may be evicted.
struct Candidate {
  float priority;
  uint32_t page;
};

/// A limit of 0 is none.
template <typename Number>
Number limit_of(Number given) {
  return given == 0 ? std::numeric_limits<Number>::max() : given;
}

ResidencyConfig with_limits(ResidencyConfig config) {
  const auto set = [](auto& limit) { limit = limit_of(limit); };
  set(config.budget_bytes), set(config.bytes_per_step), set(config.loads_in_flight);
  set(config.evictions_per_step), set(config.groups_per_step), set(config.attempts);
  return config;
}

void check(const ResidencyConfig& config) {
  const auto at_least = [](const char* name, double value, int least) {
    if (!(value >= least))
      refuse(std::string(name) + " is " + printed(value) + ", but must be at least " +
             std::to_string(least));
  };
  at_least("hysteresis", double{config.hysteresis}, 1);
  at_least("backoff_seconds", config.backoff_seconds, 0);
  at_least("slow_seconds", config.slow_seconds, 0);
}

void check_budget(uint64_t budget, uint64_t pinned) {
  if (budget < pinned)
    refuse("a budget of " + std::to_string(budget) +
           " bytes is too small: the pages of the root groups take " + std::to_string(pinned));
}

void check(const StreamView& view, size_t index, size_t meshes) {
  const auto refuse_view = [&](const std::string& why) {
    refuse("views[" + std::to_string(index) + "]" + why);
  };
  const lod::View& v = view.view;
  const bool by_camera = v.kind == lod::View::Kind::kCamera;
  if (view.mesh >= meshes)
    refuse_view(" is of mesh " + std::to_string(view.mesh) + ", but the asset has " +
                std::to_string(meshes));
  if (!by_camera && v.kind != lod::View::Kind::kError)
    refuse_view(" must be by error or by camera");
  const float limit = by_camera ? v.threshold : v.error;
  if (!(limit >= 0))
    refuse_view(" has the " + std::string(by_camera ? "threshold " : "error ") + printed(limit) +
                ", but it must not be negative");
  if (by_camera && !is_finite(v.eye)) refuse_view(" has an eye that is not finite");
  for (size_t i = 0; i < view.planes.size(); ++i)
    if (!is_finite(view.planes[i].normal) || !std::isfinite(view.planes[i].offset))
      refuse_view(".planes[" + std::to_string(i) + "] is not finite");
}

}  // namespace

struct Residency::State {
  State(const Asset& of, const ResidencyConfig& how)
      : asset(&of), config(with_limits(how)), tracker(of), pages(of.info().pages) {}

  const Asset* asset;
  ResidencyConfig config;
  stream::CutTracker tracker;
  std::unique_ptr<PageLoader> loader;
  std::vector<PageSlot> pages;
  std::vector<uint32_t> resident, in_flight;
  /// Pages that no view shows: when each was last used, and the complement of its number, so that
  /// the first is the one unused longest, and the finer of two.
  std::set<std::pair<double, uint32_t>> unused;
  std::vector<Candidate> candidates;  // the lowest priority last
  bool candidates_are_known = false;
  std::vector<PageArrival> waiting;  // have arrived, for a later step
  uint64_t lists = 0;
  ResidencyStatistics statistics;
  bool is_torn = false;  // a step has begun and not ended: only what is in `pages` holds

  std::unique_ptr<State> mended();

  // ---- loading and evicting

  void install(uint32_t page, std::shared_ptr<const AssetPage> data, double now);
  void evict(uint32_t page);
  void check_and_pin_roots();
  void take_arrivals(double now, StreamStep& result);
  void fail(uint32_t page, const std::string& problem, double now);
  bool make_room(uint64_t bytes, float priority, StreamStep& result);
  uint32_t lowest_priority(float priority);
  void find_candidates();
  void note_use(double now);

  // ---- missing pages

  std::vector<uint32_t> missing_pages();
  void request(double now, StreamStep& result);
  void cancel_stale(StreamStep& result);
  std::pair<double, uint32_t> age(uint32_t page) const { return {pages[page].last_used, ~page}; }
  /// Per byte.
  float priority_of(uint32_t page) const {
    return static_cast<float>(tracker.pages().priority(page) / asset->page_bytes(page));
  }
};

/// After a step that threw: the same pages, loader and statistics, and the rest from the beginning.
std::unique_ptr<Residency::State> Residency::State::mended() {
  auto made = std::make_unique<State>(*asset, config);
  made->statistics = statistics;
  made->statistics.resident_bytes = 0;
  made->statistics.given_up.clear();
  for (uint32_t p = 0; p < pages.size(); ++p) {
    PageSlot& slot = made->pages[p];
    slot = pages[p];
    slot.state = slot.data ? PageState::kResident : PageState::kAbsent;
    slot.listed = 0;
    if (slot.given_up) made->statistics.given_up.push_back(p);
    if (!slot.data) continue;
    made->tracker.install(*slot.data);
    made->resident.push_back(p);
    if (!slot.pinned) made->unused.insert(made->age(p));
    made->statistics.resident_bytes += asset->page_bytes(p);
  }
  for (const uint32_t page : in_flight)
    if (loader) loader->cancel(page);
  made->loader = std::move(loader);
  return made;
}

void Residency::State::install(uint32_t page, std::shared_ptr<const AssetPage> data, double now) {
  PageSlot& slot = pages[page];
  tracker.install(*data);
  slot.data = std::move(data);
  slot.state = PageState::kResident;
  slot.last_used = now;
  slot.failures = 0;
  resident.push_back(page);
  if (!slot.pinned && !tracker.pages().is_wanted(page)) unused.insert(age(page));
  const uint64_t bytes = asset->page_bytes(page);
  statistics.resident_bytes += bytes;
  statistics.loaded_bytes += bytes;
  ++statistics.loads;
  statistics.reloads += slot.was_loaded;
  slot.was_loaded = true;
}

void Residency::State::evict(uint32_t page) {
  PageSlot& slot = pages[page];
  unused.erase(age(page));
  tracker.remove(page);
  slot.data.reset();
  slot.state = PageState::kAbsent;
  resident.erase(std::find(resident.begin(), resident.end(), page));
  const uint64_t bytes = asset->page_bytes(page);
  statistics.resident_bytes -= bytes;
  statistics.evicted_bytes += bytes;
  ++statistics.evictions;
}

void Residency::State::check_and_pin_roots() {
  check(config);
  uint64_t bytes = 0;
  for (uint32_t m = 0; m < asset->meshes().size(); ++m)
    for (const GroupRef& root : asset->roots(m)) {
      PageSlot& slot = pages[root.page];
      if (!slot.pinned) bytes += asset->page_bytes(root.page);
      slot.pinned = true;
    }
  check_budget(config.budget_bytes, bytes);
  statistics.pinned_bytes = bytes;
  for (uint32_t p = 0; p < pages.size(); ++p)
    if (pages[p].pinned) install(p, std::make_shared<const AssetPage>(asset->read_page(p)), 0);
}

/// Updates `unused` for pages that have become wanted, or ceased to be.
void Residency::State::note_use(double now) {
  for (const uint32_t page : tracker.take_changed()) {
    PageSlot& slot = pages[page];
    if (slot.pinned || slot.state != PageState::kResident) continue;
    unused.erase(age(page));
    slot.last_used = now;
    if (!tracker.pages().is_wanted(page)) unused.insert(age(page));
  }
}

/// Lists pages that are shown and through which no other is. A missing page's priority counts for
/// the pages through which it is reached.
void Residency::State::find_candidates() {
  std::vector<float> inherited(pages.size());
  for (const uint32_t page : missing_pages()) {
    const float priority = priority_of(page);
    tracker.for_each_page_above(
        page, [&](uint32_t above) { inherited[above] = std::max(inherited[above], priority); });
  }
  candidates.clear();
  for (const uint32_t page : resident)
    if (!pages[page].pinned && tracker.pages().is_wanted(page) && tracker.pages().is_leaf(page))
      candidates.push_back({std::max(priority_of(page), inherited[page]), page});
  std::sort(candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
    return a.priority != b.priority ? a.priority > b.priority : a.page < b.page;
  });
  candidates_are_known = true;
}

/// The resident page to evict for one of the given priority, or kNone: first pages that no view
/// shows, unused longest first; then the shown page of the lowest priority, if that is low enough.
uint32_t Residency::State::lowest_priority(float priority) {
  if (!unused.empty()) return ~unused.begin()->second;
  if (!candidates_are_known) find_candidates();
  const auto is_gone = [&](uint32_t page) {
    return pages[page].state != PageState::kResident || !tracker.pages().is_leaf(page);
  };
  while (!candidates.empty() && is_gone(candidates.back().page)) candidates.pop_back();
  const bool any = !candidates.empty() && candidates.back().priority < priority / config.hysteresis;
  return any ? candidates.back().page : kNone;
}

bool Residency::State::make_room(uint64_t bytes, float priority, StreamStep& result) {
  while (statistics.resident_bytes + bytes > config.budget_bytes) {
    if (result.evicted >= config.evictions_per_step) return false;
    const uint32_t page = lowest_priority(priority);
    if (page == kNone) return false;
    evict(page);
    ++result.evicted;
  }
  return true;
}

void Residency::State::fail(uint32_t page, const std::string& problem, double now) {
  PageSlot& slot = pages[page];
  ++statistics.failures;
  statistics.last_problem = problem;
  if (++slot.failures >= config.attempts) {
    slot.given_up = true;
    statistics.given_up.push_back(page);
    return;
  }
  slot.not_before =
      now + config.backoff_seconds * std::exp2(static_cast<double>(slot.failures - 1));
}

void Residency::State::take_arrivals(double now, StreamStep& result) {
  for (PageArrival& arrival : loader->poll()) {
    const bool is_expected = std::erase(in_flight, arrival.page) > 0;
    if (arrival.data) {
      waiting.push_back(std::move(arrival));
    } else if (is_expected) {  // else it was slow, and has failed already
      pages[arrival.page].state = PageState::kAbsent;
      fail(arrival.page, arrival.problem, now);
    }
  }
  uint64_t taken = 0;
  size_t used = 0;
  for (; used < waiting.size(); ++used) {
    PageArrival& arrival = waiting[used];
    PageSlot& slot = pages[arrival.page];
    if (slot.state == PageState::kResident) continue;
    const uint64_t bytes = asset->page_bytes(arrival.page);
    if (taken > 0 && taken + bytes > config.bytes_per_step) break;
    std::erase(in_flight, arrival.page);  // asked for again, after it was slow
    slot.state = PageState::kAbsent;
    // By the priority of the last step, which requested it.
    if (!make_room(bytes, priority_of(arrival.page), result)) {
      ++statistics.refused;
      continue;
    }
    taken += bytes;
    if (std::exchange(slot.given_up, false)) std::erase(statistics.given_up, arrival.page);
    install(arrival.page, std::move(arrival.data), now);
    ++result.loaded;
  }
  waiting.erase(waiting.begin(), waiting.begin() + static_cast<ptrdiff_t>(used));
  for (size_t i = in_flight.size(); i-- > 0;) {
    const uint32_t page = in_flight[i];
    if (now - pages[page].asked_at <= config.slow_seconds) continue;
    ++statistics.slow_loads;
    pages[page].state = PageState::kAbsent;
    in_flight.erase(in_flight.begin() + static_cast<ptrdiff_t>(i));
    fail(page, "page " + std::to_string(page) + " took longer than slow_seconds", now);
  }
}

/// Pages that are wanted and not in memory.
std::vector<uint32_t> Residency::State::missing_pages() {
  ++lists;
  std::vector<uint32_t> missing;
  for (const stream::MissingList::Missing& group : tracker.missing()) {
    const uint32_t page = tracker.page_of(group);
    if (std::exchange(pages[page].listed, lists) != lists) missing.push_back(page);
  }
  return missing;
}

void Residency::State::cancel_stale(StreamStep& result) {
  for (size_t i = in_flight.size(); i-- > 0;) {
    const uint32_t page = in_flight[i];
    if (tracker.pages().is_wanted(page) || !loader->cancel(page)) continue;
    pages[page].state = PageState::kAbsent;
    in_flight.erase(in_flight.begin() + static_cast<ptrdiff_t>(i));
    ++statistics.cancellations;
    ++result.cancelled;
  }
}

void Residency::State::request(double now, StreamStep& result) {
  const size_t room =
      config.loads_in_flight - std::min<size_t>(in_flight.size(), config.loads_in_flight);
  if (room == 0) return;
  std::vector<Candidate> wanted;
  for (const uint32_t page : missing_pages()) {
    const PageSlot& slot = pages[page];
    if (slot.state == PageState::kAbsent && !slot.given_up && now >= slot.not_before)
      wanted.push_back({priority_of(page), page});
  }
  const size_t asked = std::min(room, wanted.size());
  std::partial_sort(wanted.begin(), wanted.begin() + static_cast<ptrdiff_t>(asked), wanted.end(),
                    [](const Candidate& a, const Candidate& b) {
                      return a.priority != b.priority ? a.priority > b.priority : a.page < b.page;
                    });
  wanted.resize(asked);
  uint64_t coming = 0;
  for (const uint32_t page : in_flight) coming += asset->page_bytes(page);
  for (const auto& [priority, page] : wanted) {
    // What would not fit on arrival is not requested.
    const uint64_t bytes = asset->page_bytes(page);
    const bool fits = statistics.resident_bytes + coming + bytes <= config.budget_bytes;
    if (!fits && lowest_priority(priority) == kNone) break;
    coming += bytes;
    pages[page].state = PageState::kInFlight;
    pages[page].asked_at = now;
    in_flight.push_back(page);
    loader->request(page);
    ++result.requested;
  }
}

Residency::Residency(const Asset& asset, const ResidencyConfig& config,
                     std::unique_ptr<PageLoader> loader)
    : state_(std::make_unique<State>(asset, config)) {
  State& state = *state_;
  state.check_and_pin_roots();
  // More threads than loads would have nothing to do, and a system may refuse to start them.
  const uint32_t threads = std::min(config.threads, state.config.loads_in_flight);
  state.loader = loader ? std::move(loader) : make_thread_loader(asset, threads);
}

Residency::Residency(Residency&&) noexcept = default;
Residency& Residency::operator=(Residency&&) noexcept = default;
Residency::~Residency() = default;

StreamStep Residency::step(std::span<const StreamView> views, double now) {
  if (!std::isfinite(now)) refuse("now is " + printed(now) + ", but must be finite");
  for (size_t i = 0; i < views.size(); ++i) check(views[i], i, state_->asset->meshes().size());
  if (state_->is_torn) state_ = state_->mended();
  State& state = *state_;
  StreamStep result;
  state.is_torn = true;
  state.candidates_are_known = false;
  if (state.loader) state.take_arrivals(now, result);
  const uint64_t before = state.tracker.work();
  result.caught_up = state.tracker.follow(views, state.config.groups_per_step);
  result.evaluated = static_cast<uint32_t>(state.tracker.work() - before);
  state.note_use(now);
  state.candidates_are_known = false;
  if (state.loader) {
    state.cancel_stale(result);
    state.request(now, result);
  }
  result.open_groups = state.tracker.open_groups();
  result.missing_groups = static_cast<uint32_t>(state.tracker.missing().size());
  for (const stream::MissingList::Missing& group : state.tracker.missing())
    result.worst_error = std::max(result.worst_error, group.ratio);
  ++state.statistics.steps;
  state.is_torn = false;
  return result;
}

std::span<const StreamCluster> Residency::cut() const {
  if (state_->is_torn) return {};
  return state_->tracker.cut();
}

std::shared_ptr<const AssetPage> Residency::page(uint32_t page) const {
  return page < state_->pages.size() ? state_->pages[page].data : nullptr;
}

std::vector<uint32_t> Residency::resident_pages() const {
  std::vector<uint32_t> pages = state_->resident;
  std::sort(pages.begin(), pages.end());
  return pages;
}

std::vector<uint32_t> Residency::wanted_pages() const {
  std::vector<uint32_t> pages;
  for (uint32_t p = 0; p < state_->pages.size(); ++p)
    if (state_->tracker.pages().is_wanted(p)) pages.push_back(p);
  return pages;
}

ResidencyStatistics Residency::statistics() const {
  ResidencyStatistics statistics = state_->statistics;
  statistics.resident_pages = static_cast<uint32_t>(state_->resident.size());
  statistics.in_flight = static_cast<uint32_t>(state_->in_flight.size());
  return statistics;
}

void Residency::retry_failed() {
  for (const uint32_t page : state_->statistics.given_up) {
    state_->pages[page].given_up = false;
    state_->pages[page].failures = 0;
  }
  state_->statistics.given_up.clear();
}

void Residency::close() {
  state_->loader.reset();
  state_->in_flight.clear();
}

void Residency::set_budget(uint64_t bytes) {
  const uint64_t budget = limit_of(bytes);
  check_budget(budget, state_->statistics.pinned_bytes);
  state_->config.budget_bytes = budget;
}

}  // namespace umbel
