// Pages come for what they are worth a byte and go when others are worth more.
//
// Selection walks from the roots through the references of groups that are open, and needs nothing
// but pages that are there. A reference to a group that must be refined is worth how many times its
// error is too large, a page the sum over its groups, a byte; but not less than any page that is
// reached through it. So parents come before their children, and no page is given up for one that
// cannot be shown without it.
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "base/math.hpp"
#include "lod/cull.hpp"
#include "umbel/stream.hpp"

namespace umbel {
namespace {

/// How many times too large an error is as seen from a view; 0 where it is small enough.
float times_too_large(const Sphere& sphere, float error, const StreamView& seen) {
  if (error != std::numeric_limits<float>::infinity() && lod::is_outside(sphere, seen.planes))
    return 0;
  return lod::times_too_large(sphere, error, seen.view);
}

enum class PageState : uint8_t { kAbsent, kInFlight, kResident };

/// What a walk reads of a page's groups, close together: the pages of a large cut are far more than
/// caches hold.
struct WalkTable {
  struct Entry {
    uint32_t mesh, group, first_child, first_cluster;
  };
  std::vector<Entry> groups;  // and one behind the last
  std::vector<GroupRef> children;
  std::vector<uint32_t> made_from;  // of each cluster, or kNone
};

WalkTable walk_table(const AssetPage& page) {
  WalkTable table;
  table.groups.reserve(page.groups.size() + 1);
  const auto add = [&](uint32_t mesh, uint32_t group) {
    table.groups.push_back({mesh, group, static_cast<uint32_t>(table.children.size()),
                            static_cast<uint32_t>(table.made_from.size())});
  };
  for (const PageGroup& group : page.groups) {
    add(group.mesh, group.id);
    table.children.insert(table.children.end(), group.children.begin(), group.children.end());
    for (const lod::Cluster& cluster : group.clusters)
      table.made_from.push_back(cluster.generating_group);
  }
  add(kNone, kNone);
  return table;
}

struct PageSlot {
  std::shared_ptr<const AssetPage> data;
  WalkTable table;
  PageState state = PageState::kAbsent;
  bool pinned = false, was_loaded = false, given_up = false;
  uint32_t failures = 0;
  double not_before = 0, asked_at = 0;
  double last_used = -std::numeric_limits<double>::infinity();
  // Of the current step:
  uint64_t step = 0;
  float worth = 0;                 // a byte
  bool is_open = false;            // a group in it is open
  bool has_open_children = false;  // in another page
};

/// A group as the walk of one view meets it.
struct Visit {
  uint64_t walk = 0;
  uint32_t parents = 0;
  float ratio = 0;       ///< how many times too large its error is; 0: it is not
  uint32_t in_page = 0;  ///< where the group is in its page, while that is there
};

struct OpenGroup {
  uint32_t page, index;
};

/// Which groups of a mesh are open: a bit each, so that all of it stays near.
class OpenSet {
 public:
  void clear(size_t groups) { words_.assign((groups + 63) / 64, 0); }
  void insert(uint32_t group) { words_[group / 64] |= uint64_t{1} << group % 64; }
  bool contains(uint32_t group) const { return (words_[group / 64] >> group % 64 & 1) != 0; }

 private:
  std::vector<uint64_t> words_;
};

/// Something in one page was reached through another.
struct PageLink {
  uint32_t from, to;
};

}  // namespace

struct Residency::State {
  const Asset* asset;
  ResidencyConfig config;
  std::unique_ptr<PageLoader> loader;
  std::vector<PageSlot> pages;
  std::vector<std::vector<Visit>> visits;  // by mesh and group
  std::vector<uint32_t> resident, in_flight, touched;
  std::vector<OpenGroup> open;
  OpenSet is_open;  // of the mesh of the view
  std::vector<PageLink> links;
  std::vector<PageArrival> waiting;  // have come, for a later step
  std::vector<StreamCluster> cut;
  uint64_t walk = 0, step_number = 0;
  ResidencyStatistics statistics;

  // ---- pages come and go

