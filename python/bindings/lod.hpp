// What the bindings of DAGs in memory and of assets on disk share.
#pragma once

#include <mutex>

#include "bind.hpp"
#include "umbel/lod.hpp"

namespace umbel::python {

/// Throws kInvalidArgument naming the first index that is no cluster.
void check_cut(const lod::Tables& tables, std::span<const uint32_t> cut);

/// What a build says of itself.
Dict build_report(const lod::Report& report);
Dict report_dict(const lod::VerifyReport& report);
Dict geometry_dict(lod::ClusterGeometry&& geometry);

/// One cut as the arrays of a mesh; reads and welds without the GIL.
Dict cut_dict(const lod::Tables& tables, const lod::GeometryReader& geometry,
              const Flat<uint32_t>& cut);

/// (c, 11) float32: the spheres and cones of all clusters.
Array<float> normal_cone_array(const lod::Tables& tables, const lod::GeometryReader& geometry,
                               const nb::object& progress, uint32_t threads);

/// A base of what refers to an asset, and is for one thread at a time: keeps the asset's object.
class AssetUser {
 public:
  explicit AssetUser(nb::object asset) : asset_(std::move(asset)) {}
  AssetUser(const AssetUser&) = delete;
  AssetUser& operator=(const AssetUser&) = delete;
  ~AssetUser() {
    const nb::gil_scoped_acquire acquire;
    asset_.reset();
  }
  nb::handle held() const { return asset_; }

  /// Calls `use` when no other thread does, without the GIL, which who reads may have to wait for.
  template <typename Use>
  auto alone(const Use& use) const {
    const nb::gil_scoped_release release;
    const std::lock_guard lock(mutex_);
    return use();
  }

 private:
  nb::object asset_;
  mutable std::mutex mutex_;
};

/// tp_traverse of a class with held(): a cycle through what the collector does not see would never
/// be freed.
template <typename T>
int traverse(PyObject* self, visitproc visit, void* arg) {
  Py_VISIT(Py_TYPE(self));
  if (nb::inst_ready(self)) Py_VISIT(nb::inst_ptr<T>(self)->held().ptr());
  return 0;
}

/// Binds what needs tables alone; `Tables` must be bound already.
void bind_select(nb::module_& module);

}  // namespace umbel::python
