// Residency: pages of an asset in memory under a budget.
#include "umbel/stream.hpp"

#include <nanobind/stl/vector.h>
#include <unistd.h>

#include <algorithm>
#include <ctime>
#include <new>
#include <utility>

#include "lod.hpp"

namespace umbel::python {
namespace {

Dict step_dict(const StreamStep& step) {
  Dict result;
  PUT_FIELDS(result, step, worst_error, open_groups, missing_groups, loaded, evicted, requested,
             cancelled, evaluated, caught_up);
  return result;
}

Dict statistics_dict(const ResidencyStatistics& s) {
  Dict result;
  PUT_FIELDS(result, s, steps, resident_bytes, pinned_bytes, loaded_bytes, evicted_bytes, loads,
             reloads, evictions, cancellations, failures, slow_loads, refused, resident_pages,
             in_flight);
  nb::list given_up;
  for (const uint32_t page : s.given_up) given_up.append(page);
  result["given_up"] = given_up;
  result["last_problem"] = s.last_problem;
  return result;
}

/// The clusters that one view shows, by their numbers in its mesh's tables, ascending.
std::vector<uint32_t> clusters_of(const Residency& residency, uint32_t view) {
  std::vector<uint32_t> clusters;
  std::shared_ptr<const AssetPage> page;
  uint32_t held = kNone;
  for (const StreamCluster& c : residency.cut()) {
    if (c.view != view) continue;
    if (c.page != held) page = residency.page(c.page), held = c.page;
    clusters.push_back(page->groups[c.group].group.clusters.offset + c.cluster);
  }
  std::sort(clusters.begin(), clusters.end());
  return clusters;
}

/// Threads may wait for the GIL to read a Python source: whoever waits for them must not hold it.
struct PythonResidency : AssetUser, Residency {
  PythonResidency(nb::object object, const Asset& asset, const ResidencyConfig& config)
      : AssetUser(std::move(object)), Residency(asset, config) {}
  /// On a line of a simulation, whose time is that of the steps.
  PythonResidency(nb::object object, const Asset& asset, const ResidencyConfig& config,
                  const LinkModel& link, std::shared_ptr<double> time)
      : AssetUser(std::move(object)),
        Residency(asset, config, make_model_loader(asset, link, time)),
        clock(std::move(time)) {}
  PythonResidency(const PythonResidency&) = delete;
  ~PythonResidency() {
    end();
    // The loader's threads are not in a forked process, so nothing there can wait for them.
    if (is_forked())
      static_cast<void>(new (std::nothrow) Residency(std::move(static_cast<Residency&>(*this))));
  }
  void end() {
    if (!is_forked()) AssetUser::alone([&] { close(); });
  }
  template <typename Use>
  auto alone(const Use& use) const {
    if (is_forked())
      throw Error(ErrorCode::kInvalidArgument,
                  "this residency was made before the process was forked, and its threads are not "
                  "in this process: make another one here");
    return AssetUser::alone(use);
  }

  std::shared_ptr<double> clock;