  void install(uint32_t page, std::shared_ptr<const AssetPage> data, double now);
  void evict(uint32_t page);
  void check_and_pin_roots();
  void take_arrivals(double now, ResidencyStep& result);
  void fail(uint32_t page, const std::string& problem, double now);
  bool make_room(uint64_t bytes, float worth, ResidencyStep& result);
  uint32_t least_worthy(float worth) const;

  // ---- what is shown

  PageSlot& touch(uint32_t page);
  void select(uint32_t index, const StreamView& view, double now, ResidencyStep& result);
  void ask(double now, ResidencyStep& result);
  void cancel_stale(ResidencyStep& result);
  void hand_worth_up();
  float worth_of(uint32_t page) const {
    return pages[page].step == step_number ? pages[page].worth : 0;
  }
};

void Residency::State::install(uint32_t page, std::shared_ptr<const AssetPage> data, double now) {
  PageSlot& slot = pages[page];
  for (uint32_t i = 0; i < data->groups.size(); ++i)
    visits[data->groups[i].mesh][data->groups[i].id].in_page = i;
  slot.table = walk_table(*data);
  slot.data = std::move(data);
  slot.state = PageState::kResident;
  slot.last_used = now;
  slot.failures = 0;
  resident.push_back(page);
  const uint64_t bytes = asset->page_bytes(page);
  statistics.resident_bytes += bytes;
  statistics.loaded_bytes += bytes;
  ++statistics.loads;
  statistics.reloads += slot.was_loaded;
  slot.was_loaded = true;
}

void Residency::State::evict(uint32_t page) {
  PageSlot& slot = pages[page];
  slot.data.reset();
  slot.table = {};
  slot.state = PageState::kAbsent;
  resident.erase(std::find(resident.begin(), resident.end(), page));
  const uint64_t bytes = asset->page_bytes(page);
  statistics.resident_bytes -= bytes;
  statistics.evicted_bytes += bytes;
  ++statistics.evictions;
}

void Residency::State::check_and_pin_roots() {
  const auto in_range = [](double value) { return value >= 0; };
  if (!in_range(config.backoff_seconds) || !in_range(config.slow_seconds) ||
      !(config.hysteresis >= 1) || config.attempts == 0 || config.loads_in_flight == 0)
    throw Error(ErrorCode::kInvalidArgument,
                "a residency's times must not be negative, its hysteresis at least 1, and its "
                "attempts and loads_in_flight at least 1");
  uint64_t bytes = 0;
  for (uint32_t m = 0; m < asset->meshes().size(); ++m)
    for (const GroupRef& root : asset->roots(m)) {
      PageSlot& slot = pages[root.page];
      if (!slot.pinned) bytes += asset->page_bytes(root.page);
      slot.pinned = true;
    }
  if (bytes > config.budget_bytes)
    throw Error(ErrorCode::kInvalidArgument,
                "budget_bytes is " + std::to_string(config.budget_bytes) +
                    ", but the pages of the root groups take " + std::to_string(bytes));
  statistics.pinned_bytes = bytes;
  for (uint32_t p = 0; p < pages.size(); ++p)
    if (pages[p].pinned) install(p, std::make_shared<const AssetPage>(asset->read_page(p)), 0);
}

/// The resident page that may go for one of the given worth, or kNone: first what nobody shows, the
/// longest first and the finer of two; then what is worth least, if that is little enough.
uint32_t Residency::State::least_worthy(float worth) const {
  uint32_t unused = kNone, least = kNone;
  float least_worth = worth / config.hysteresis;
  for (const uint32_t page : resident) {
    const PageSlot& slot = pages[page];
    if (slot.pinned) continue;
    if (slot.step != step_number) {
      const bool is_older = unused == kNone || slot.last_used < pages[unused].last_used ||
                            (slot.last_used == pages[unused].last_used && page > unused);
      if (is_older) unused = page;
    } else if (!slot.has_open_children && slot.worth < least_worth) {
      least = page, least_worth = slot.worth;
    }
  }
  return unused != kNone ? unused : least;
}

bool Residency::State::make_room(uint64_t bytes, float worth, ResidencyStep& result) {
  while (statistics.resident_bytes + bytes > config.budget_bytes) {
    if (result.evicted >= config.evictions_per_step) return false;
    const uint32_t page = least_worthy(worth);
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

void Residency::State::take_arrivals(double now, ResidencyStep& result) {
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
    // Its worth is that of the last step, which asked for it.
    if (!make_room(bytes, worth_of(arrival.page), result)) {
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

PageSlot& Residency::State::touch(uint32_t page) {
  PageSlot& slot = pages[page];
  if (slot.step != step_number) {
    slot.step = step_number;
    slot.worth = 0;
    slot.is_open = slot.has_open_children = false;
    touched.push_back(page);
  }
  return slot;
}

void Residency::State::select(uint32_t index, const StreamView& view, double now,
                              ResidencyStep& result) {
  ++walk;
  open.clear();
  std::vector<Visit>& notes = visits[view.mesh];
  is_open.clear(notes.size());
  const auto meet = [&](const GroupRef& reference, uint32_t from_page) {
    Visit& visit = notes[reference.group];
    // All references to a group say the same of it.
    if (visit.walk != walk)
      visit = {walk, 0, times_too_large(reference.sphere, reference.error, view), visit.in_page};
    const float ratio = visit.ratio;
    if (!(ratio > 0)) return;
    ++visit.parents;
    PageSlot& slot = touch(reference.page);
    const bool is_there = slot.state == PageState::kResident;
    if (visit.parents == 1)
      slot.worth += ratio / static_cast<float>(asset->page_bytes(reference.page));
    if (from_page != kNone && from_page != reference.page &&
        (links.empty() || links.back().from != from_page || links.back().to != reference.page))
      links.push_back({from_page, reference.page});
    if (!is_there) result.worst_error = std::max(result.worst_error, ratio);
    if (visit.parents == 1 && !is_there) ++result.missing_groups;
    if (visit.parents < reference.parents || !is_there || is_open.contains(reference.group)) return;
    // A file may refer to a page that does not have the group.
    const std::vector<WalkTable::Entry>& groups = slot.table.groups;
    if (visit.in_page >= groups.size() || groups[visit.in_page].group != reference.group ||
        groups[visit.in_page].mesh != view.mesh)
      return;
    is_open.insert(reference.group);
    slot.is_open = true;
    slot.last_used = now;
    open.push_back({reference.page, visit.in_page});
  };
  for (const GroupRef& root : asset->roots(view.mesh)) meet(root, kNone);
  for (size_t next = 0; next < open.size(); ++next) {
    const OpenGroup at = open[next];
    const WalkTable& table = pages[at.page].table;
    const uint32_t end = table.groups[at.index + 1].first_child;
    for (uint32_t i = table.groups[at.index].first_child; i < end; ++i)
      meet(table.children[i], at.page);
  }
  for (const OpenGroup& at : open) {
    const WalkTable& table = pages[at.page].table;
    const WalkTable::Entry &entry = table.groups[at.index], &after = table.groups[at.index + 1];
    for (uint32_t i = entry.first_child; i < after.first_child; ++i)
      if (table.children[i].page != at.page && is_open.contains(table.children[i].group))
        pages[at.page].has_open_children = true;
    for (uint32_t i = entry.first_cluster; i < after.first_cluster; ++i)
      if (table.made_from[i] == kNone || !is_open.contains(table.made_from[i]))
        cut.push_back({index, at.page, at.index, i - entry.first_cluster});
  }
  result.open_groups += static_cast<uint32_t>(open.size());
}

/// Links are in the order from coarse to fine.
void Residency::State::hand_worth_up() {
  for (size_t i = links.size(); i-- > 0;)
    pages[links[i].from].worth = std::max(pages[links[i].from].worth, pages[links[i].to].worth);
}

void Residency::State::cancel_stale(ResidencyStep& result) {
  for (size_t i = in_flight.size(); i-- > 0;) {
    const uint32_t page = in_flight[i];
    if (pages[page].step == step_number || !loader->cancel(page)) continue;
    pages[page].state = PageState::kAbsent;
    in_flight.erase(in_flight.begin() + static_cast<ptrdiff_t>(i));
    ++statistics.cancellations;
    ++result.cancelled;
  }
}

void Residency::State::ask(double now, ResidencyStep& result) {
  std::vector<uint32_t> wanted;
  for (const uint32_t page : touched) {
    const PageSlot& slot = pages[page];
    if (slot.state == PageState::kAbsent && !slot.given_up && now >= slot.not_before)
      wanted.push_back(page);
  }
  std::sort(wanted.begin(), wanted.end(), [&](uint32_t a, uint32_t b) {
    const float x = worth_of(a), y = worth_of(b);
    return x != y ? x > y : a < b;
  });
  uint64_t coming = 0;
  for (const uint32_t page : in_flight) coming += asset->page_bytes(page);
  for (const uint32_t page : wanted) {
    if (in_flight.size() >= config.loads_in_flight) break;
    // What would find no place when it comes is not asked for.
    const uint64_t bytes = asset->page_bytes(page);
    const bool fits = statistics.resident_bytes + coming + bytes <= config.budget_bytes;
    if (!fits && least_worthy(worth_of(page)) == kNone) break;
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
    : state_(std::make_unique<State>()) {
  State& state = *state_;
  state.asset = &asset;
  state.config = config;
  state.pages.resize(asset.info().pages);
  for (const AssetMesh& mesh : asset.meshes()) {
    state.visits.emplace_back(mesh.groups);
  }
  state.check_and_pin_roots();
  state.loader = loader ? std::move(loader) : make_thread_loader(asset, config.threads);
}

Residency::Residency(Residency&&) noexcept = default;
Residency& Residency::operator=(Residency&&) noexcept = default;
Residency::~Residency() = default;

ResidencyStep Residency::step(std::span<const StreamView> views, double now) {
  State& state = *state_;
  for (const StreamView& view : views) {
    if (view.mesh >= state.visits.size())
      throw Error(ErrorCode::kInvalidArgument, "a view is of mesh " + std::to_string(view.mesh) +
                                                   ", but the asset has " +
                                                   std::to_string(state.visits.size()));
    const lod::View& v = view.view;
    const bool is_camera = v.kind == lod::View::Kind::kCamera;
    if (!(is_camera ? v.threshold >= 0 && std::isfinite(v.eye.x + v.eye.y + v.eye.z)
                    : v.kind == lod::View::Kind::kError && v.error >= 0))
      throw Error(
          ErrorCode::kInvalidArgument,
          "a view must be of an error or a camera, with finite values that are not negative");
  }
  ResidencyStep result;
  if (state.loader) state.take_arrivals(now, result);
  ++state.step_number;
  state.touched.clear();
  state.links.clear();
  state.cut.clear();
  for (uint32_t i = 0; i < views.size(); ++i) state.select(i, views[i], now, result);
  state.hand_worth_up();
  if (state.loader) {
    state.cancel_stale(result);
    state.ask(now, result);
  }
  ++state.statistics.steps;
  return result;
}

std::span<const StreamCluster> Residency::cut() const { return state_->cut; }

std::shared_ptr<const AssetPage> Residency::page(uint32_t page) const {
  return page < state_->pages.size() ? state_->pages[page].data : nullptr;
}

std::vector<uint32_t> Residency::resident_pages() const {
  std::vector<uint32_t> pages = state_->resident;
  std::sort(pages.begin(), pages.end());
  return pages;
}

std::vector<uint32_t> Residency::wanted_pages() const {
  std::vector<uint32_t> pages = state_->touched;
  std::sort(pages.begin(), pages.end());
  return pages;
}

ResidencyStatistics Residency::statistics() const {
  ResidencyStatistics statistics = state_->statistics;
  statistics.resident_pages = static_cast<uint32_t>(state_->resident.size());
  statistics.in_flight = static_cast<uint32_t>(state_->in_flight.size());
  return statistics;
}

void Residency::forgive() {
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
  if (bytes < state_->statistics.pinned_bytes)
    throw Error(ErrorCode::kInvalidArgument, "the budget is " + std::to_string(bytes) +
                                                 ", but the pages of the root groups take " +
                                                 std::to_string(state_->statistics.pinned_bytes));
  state_->config.budget_bytes = bytes;
}

}  // namespace umbel
