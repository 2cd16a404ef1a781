#include "stream/cut_tracker.hpp"

#include <algorithm>
#include <utility>

namespace umbel::stream {
namespace {

/// The ratio of what should close, and waits for all that is open below it.
constexpr float kLingers = 1e-30f;

/// Beyond these the clock's ticks are no longer exact; all is then looked at again.
constexpr double kMostTicks = 0x1p52;

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

/// A place that is free again, or a new one.
template <typename T>
uint32_t place_in(std::vector<T>& all, std::vector<uint32_t>& free) {
  if (free.empty()) {
    all.emplace_back();
    return static_cast<uint32_t>(all.size() - 1);
  }
  const uint32_t place = free.back();
  free.pop_back();
  return place;
}

}  // namespace

Frontier::Frontier(const Asset& asset) : asset_(asset), pages_(asset.info().pages) {
  for (const AssetMesh& mesh : asset.meshes()) in_page_.emplace_back(mesh.groups);
}

// ---- pages

void Frontier::install(const AssetPage& page) {
  for (uint32_t i = 0; i < page.groups.size(); ++i)
    in_page_[page.groups[i].mesh][page.groups[i].id] = i;
  Page& slot = pages_[page.index];
  slot.table = walk_table(page);
  slot.is_there = true;
  for (uint32_t n = slot.first; n != kNone; n = nodes_[n].after) {
    remove_missing(n);
    look_later(n);
  }
}

void Frontier::remove(uint32_t page) {
  Page& slot = pages_[page];
  std::vector<uint32_t> shown;
  for (uint32_t n = slot.first; n != kNone; n = nodes_[n].after)
    if (nodes_[n].is_open) shown.push_back(n);
  for (const uint32_t n : shown)
    if (nodes_[n].is_open) close(n);
  slot.table = {};
  slot.is_there = false;
  for (uint32_t n = slot.first; n != kNone; n = nodes_[n].after) {
    add_missing(n);
    look_later(n);
  }
}

/// Where the node's group is in its page, if it is there: a file may refer to a page without it.
bool Frontier::find_in_page(Node& node) const {
  const GroupRef& reference = node.reference;
  const Page& page = pages_[reference.page];
  const uint32_t mesh = watches_[node.view].view.mesh;
  const uint32_t at = in_page_[mesh][reference.group];
  if (!page.is_there || at + 1 >= page.table.groups.size()) return false;
  const WalkTable::Entry& entry = page.table.groups[at];
  if (entry.group != reference.group || entry.mesh != mesh) return false;
  node.in_page = at;
  return true;
}

std::span<const GroupRef> Frontier::children_of(uint32_t node) const {
  const WalkTable& table = pages_[nodes_[node].reference.page].table;
  const WalkTable::Entry* entry = &table.groups[nodes_[node].in_page];
  return std::span(table.children)
      .subspan(entry->first_child, entry[1].first_child - entry->first_child);
}

std::span<const uint32_t> Frontier::made_from(uint32_t node) const {
  const WalkTable& table = pages_[nodes_[node].reference.page].table;
  const WalkTable::Entry* entry = &table.groups[nodes_[node].in_page];
  return std::span(table.made_from)
      .subspan(entry->first_cluster, entry[1].first_cluster - entry->first_cluster);
}

// ---- views

bool Frontier::follow(std::span<const StreamView> views, uint64_t most) {
  due_.erase(due_.begin(), due_.begin() + static_cast<ptrdiff_t>(std::exchange(next_due_, 0)));
  while (watches_.size() > views.size()) {
    end(static_cast<uint32_t>(watches_.size()) - 1);
    watches_.pop_back();
  }
  for (uint32_t i = 0; i < views.size(); ++i) {
    if (i == watches_.size() || watches_[i].view.mesh != views[i].mesh)
      begin(i, views[i]);
    else
      move(i, views[i]);
  }
  for (const uint64_t stop = work_ + most; work_ < stop;) {
    const bool was_new = look_at_new();
    const bool was_due = look_at_due();
    if (!was_new && !was_due) return true;
  }
  return false;
}

void Frontier::begin(uint32_t index, const StreamView& view) {
  if (index < watches_.size()) end(index);
  Watch watch{view, {}, GroupMap(asset_.meshes()[view.mesh].groups), {}};
  if (index < watches_.size())
    watches_[index] = std::move(watch);
  else
    watches_.push_back(std::move(watch));
  for (const GroupRef& root : asset_.roots(view.mesh)) ++nodes_[meet(index, root)].open_parents;
}

void Frontier::end(uint32_t index) {
  for (const GroupRef& root : asset_.roots(watches_[index].view.mesh)) {
    const uint32_t n = watches_[index].nodes.find(root.group);
    if (nodes_[n].is_open) close(n);
    if (--nodes_[n].open_parents == 0) drop(n);
  }
}

void Frontier::move(uint32_t index, const StreamView& view) {
  Watch& watch = watches_[index];
  const Motion before = watch.motion;
  const bool holds = watch.motion.add(watch.view, view);
  watch.view = view;
  if (!holds) return look_at_all_again(watch);
  if (watch.motion == before) return;
  for (Queue& queue : watch.queues) {
    const double ticks = queue.ticks(watch.motion.clock(queue.reason, queue.reach));
    if (!(ticks < kMostTicks)) return look_at_all_again(watch);
    for (const DueQueue::Entry& entry : queue.fresh) queue.due.push(entry);
    queue.fresh.clear();
    queue.due.take(static_cast<uint64_t>(ticks) + 1, due_);
  }
}

void Frontier::look_at_all_again(Watch& watch) {
  watch.motion = {};
  watch.queues.clear();
  watch.nodes.for_each([&](uint32_t n) { look_later(n); });
}

/// The coarsest first, as they were met.
bool Frontier::look_at_new() {
  while (!todo_.empty()) {
    const Todo todo = todo_.front();
    todo_.pop_front();
    if (nodes_[todo.node].stamp != todo.stamp) continue;
    look(todo.node);
    return true;
  }
  return false;
}

bool Frontier::look_at_due() {
  constexpr size_t kAhead = 8;  // nodes are all over the memory
  while (next_due_ < due_.size()) {
    if (next_due_ + kAhead < due_.size())
      __builtin_prefetch(&nodes_[due_[next_due_ + kAhead].node]);
    const DueQueue::Entry& due = due_[next_due_++];
    if (nodes_[due.node].stamp != due.stamp) continue;
    look(due.node);
    return true;
  }
  due_.clear();
  next_due_ = 0;
  return false;
}

void Frontier::look(uint32_t n) {
  ++work_;
  Node& node = nodes_[n];
  ++node.stamp;
  Watch& watch = watches_[node.view];
  const bool is_there = pages_[node.reference.page].is_there;
  const Answer answer = look_at(node.reference, watch.view, !is_there);
  const bool lingers = answer.ratio == 0 && node.is_open && node.open_children > 0;
  want(n, lingers ? kLingers : answer.ratio);
  keep(n, watch, Reason::kError, answer.size, answer.error_margin);
  keep(n, watch, Reason::kPlanes, answer.size, answer.planes_margin);
  const bool should_be_open =
      answer.ratio > 0 && is_there && node.open_parents >= node.reference.parents;
  if (should_be_open && !node.is_open && find_in_page(node)) open(n);
  if (!should_be_open && node.is_open && !lingers) close(n);
}

/// Until when the answer holds, rounded down.
void Frontier::keep(uint32_t n, Watch& watch, Reason reason, int size, double margin) {
  if (margin == Answer::kForEver) return;
  auto queue = std::find_if(watch.queues.begin(), watch.queues.end(),
                            [&](const Queue& q) { return q.size == size && q.reason == reason; });
  if (queue == watch.queues.end())
    queue = watch.queues.insert(queue, Queue{reason, size, reach_of(size), {}, {}});
  const double due = watch.motion.clock(reason, queue->reach) + margin;
  const double ticks = std::min(kMostTicks, queue->ticks(due));
  queue->fresh.push_back({static_cast<uint64_t>(ticks), n, nodes_[n].stamp});
}

// ---- groups

uint32_t Frontier::meet(uint32_t view, const GroupRef& reference) {
  uint32_t& known = watches_[view].nodes.at(reference.group);
  if (known != kNone) return known;
  known = place_in(nodes_, free_nodes_);
  Node& node = nodes_[known];
  node.reference = reference;
  node.view = view;
  look_later(known);
  return known;
}

void Frontier::drop(uint32_t n) {
  want(n, 0);
  Node& node = nodes_[n];
  watches_[node.view].nodes.at(node.reference.group) = kNone;
  ++node.stamp;
  free_nodes_.push_back(n);
}

void Frontier::link(uint32_t parent, uint32_t child) {
  Node& node = nodes_[child];
  const uint32_t edge = place_in(edges_, free_edges_);
  edges_[edge] = {parent, node.first_edge};
  node.first_edge = edge;
  ++node.open_parents;
  if (node.ratio > 0 && node.open_parents == node.reference.parents) look_later(child);
}

void Frontier::unlink(uint32_t parent, uint32_t child) {
  Node& node = nodes_[child];
  uint32_t* at = &node.first_edge;
  while (edges_[*at].parent != parent) at = &edges_[*at].next;
  free_edges_.push_back(*at);
  *at = edges_[*at].next;
  if (--node.open_parents == 0) drop(child);
}

/// Sets how much its page is wanted for it.
void Frontier::want(uint32_t n, float ratio) {
  Node& node = nodes_[n];
  Page& page = pages_[node.reference.page];
  const float before = std::exchange(node.ratio, ratio);
  page.worth += double{ratio} * ratio - double{before} * before;
  if (before == 0 && ratio > 0) {
    node.before = kNone;
    node.after = page.first;
    if (page.first != kNone) nodes_[page.first].before = n;
    page.first = n;
    if (page.wanted++ == 0) changed_.push_back(node.reference.page);
    if (!page.is_there) add_missing(n);
  } else if (before > 0 && ratio == 0) {
    (node.before == kNone ? page.first : nodes_[node.before].after) = node.after;
    if (node.after != kNone) nodes_[node.after].before = node.before;
    if (--page.wanted == 0) changed_.push_back(node.reference.page), page.worth = 0;
    if (node.missing_at != kNone) remove_missing(n);
  } else if (node.missing_at != kNone) {
    missing_[node.missing_at].ratio = ratio;
  }
}

void Frontier::open(uint32_t n) {
  nodes_[n].is_open = true;
  nodes_[n].shown.assign(made_from(n).size(), kNone);
  ++open_groups_;
  const GroupRef reference = nodes_[n].reference;
  for (uint32_t e = nodes_[n].first_edge; e != kNone; e = edges_[e].next) {
    const uint32_t parent = edges_[e].parent;
    ++nodes_[parent].open_children;
    pages_[nodes_[parent].reference.page].open_elsewhere +=
        nodes_[parent].reference.page != reference.page;
    const std::span<const uint32_t> from = made_from(parent);
    for (uint32_t i = 0; i < from.size(); ++i)
      if (from[i] == reference.group) hide(parent, i);
  }
  for (const GroupRef& child : children_of(n)) {
    const uint32_t c = meet(nodes_[n].view, child);
    link(n, c);
    if (!nodes_[c].is_open) continue;  // it is, where a file says that it has fewer parents
    ++nodes_[n].open_children;
    pages_[reference.page].open_elsewhere += nodes_[c].reference.page != reference.page;
  }
  const GroupMap& known = watches_[nodes_[n].view].nodes;
  const std::span<const uint32_t> from = made_from(n);
  for (uint32_t i = 0; i < from.size(); ++i) {
    const uint32_t c = from[i] == kNone ? kNone : known.find(from[i]);
    if (c == kNone || !nodes_[c].is_open) show(n, i);
  }
  work_ += children_of(n).size();
}

/// And all that is open below it, first: a group may have parents at several depths.
void Frontier::close(uint32_t top) {
  struct Step {
    uint32_t node;
    size_t next_child;
  };
  std::vector<Step> path{{top, 0}};
  nodes_[top].is_open = false;
  while (!path.empty()) {
    const uint32_t n = path.back().node;
    const std::span<const GroupRef> children = children_of(n);
    if (path.back().next_child == children.size()) {
      finish_closing(n);
      path.pop_back();
      continue;
    }
    const GroupRef& child = children[path.back().next_child++];
    const uint32_t c = watches_[nodes_[n].view].nodes.find(child.group);
    if (std::exchange(nodes_[c].is_open, false)) path.push_back({c, 0});
  }
}

void Frontier::finish_closing(uint32_t n) {
  const GroupRef reference = nodes_[n].reference;
  for (uint32_t i = 0; i < nodes_[n].shown.size(); ++i) hide(n, i);
  nodes_[n].shown.clear();
  --open_groups_;
  for (uint32_t e = nodes_[n].first_edge; e != kNone; e = edges_[e].next) {
    Node& parent = nodes_[edges_[e].parent];
    --parent.open_children;
    pages_[parent.reference.page].open_elsewhere -= parent.reference.page != reference.page;
    if (!parent.is_open) continue;
    const std::span<const uint32_t> from = made_from(edges_[e].parent);
    for (uint32_t i = 0; i < from.size(); ++i)
      if (from[i] == reference.group) show(edges_[e].parent, i);
    if (parent.ratio == kLingers && parent.open_children == 0) look_later(edges_[e].parent);
  }
  const GroupMap& known = watches_[nodes_[n].view].nodes;
  for (const GroupRef& child : children_of(n)) unlink(n, known.find(child.group));
  work_ += children_of(n).size();
}

// ---- lists

void Frontier::show(uint32_t n, uint32_t cluster) {
  const Node& node = nodes_[n];
  if (node.shown[cluster] != kNone) return;
  nodes_[n].shown[cluster] = static_cast<uint32_t>(cut_.size());
  cut_.push_back({node.view, node.reference.page, node.in_page, cluster});
  owners_.push_back({n, cluster});
}

void Frontier::hide(uint32_t n, uint32_t cluster) {
  const uint32_t at = std::exchange(nodes_[n].shown[cluster], kNone);
  if (at == kNone) return;
  const Owner last = owners_.back();
  if (at + 1 < cut_.size()) {
    cut_[at] = cut_.back();
    owners_[at] = last;
    nodes_[last.node].shown[last.cluster] = at;
  }
  cut_.pop_back();
  owners_.pop_back();
}

void Frontier::add_missing(uint32_t n) {
  nodes_[n].missing_at = static_cast<uint32_t>(missing_.size());
  missing_.push_back({nodes_[n].ratio, n});
}

void Frontier::remove_missing(uint32_t n) {
  const uint32_t at = std::exchange(nodes_[n].missing_at, kNone);
  missing_[at] = missing_.back();
  nodes_[missing_[at].node].missing_at = at;
  if (missing_[at].node == n) nodes_[n].missing_at = kNone;
  missing_.pop_back();
}

}  // namespace umbel::stream
