// Saving levels of detail as a .umbel file from C.
#include "base/fields.hpp"
#include "capi/cluster_input.hpp"
#include "capi/guard.hpp"
#include "capi/lod_input.hpp"
#include "capi/structs.hpp"
#include "umbel/asset.hpp"

#define SAVE_FIELDS normal_bits, tangent_bits, color_bits, uv_step, page_bytes

namespace umbel::capi {
namespace {

umbel_lod_save_config save_config(const AssetConfig& config) {
  umbel_lod_save_config result{};
  result.struct_size = sizeof result;
  COPY_FIELDS(result, config, SAVE_FIELDS);
  return result;
}

void save(const umbel_lod* lod, const char* path, const AssetConfig& config, umbel_vec3d origin,
          const umbel_build_options* options) {
  AssetContents contents;
  contents.meshes = {&required(lod, "lod").dag};
  contents.origin = {origin.x, origin.y, origin.z};
  write_asset(&required(path, "path"), contents, build_options(options), config);
}

}  // namespace
}  // namespace umbel::capi

using namespace umbel;

void umbel_lod_save_config_init_sized(umbel_lod_save_config* config, size_t size) {
  capi::init_sized(config, size, capi::save_config(AssetConfig{}));
}

umbel_result umbel_lod_save_with(const umbel_lod* lod, const char* path,
                                 const umbel_lod_save_config* config,
                                 const umbel_build_options* options) {
  return capi::guard([&] {
    const umbel_lod_save_config given =
        config ? capi::read_struct(config, "config") : capi::save_config(AssetConfig{});
    AssetConfig precision;
    COPY_FIELDS(precision, given, SAVE_FIELDS);
    capi::save(lod, path, precision, given.origin, options);
  });
}

umbel_result umbel_lod_save(const umbel_lod* lod, const char* path, int exact,
                            const umbel_build_options* options) {
  return umbel_lod_save_at(lod, path, exact, {0, 0, 0}, options);
}

umbel_result umbel_lod_save_at(const umbel_lod* lod, const char* path, int exact,
                               umbel_vec3d origin, const umbel_build_options* options) {
  return capi::guard([&] {
    capi::save(lod, path, exact ? AssetConfig::exact() : AssetConfig{}, origin, options);
  });
}