 private:
  bool is_forked() const { return process_ != getpid(); }
  pid_t process_ = getpid();
};

double processor_seconds() {
  timespec time;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

using View = std::tuple<uint32_t, lod::View, std::optional<Rows<float, 4>>>;

auto key(const StreamCluster& c) { return std::tuple(c.page, c.group, c.cluster); }

/// The same clusters beside each other, in the order of views.
std::vector<StreamCluster> ordered(std::span<const StreamCluster> cut) {
  std::vector<StreamCluster> order(cut.begin(), cut.end());
  std::sort(order.begin(), order.end(), [](const StreamCluster& a, const StreamCluster& b) {
    return key(a) != key(b) ? key(a) < key(b) : a.view < b.view;
  });
  return order;
}

/// What the last step's cut takes, each cluster counted once however often it stands: clusters,
/// triangles, vertices; and places.
std::tuple<uint64_t, uint64_t, uint64_t, uint64_t> cost_of(const Residency& residency) {
  const std::vector<StreamCluster> order = ordered(residency.cut());
  uint64_t clusters = 0, triangles = 0, vertices = 0;
  for (size_t i = 0; i < order.size(); ++i) {
    if (i > 0 && key(order[i - 1]) == key(order[i])) continue;
    const lod::Cluster& cluster =
        residency.page(order[i].page)->groups[order[i].group].clusters[order[i].cluster];
    ++clusters;
    triangles += cluster.triangle_count;
    vertices += cluster.vertex_count;
  }
  return {clusters, triangles, vertices, order.size()};
}

}  // namespace

/// Over 60 lines: a list of methods.
void bind_stream(nb::module_& module) {
  PyType_Slot slots[] = {{Py_tp_traverse, reinterpret_cast<void*>(&traverse<PythonResidency>)},
                         {0, nullptr}};
  nb::class_<PythonResidency>(module, "Residency", "Pages of an asset in memory.",
                              nb::type_slots(slots))
      .def(
          "__init__",
          [](PythonResidency* self, const Asset& asset, uint64_t budget_bytes,
             uint32_t loads_in_flight, uint64_t bytes_per_step, uint32_t evictions_per_step,
             uint32_t groups_per_step, float hysteresis, uint32_t attempts, double backoff_seconds,
             double slow_seconds, uint32_t threads,
             const std::optional<std::array<double, 4>>& link) {
            ResidencyConfig config;
            config.budget_bytes = budget_bytes;
            config.loads_in_flight = loads_in_flight;
            config.bytes_per_step = bytes_per_step;
            config.evictions_per_step = evictions_per_step;
            config.groups_per_step = groups_per_step;
            config.hysteresis = hysteresis;
            config.attempts = attempts;
            config.backoff_seconds = backoff_seconds;
            config.slow_seconds = slow_seconds;
            config.threads = threads;
            nb::object object = nb::find(asset);
            const nb::gil_scoped_release release;
            if (!link) {
              new (self) PythonResidency(std::move(object), asset, config);
              return;
            }
            const auto& [latency, bandwidth, failures, slow] = *link;
            new (self) PythonResidency(std::move(object), asset, config,
                                       LinkModel{latency, bandwidth, failures, slow},
                                       std::make_shared<double>(0));
          },
          "asset"_a, "budget_bytes"_a, "loads_in_flight"_a, "bytes_per_step"_a,
          "evictions_per_step"_a, "groups_per_step"_a, "hysteresis"_a, "attempts"_a,
          "backoff_seconds"_a, "slow_seconds"_a, "threads"_a, "link"_a = nb::none())
      .def(
          "step",
          [](PythonResidency& residency, const std::vector<View>& views, double now) {
            std::vector<StreamView> list;
            for (const auto& [mesh, view, planes] : views) {
              StreamView& one = list.emplace_back();
              one.mesh = mesh;
              one.view = view;
              if (!planes) continue;
              for (const auto& p : rows_of<std::array<float, 4>>(*planes))
                one.planes.push_back({{p[0], p[1], p[2]}, p[3]});
            }
            double seconds = 0;
            const StreamStep step = residency.alone([&] {
              if (residency.clock) *residency.clock = now;
              const double before = processor_seconds();
              const StreamStep made = residency.step(list, now);
              seconds = processor_seconds() - before;
              return made;
            });
            Dict result = step_dict(step);
            result["seconds"] = seconds;
            return result;
          },
          "views"_a, "now"_a)
      .def(
          "clusters",
          [](const PythonResidency& residency, uint32_t view) {
            return take<uint32_t>(residency.alone([&] { return clusters_of(residency, view); }));
          },
          "view"_a)
      .def("cost",
           [](const PythonResidency& residency) {
             return residency.alone([&] { return cost_of(residency); });
           })
      .def(
          "table",
          [](const PythonResidency& residency, const std::vector<uint32_t>& hidden_materials) {
            return take<uint32_t>(residency.alone([&] {
              std::vector<StreamCluster> shown = ordered(residency.cut());
              std::erase_if(shown, [&](const StreamCluster& c) {
                const lod::Cluster& cluster =
                    residency.page(c.page)->groups[c.group].clusters[c.cluster];
                return std::find(hidden_materials.begin(), hidden_materials.end(),
                                 cluster.material) != hidden_materials.end();
              });
              return shown;
            }));
          },
          "hidden_materials"_a)
      .def("wanted_pages",
           [](const PythonResidency& residency) {
             return take<uint32_t>(residency.alone([&] { return residency.wanted_pages(); }));
           })
      .def("resident_pages",
           [](const PythonResidency& residency) {
             return take<uint32_t>(residency.alone([&] { return residency.resident_pages(); }));
           })
      .def_prop_ro(
          "statistics",
          [](const PythonResidency& residency) {
            return statistics_dict(residency.alone([&] { return residency.statistics(); }));
          })
      .def("retry_failed",
           [](PythonResidency& residency) { residency.alone([&] { residency.retry_failed(); }); })
      .def("close", &PythonResidency::end)
      // Comes before the collector takes apart what the threads read from.
      .def("__del__", &PythonResidency::end)
      .def(
          "set_budget",
          [](PythonResidency& residency, uint64_t bytes) {
            residency.alone([&] { residency.set_budget(bytes); });
          },
          "bytes"_a);
}

}  // namespace umbel::python
