#include "stream/tracked_view.hpp"

#include <algorithm>
#include <cmath>

namespace umbel::stream {
namespace {

/// Beyond these ticks are not exact, so all nodes are evaluated again.
constexpr double kMostTicks = 0x1p52;

}  // namespace

double TrackedView::Queue::ticks(double distance) const {
  return std::floor(distance / reach * 0x1p14);
}

bool TrackedView::move_to(const StreamView& next, std::vector<DueQueue::Entry>& due) {
  const auto forget = [&] {
    motion_ = {};
    queues_.clear();
    return false;
  };
  const ViewMotion before = motion_;
  const bool holds = motion_.add(view, next);
  view = next;
  if (!holds) return forget();
  if (motion_ == before) return true;
  for (Queue& queue : queues_) {
    const double ticks = queue.ticks(motion_.travelled(queue.reason, queue.reach));
    if (!(ticks < kMostTicks)) return forget();
    for (const DueQueue::Entry& entry : queue.fresh) queue.due.push(entry);
    queue.fresh.clear();
    queue.due.take(static_cast<uint64_t>(ticks) + 1, due);
  }
  return true;
}

void TrackedView::schedule(uint32_t node, uint32_t stamp, const Evaluation& evaluation) {
  schedule(node, stamp, Reason::kError, evaluation.size, evaluation.error_margin);
  schedule(node, stamp, Reason::kPlanes, evaluation.size, evaluation.planes_margin);
}

void TrackedView::schedule(uint32_t node, uint32_t stamp, Reason reason, int size, double margin) {
  if (margin == Evaluation::kForEver) return;
  auto queue = std::find_if(queues_.begin(), queues_.end(),
                            [&](const Queue& q) { return q.size == size && q.reason == reason; });
  if (queue == queues_.end())
    queue = queues_.insert(queue, Queue{reason, size, reach_of(size), {}, {}});
  const double due = motion_.travelled(reason, queue->reach) + margin;
  const double ticks = std::min(kMostTicks, queue->ticks(due));
  queue->fresh.push_back({static_cast<uint64_t>(ticks), node, stamp});
}

}  // namespace umbel::stream
