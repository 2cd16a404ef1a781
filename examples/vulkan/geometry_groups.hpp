// Groups by VK_KHR_acceleration_structure: each cluster a geometry.
#pragma once

#include "group_builder.hpp"

namespace sample {

class GeometryGroups : public GroupBuilder {
 public:
  explicit GeometryGroups(const Device& device) : device_(device) {}
  std::vector<GroupStructure> build(std::span<const std::vector<uint32_t>> sets,
                                    const Tables& tables, const PagePool& pool) override;
  bool numbers_clusters() const override { return false; }

 private:
  const Device& device_;
};

}  // namespace sample
