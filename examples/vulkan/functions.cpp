#include "functions.hpp"

#include <dlfcn.h>

#include <stdexcept>
#include <string>

#include "unavailable.hpp"

namespace sample {

namespace {

template <class Function>
void need(Function& function, PFN_vkVoidFunction found, const char* name) {
  if (found == nullptr) throw Unavailable(std::string("the Vulkan driver lacks ") + name + ".");
  function = reinterpret_cast<Function>(found);
}

}  // namespace

void load_global_functions() {
  void* loader = dlopen("libvulkan.so.1", RTLD_NOW | RTLD_LOCAL);
  if (loader == nullptr) throw Unavailable("there is no Vulkan loader (libvulkan.so.1).");
  vkGetInstanceProcAddr =
      reinterpret_cast<PFN_vkGetInstanceProcAddr>(dlsym(loader, "vkGetInstanceProcAddr"));
  if (vkGetInstanceProcAddr == nullptr) throw Unavailable("libvulkan.so.1 is no Vulkan loader.");
  need(vkCreateInstance, vkGetInstanceProcAddr(nullptr, "vkCreateInstance"), "vkCreateInstance");
  need(vkEnumerateInstanceLayerProperties,
       vkGetInstanceProcAddr(nullptr, "vkEnumerateInstanceLayerProperties"),
       "vkEnumerateInstanceLayerProperties");
}

void load_instance_functions(VkInstance instance) {
#define SAMPLE_LOAD(name) need(name, vkGetInstanceProcAddr(instance, #name), #name);
  SAMPLE_INSTANCE_FUNCTIONS(SAMPLE_LOAD)
#undef SAMPLE_LOAD
#define SAMPLE_LOAD(name) \
  name = reinterpret_cast<PFN_##name>(vkGetInstanceProcAddr(instance, #name));
  SAMPLE_SURFACE_FUNCTIONS(SAMPLE_LOAD)
#undef SAMPLE_LOAD
}

void load_device_functions(VkDevice device) {
#define SAMPLE_LOAD(name) need(name, vkGetDeviceProcAddr(device, #name), #name);
  SAMPLE_DEVICE_FUNCTIONS(SAMPLE_LOAD)
#undef SAMPLE_LOAD
#define SAMPLE_LOAD(name) name = reinterpret_cast<PFN_##name>(vkGetDeviceProcAddr(device, #name));
  SAMPLE_OPTIONAL_FUNCTIONS(SAMPLE_LOAD)
#undef SAMPLE_LOAD
}

void check(VkResult result, const char* what) {
  if (result == VK_SUCCESS) return;
  const std::string name = what;
  if (result == VK_ERROR_DEVICE_LOST)
    throw std::runtime_error("the device was lost in " + name + ".");
  if (result == VK_ERROR_OUT_OF_DEVICE_MEMORY || result == VK_ERROR_OUT_OF_HOST_MEMORY) {
    throw std::runtime_error("there is not enough memory for " + name + ".");
  }
  throw std::runtime_error(name + " failed with VkResult " + std::to_string(result) + ".");
}

}  // namespace sample
