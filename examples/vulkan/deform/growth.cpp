#include "deform/growth.hpp"

#include <algorithm>
#include <numeric>

namespace sample {

namespace {

constexpr uint64_t kWhole = uint64_t{1} << 40;  // the share of the box of all

double half_area(const umbel::Aabb& box) {
  const double x = double{box.max.x} - box.min.x, y = double{box.max.y} - box.min.y,
               z = double{box.max.z} - box.min.z;
  return x * y + y * z + z * x;
}

std::vector<uint64_t> shares(std::span<const umbel::Aabb> boxes) {
  umbel::Aabb all = boxes[0];
  for (const umbel::Aabb& box : boxes) {
    all.min = {std::min(all.min.x, box.min.x), std::min(all.min.y, box.min.y),
               std::min(all.min.z, box.min.z)};
    all.max = {std::max(all.max.x, box.max.x), std::max(all.max.y, box.max.y),
               std::max(all.max.z, box.max.z)};
  }
  const double whole = half_area(all);
  std::vector<uint64_t> found;
  for (const umbel::Aabb& box : boxes) {
    const double area = half_area(box);
    found.push_back(area < whole  ? static_cast<uint64_t>(area / whole * double{kWhole})
                    : area == 0.0 ? 0
                                  : kWhole);
  }
  return found;
}

}  // namespace

void Growth::measure(std::span<const umbel::Aabb> boxes) { now_ = shares(boxes); }

void Growth::rebuilt(std::span<const umbel::Aabb> boxes, std::span<const uint32_t> numbers) {
  measure(boxes);
  std::vector<uint64_t> at_build = now_;
  for (size_t c = 0; c < numbers.size(); ++c) at_build[c] = at_build_[numbers[c]];
  at_build_ = std::move(at_build);
}

umbel::AreaGrowth Growth::growth() const {
  const auto ratio = [](const std::vector<uint64_t>& all) {
    return static_cast<double>(std::accumulate(all.begin(), all.end(), uint64_t{0})) /
           double{kWhole};
  };
  return {ratio(now_), ratio(at_build_)};
}

std::vector<uint32_t> Growth::worst(uint32_t most) const {
  std::vector<uint32_t> numbers;
  for (uint32_t c = 0; c < now_.size(); ++c) {
    if (now_[c] > at_build_[c]) numbers.push_back(c);
  }
  const auto factor = [&](uint32_t c) {
    return static_cast<float>(static_cast<double>(now_[c]) / static_cast<double>(at_build_[c] + 1));
  };
  std::stable_sort(numbers.begin(), numbers.end(),
                   [&](uint32_t a, uint32_t b) { return factor(a) > factor(b); });
  if (numbers.size() > most) numbers.resize(most);
  std::sort(numbers.begin(), numbers.end());
  return numbers;
}

}  // namespace sample
