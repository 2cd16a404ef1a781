#include "device.hpp"

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <span>
#include <vector>

#include "unavailable.hpp"

namespace sample {

namespace {

constexpr const char* kValidationLayer = "VK_LAYER_KHRONOS_validation";

VKAPI_ATTR VkBool32 VKAPI_CALL print_message(VkDebugUtilsMessageSeverityFlagBitsEXT,
                                             VkDebugUtilsMessageTypeFlagsEXT,
                                             const VkDebugUtilsMessengerCallbackDataEXT* data,
                                             void* count) {
  std::fprintf(stderr, "validation: %s\n", data->pMessage);
  ++*static_cast<uint32_t*>(count);
  return VK_FALSE;
}

bool has_validation_layer() {
  uint32_t count = 0;
  check(vkEnumerateInstanceLayerProperties(&count, nullptr), "the list of layers");
  std::vector<VkLayerProperties> layers(count);
  check(vkEnumerateInstanceLayerProperties(&count, layers.data()), "the list of layers");
  for (const VkLayerProperties& layer : layers) {
    if (std::strcmp(layer.layerName, kValidationLayer) == 0) return true;
  }
  return false;
}

bool has_extension(VkPhysicalDevice device, const char* name) {
  uint32_t count = 0;
  check(vkEnumerateDeviceExtensionProperties(device, nullptr, &count, nullptr), "extensions");
  std::vector<VkExtensionProperties> extensions(count);
  check(vkEnumerateDeviceExtensionProperties(device, nullptr, &count, extensions.data()),
        "extensions");
  for (const VkExtensionProperties& extension : extensions) {
    if (std::strcmp(extension.extensionName, name) == 0) return true;
  }
  return false;
}

constexpr const char* kRayExtensions[] = {VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME,
                                          VK_KHR_DEFERRED_HOST_OPERATIONS_EXTENSION_NAME,
                                          VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME};

constexpr const char* kShareExtensions[] = {VK_KHR_EXTERNAL_MEMORY_FD_EXTENSION_NAME,
                                            VK_KHR_EXTERNAL_SEMAPHORE_FD_EXTENSION_NAME};

bool has_all(VkPhysicalDevice device, std::span<const char* const> names) {
  return std::all_of(names.begin(), names.end(),
                     [&](const char* name) { return has_extension(device, name); });
}

// What the sample asks of a device, chained for a query or for a creation.
struct Features {
  VkPhysicalDeviceAccelerationStructureFeaturesKHR structures{
      VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_FEATURES_KHR};
  VkPhysicalDeviceRayTracingPipelineFeaturesKHR rays{
      VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_TRACING_PIPELINE_FEATURES_KHR};
  VkPhysicalDeviceMeshShaderFeaturesEXT mesh{
      VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_MESH_SHADER_FEATURES_EXT};
  VkPhysicalDeviceVulkan13Features v13{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_3_FEATURES};
  VkPhysicalDeviceVulkan12Features v12{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES};
  VkPhysicalDeviceFeatures2 all{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2};
  VkPhysicalDeviceClusterAccelerationStructureFeaturesNV clusters{
      VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_CLUSTER_ACCELERATION_STRUCTURE_FEATURES_NV};
  Features(bool with_mesh_shaders, bool with_rays, bool with_clusters) {
    structures.pNext = &rays;
    rays.pNext = with_clusters ? &clusters : nullptr;
    mesh.pNext = with_rays ? &structures : nullptr;
    v13.pNext = with_mesh_shaders ? &mesh : mesh.pNext;
    v12.pNext = &v13;
    all.pNext = &v12;
  }
  Features(const Features&) = delete;
  Features& operator=(const Features&) = delete;
  bool enough() const {
    return v12.bufferDeviceAddress && v12.scalarBlockLayout && v13.dynamicRendering &&
           v13.synchronization2 && all.features.shaderInt64;
  }
};

}  // namespace

Device::Device(const DeviceOptions& options) {
  load_global_functions();
  make_instance(options);
  choose(options.mesh_shaders);
  make_device(!options.window_extensions.empty());
}

void Device::make_instance(const DeviceOptions& options) {
  const bool validation = options.validation;
  if (validation && !has_validation_layer()) {
    throw Unavailable(std::string("the layer ") + kValidationLayer + " is not installed.");
  }
  const VkApplicationInfo application{.sType = VK_STRUCTURE_TYPE_APPLICATION_INFO,
                                      .pApplicationName = "umbel",
                                      .apiVersion = VK_API_VERSION_1_3};
  const VkValidationFeatureEnableEXT enabled[] = {
      VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT};
  const VkValidationFeaturesEXT features{.sType = VK_STRUCTURE_TYPE_VALIDATION_FEATURES_EXT,
                                         .enabledValidationFeatureCount = 1,
                                         .pEnabledValidationFeatures = enabled};
  std::vector<const char*> extensions = options.window_extensions;
  extensions.push_back(VK_EXT_DEBUG_UTILS_EXTENSION_NAME);
  const VkInstanceCreateInfo info{.sType = VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO,
                                  .pNext = validation ? &features : nullptr,
                                  .pApplicationInfo = &application,
                                  .enabledLayerCount = validation ? 1u : 0u,
                                  .ppEnabledLayerNames = &kValidationLayer,
                                  .enabledExtensionCount = static_cast<uint32_t>(extensions.size()),
                                  .ppEnabledExtensionNames = extensions.data()};
  if (vkCreateInstance(&info, nullptr, &instance_) != VK_SUCCESS) {
    throw Unavailable("there is no Vulkan driver.");
  }
  load_instance_functions(instance_);
  if (!validation) return;
  const VkDebugUtilsMessengerCreateInfoEXT messenger{
      .sType = VK_STRUCTURE_TYPE_DEBUG_UTILS_MESSENGER_CREATE_INFO_EXT,
      .messageSeverity = VK_DEBUG_UTILS_MESSAGE_SEVERITY_WARNING_BIT_EXT |
                         VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT,
      .messageType = VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT,
      .pfnUserCallback = print_message,
      .pUserData = &messages_};
  check(vkCreateDebugUtilsMessengerEXT(instance_, &messenger, nullptr, &messenger_),
        "the debug messenger");
}

void Device::choose(bool mesh_shaders) {
  uint32_t count = 0;
  check(vkEnumeratePhysicalDevices(instance_, &count, nullptr), "the list of devices");
  std::vector<VkPhysicalDevice> devices(count);
  check(vkEnumeratePhysicalDevices(instance_, &count, devices.data()), "the list of devices");
  for (const VkPhysicalDevice device : devices) {
    VkPhysicalDeviceProperties properties;
    vkGetPhysicalDeviceProperties(device, &properties);
    if (properties.apiVersion < VK_API_VERSION_1_3) continue;
    const bool mesh = mesh_shaders && has_extension(device, VK_EXT_MESH_SHADER_EXTENSION_NAME);
    const bool rays = has_all(device, kRayExtensions);
    const bool clusters =
        rays && has_extension(device, VK_NV_CLUSTER_ACCELERATION_STRUCTURE_EXTENSION_NAME);
    Features features(mesh, rays, clusters);
    vkGetPhysicalDeviceFeatures2(device, &features.all);
    if (!features.enough()) continue;
    uint32_t families = 0;
    vkGetPhysicalDeviceQueueFamilyProperties(device, &families, nullptr);
    std::vector<VkQueueFamilyProperties> queues(families);
    vkGetPhysicalDeviceQueueFamilyProperties(device, &families, queues.data());
    for (uint32_t f = 0; f < families; ++f) {
      const VkQueueFlags wanted = VK_QUEUE_GRAPHICS_BIT | VK_QUEUE_COMPUTE_BIT;
      if ((queues[f].queueFlags & wanted) != wanted) continue;
      physical_ = device;
      family_ = f;
      name_ = static_cast<const char*>(properties.deviceName);
      mesh_shaders_ = mesh && features.mesh.meshShader;
      ray_tracing_ =
          rays && features.structures.accelerationStructure && features.rays.rayTracingPipeline;
      return;
    }
  }
  throw Unavailable(
      "no device has Vulkan 1.3 with buffer addresses, scalar block layout, 64-bit integers, "
      "dynamic rendering and synchronization2.");
}

void Device::make_device(bool swapchain) {
  Features features(mesh_shaders_, ray_tracing_, cluster_structures_);
  features.clusters.clusterAccelerationStructure = cluster_structures_;
  features.mesh.meshShader = mesh_shaders_;
  features.structures.accelerationStructure = ray_tracing_;
  features.rays.rayTracingPipeline = ray_tracing_;
  features.v12.bufferDeviceAddress = VK_TRUE;
  features.v12.scalarBlockLayout = VK_TRUE;
  features.v13.dynamicRendering = VK_TRUE;
  features.v13.synchronization2 = VK_TRUE;
  features.v13.maintenance4 = VK_TRUE;
  features.all.features.shaderInt64 = VK_TRUE;
  const float priority = 1;
  const VkDeviceQueueCreateInfo queue{.sType = VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO,
                                      .queueFamilyIndex = family_,
                                      .queueCount = 1,
                                      .pQueuePriorities = &priority};
  std::vector<const char*> extensions;
  if (mesh_shaders_) extensions.push_back(VK_EXT_MESH_SHADER_EXTENSION_NAME);
  if (ray_tracing_) {
    for (const char* name : kRayExtensions) extensions.push_back(name);
  }
  if (shares_) {
    for (const char* name : kShareExtensions) extensions.push_back(name);
  }
  if (cluster_structures_) {
    extensions.push_back(VK_NV_CLUSTER_ACCELERATION_STRUCTURE_EXTENSION_NAME);
  }
  if (swapchain) extensions.push_back(VK_KHR_SWAPCHAIN_EXTENSION_NAME);
  const VkDeviceCreateInfo info{.sType = VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO,
                                .pNext = &features.all,
                                .queueCreateInfoCount = 1,
                                .pQueueCreateInfos = &queue,
                                .enabledExtensionCount = static_cast<uint32_t>(extensions.size()),
                                .ppEnabledExtensionNames = extensions.data()};
  check(vkCreateDevice(physical_, &info, nullptr, &device_), "the device");
  load_device_functions(device_);
  vkGetDeviceQueue(device_, family_, 0, &queue_);
  const VkCommandPoolCreateInfo pool{.sType = VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO,
                                     .queueFamilyIndex = family_};
  check(vkCreateCommandPool(device_, &pool, nullptr, &pool_), "the command pool");
  const VkCommandBufferAllocateInfo allocate{
      .sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO,
      .commandPool = pool_,
      .level = VK_COMMAND_BUFFER_LEVEL_PRIMARY,
      .commandBufferCount = 1};
  check(vkAllocateCommandBuffers(device_, &allocate, &commands_), "the command buffer");
  const VkFenceCreateInfo fence{.sType = VK_STRUCTURE_TYPE_FENCE_CREATE_INFO};
  check(vkCreateFence(device_, &fence, nullptr, &fence_), "the fence");
}

Device::~Device() {
  if (device_ != VK_NULL_HANDLE) {
    vkDestroyFence(device_, fence_, nullptr);
    vkDestroyCommandPool(device_, pool_, nullptr);
    vkDestroyDevice(device_, nullptr);
  }
  if (messenger_ != VK_NULL_HANDLE) {
    vkDestroyDebugUtilsMessengerEXT(instance_, messenger_, nullptr);
  }
  if (instance_ != VK_NULL_HANDLE) vkDestroyInstance(instance_, nullptr);
}

void Device::run(const std::function<void(VkCommandBuffer)>& record, VkSemaphore wait,
                 VkSemaphore signal) const {
  check(vkResetCommandPool(device_, pool_, 0), "the command pool");
  const VkCommandBufferBeginInfo begin{.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO,
                                       .flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT};
  check(vkBeginCommandBuffer(commands_, &begin), "recording");
  record(commands_);
  check(vkEndCommandBuffer(commands_), "recording");
  const VkCommandBufferSubmitInfo buffer{.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_SUBMIT_INFO,
                                         .commandBuffer = commands_};
  const auto on_semaphore = [](VkSemaphore semaphore) {
    return VkSemaphoreSubmitInfo{.sType = VK_STRUCTURE_TYPE_SEMAPHORE_SUBMIT_INFO,
                                 .semaphore = semaphore,
                                 .stageMask = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT};
  };
  const VkSemaphoreSubmitInfo before = on_semaphore(wait), after = on_semaphore(signal);
  const VkSubmitInfo2 submit{.sType = VK_STRUCTURE_TYPE_SUBMIT_INFO_2,
                             .waitSemaphoreInfoCount = wait == VK_NULL_HANDLE ? 0u : 1u,
                             .pWaitSemaphoreInfos = &before,
                             .commandBufferInfoCount = 1,
                             .pCommandBufferInfos = &buffer,
                             .signalSemaphoreInfoCount = signal == VK_NULL_HANDLE ? 0u : 1u,
                             .pSignalSemaphoreInfos = &after};
  check(vkQueueSubmit2(queue_, 1, &submit, fence_), "a submission");
  check(vkWaitForFences(device_, 1, &fence_, VK_TRUE, UINT64_MAX), "a frame");
  check(vkResetFences(device_, 1, &fence_), "the fence");
}

RayLimits Device::ray_limits() const {
  VkPhysicalDeviceAccelerationStructurePropertiesKHR structures{
      .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_PROPERTIES_KHR};
  VkPhysicalDeviceRayTracingPipelinePropertiesKHR rays{
      .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_TRACING_PIPELINE_PROPERTIES_KHR,
      .pNext = &structures};
  VkPhysicalDeviceProperties2 all{.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2,
                                  .pNext = &rays};
  vkGetPhysicalDeviceProperties2(physical_, &all);
  return {structures.minAccelerationStructureScratchOffsetAlignment, rays.shaderGroupHandleSize,
          rays.shaderGroupBaseAlignment};
}

uint32_t Device::memory_type(uint32_t types, VkMemoryPropertyFlags wanted) const {
  VkPhysicalDeviceMemoryProperties memory;
  vkGetPhysicalDeviceMemoryProperties(physical_, &memory);
  for (uint32_t t = 0; t < memory.memoryTypeCount; ++t) {
    if ((types >> t & 1) != 0 && (memory.memoryTypes[t].propertyFlags & wanted) == wanted) return t;
  }
  throw Unavailable("the device has no memory of a type that the sample needs.");
}

void wait_for_writes(VkCommandBuffer commands) {
  const VkMemoryBarrier2 barrier{
      .sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER_2,
      .srcStageMask = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT,
      .srcAccessMask = VK_ACCESS_2_MEMORY_WRITE_BIT,
      .dstStageMask = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT | VK_PIPELINE_STAGE_2_HOST_BIT,
      .dstAccessMask = VK_ACCESS_2_MEMORY_READ_BIT | VK_ACCESS_2_MEMORY_WRITE_BIT};
  const VkDependencyInfo dependency{.sType = VK_STRUCTURE_TYPE_DEPENDENCY_INFO,
                                    .memoryBarrierCount = 1,
                                    .pMemoryBarriers = &barrier};
  vkCmdPipelineBarrier2(commands, &dependency);
}

}  // namespace sample
