#include "stream/cut_tracker.hpp"

#include <algorithm>
#include <utility>

namespace umbel::stream {
namespace {

/// The ratio of a node that should close, but waits for open nodes below it.
constexpr float kWaitsToClose = 1e-30f;

/// The index of an element that is free again, or of a new one.
template <typename T>
uint32_t free_slot(std::vector<T>& all, std::vector<uint32_t>& free) {
  if (free.empty()) {
    all.emplace_back();
    return static_cast<uint32_t>(all.size() - 1);
  }
  const uint32_t slot = free.back();
  free.pop_back();
  return slot;
}

}  // namespace

CutTracker::CutTracker(const Asset& asset)
    : asset_(asset), tables_(asset), pages_(asset.info().pages) {}

// ---- pages

void CutTracker::install(const AssetPage& page) {
  tables_.add(page);
  for (uint32_t n = pages_.first_node(page.index); n != kNone; n = nodes_[n].after) {
    missing_.remove(nodes_, n);
    update_later(n);
  }
}

void CutTracker::remove(uint32_t page) {
  std::vector<uint32_t> open;
  for (uint32_t n = pages_.first_node(page); n != kNone; n = nodes_[n].after)
    if (nodes_[n].is_open) open.push_back(n);
  for (const uint32_t n : open)
    if (nodes_[n].is_open) close(n);
  tables_.remove(page);
  for (uint32_t n = pages_.first_node(page); n != kNone; n = nodes_[n].after) {
    missing_.add(nodes_, n);
    update_later(n);
  }
}

// ---- views

bool CutTracker::follow(std::span<const StreamView> views, uint64_t most) {
  due_.erase(due_.begin(), due_.begin() + static_cast<ptrdiff_t>(std::exchange(next_due_, 0)));
  while (views_.size() > views.size()) {
    end_view(static_cast<uint32_t>(views_.size()) - 1);
    views_.pop_back();
  }
  for (uint32_t i = 0; i < views.size(); ++i) {
    if (i == views_.size() || views_[i].view.mesh != views[i].mesh)
      begin_view(i, views[i]);
    else if (!views_[i].move_to(views[i], due_))
      views_[i].nodes.for_each([&](uint32_t n) { update_later(n); });
  }
  for (const uint64_t stop = work_ + most; work_ < stop;) {
    const bool was_pending = evaluate_pending();
    const bool was_due = evaluate_due();
    if (!was_pending && !was_due) return true;
  }
  return false;
}

void CutTracker::begin_view(uint32_t index, const StreamView& view) {
  if (index < views_.size()) end_view(index);
  TrackedView tracked(view, asset_.meshes()[view.mesh].groups);
  if (index < views_.size())
    views_[index] = std::move(tracked);
  else
    views_.push_back(std::move(tracked));
  for (const GroupRef& root : asset_.roots(view.mesh)) ++nodes_[track(index, root)].open_parents;
}

void CutTracker::end_view(uint32_t index) {
  for (const GroupRef& root : asset_.roots(views_[index].view.mesh)) {
    const uint32_t n = views_[index].nodes.find(root.group);
    if (nodes_[n].is_open) close(n);
    if (--nodes_[n].open_parents == 0) untrack(n);
  }
}

/// In the order in which they were reached: coarse groups first.
bool CutTracker::evaluate_pending() {
  while (!pending_.empty()) {
    const Pending pending = pending_.front();
    pending_.pop_front();
    if (nodes_[pending.node].stamp != pending.stamp) continue;
    update(pending.node);
    return true;
  }
  return false;
}

bool CutTracker::evaluate_due() {
  constexpr size_t kAhead = 8;  // nodes lie scattered in memory
  while (next_due_ < due_.size()) {
    if (next_due_ + kAhead < due_.size())
      __builtin_prefetch(&nodes_[due_[next_due_ + kAhead].node]);
    const DueQueue::Entry& due = due_[next_due_++];
    if (nodes_[due.node].stamp != due.stamp) continue;
    update(due.node);
    return true;
  }
  due_.clear();
  next_due_ = 0;
  return false;
}

/// Evaluates a node, then opens or closes it.
void CutTracker::update(uint32_t n) {
  ++work_;
  TrackedNode& node = nodes_[n];
  ++node.stamp;
  TrackedView& tracked = views_[node.view];
  const bool is_there = tables_.has(node.reference.page);
  const Evaluation evaluation = evaluate(node.reference, tracked.view, !is_there);
  const bool waits = evaluation.ratio == 0 && node.is_open && node.open_children > 0;
  want(n, waits ? kWaitsToClose : evaluation.ratio);
  tracked.schedule(n, node.stamp, evaluation);
  const bool should_be_open =
      evaluation.ratio > 0 && is_there && node.open_parents >= node.reference.parents;
  if (should_be_open && !node.is_open) {
    const uint32_t index = tables_.find(tracked.view.mesh, node.reference);
    if (index != kNone) {
      node.in_page = index;
      open(n);
    }
  }
  if (!should_be_open && node.is_open && !waits) close(n);
}

// ---- groups

uint32_t CutTracker::track(uint32_t view, const GroupRef& reference) {
  uint32_t& known = views_[view].nodes.at(reference.group);
  if (known != kNone) return known;
  known = free_slot(nodes_, free_nodes_);
  TrackedNode& node = nodes_[known];
  node.reference = reference;
  node.view = view;
  update_later(known);
  return known;
}

void CutTracker::untrack(uint32_t n) {
  want(n, 0);
  TrackedNode& node = nodes_[n];
  views_[node.view].nodes.at(node.reference.group) = kNone;
  ++node.stamp;
  free_nodes_.push_back(n);
}

void CutTracker::link(uint32_t parent, uint32_t child) {
  TrackedNode& node = nodes_[child];
  const uint32_t edge = free_slot(edges_, free_edges_);
  edges_[edge] = {parent, node.first_edge};
  node.first_edge = edge;
  ++node.open_parents;
  if (node.ratio > 0 && node.open_parents == node.reference.parents) update_later(child);
}

void CutTracker::unlink(uint32_t parent, uint32_t child) {
  TrackedNode& node = nodes_[child];
  uint32_t* at = &node.first_edge;
  while (edges_[*at].parent != parent) at = &edges_[*at].next;
  free_edges_.push_back(*at);
  *at = edges_[*at].next;
  if (--node.open_parents == 0) untrack(child);
}

/// Sets the ratio, and what follows from it for the page and the list of missing ones.
void CutTracker::want(uint32_t n, float ratio) {
  const float before = nodes_[n].ratio;
  pages_.set_ratio(nodes_, n, ratio);
  const TrackedNode& node = nodes_[n];
  if (before == 0 && ratio > 0) {
    if (!tables_.has(node.reference.page)) missing_.add(nodes_, n);
  } else if (node.missing_at != kNone) {
    if (ratio == 0)
      missing_.remove(nodes_, n);
    else
      missing_.update(node);
  }
}

void CutTracker::open(uint32_t n) {
  nodes_[n].is_open = true;
  nodes_[n].shown.assign(tables_.generating_groups(nodes_[n]).size(), kNone);
  ++open_groups_;
  const GroupRef reference = nodes_[n].reference;
  for (uint32_t e = nodes_[n].first_edge; e != kNone; e = edges_[e].next) {
    const uint32_t parent = edges_[e].parent;
    ++nodes_[parent].open_children;
    pages_.count_opened(nodes_[parent].reference.page, reference.page);
    const std::span<const uint32_t> from = tables_.generating_groups(nodes_[parent]);
    for (uint32_t i = 0; i < from.size(); ++i)
      if (from[i] == reference.group) cut_.hide(nodes_, parent, i);
  }
  for (const GroupRef& child : tables_.children(nodes_[n])) {
    const uint32_t c = track(nodes_[n].view, child);
    link(n, c);
    if (!nodes_[c].is_open) continue;  // it is, where a file says that it has fewer parents
    ++nodes_[n].open_children;
    pages_.count_opened(reference.page, nodes_[c].reference.page);
  }
  const GroupMap& known = views_[nodes_[n].view].nodes;
  const std::span<const uint32_t> from = tables_.generating_groups(nodes_[n]);
  for (uint32_t i = 0; i < from.size(); ++i) {
    const uint32_t c = from[i] == kNone ? kNone : known.find(from[i]);
    if (c == kNone || !nodes_[c].is_open) cut_.show(nodes_, n, i);
  }
  work_ += tables_.children(nodes_[n]).size();
}

/// Closes all that is open below it first: a group may have parents at several depths.
void CutTracker::close(uint32_t top) {
  struct Step {
    uint32_t node;
    size_t next_child;
  };
  std::vector<Step> path{{top, 0}};
  nodes_[top].is_open = false;
  while (!path.empty()) {
    const uint32_t n = path.back().node;
    const std::span<const GroupRef> children = tables_.children(nodes_[n]);
    if (path.back().next_child == children.size()) {
      finish_closing(n);
      path.pop_back();
      continue;
    }
    const GroupRef& child = children[path.back().next_child++];
    const uint32_t c = views_[nodes_[n].view].nodes.find(child.group);
    if (std::exchange(nodes_[c].is_open, false)) path.push_back({c, 0});
  }
}

void CutTracker::finish_closing(uint32_t n) {
  const GroupRef reference = nodes_[n].reference;
  for (uint32_t i = 0; i < nodes_[n].shown.size(); ++i) cut_.hide(nodes_, n, i);
  nodes_[n].shown.clear();
  --open_groups_;
  for (uint32_t e = nodes_[n].first_edge; e != kNone; e = edges_[e].next) {
    TrackedNode& parent = nodes_[edges_[e].parent];
    --parent.open_children;
    pages_.count_closed(parent.reference.page, reference.page);
    if (!parent.is_open) continue;
    const std::span<const uint32_t> from = tables_.generating_groups(parent);
    for (uint32_t i = 0; i < from.size(); ++i)
      if (from[i] == reference.group) cut_.show(nodes_, edges_[e].parent, i);
    if (parent.ratio == kWaitsToClose && parent.open_children == 0) update_later(edges_[e].parent);
  }
  const GroupMap& known = views_[nodes_[n].view].nodes;
  for (const GroupRef& child : tables_.children(nodes_[n])) unlink(n, known.find(child.group));
  work_ += tables_.children(nodes_[n]).size();
}

}  // namespace umbel::stream
